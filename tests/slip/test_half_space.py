# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

"""Slip by the normal curve against a half-space with both components of traction, benchmarks/slip.py."""

from __future__ import annotations

import importlib
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).parents[2]


@pytest.fixture
def slip(monkeypatch: pytest.MonkeyPatch) -> Any:
    monkeypatch.syspath_prepend(str(ROOT / "benchmarks"))
    return importlib.import_module("slip")


def errors(slip: Any, surface: Any, nu: float, amplitudes: tuple[float, ...]) -> list[tuple[float, float]]:
    """Errors of the force over mu P at the displacement of the law, and of the energy at the same force."""
    curve = slip.NormalCurve(surface, 48, nu)
    space, found = slip.HalfSpace(curve.pressure, nu), []
    for t in amplitudes:
        force, energy = space.loop(curve.move(t))
        found.append((force - t, curve.energy(force) / energy - 1.0))
    return found


def test_the_law_is_exact_without_lateral_contraction(slip: Any) -> None:
    for name in ("H 0.7, seed 2", "sphere"):
        for force, energy in errors(slip, slip.SURFACES[name], 0.0, (0.3, 0.9)):
            assert force == pytest.approx(0.0, abs=1e-5)
            assert energy == pytest.approx(0.0, abs=0.01)


def test_the_law_is_near_on_isotropic_surfaces(slip: Any) -> None:
    for surface in slip.SURFACES.values():
        for force, energy in errors(slip, surface, 0.3, (0.3, 0.6, 0.9)):
            assert abs(force) < 0.01
            assert abs(energy) < 0.15


@pytest.mark.parametrize(("aspect", "sign"), [("6", -1), ("0.166667", 1)])
def test_grooves_along_and_across_the_motion_are_inside_the_bar(slip: Any, aspect: str, sign: int) -> None:
    """Long spots have the compliance of waves along or across the motion, 1 - nu/2 over 1 or over 1 - nu."""
    nu = 0.3
    for t, (force, energy) in zip((0.3, 0.6), errors(slip, slip.OTHERS[f"H 0.8, seed 14, aspect {aspect}"], nu,
                                                     (0.3, 0.6)), strict=True):  # fmt: skip
        assert sign * force > 0.01
        assert abs(1.0 / (1.0 + energy) - 1.0) < nu
        assert abs(force) / t < 1.2 * nu / (2 - nu)
