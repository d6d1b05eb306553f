"""The verification suite: its error bars, its table, and that the cheap cases pass."""

from __future__ import annotations

import numpy as np
import pytest

from asperity.errors import InputError
from asperity.verification import verify
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


@pytest.mark.slow
def test_all_cases_pass() -> None:
    assert [row for row in verify() if not row.passed] == []


def test_cheap_cases_pass() -> None:
    rows = verify(["patch"])
    assert {row.case for row in rows} == {"patch"} and all(row.passed for row in rows)


def test_unknown_names_are_refused() -> None:
    with pytest.raises(InputError, match='did you mean "hertz"'):
        verify(["herz"])
