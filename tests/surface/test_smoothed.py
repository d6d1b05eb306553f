"""Surfaces smoothed by a Gaussian whose width differs from point to point."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from asperity.surface import HeightMap, SelfAffine, Sinusoid, Surface, WeierstrassMandelbrot

ROUGH = SelfAffine(L=1.0, H=0.6, slope=0.3, lambda_roll=0.5, lambda_short=0.06, aspect=1.5, seed=2)
FRACTAL = WeierstrassMandelbrot(L=1.0, D=2.5, G=1e-4, M=5, f_max=6)
WAVE = Sinusoid(L=1.0, amplitude=0.01, wavelength=0.25, dims=2)
RNG = np.random.default_rng(0)
X, Y = RNG.uniform(0, 1, (2, 200))


def convolved(surface: Surface, x: float, y: float, s: float) -> float:
    """Gauss-Hermite quadrature of the convolution, for surfaces that continue beyond the patch."""
    t, w = np.polynomial.hermite_e.hermegauss(80)
    w = w / w.sum()
    return float(w @ surface.height(x + s * t[None, :], y + s * t[:, None]) @ w)


@pytest.mark.parametrize(("surface", "error"), [(FRACTAL, 1e-9), (WAVE, 1e-9), (ROUGH, 0.005)])
def test_formulas_against_quadrature_of_the_convolution(surface: Surface, error: float) -> None:
    widths = np.geomspace(1e-3, 0.1, 25)
    exact = [convolved(surface, x, y, float(s)) for x, y, s in zip(X[:25], Y[:25], widths, strict=True)]
    found = surface.smoothed(X[:25], Y[:25], widths)
    np.testing.assert_allclose(found, exact, rtol=0, atol=error * surface.statistics(129).Sq)


@pytest.mark.parametrize("shape", [(129, 129), (120, 151)])
def test_maps_against_a_direct_convolution(shape: tuple[int, int]) -> None:
    """Mirrored at the edges; points at the nodes, edges and corners included."""
    ny, nx = shape
    z = 0.01 * (np.random.default_rng(1).normal(size=shape) + 3 * np.sin(np.arange(nx) / 9)) + 500.0
    surface = HeightMap.of(z, (1.0, 1.0))
    iy, ix = (np.append(np.random.default_rng(2).integers(0, n, 300), [0, n - 1, 0]) for n in shape)
    for width in (1.0, 1.5, 3.1, 8.0, 25.0):  # a sampled Gaussian of less is not a Gaussian
        s = width / (min(shape) - 1)
        exact = gaussian_filter(z, (s * (ny - 1), s * (nx - 1)), mode="mirror", truncate=8)
        found = surface.smoothed(ix / (nx - 1), iy / (ny - 1), s)
        np.testing.assert_allclose(found, exact[iy, ix], rtol=0, atol=0.015 * np.std(z))
    nodes = surface.smoothed(ix / (nx - 1), iy / (ny - 1), 0.0)
    np.testing.assert_allclose(nodes, z[iy, ix], rtol=1e-14)


def test_a_constant_map_stays_and_the_mean_is_kept() -> None:
    constant = HeightMap.of(np.full((33, 40), 7.0), (1.0, 1.0))
    np.testing.assert_allclose(constant.smoothed(X, Y, RNG.uniform(0, 0.5, X.size)), 7.0, rtol=1e-14)
    rough = HeightMap.of(RNG.normal(size=(200, 200)) + 1e4, 1.0)
    s = np.linspace(0, 1, 100)
    for width in (0.01, 0.1, 1.0, 50.0):
        smooth = rough.smoothed(s[None, :], s[:, None], width)
        assert np.trapezoid(np.trapezoid(smooth, s), s) == pytest.approx(
            np.trapezoid(np.trapezoid(rough.grid(200), np.linspace(0, 1, 200)), np.linspace(0, 1, 200)), abs=2e-3
        )
    assert np.ptp(smooth) < 1e-6


@pytest.mark.parametrize("wavelength", [4, 16, 64])
def test_the_amplitude_of_a_wave_falls_steadily_as_a_gaussian(wavelength: int) -> None:
    """Within 0.006, through all levels; smoothly, so that meshes of similar sizes have similar heights."""
    n, k = 257, 2 * np.pi * 256 / wavelength
    surface = HeightMap.of(np.tile(np.cos(k * np.linspace(0, 1, n)), (n, 1)), 1.0)
    s = np.linspace(0, 5 / k, 400)
    found = surface.smoothed(0.5, 0.5, s)
    np.testing.assert_allclose(found, np.exp(-((k * s) ** 2) / 2), rtol=0, atol=0.006)
    assert np.diff(found).max() < 1e-3 and np.abs(np.diff(found)).max() < 0.02


def test_a_periodic_surface_stays_periodic() -> None:
    s = np.linspace(0, 1, 9)
    widths: Any = np.linspace(0, 0.1, 9)
    np.testing.assert_allclose(ROUGH.smoothed(0, s, widths), ROUGH.smoothed(1, s, widths), atol=1e-7)
    assert WAVE.periodic and not Sinusoid(L=1.0, amplitude=0.01, wavelength=0.3).periodic and not FRACTAL.periodic
