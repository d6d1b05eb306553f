"""`asperity verify`: its rows, and that all cases pass."""

from __future__ import annotations

import pytest

from asperity.cli.verify import CASES, Row


def test_rows_pass_within_the_bar_only() -> None:
    row = Row("case", "force", "closed form", 2.0, 2.1, bar=0.04)
    assert row.error == pytest.approx(0.05) and not row.passed
    assert Row("case", "spread", "uniform", 0.0, 0.03, bar=0.04).passed


def test_a_flat_block_passes() -> None:
    rows = list(CASES["patch"]())
    assert {row.case for row in rows} == {"patch"} and all(row.passed for row in rows)


@pytest.mark.slow
def test_all_cases_pass() -> None:
    for name, case in CASES.items():
        rows = list(case())
        assert {row.case for row in rows} == {name} and [row for row in rows if not row.passed] == []
