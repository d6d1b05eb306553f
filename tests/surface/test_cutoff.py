"""Rms values of the spline of a map, and the shortest cut-off that makes a surface acceptable."""

from __future__ import annotations

import numpy as np
import pytest

from asperity.mesh.resolution import ONE_MESH, SHARE, doubt_of_waves, unresolved_height
from asperity.surface import HeightMap, SelfAffine, Surface, WeierstrassMandelbrot
from asperity.surface.cutoff import approach_of_share, share_of_approach, shortest_cutoff

L = 1e-6


def rough(n: int, seed: int = 0) -> HeightMap:
    z = SelfAffine(L=L, H=0.7, slope=0.2, lambda_roll=L / 3, lambda_short=L / 40, periodic=False, seed=seed).grid(n)
    return HeightMap.of(z + 1e-9 * np.random.default_rng(seed).normal(size=z.shape) + 3 * L, L)


def test_rms_values_of_a_map_are_those_of_its_spline() -> None:
    """Against a midpoint rule of 20 points a cell, which converges to them."""
    n = 33
    surface = HeightMap.of(rough(n).heights, L)
    s = (np.arange(20 * (n - 1)) + 0.5) * L / (20 * (n - 1))
    z, zx, zy, xx, yy = (surface.on_product(s, s, *d) for d in ((0, 0), (1, 0), (0, 1), (2, 0), (0, 2)))
    expected = np.std(z), np.sqrt(np.mean(zx**2 + zy**2)), np.sqrt(np.mean((xx + yy) ** 2)) / 2
    np.testing.assert_allclose(surface.exact_rms(), expected, rtol=1e-3)
    found = surface.statistics(65)
    assert (found.Sq, found.rms_slope, found.rms_curvature) == surface.exact_rms()


@pytest.mark.parametrize("seed", range(2))
def test_the_shortest_cutoff_is_stable(seed: int) -> None:
    """What is filtered with it needs none; a shorter one would not do."""
    surface, h = rough(129, seed), 0.03 * L
    delta = approach_of_share(surface)

    def accepts(filtered: Surface, depth: float) -> bool:
        return unresolved_height(filtered, h, depth) <= SHARE * ONE_MESH

    assert not accepts(surface, delta)
    cutoff = shortest_cutoff(surface, delta, accepts)
    assert cutoff is not None and f"cut off what is shorter than {cutoff:g}" in doubt_of_waves(surface, h, delta)
    filtered = surface.cut_off(cutoff)
    share = share_of_approach(surface, delta)
    assert not doubt_of_waves(filtered, h, approach_of_share(filtered, share))
    shorter = surface.cut_off(cutoff / 2**0.25)
    assert doubt_of_waves(shorter, h, approach_of_share(shorter, share))


def test_no_cutoff_takes_more_than_a_quarter_of_the_height() -> None:
    noise = HeightMap.of(1e-9 * np.random.default_rng(0).normal(size=(65, 65)), L)
    assert shortest_cutoff(noise, 1e-9, lambda surface, delta: surface.statistics(65).Sq < 0.5e-9) is None


def test_closed_forms_are_cut_off_by_their_keys() -> None:
    fractal = WeierstrassMandelbrot(L=L, D=2.5, G=1e-12, f_max=8, drawing="nested", seed=3)
    short = WeierstrassMandelbrot(L=L, D=2.5, G=1e-12, f_max=5, drawing="nested", seed=3)
    x = np.linspace(0, L, 7)
    np.testing.assert_allclose(fractal.cut_off(L / 1.5**5).height(x, x), short.height(x, x))
    affine = SelfAffine(L=L, H=0.8, rms_height=1e-8, lambda_roll=L / 2, lambda_short=L / 30)
    assert affine.cut_off(L / 10).lambda_short == L / 10 and affine.cut_off(L / 90).lambda_short == L / 30
