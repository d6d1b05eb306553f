"""The capped half-space against the uncapped solver, the plastic limit, and its own energy."""

from __future__ import annotations

import numpy as np
import pytest

from asperity.errors import InputError
from asperity.reference import RoughHalfSpace, half_space_contact
from asperity.surface import SelfAffine, WeierstrassMandelbrot

SURFACE = WeierstrassMandelbrot(L=1e-6, D=2.4, G=1.36e-11)
APPROACHES = [0.005, 0.01, 0.02]


def test_without_a_cap_it_is_the_elastic_half_space() -> None:
    """Without leaving cells out, and to a much smaller tolerance."""
    layer = RoughHalfSpace(n=64, height=1.0, nu=0.3)
    curve = layer.curve(layer.heights(SURFACE), SURFACE.maximum()[2] / SURFACE.L, APPROACHES, tolerance=1e-6)
    for k, delta in enumerate(APPROACHES):
        exact = half_space_contact(SURFACE, 64, delta_star=delta, height=SURFACE.L)
        assert curve.P_star[k] == pytest.approx(exact.P_star, rel=1e-4)
        assert curve.area_fraction[k] == pytest.approx(exact.area_fraction, rel=1e-3)
        np.testing.assert_array_equal(curve.touched_at <= delta, exact.pressure > 0.0)


def test_the_default_tolerance_is_enough_for_a_ratio() -> None:
    layer = RoughHalfSpace(n=128, height=1.0, nu=0.3)
    heights, summit = layer.heights(SURFACE), SURFACE.maximum()[2] / SURFACE.L
    loose, tight = (layer.curve(heights, summit, APPROACHES, tolerance=t).P_star for t in (1e-3, 1e-6))
    np.testing.assert_allclose(loose, tight, rtol=2e-3)


def test_a_soft_layer_carries_its_hardness_on_the_area_it_touches() -> None:
    """With a small hardness nearly all cells in contact are at it, and the area is the truncated one."""
    surface = SelfAffine(L=1.0, H=0.8, slope=0.3, lambda_roll=0.5, lambda_short=0.05, seed=3)
    layer = RoughHalfSpace(n=128, height=1.0, nu=0.3, hardness=1e-4)
    heights, summit = layer.heights(surface), surface.maximum()[2]
    curve = layer.curve(heights, summit, [0.01])
    touched = curve.touched_at <= 0.01
    assert curve.P_star[0] == pytest.approx(1e-4 * touched.mean(), rel=0.02)
    np.testing.assert_allclose(touched.mean(), np.mean(heights > summit - 0.01), rtol=0.02)


@pytest.mark.parametrize("hardness", [0.02, 0.05, 0.2])
def test_pressure_stays_between_the_bounds(hardness: float) -> None:
    """The optimality conditions of the capped problem are those of the fields, so P* lies below both limits."""
    elastic, capped = (RoughHalfSpace(n=64, height=1.0, nu=0.3, hardness=h) for h in (np.inf, hardness))
    heights, summit = elastic.heights(SURFACE), SURFACE.maximum()[2] / SURFACE.L
    free, limited = (layer.curve(heights, summit, APPROACHES, tolerance=1e-5) for layer in (elastic, capped))
    assert np.all(limited.P_star <= free.P_star * (1 + 1e-4))
    assert np.all(limited.P_star <= hardness * np.array([np.mean(limited.touched_at <= d) for d in APPROACHES]))
    assert np.all(limited.area_fraction >= free.area_fraction * (1 - 1e-3))


def test_free_sides_are_softer() -> None:
    heights = RoughHalfSpace(n=32, height=1.0, nu=0.4).heights(SURFACE)
    summit = SURFACE.maximum()[2] / SURFACE.L
    held, free = (
        RoughHalfSpace(32, 1.0, 0.4, sides).curve(heights, summit, [0.02]).P_star for sides in ("rollers", "free")
    )
    assert free[0] < held[0]


@pytest.mark.parametrize("approaches", [[], [0.0, 0.1], [0.2, 0.1]])
def test_approaches_must_ascend(approaches: list[float]) -> None:
    layer = RoughHalfSpace(n=8, height=1.0, nu=0.3)
    with pytest.raises(InputError, match="ascend"):
        layer.curve(np.zeros((8, 8)), 0.0, approaches)


def test_the_area_of_a_period_does_not_depend_on_where_it_begins() -> None:
    """Spots that the sides cut have no edge there."""
    x = 2.0 * np.pi * (np.arange(32) + 0.5) / 32
    heights = 0.01 * np.cos(x) * np.cos(x)[:, None]
    layer = RoughHalfSpace(n=32, height=1.0, nu=0.3, sides="periodic")
    assert layer.curve(np.asfortranarray(heights), 0.01, [0.004]).P_star == layer.curve(heights, 0.01, [0.004]).P_star
    areas = [layer.curve(np.roll(heights, shift, (0, 1)), 0.01, [0.004]).area_fraction[0] for shift in (0, 5, 11)]
    assert areas == pytest.approx([areas[0]] * 3, rel=1e-9) and 0.05 < areas[0] < 0.5
