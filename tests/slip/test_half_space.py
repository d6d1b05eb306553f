"""Slip by the normal curve against a half-space with both components of traction, benchmarks/slip.py."""

from __future__ import annotations

import importlib
from pathlib import Path
from typing import Any

import numpy as np
import pytest

ROOT = Path(__file__).parents[2]


@pytest.fixture
def slip(monkeypatch: pytest.MonkeyPatch) -> Any:
    monkeypatch.syspath_prepend(str(ROOT / "benchmarks"))
    return importlib.import_module("slip")


def test_the_law_is_exact_without_lateral_contraction(slip: Any) -> None:
    for name in ("H 0.7, seed 2", "sphere"):
        pressed = slip.Pressed(slip.SURFACES[name], 48, 0.0)
        found = slip.errors_of(pressed.slip(20), pressed.loops)
        assert np.all(np.abs(found[1:, 0, 0]) < 1e-3)
        assert np.all(np.abs(found[1:, 1, 0]) < 0.01)  # at 0.1 mu P the ring that slips is narrower than a cell


@pytest.mark.parametrize("aspect", ["1", "6", "0.166667"])
def test_bars_hold_on_isotropic_surfaces_and_on_grooves(slip: Any, aspect: str) -> None:
    """With many rows and with few; a half-space that ignores the lay would be 15 % off along and across the motion."""
    name = "H 0.8, seed 12, aspect 1" if aspect == "1" else f"H 0.8, seed 14, aspect {aspect}"
    pressed = slip.Pressed(slip.OTHERS[name], 48, 0.3)
    for rows in slip.ROWS:
        found = slip.errors_of(pressed.slip(rows), pressed.loops)
        assert np.count_nonzero(np.abs(found[1:, :, 0]) > found[1:, :, 1]) == 0
    assert np.all(np.abs(found[:, 0, 0]) < 0.02)
    assert np.all(np.abs(found[2:, 1, 0]) < 0.05)
