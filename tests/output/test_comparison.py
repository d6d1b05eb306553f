"""Comparison of a curve with a reference."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import call, make_curve
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from asperity.curve import Curve
from asperity.errors import InputError
from asperity.output.comparison import TOLERANCES, compare_curves


def change(curve: Curve, row: int, **values: object) -> Curve:
    """Return the curve with one row changed."""
    rows = list(curve.rows())
    rows[row] |= values
    return Curve.from_rows(rows, curve.header)


def test_equal_curves_have_no_differences():
    assert compare_curves(make_curve(), make_curve()) == []
    assert compare_curves(make_curve(), change(make_curve(), 1, seconds=9.0, krylov=1)) == []


@settings(deadline=None, derandomize=True)
@given(
    st.sampled_from(sorted(TOLERANCES)),
    st.integers(0, 3),
    st.floats(-10, 1),
    st.none() | st.floats(-9, 0),
    st.booleans(),
)
def test_a_row_that_is_off_by_more_than_the_tolerance_is_a_difference(
    name: str, row: int, size: float, rtol: float | None, stored: bool
) -> None:
    """Over the greatest value of the column in the reference. A tolerance that is given, or stored with the reference,
    is that of its column alone: all others are compared as before."""  # fmt: skip
    tolerance = TOLERANCES[name] if rtol is None else 10.0**rtol
    mine = None if rtol is None else {name: tolerance}
    reference = make_curve(**{"tolerances": mine} if stored and mine else {})
    values = getattr(reference, name)
    scale = np.nanmax(np.abs(values))
    other = change(reference, row, **{name: values.dtype.type(values[row] + 10.0**size * scale)})
    off = abs(getattr(other, name)[row] - values[row]) / scale
    assume(np.isfinite(off) and not math.isclose(off, tolerance, rel_tol=1e-6))
    for tolerances in (None,) if stored or mine is None else (mine, mine | {"newton": 0.5}):
        found = compare_curves(other, reference, tolerances)
        assert [(difference.column, difference.row) for difference in found] == [(name, row)] * bool(off > tolerance)
        for difference in found:
            assert difference.error == pytest.approx(off)
            assert f"at step {row + 1}, relative difference {off:.3g} > {tolerance:g}" in str(difference)


@pytest.mark.parametrize("name", ["max_pressure", "spots", "error_k_t"])
def test_a_column_that_one_curve_lacks_is_compared_where_the_reference_stores_it(name: str) -> None:
    reference, nothing = make_curve(), 0 if name == "spots" else math.nan
    without = Curve.from_rows([row | {name: nothing} for row in reference.rows()])
    assert compare_curves(without, reference) == [] == compare_curves(reference, without)
    (lost,) = compare_curves(without, make_curve(tolerances={name: 1e-3}))
    assert lost.column == name


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
    for passed, header in ((tolerances, {}), (None, {"tolerances": tolerances})):
        with pytest.raises(InputError):
            compare_curves(make_curve(), make_curve(**header), passed)


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
        options = [word for text in rtol for word in ("--rtol", text)]
        assert call("compare", tmp_path / "curve.csv", tmp_path / "changed.csv", *options) == code
    for first, second in (("link.csv", "curve.csv"), (".", "curve.csv"), ("none.csv", "none.csv"), (".", other)):
        assert call("compare", tmp_path / first, tmp_path / second) == 2
