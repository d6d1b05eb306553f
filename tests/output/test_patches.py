"""Whether one patch stands for a joint."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from asperity.model.material import Material
from asperity.model.problem import Problem
from asperity.output.patches import Spread, spread_of_patches
from asperity.reference.halfspace import RoughHalfSpace
from asperity.surface import HeightMap, SelfAffine, Sphere, Surface, WeierstrassMandelbrot

STEEL = Material(E=200e9, nu=0.3)
SMALL = SelfAffine(L=80e-6, H=0.8, slope=0.09, lambda_short=10e-6, lambda_roll=40e-6, seed=1)


def spread(surface: Surface, pressure: float, material: Material = STEEL) -> Spread | None:
    return spread_of_patches(
        Problem.of(surface, material, delta_max=0.01 * (surface.maximum()[2] - surface.mean()), height=surface.L),
        pressure,
    )


def stiffness(surface: Surface, pressure: float, cells: int) -> float:
    """Slope of the pressure over the approach of a half-space [Pa/m], by differences."""
    layer, target = RoughHalfSpace(cells, 80e-6 / surface.L, 0.3, "periodic"), pressure / STEEL.reduced_modulus
    heights = layer.heights(surface)
    top = float(heights.max())
    delta = np.geomspace(0.02, 0.7, 40) * (top - float(heights.mean()))
    carried = layer.curve(heights, top, delta).P_star
    k = np.gradient(carried, delta)
    return float(np.interp(np.log(target), np.log(carried), k)) * STEEL.reduced_modulus / surface.L


@pytest.mark.parametrize("pressure", [25e6, 100e6])
def test_the_mean_of_patches_is_a_patch_of_sixteen_times_the_area(pressure: float) -> None:
    """Of the same waves: its stiffness per area is that of the patch, changed as the other patches say."""
    large = SelfAffine(L=320e-6, H=0.8, slope=0.09, lambda_short=10e-6, lambda_roll=40e-6, seed=9)
    true = stiffness(large, pressure, 480)
    for seed in (1, 2, 3):
        small = replace(SMALL, seed=seed)
        found = spread_of_patches(Problem.of(small, STEEL, delta_max=1e-7, height=small.L, sides="periodic"), pressure)
        assert found is not None and found.patches == 5
        own = stiffness(small, pressure, 120)
        assert own * (1.0 + found.change) == pytest.approx(true, abs=3.0 * found.error * own)


def test_a_larger_patch_changes_less() -> None:
    bars = []
    for factor in (1, 4):
        of_seeds = [spread(replace(SMALL, L=factor * SMALL.L, seed=seed), 100e6) for seed in (1, 2, 3)]
        bars.append(np.mean([found.bar for found in of_seeds if found is not None]))
    assert bars[1] < 0.5 * bars[0]


def test_a_map_is_compared_with_its_quarters() -> None:
    of_map = spread(HeightMap.of(SMALL.grid(129), SMALL.L), 100e6)
    assert of_map is not None and of_map.patches == 5 and 0.0 < of_map.bar < 1.0


@pytest.mark.parametrize(("surface", "pressure"), [(Sphere(L=1e-6, radius=2e-6), 1e6), (SMALL, 0.0), (SMALL, 1e13)])
def test_there_may_be_no_others(surface: Any, pressure: float) -> None:
    assert spread(surface, pressure) is None


def test_explicit_phases_are_no_seed() -> None:
    random = WeierstrassMandelbrot(L=1e-6, D=2.4, G=1e-12, seed=1)
    assert spread(random, 1e7) is not None and spread(random, 1e7).bar > 0.0  # type: ignore[union-attr]
    assert random.phases is not None
    assert spread(WeierstrassMandelbrot(L=1e-6, D=2.4, G=1e-12, phases=0.5 * random.phases), 1e7) is None


@pytest.mark.parametrize("pressure", [2.5e6, 25e6, 400e6, 3e9])
def test_any_pressure_has_an_answer(pressure: float) -> None:
    """Yielding spots end at a greatest pressure, where the curve of the half-space is flat to its tolerance."""
    for seed in range(1, 4):
        found = spread(replace(SMALL, seed=seed), pressure, replace(STEEL, yield_strength=1e9, tangent_modulus=0.0))
        assert found is None or 0.0 <= found.bar < 20.0


def test_the_bar_of_a_patch_holds_the_change_and_its_error() -> None:
    assert [Spread(change, 0.31, 5).bar for change in (-0.56, 0.2)] == pytest.approx([0.87, 0.51])
