"""Surfaces convolved with Gaussians whose width differs from point to point."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from asperity.arrays import Array

Heights = Callable[[Array, Array], Array]

_ALPHA = math.sqrt(math.log(2) / math.pi)  # constant of the Gaussian filter, ISO 16610-61


class ScaleSpace:
    """Heights smoothed by a Gaussian of any width, interpolated between levels of fixed widths.

    Level j has the standard deviation s_j = first sqrt(2^j - 1); level 0 is the surface itself. Between the levels the
    heights are cubic in ln(1 + (s/first)^2) with continuous slope. Of a wave of wave number k with k first < 0.7 the
    amplitude differs from exp(-(k s)^2/2) of its own by less than 0.006; for s = 0 it is exact.

    Args:
        first: width that the spacing of the levels is related to (length)
        last: width beyond which the heights no longer change (length)
        level: for a standard deviation (length), returns the heights at points; called once for each level in use
    """

    def __init__(self, first: float, last: float, level: Callable[[float], Heights]) -> None:
        self._first, self._level = first, level
        self._last = max(2, math.ceil(math.log2(1 + (last / first) ** 2)))
        self._levels: dict[int, Heights] = {}

    def heights(self, x: Array, y: Array, s: Array) -> Array:
        """Heights (length) at points x, y smoothed with standard deviations s, each (n,) (length)."""
        place = np.minimum(np.log2(1 + (s / self._first) ** 2), self._last)
        below = np.minimum(place.astype(int), self._last - 1)
        weights = _cubic(place - below)
        start = below == 0  # there is no level -1: the quadratic through the first three continues
        for i, factor in ((1, 3.0), (2, -3.0), (3, 1.0)):
            weights[i, start] += factor * weights[0, start]
        weights[0, start] = 0.0
        z = np.zeros(x.size)
        for j in np.unique(below):
            for i, level in enumerate(range(j - 1, j + 3)):
                used = np.flatnonzero((below == j) & (weights[i] != 0))
                if used.size:
                    z[used] += weights[i, used] * self._heights_of(min(level, self._last))(x[used], y[used])
        return z

    def _heights_of(self, level: int) -> Heights:
        if level not in self._levels:
            self._levels[level] = self._level(self._first * math.sqrt(2.0**level - 1))
        return self._levels[level]


def spline_gain(omega: Array) -> Array:
    """Transform of the quintic B-spline on its nodes at angular wave numbers per node.

    Waves divided by it are the coefficients of the spline that interpolates them.
    """
    return (66 + 52 * np.cos(omega) + 2 * np.cos(2 * omega)) / 120


def spline_heights(coefficients: Array, spacing: tuple[float, float], mode: str, mean: float = 0.0) -> Heights:
    """Heights as a function of points, from the coefficients of a quintic spline.

    Args:
        coefficients: (ny, nx), index [iy, ix], the first node at (0, 0) (length); kept in single precision
        spacing: distance of the nodes along y and along x (length)
        mode: beyond the nodes: "mirror" at the first and the last one, or "grid-wrap" for a period
        mean: height to add (length)
    """
    from scipy.ndimage import map_coordinates

    spline = coefficients.astype(np.float32, copy=False)

    def heights(x: Array, y: Array) -> Array:
        places = np.stack([y / spacing[0], x / spacing[1]])
        return mean + np.asarray(map_coordinates(spline, places, output=float, order=5, mode=mode, prefilter=False))

    return heights


def gaussian_filtered(z: Array, size: tuple[float, float], cutoff: float) -> Array:
    """Heights after a Gaussian low-pass filter of ISO 16610-61, mirrored at the edges.

    Args:
        z: heights (ny, nx) (length)
        size: of the map along x and along y (length)
        cutoff: wavelength of 50 % transmission (length)
    """
    from scipy.fft import dctn, idctn

    waves = dctn(z, type=1)
    for axis, (n, length) in enumerate(zip(z.shape, size[::-1], strict=True)):
        half_waves = np.arange(n) / (2 * length)  # 1/wavelength
        waves *= np.expand_dims(np.exp(-np.pi * (_ALPHA * cutoff * half_waves) ** 2), 1 - axis)
    return np.asarray(idctn(waves, type=1, overwrite_x=True))


def _cubic(t: Array) -> Array:
    """Weights (4, n) of values at -1, 0, 1 and 2 in their cubic with continuous slope at 0 <= t <= 1."""
    return 0.5 * np.stack([-t + 2 * t**2 - t**3, 2 - 5 * t**2 + 3 * t**3, t + 4 * t**2 - 3 * t**3, t**3 - t**2])
