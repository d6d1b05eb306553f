"""The verification suite: its error bars, its table, and that the cheap cases pass."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import pytest

from asperity.cli import main
from asperity.errors import InputError
from asperity.verification import NAMES, verify
from asperity.verification.table import RATIO, Row, convergence_bar, norm_bar, rows_along


@pytest.mark.parametrize("order", [1.0, 1.8, 3.0])
def test_bar_covers_the_error_of_a_convergent_sequence(order: float) -> None:
    h = 0.1 * RATIO ** -np.arange(3)
    limit, slope = np.array([2.0, 3.0]), np.array([0.7, 1.05])  # of equal relative errors
    values = [limit + slope * size**order for size in h]
    error = np.abs(values[-1] - limit)
    bar = convergence_bar(values)
    assert np.all(error <= bar) and np.all(bar < 2.0 * error)


def test_bar_of_scatter_is_no_smaller_than_the_scatter() -> None:
    assert convergence_bar([1.0, 1.01, 1.0])[0] >= 0.01
    assert convergence_bar([1.0, 1.001, 1.01])[0] >= 0.009


def test_a_norm_must_fall() -> None:
    assert norm_bar([0.04, 0.04 / RATIO, 0.02], 1.0)[0] == pytest.approx(0.025)
    (fallen,) = rows_along("", [""], "", [[0.04], [0.028], [0.02]], [0.0], order=1.0)
    (stuck,) = rows_along("", [""], "", [[0.04], [0.04], [0.04]], [0.0], order=1.0)
    assert fallen.passed and not stuck.passed


def test_rows_pass_within_the_bar_only() -> None:
    row = Row("case", "force", "closed form", 2.0, 2.1, mesh=0.03, theory=0.01)
    assert row.error == pytest.approx(0.05) and row.bar == pytest.approx(0.04) and not row.passed
    assert Row("case", "order", "", 2.0, 2.6, mesh=0.1, at_least=True).passed
    assert not Row("case", "order", "", 2.0, 1.6, mesh=0.1, at_least=True).passed


def test_cheap_cases_pass(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as left:
        main(["verify", "patch", "material", "westergaard", "-o", str(tmp_path / "table.csv")])
    assert left.value.code == 0, capsys.readouterr().err
    with (tmp_path / "table.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert {row["case"] for row in rows} == {"patch", "material", "westergaard"}
    assert all(row["passed"] == "True" and float(row["error"]) <= float(row["bar"]) for row in rows)


@pytest.mark.slow
def test_all_cases_pass() -> None:
    assert [row for row in verify(set(NAMES) - {"patch", "material", "westergaard"}) if not row.passed] == []


def test_unknown_names_are_refused() -> None:
    with pytest.raises(InputError, match="did you mean hertz"):
        verify(["herz"])
    with pytest.raises(InputError, match="level"):
        verify(["patch"], level="fast")
