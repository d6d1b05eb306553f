"""Spline of a height map that does not ring at steps and at edges of plateaus.

Of a smooth surface it is a cubic spline: where that rises above the heights around a cell, as it does at a summit
between them, neighbours agree on the parabola. Steps, scratches and single pits have no such neighbours, and a cubic
spline has summits beside them that are not there. Of a map with these the slopes at the heights are those of monotone
cubics (Fritsch and Butland, SIAM J. Sci. Stat. Comput. 5 (1984) 300), which exceed no height. The bicubic Hermite
polynomials of these slopes are a spline with double knots.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from asperity.arrays import Array

if TYPE_CHECKING:
    from scipy.interpolate import BivariateSpline

MATTERS = 0.03  # rise of the spline above what neighbours agree on, over the depth of a light contact
AGREED = 2.0  # rise that is believed, over that of the lesser parabola of two neighbours

DEGREE = 3  # of the spline
LIGHT, LEAST = 0.02, 0.02  # share of the heights above the flat at a light load; least depth over their range


def interpolate(z: Array, L: float) -> tuple[BivariateSpline, float]:
    """Spline through heights, and how far a cubic one would rise above them (length) where it was not taken, else 0.

    Args:
        z: heights (ny, nx) on the square [0, L]^2 (length)
    """
    from scipy.interpolate import BivariateSpline, PchipInterpolator, RectBivariateSpline

    x, y = (np.linspace(0, L, n) for n in z.shape[::-1])
    # the first axis of the spline is x
    spline = RectBivariateSpline(x, y, z.T, s=0)
    rise = _ringing(z, spline(with_middles(x), with_middles(y)).T)
    if rise <= MATTERS * light_depth(z):
        return spline, 0.0
    slopes = (step * PchipInterpolator(at, z, axis=axis)(at, 1) for at, step, axis in ((x, x[1], 1), (y, y[1], 0)))
    signs, knots = [], []
    for n, step in zip(z.shape, (y[1], x[1]), strict=True):
        sign = np.tile([-1.0, 1.0], n) / 3.0
        sign[0] = sign[-1] = 0.0  # the end of the patch
        signs.append(sign)
        knots.append(step * np.repeat(np.arange(n), [4, *[2] * (n - 2), 4]))
    heights, dx, dy = (np.repeat(np.repeat(f, 2, axis=0), 2, axis=1) for f in (z, *slopes))
    c = heights + signs[1] * dx + signs[0][:, None] * dy
    return BivariateSpline._from_tck((knots[1], knots[0], c.T.ravel(), DEGREE, DEGREE)), rise


def _ringing(z: Array, fine: Array) -> float:
    """Greatest rise of a spline above the highest height, beyond what neighbours explain.

    Args:
        z: heights (ny, nx) (length)
        fine: of the spline there and halfway between them (2 ny - 1, 2 nx - 1) (length)
    """
    from scipy.ndimage import maximum_filter

    believed: Array = np.zeros((len(z) - 1, z.shape[1] - 1))
    for heights, cells in ((z, believed), (z.T, believed.T)):
        bend = np.pad(np.maximum(-np.diff(heights, 2, axis=1), 0.0), ((0, 0), (1, 1)), mode="edge")
        both = np.minimum(bend[:, 1:], bend[:, :-1])
        cells += AGREED / 8.0 * np.maximum(both[1:], both[:-1])
    top = maximum_filter(fine, 3)[1::2, 1::2]
    explained = maximum_filter(z, 2)[1:, 1:] + believed
    return float(np.max(top - np.maximum(explained, z.max()), initial=0.0))


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
