"""Surfaces whose heights are a spline over a regular grid, and their heights smoothed by Gaussians."""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Callable
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from asperity.arrays import Array
from asperity.surface.base import Surface

if TYPE_CHECKING:
    from scipy.interpolate import BivariateSpline

Heights = Callable[[Array, Array], Array]

_SPACING, _FEWEST = 0.5, 16  # distance of the nodes of smoothed heights over their width; least nodes of a period


class SplineSurface(Surface):
    """A surface whose heights are a tensor-product spline, with the derivatives of that spline."""

    @abstractmethod
    def _make_spline(self) -> BivariateSpline:
        """The spline; its first axis is y."""

    @cached_property
    def _derivatives(self) -> dict[tuple[int, int], Any]:
        return {(0, 0): self._make_spline()}

    def _derivative(self, dx: int, dy: int) -> Any:
        """Derivative as a spline, made once: it takes as long as 10,000 points."""
        if (dx, dy) not in self._derivatives:
            self._derivatives[dx, dy] = self._derivatives[0, 0].partial_derivative(dy, dx)
        return self._derivatives[dx, dy]

    def _at(self, x: ArrayLike, y: ArrayLike, dx: int = 0, dy: int = 0) -> Array:
        x, y = np.broadcast_arrays(np.asarray(x, dtype=float), np.asarray(y, dtype=float))
        values = self._derivative(dx, dy)(y.ravel(), x.ravel(), grid=False)
        return np.asarray(values, dtype=float).reshape(x.shape)

    def height(self, x: ArrayLike, y: ArrayLike) -> Array:
        return self._at(x, y)

    def gradient(self, x: ArrayLike, y: ArrayLike) -> tuple[Array, Array]:
        return self._at(x, y, 1, 0), self._at(x, y, 0, 1)

    def hessian(self, x: ArrayLike, y: ArrayLike) -> tuple[Array, Array, Array]:
        return self._at(x, y, 2, 0), self._at(x, y, 1, 1), self._at(x, y, 0, 2)

    def on_product(self, x: Array, y: Array, dx: int = 0, dy: int = 0) -> Array:  # far cheaper than scattered points
        return np.asarray(self._derivative(dx, dy)(y, x))

    def curvature_bound(self) -> float:
        """Bound of the Hessian (1/length) from the convex hull of the spline coefficients."""
        xx, xy, yy = (float(np.abs(self._derivative(*order).tck[2]).max()) for order in ((2, 0), (1, 1), (0, 2)))
        return max(xx, yy) + xy

    def smoothed(self, x: ArrayLike, y: ArrayLike, s: ArrayLike) -> Array:
        return self._scales.heights(x, y, s)

    @cached_property
    @abstractmethod
    def _scales(self) -> ScaleSpace:
        """Levels of smoothed heights."""


def quintic_gain(omega: Array) -> Array:
    """Transform of the quintic B-spline at the nodes, at angular wave numbers per node of any shape."""
    return np.asarray((66 + 52 * np.cos(omega) + 2 * np.cos(2 * omega)) / 120)


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
                gain = np.exp(-((2 * np.pi * k * s / self._period) ** 2) / 2) / quintic_gain(2 * np.pi * k / n)
                waves = waves * np.expand_dims(gain.astype(np.float32), 1 - axis)
            spline = irfft2(waves, s=(ny, nx), norm="forward")

            def heights(x: Array, y: Array) -> Array:
                places = np.stack([y * (ny / self._period), x * (nx / self._period)])
                z = map_coordinates(spline, places, output=float, order=5, mode="grid-wrap", prefilter=False)
                return self._mean + np.asarray(z)

            self._levels[level] = heights
        return self._levels[level]
