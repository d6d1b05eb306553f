"""Surfaces convolved with Gaussians whose width differs from point to point."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike

from asperity.arrays import Array

Heights = Callable[[Array, Array], Array]

_ALPHA = math.sqrt(math.log(2) / math.pi)  # constant of the Gaussian filter, ISO 16610-61
_SPACING, _FEWEST = 0.5, 16  # distance of the nodes of smoothed heights over their width; least nodes of a period


class ScaleSpace:
    """Heights smoothed by a Gaussian of any width, interpolated between levels of fixed widths.

    Level j has the standard deviation s_j = first sqrt(2^j - 1); level 0 is the surface itself. The others are quintic
    splines on a grid that is coarse where few waves are left, in single precision. Between the levels the
    heights are cubic in ln(1 + (s/first)^2) with continuous slope. Of a wave of wave number k with k first < 0.7 the
    amplitude differs from exp(-(k s)^2/2) of its own by less than 0.006; for s = 0 it is exact.

    Args:
        exact: heights of the surface at points
        z: one period of them above `mean`, (ny, nx), index [iy, ix], the first at (0, 0) (length)
        period: along both axes; wider Gaussians leave the mean (length)
        first: width that the spacing of the levels is related to (length)
        mean: about that of the heights (length)
    """

    def __init__(self, exact: Heights, z: Array, period: float, first: float, mean: float = 0.0) -> None:
        from scipy.fft import rfft2

        self._shape, self._period, self._first, self._mean = z.shape, period, first, mean
        self._waves = rfft2(z.astype(np.float32), norm="forward")
        self._last = max(2, math.ceil(math.log2(1 + (period / first) ** 2)))
        self._levels: dict[int, Heights] = {0: exact}

    def heights(self, x: ArrayLike, y: ArrayLike, s: ArrayLike) -> Array:
        """Heights (length) at points x, y smoothed with standard deviations s (length), in their broadcast shape."""
        points = np.broadcast_arrays(*(np.asarray(v, dtype=float) for v in (x, y, s)))
        px, py, widths = (v.ravel() for v in points)
        place = np.minimum(np.log2(1 + (widths / self._first) ** 2), self._last)
        below = np.minimum(place.astype(int), self._last - 1)
        t = place - below  # weights of levels at -1, 0, 1 and 2 in their cubic with continuous slope
        weights = 0.5 * np.stack(
            [-t + 2 * t**2 - t**3, 2 - 5 * t**2 + 3 * t**3, t + 4 * t**2 - 3 * t**3, t**3 - t**2],
        )
        start = below == 0  # there is no level -1: the quadratic through the first three continues
        for i, factor in ((1, 3.0), (2, -3.0), (3, 1.0)):
            weights[i, start] += factor * weights[0, start]
        weights[0, start] = 0.0
        z = np.zeros(px.size)
        for j in np.unique(below):
            for i, level in enumerate(range(j - 1, j + 3)):
                used = np.flatnonzero((below == j) & (weights[i] != 0))
                if used.size:
                    z[used] += weights[i, used] * self._level(min(level, self._last))(px[used], py[used])
        inside = np.flatnonzero(start & (t > 0.0))  # at steps of a map the quadratic leaves both levels
        if inside.size:
            ends = [self._level(k)(px[inside], py[inside]) for k in (0, 1)]
            z[inside] = np.clip(z[inside], np.minimum(*ends), np.maximum(*ends))
        return z.reshape(points[0].shape)

    def _level(self, level: int) -> Heights:
        """Heights of a level at points, made once."""
        from scipy.fft import fftfreq, irfft2
        from scipy.ndimage import map_coordinates

        if level not in self._levels:
            s = self._first * math.sqrt(2.0**level - 1)
            enough = max(_FEWEST, 2 * math.ceil(self._period / (2 * _SPACING * s)))
            ny, nx = (min(n, enough) for n in self._shape)
            rows = np.rint(fftfreq(ny, 1 / ny)).astype(int)
            waves = self._waves[rows, : nx // 2 + 1]
            for axis, (k, n) in enumerate(((rows, ny), (np.arange(nx // 2 + 1), nx))):
                omega = 2 * np.pi * k / n
                of_spline = (66 + 52 * np.cos(omega) + 2 * np.cos(2 * omega)) / 120  # transform of its basis
                gain = np.exp(-((2 * np.pi * k * s / self._period) ** 2) / 2) / of_spline
                waves = waves * np.expand_dims(gain.astype(np.float32), 1 - axis)
            spline = irfft2(waves, s=(ny, nx), norm="forward")

            def heights(x: Array, y: Array) -> Array:
                places = np.stack([y * (ny / self._period), x * (nx / self._period)])
                z = map_coordinates(spline, places, output=float, order=5, mode="grid-wrap", prefilter=False)
                return self._mean + np.asarray(z)

            self._levels[level] = heights
        return self._levels[level]


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
