# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

"""Exact mean squares of a spline over its patch, by the integrals of products of B-splines."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from asperity.arrays import Array

Order = tuple[int, int]

DEGREE = 3  # of the spline


def spline_rms(knots: tuple[Array, Array], coefficients: Callable[[int, int], Array]) -> tuple[float, float, float]:
    """(Sq, rms slope, rms curvature) (length, 1, 1/length); curvature is half the Laplacian.

    A grid of the same or of half the spacing of the knots would favour some places between them.

    Args:
        knots: of the spline along x and along y (length)
        coefficients: of its derivative of orders (dx, dy), index [iy, ix]
    """
    across = [_products(t) for t in knots]
    area = math.prod(float(t[-1] - t[0]) for t in knots)

    def mean(first: Order, second: Order) -> float:
        along_x, along_y = (products(first[i], second[i]) for i, products in enumerate(across))
        f, g = (shifted if order == (0, 0) else coefficients(*order) for order in (first, second))
        return float(np.sum(f * (along_y @ (along_x @ g.T).T))) / area

    shifted = coefficients(0, 0)
    shifted = shifted - shifted.mean()  # a constant is the same constant in all coefficients
    total = [np.asarray(products(0, 0).sum(axis=0)).ravel() for products in across]
    level = float(total[1] @ shifted @ total[0]) / area
    square = mean((0, 0), (0, 0)) - level**2
    slope2 = mean((1, 0), (1, 0)) + mean((0, 1), (0, 1))
    laplacian2 = mean((2, 0), (2, 0)) + mean((0, 2), (0, 2)) + 2 * mean((2, 0), (0, 2))
    return math.sqrt(max(square, 0.0)), math.sqrt(slope2), math.sqrt(max(laplacian2, 0.0)) / 2


def _products(knots: Array) -> Callable[[int, int], Any]:
    """Integrals (n, m) of products of B-splines of the a-th and of the b-th derivative, for orders a, b."""
    from scipy.interpolate import BSpline
    from scipy.sparse import diags_array

    ends = np.unique(knots)
    at, weight = np.polynomial.legendre.leggauss(DEGREE + 1)
    half = np.diff(ends)[:, None] / 2
    points = (ends[:-1, None] + half * (1 + at)).ravel()
    weights = diags_array((half * weight).ravel())
    inner = [knots[k : len(knots) - k] for k in range(3)]
    values = [BSpline.design_matrix(points, t, DEGREE - k) for k, t in enumerate(inner)]
    return lambda a, b: (values[a].T @ weights @ values[b]).tocsr()
