"""The global maximum of a surface: Newton iterations from all nodes of a grid that may be next to it."""

from __future__ import annotations

from typing import Any

import numpy as np

from asperity.arrays import Array, Indices

Surface = Any  # `base.Surface`, whose module imports this one
_PER_FEATURE, _FEWEST, _MOST = 8, 64, 4096  # intervals of the grid per feature, at least, and at most
_CLIMBS = 30_000  # nodes, the highest ones, from which Newton's method climbs: more hold a ridge, or equal peaks
_ROWS = 256  # of the grid at once
_ROUNDS = 8, 200  # steps of the ascents of all nodes, and of the highest one


def global_maximum(surface: Surface, nodes: tuple[Array, Array] | None = None) -> tuple[float, float, float]:
    """(x, y, z) of the highest point of the closed patch.

    Next to a summit there is a node of a grid of spacing h, at most h/sqrt(2) away and at most K h^2/4 lower for the
    bound K of the curvature. From all nodes above that level Newton's method climbs to a summit. Heights determine its
    position to the square root of the rounding unit only; beyond that the slope decides.

    Args:
        surface: the height field
        nodes: along x and along y, from edge to edge (length); default some on each feature
    """
    if nodes is None:
        n = int(np.clip(np.ceil(_PER_FEATURE * surface.L / surface.feature_size), _FEWEST, _MOST))
        nodes = (np.linspace(0.0, surface.L, n + 1),) * 2
    x, y = nodes
    h = max(float(np.diff(x).max()), float(np.diff(y).max()))
    margin = 0.25 * surface.curvature_bound() * h**2
    places: Indices = np.empty(0, dtype=np.int64)
    heights: Array = np.empty(0)
    level = -np.inf
    for first in range(0, y.size, _ROWS):
        z = surface.on_product(x, y[first : first + _ROWS]).ravel()
        level = max(level, float(z.max()) - margin)
        high = np.flatnonzero(z >= level)
        places, heights = np.append(places, first * x.size + high), np.append(heights, z[high])
        if heights.size > _CLIMBS:
            kept = np.argpartition(heights, -_CLIMBS)[-_CLIMBS:]
            places, heights = places[kept], heights[kept]
    places = places[heights >= level]
    x, y = x[places % x.size], y[places // x.size]
    for rounds in _ROUNDS:
        x, y, z = _climb(surface, x, y, h, rounds)
        top = slice(int(np.argmax(z)), int(np.argmax(z)) + 1)
        x, y = x[top], y[top]
    slope, best, step = np.inf, (x, y), np.full(1, 1e-3 * surface.feature_size)  # too short for another summit
    while True:
        new_x, new_y, left = _newton_step(surface, x, y, step, 0.0)
        if not left[0] < 0.5 * slope:
            break
        slope, best, x, y = float(left[0]), (x, y), new_x, new_y
    x, y = best
    return float(x[0]), float(y[0]), float(surface.height(x, y)[0])


def _climb(surface: Surface, x: Array, y: Array, longest: float, rounds: int) -> tuple[Array, Array, Array]:
    """Points (n,) that ascents from (x, y) (n,) reach in so many steps, all points at once, and their heights."""
    z: Array = surface.height(x, y)
    step: Array = np.full(x.size, longest)
    for _ in range(rounds):
        new_x, new_y, _ = _newton_step(surface, x, y, step, 1e-3)
        new_z = surface.height(new_x, new_y)
        better = new_z > z
        x, y, z = np.where(better, new_x, x), np.where(better, new_y, y), np.where(better, new_z, z)
        step = np.where(better, step, 0.25 * step)
        if step.max() < 1e-9 * longest or (rounds == _ROUNDS[0] and not better.any()):
            break
    return x, y, z


def _newton_step(surface: Surface, x: Array, y: Array, longest: Array, least: float) -> tuple[Array, Array, Array]:
    """Points (n,) after a step of Newton's method, no longer than `longest`, and the slopes before it.

    A summit counts as a ridge where the smaller curvature is below `least` times the sum of both.
    """
    zx, zy = surface.gradient(x, y)
    fixed_x = ((x <= 0) & (zx < 0)) | ((x >= surface.L) & (zx > 0))
    fixed_y = ((y <= 0) & (zy < 0)) | ((y >= surface.L) & (zy > 0))
    xx, xy, yy = surface.hessian(x, y)
    zx, zy, xy = np.where(fixed_x, 0.0, zx), np.where(fixed_y, 0.0, zy), np.where(fixed_x | fixed_y, 0.0, xy)
    # a Hessian that is not negative definite is shifted until it is
    top = 0.5 * (xx + yy) + np.hypot(0.5 * (xx - yy), xy)
    slope = np.hypot(zx, zy)
    shift = np.maximum(top + least * (np.abs(xx) + np.abs(yy)) + 1e-9 * slope / longest, 0.0)
    xx, yy = xx - shift, yy - shift
    det = np.maximum(xx * yy - xy**2, np.finfo(float).tiny)
    dx, dy = (xy * zy - yy * zx) / det, (xy * zx - xx * zy) / det
    scale = longest / np.maximum(np.hypot(dx, dy), longest)
    return np.clip(x + scale * dx, 0.0, surface.L), np.clip(y + scale * dy, 0.0, surface.L), slope
