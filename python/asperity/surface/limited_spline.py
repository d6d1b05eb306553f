# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

"""Cubic spline of a height map that does not ring at steps and at edges of plateaus.

The slopes of a spline are limited at heights where the data are no samples of a smooth surface (Huynh, SIAM J. Numer.
Anal. 30 (1993) 57, limiter M3): to those of a monotone cubic between heights that rise or fall, and near a summit to
those of parabolas that the neighbours on both sides agree on, so that a summit between heights stays. The bicubic
Hermite polynomials of the limited slopes are a spline with double knots.
"""

from __future__ import annotations

import numpy as np

from asperity.arrays import Array

Knots = tuple[Array, Array, Array]  # along x and y (length), coefficients (length)

BULGE = 4.0 / 27.0  # greatest value of a cubic on [0, 1] with values 0 at both ends and slope 1 at one of them
MATTERS = 0.03  # rise of the spline above the limited one, over the depth of a light contact


def limited_spline(
    z: Array, zx: Array, zy: Array, zxy: Array, spacing: tuple[float, float], depth: float
) -> Knots | None:
    """Knots and coefficients of the spline with limited slopes; None where one without cannot rise by MATTERS.

    Args:
        z: heights, index [iy, ix] (length)
        zx, zy, zxy: derivatives of a spline there
        spacing: of the heights along x and y (length)
        depth: of a light contact (length)
    """
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
