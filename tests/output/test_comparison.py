"""Comparison of a curve with a reference."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import call, make_curve

from asperity.curve import Curve
from asperity.errors import InputError
from asperity.output.comparison import compare_curves


def change(curve: Curve, row: int, **values: object) -> Curve:
    """Return the curve with one row changed."""
    rows = list(curve.rows())
    rows[row] |= values
    return Curve.from_rows(rows, curve.header)


def test_equal_curves_have_no_differences():
    assert compare_curves(make_curve(), make_curve()) == []
    assert compare_curves(make_curve(), change(make_curve(), 1, seconds=9.0, krylov=1)) == []


def test_differences_name_column_row_and_size():
    reference = make_curve()
    largest = reference.force.max()
    other = change(reference, 2, force=reference.force[2] + 0.01 * largest)
    (difference,) = compare_curves(other, reference)
    assert (difference.column, difference.row) == ("force", 2)
    assert difference.error == pytest.approx(0.01)
    assert "at step 3, relative difference 0.01 > 1e-06" in str(difference)
    assert compare_curves(other, reference, {"force": 0.011}) == []
    assert [d.column for d in compare_curves(other, reference, {"P_star": 0.0})] == ["force"]


@pytest.mark.parametrize("name", ["max_pressure", "k_n_elastic", "mean_gap", "spots", "error_k_t", "strained_fraction"])
def test_a_tolerance_of_one_column_leaves_the_others_compared(name: str) -> None:
    """By default each column that both have; a column that one lacks is none, unless the reference stores it."""
    reference, values = make_curve(), getattr(make_curve(), name)
    other = change(reference, 2, **{name: values[2] + 0.01 * values.max() if name != "spots" else 4})
    for tolerances in (None, {"force": 0.05}, {"delta": 1.0, "P_star": 1.0}):
        assert [d.column for d in compare_curves(other, reference, tolerances)] == [name]
    assert compare_curves(other, reference, {name: 0.5}) == []
    nothing = 0 if name == "spots" else math.nan
    without = Curve.from_rows([row | {name: nothing} for row in reference.rows()])
    assert compare_curves(without, reference) == [] == compare_curves(reference, without)
    (lost,) = compare_curves(without, make_curve(tolerances={name: 1e-3}))
    assert lost.column == name


def test_tolerances_come_with_the_stored_curve():
    reference = make_curve(tolerances={"force": 0.02})
    other = change(reference, 2, force=reference.force[2] + 0.01 * reference.force.max(), krylov=1)
    assert compare_curves(other, reference) == [] != compare_curves(other, make_curve())


def test_a_value_that_turns_into_nan_is_a_difference():
    reference = make_curve()
    (difference,) = compare_curves(change(reference, 0, P_star=math.nan), reference)
    assert difference.column == "P_star" and difference.error == math.inf


def test_steps_must_correspond():
    curve = make_curve()
    (shorter,) = compare_curves(curve.where(np.arange(3)), curve)
    assert str(shorter) == "rows: 3 steps against 4 steps, first at step 4"
    (branch,) = compare_curves(change(curve, 1, branch="unload"), curve)
    assert (branch.column, branch.row) == ("rows", 1)


BAD: tuple[Any, ...] = (
    {"force": -1.0}, {"forces": 1.0}, {"branch": 1.0}, {"force": "1"}, {"force": None}, ["force"], 1e-6, {},
    {"force": math.inf}, {"force": math.nan},
)  # fmt: skip


@pytest.mark.parametrize("tolerances", BAD)
def test_bad_tolerances_are_refused(tolerances):
    """Of a call, and in the header of a stored curve, which anyone may have edited."""
    for given, header in ((tolerances, {}), (None, {"tolerances": tolerances})):
        with pytest.raises(InputError):
            compare_curves(make_curve(), make_curve(**header), given)


def test_a_comparison_of_nothing_is_refused(tmp_path: Path) -> None:
    """It could not fail: a reference without steps, or without values in the columns that are compared."""
    curve, none = make_curve(), make_curve().where(np.arange(0))
    measured = Curve.from_rows([{"delta": 1.0, "force": 2.0}])
    for a, b, tolerances in ((none, none, None), (curve, none, None), (measured, measured, {"P_star": 0.1})):
        with pytest.raises(InputError, match="so nothing is compared"):
            compare_curves(a, b, tolerances)
    assert compare_curves(none, curve)[0].column == "rows"
    curve.write(tmp_path / "curve.csv")
    (tmp_path / "link.csv").symlink_to(tmp_path / "curve.csv")
    none.write(tmp_path / "none.csv")
    other = tmp_path / "other.csv"
    replace(curve, header={"tolerances": {}}).write(other)
    top = int(np.argmax(curve.force))
    change(curve, top, force=1.4 * curve.force[top]).write(tmp_path / "changed.csv")
    for code, *rtol in ((1,), (1, "P_star=1e-9"), (0, "force=0.5"), (2, "force"), (2, "farce=1")):
        given = [word for text in rtol for word in ("--rtol", text)]
        assert call("compare", tmp_path / "curve.csv", tmp_path / "changed.csv", *given) == code
    for first, second in (("link.csv", "curve.csv"), (".", "curve.csv"), ("none.csv", "none.csv"), (".", other)):
        assert call("compare", tmp_path / first, tmp_path / second) == 2
