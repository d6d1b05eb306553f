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


def errors_and_bars(pressed: Any, rows: int) -> np.ndarray:
    """Relative error and bar of displacement and energy, shape (amplitudes, 2, 2)."""
    slip = pressed.slip(rows)
    return np.array(
        [
            [(path.displacement / u - 1.0, bar["u"] / u), (path.energy / W - 1.0, bar["energy"] / W)]
            for path, bar, (u, W) in zip(slip.by_curve, slip.errors, pressed.loops, strict=True)
        ]
    )


def test_the_law_is_exact_without_lateral_contraction(slip: Any) -> None:
    for name in ("H 0.7, seed 2", "sphere"):
        found = errors_and_bars(slip.Pressed(slip.SURFACES[name], 48, 0.0), 20)
        assert np.all(np.abs(found[1:, 0, 0]) < 1e-3)
        assert np.all(np.abs(found[1:, 1, 0]) < 0.01)  # at 0.1 mu P the ring that slips is narrower than a cell


@pytest.mark.parametrize("aspect", ["1", "6", "0.166667"])
def test_bars_hold_on_isotropic_surfaces_and_on_grooves(slip: Any, aspect: str) -> None:
    """With many rows and with few; a half-space that ignores the lay would be 15 % off along and across the motion."""
    name = "H 0.8, seed 12, aspect 1" if aspect == "1" else f"H 0.8, seed 14, aspect {aspect}"
    pressed = slip.Pressed(slip.OTHERS[name], 48, 0.3)
    for rows in slip.ROWS:
        found = errors_and_bars(pressed, rows)
        assert np.count_nonzero(np.abs(found[1:, :, 0]) > found[1:, :, 1]) == 0
    assert np.all(np.abs(found[:, 0, 0]) < 0.02)
    assert np.all(np.abs(found[2:, 1, 0]) < 0.05)
