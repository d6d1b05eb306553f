"""Stored curves: what a change of the code must not change."""

from __future__ import annotations

from pathlib import Path

import pytest

from asperity.case import Case
from asperity.curve import Curve
from asperity.job.run_case import run
from asperity.output.comparison import compare_curves

CURVES = Path(__file__).parent / "curves"


@pytest.mark.parametrize("file", sorted(CURVES.glob("*.csv")), ids=lambda path: path.stem)
def test_a_stored_curve_is_computed_again(file: Path) -> None:
    stored = Curve.read(file)
    curve = run(Case.load(CURVES / stored.header["case"])).curve
    assert [str(difference) for difference in compare_curves(curve, stored)] == []
