"""Heights between samples at steps, edges of plateaus and in quantised maps."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.interpolate import RectBivariateSpline

from asperity.arrays import Array
from asperity.reference import RoughHalfSpace
from asperity.surface import HeightMap, SelfAffine
from asperity.surface.base import light_depth

N = 97


def dimpled() -> Array:
    """Exactly flat plateau at 0 with four flat-bottomed dimples."""
    x, y = np.meshgrid(*2 * [np.linspace(0.0, 1.0, N)])
    z = np.zeros((N, N))
    for cx, cy in ((0.3, 0.3), (0.72, 0.2), (0.25, 0.7), (0.7, 0.7)):
        z[np.hypot(x - cx, y - cy) < 0.13] = -2e-3
    return z


def step() -> Array:
    """One step along y."""
    return np.where(np.arange(N) < N // 2, 0.0, -2e-3)[None, :].repeat(N, axis=0)


def rough(pixels: float) -> Array:
    """Self-affine, with so many heights in the shortest wave."""
    return SelfAffine(L=1.0, H=0.8, slope=0.02, lambda_roll=0.4, lambda_short=pixels / (N - 1), seed=5).grid(N)


def marked(kind: str) -> Array:
    """Rough, with pixels that are missing, with scratches at an angle, or with blocks that are turned."""
    z, (x, y) = rough(6), np.meshgrid(*2 * [np.linspace(0.0, 1.0, N)])
    if kind == "pits":
        low = np.random.default_rng(2).random((N, N)) < 0.003
    elif kind == "scratches":
        low = (np.abs(x - 0.6 * y - 0.2) < 0.01) | (np.abs(x + y - 1.1) < 0.012)
    else:
        low = (np.floor(7.0 * (x + 0.6 * y)) + np.floor(5.0 * (y - 0.6 * x))) % 2 > 0.0
    return np.where(low, z - 5.0 * float(np.ptp(z)), z)


def bump(width: float) -> Array:
    """Smooth summit between four heights, beside the edge of the map."""
    x, y = np.meshgrid(np.arange(N), np.arange(N))
    return np.asarray(1e-3 * np.exp(-((x - 4.4) ** 2 + (y - 60.5) ** 2) / (2.0 * width**2)))


def cubic(z: Array, n: int) -> Array:
    """Spline without limits on a grid of n x n."""
    s, fine = np.linspace(0.0, 1.0, len(z)), np.linspace(0.0, 1.0, n)
    return np.asarray(RectBivariateSpline(s, s, z)(fine, fine))


@pytest.mark.parametrize(
    "z",
    [dimpled(), step(), dimpled() + 1e-3 * np.linspace(0.0, 1.0, N), *map(marked, ("pits", "scratches", "blocks"))],
    ids=["dimples", "step", "tilted", "pits", "scratches", "blocks"],
)
def test_steps_and_plateaus_are_not_exceeded(z: Array) -> None:
    surface, n = HeightMap.of(z, 1.0), 4 * (N - 1) + 1
    depth = light_depth(z)
    assert surface.spline_rise > depth
    fine = surface.grid(n)
    assert np.allclose(fine[::4, ::4], z, atol=1e-15)
    assert surface.maximum()[2] <= z.max() + 0.1 * depth and fine.min() >= z.min() - 0.1 * depth
    assert surface.maximum()[2] >= fine.max() - 1e-15
    x, y = np.meshgrid(*2 * [np.linspace(0.0, 1.0, n)])
    for width in (0.1, 0.25, 0.5, 0.8, 1.2):
        assert surface.smoothed(x, y, width / (N - 1)).max() <= z.max() + 0.15 * depth


@pytest.mark.parametrize("z", [rough(4), rough(6), rough(10), bump(1.5), bump(3.0)], ids=["4", "6", "10", "b", "c"])
def test_a_smooth_map_keeps_its_spline(z: Array) -> None:
    n = 3 * (N - 1) + 1
    surface = HeightMap.of(z, 1.0)
    assert surface.spline_rise == 0.0
    assert np.allclose(surface.grid(n), cubic(z, n), rtol=0.0, atol=1e-15)


def test_contact_of_a_plateau_with_dimples_is_that_of_its_samples() -> None:
    """Pressed, the plateau is in contact and the dimples are not: half-space on the surface and on its samples."""
    z, delta = dimpled(), [2e-5]
    layer = RoughHalfSpace(N - 1, 1.0, 0.3)
    cells = (z[:-1, :-1] + z[1:, :-1] + z[:-1, 1:] + z[1:, 1:]) / 4.0
    samples = layer.curve(cells, 0.0, delta, tolerance=1e-4)
    surface = HeightMap.of(z, 1.0)
    found = layer.curve(layer.heights(surface), surface.maximum()[2], delta, tolerance=1e-4)
    ringing = layer.curve(cubic(z, 2 * N - 1)[1::2, 1::2], float(cubic(z, 8 * N + 1).max()), delta, tolerance=1e-4)
    assert found.area_fraction[0] == pytest.approx(samples.area_fraction[0], rel=0.03)
    assert found.P_star[0] == pytest.approx(samples.P_star[0], rel=0.15)
    assert ringing.area_fraction[0] < 0.2 * samples.area_fraction[0]


def test_force_of_eight_bits_is_that_of_the_heights() -> None:
    z = rough(10)
    quantum = float(np.ptp(z)) / 255
    layer, forces = RoughHalfSpace(192, 1.0, 0.3), []
    for heights in (z, np.rint(z / quantum) * quantum):
        surface = HeightMap.of(heights, 1.0)
        mean_plane = float(z.max()) - 2.0 * light_depth(z)  # the flat at one place, whatever the summit
        delta = surface.maximum()[2] - mean_plane
        forces.append(layer.curve(layer.heights(surface), surface.maximum()[2], [delta], tolerance=1e-4).P_star[0])
    assert forces[1] == pytest.approx(forces[0], rel=0.02)
