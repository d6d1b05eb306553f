"""Cubic spline of a height map that does not ring at steps and at edges of plateaus.

The slopes of a spline are limited at heights where the data are no samples of a smooth surface (Huynh, SIAM J. Numer.
Anal. 30 (1993) 57, limiter M3): to those of a monotone cubic between heights that rise or fall, and near a summit to
those of parabolas that the neighbours on both sides agree on, so that a summit between heights stays. The bicubic
Hermite polynomials of the limited slopes are a spline with double knots.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from asperity.arrays import Array

if TYPE_CHECKING:
    from scipy.interpolate import BivariateSpline

Knots = tuple[Array, Array, Array]  # along x and y (length), coefficients (length)

BULGE = 4.0 / 27.0  # greatest value of a cubic on [0, 1] with values 0 at both ends and slope 1 at one of them
MATTERS = 0.03  # rise of the spline above the limited one, over the depth of a light contact

DEGREE = 3  # of the spline
LIGHT, LEAST = 0.02, 0.02  # share of the heights above the flat at a light load; least depth over their range


def interpolate(z: Array, L: float) -> tuple[BivariateSpline, float]:
    """Spline through heights, and its rise above them (length) where limited slopes have removed that, else 0.

    Args:
        z: heights (ny, nx) on the square [0, L]^2 (length)
    """
    from scipy.interpolate import BivariateSpline, RectBivariateSpline

    x, y = (np.linspace(0, L, n) for n in z.shape[::-1])
    # the first axis of the spline is x
    spline = RectBivariateSpline(x, y, z.T, s=0)
    zx, zy, zxy = (spline(x, y, *orders).T for orders in ((1, 0), (0, 1), (1, 1)))
    depth = light_depth(z)
    found = _limited_spline(z, zx, zy, zxy, (x[1], y[1]), depth)
    if found is None:
        return spline, 0.0
    limited, fine = BivariateSpline._from_tck((*found, 3, 3)), (with_middles(x), with_middles(y))
    highest = float(spline(*fine).max())
    if highest - limited(*fine).max() <= MATTERS * depth:
        return spline, 0.0
    return limited, highest - float(z.max())


def _limited_spline(
    z: Array, zx: Array, zy: Array, zxy: Array, spacing: tuple[float, float], depth: float
) -> Knots | None:
    """Knots and coefficients of the spline with limited slopes; None where one without cannot rise by MATTERS."""
    a, b = spacing
    slopes = a * zx, b * zy
    dx, dy = _limited(slopes[0], np.diff(z, axis=1)), _limited(slopes[1].T, np.diff(z, axis=0).T).T
    taken = [np.abs(new - old) for new, old in zip((dx, dy), slopes, strict=True)]
    if BULGE * max(float(t.max()) for t in taken) <= MATTERS * depth:
        return None
    dxy = np.where((taken[0] > 0.0) | (taken[1] > 0.0), 0.0, a * b * zxy)
    signs, knots = [], []
    for n, step in zip(z.shape, (b, a), strict=True):
        sign = np.tile([-1.0, 1.0], n) / 3.0
        sign[0] = sign[-1] = 0.0  # the end of the patch
        signs.append(sign)
        knots.append(step * np.repeat(np.arange(n), [4, *[2] * (n - 2), 4]))
    z, dx, dy, dxy = (np.repeat(np.repeat(f, 2, axis=0), 2, axis=1) for f in (z, dx, dy, dxy))
    of_y, of_x = signs[0][:, None], signs[1]
    c = z + of_x * dx + of_y * dy + of_x * of_y * dxy
    return knots[1], knots[0], c.T.ravel()


def _limited(slope: Array, secant: Array) -> Array:
    """Slopes times spacing (m, n) after the limiter, from differences of neighbours (m, n - 1)."""
    before, after = (np.pad(secant, ((0, 0), pad), mode="edge") for pad in ((1, 0), (0, 1)))
    bend = np.pad((after - before)[:, 1:-1], ((0, 0), (1, 1)), mode="edge")
    agreed = _minmod(bend[:, :-1], bend[:, 1:]) / 2.0
    left, right = np.pad(secant + agreed, ((0, 0), (1, 0))), np.pad(secant - agreed, ((0, 0), (0, 1)))
    left[:, 0], right[:, -1] = right[:, 0], left[:, -1]  # an end has neighbours on one side
    smooth = _minmod(left, right)
    most = np.maximum(3.0 * np.abs(_minmod(before, after)), 1.5 * np.abs(smooth))
    return _minmod(slope, np.sign(smooth) * most)


def _minmod(a: Array, b: Array) -> Array:
    """The smaller of two numbers of one sign, else 0."""
    return 0.5 * (np.sign(a) + np.sign(b)) * np.minimum(np.abs(a), np.abs(b))


def light_depth(z: Array, summit: float | None = None) -> float:
    """Depth below the summit, or the highest height, with a small share of the heights above it (length).

    >>> from asperity.surface.spline import light_depth
    >>> round(float(light_depth(np.linspace(0.0, 1.0, 101))), 9)
    0.02
    """
    highest = float(z.max()) if summit is None else summit
    return max(highest - float(np.quantile(z, 1.0 - LIGHT)), LEAST * float(np.ptp(z)))


def with_middles(t: Array) -> Array:
    """Ascending values and those halfway between them (2n - 1,)."""
    out = np.empty(2 * t.size - 1)
    out[::2], out[1::2] = t, 0.5 * (t[1:] + t[:-1])
    return out
