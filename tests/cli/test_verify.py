"""`asperity verify`: its rows, and that all cases pass."""

from __future__ import annotations

import pytest

from asperity.cli.verify import CASES, row


def test_rows_pass_within_the_bar_only() -> None:
    high = row("case", "force", "closed form", 2.0, 2.1, bar=0.04)
    assert high["error"] == pytest.approx(0.05) and not high["passed"]
    assert row("case", "spread", "uniform", 0.0, 0.03, bar=0.04)["passed"]


SLOW = [pytest.param(name, marks=pytest.mark.slow) for name in CASES if name != "patch"]


@pytest.mark.parametrize("name", ["patch", *SLOW])
def test_a_case_passes(name: str) -> None:
    rows = list(CASES[name]())
    assert {one["case"] for one in rows} == {name} and [one for one in rows if not one["passed"]] == []
