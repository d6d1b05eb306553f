"""The global maximum of a surface: Newton iterations from all nodes of a grid that may be next to it."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from asperity.arrays import Array, Indices

_PER_FEATURE, _FEWEST, _MOST = 8, 64, 4096  # intervals of the grid per feature, at least, and at most
_CLIMBS = 30_000  # nodes, the highest ones, from which Newton's method climbs: more hold a ridge, or equal peaks
_ROWS = 256  # of the grid at once
_ROUNDS = 8  # steps of the ascents of all nodes


class Heights(Protocol):
    """What an ascent needs of a `base.Surface`."""

    @property
    def L(self) -> float: ...

    @property
    def feature_size(self) -> float: ...

    def height(self, x: ArrayLike, y: ArrayLike) -> Array: ...

    def gradient(self, x: ArrayLike, y: ArrayLike) -> tuple[Array, Array]: ...

    def hessian(self, x: ArrayLike, y: ArrayLike) -> tuple[Array, Array, Array]: ...

    def curvature_bound(self) -> float: ...

    def on_product(self, x: Array, y: Array) -> Array: ...


def global_maximum(
    surface: Heights, nodes: tuple[Array, Array] | None = None, K: float | None = None
) -> tuple[float, float, float]:
    """(x, y, z) of the highest point of the closed patch.

    Next to a summit there is a node of a grid of spacing h, at most h/sqrt(2) away and at most K h^2/4 lower. From all
    nodes above that level Newton's method climbs to a summit.

    Args:
        surface: the height field
        nodes: along x and along y, from edge to edge (length); default some on each feature
        K: bound of the curvature (1/length); default that of the surface
    """
    if nodes is None:
        n = int(np.clip(np.ceil(_PER_FEATURE * surface.L / surface.feature_size), _FEWEST, _MOST))
        nodes = (np.linspace(0.0, surface.L, n + 1),) * 2
    x, y = nodes
    h = max(float(np.diff(x).max()), float(np.diff(y).max()))
    margin = 0.25 * (surface.curvature_bound() if K is None else K) * h**2
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
    x, y, heights = climb_all(surface, x[places % x.size], y[places // x.size], h)
    top = int(np.argmax(heights))
    return climb(surface, float(x[top]), float(y[top]))


def climb(surface: Heights, x: float, y: float) -> tuple[float, float, float]:
    """Local maximum (x, y, z) of the closed patch that an ascent from (x, y) ends in.

    Newton iteration projected onto the patch; where the Hessian is not negative definite, a gradient
    step whose length the curvature bound makes safe. Heights determine the position only to the square
    root of the rounding unit; beyond that the slope decides.
    """
    L, K = surface.L, surface.curvature_bound()
    p = np.array([x, y], dtype=float)
    z = float(surface.height(*p))
    for _ in range(200):
        g = np.array(surface.gradient(*p), dtype=float)
        free = ~(((p <= 0) & (g < 0)) | ((p >= L) & (g > 0)))
        if not free.any() or not g[free].any():
            break
        hessian = _hessian(surface, p, free)
        step = np.zeros(2)
        if np.linalg.eigvalsh(hessian).max() < 0:
            step[free] = -np.linalg.solve(hessian, g[free])
        else:
            step[free] = g[free] / K if K > 0 else np.sign(g[free]) * L
        new = np.clip(p + step, 0.0, L)
        z_new = float(surface.height(*new))
        if z_new < z:  # overshoot: the safe step always climbs, except for round-off
            safe = g / K if K > 0 else np.sign(g) * L
            new = np.clip(p + np.where(free, safe, 0.0), 0.0, L)
            z_new = float(surface.height(*new))
            if z_new <= z:
                p = _zero_slope(surface, p, free)
                z = float(surface.height(*p))
                break
        moved = float(np.abs(new - p).max())
        p, z = new, z_new
        if moved <= 1e-15 * L:
            break
    return float(p[0]), float(p[1]), z


def climb_all(surface: Heights, x: Array, y: Array, step: float) -> tuple[Array, Array, Array]:
    """Points near the local maxima of the closed patch that ascents from (x, y) end in, and their heights.

    A few Newton steps of limited length, all points at once; :func:`climb` finds one of them to round-off.

    Args:
        surface: the height field
        x, y: starting points, each (n,) (length)
        step: longest step (length)
    """
    L = surface.L
    z = surface.height(x, y)
    for _ in range(_ROUNDS):
        zx, zy = surface.gradient(x, y)
        fixed_x = ((x <= 0) & (zx < 0)) | ((x >= L) & (zx > 0))
        fixed_y = ((y <= 0) & (zy < 0)) | ((y >= L) & (zy > 0))
        xx, xy, yy = surface.hessian(x, y)
        zx, zy, xy = np.where(fixed_x, 0.0, zx), np.where(fixed_y, 0.0, zy), np.where(fixed_x | fixed_y, 0.0, xy)
        # a Hessian that is not negative definite is shifted until it is
        top = 0.5 * (xx + yy) + np.hypot(0.5 * (xx - yy), xy)
        shift = np.maximum(top + 1e-3 * (np.abs(xx) + np.abs(yy)) + 1e-9 * np.hypot(zx, zy) / step, 0.0)
        xx, yy = xx - shift, yy - shift
        det = np.maximum(xx * yy - xy**2, np.finfo(float).tiny)
        dx, dy = (xy * zy - yy * zx) / det, (xy * zx - xx * zy) / det
        scale = step / np.maximum(np.hypot(dx, dy), step)
        new_x, new_y = np.clip(x + scale * dx, 0.0, L), np.clip(y + scale * dy, 0.0, L)
        new_z = surface.height(new_x, new_y)
        better = new_z > z
        x, y, z = np.where(better, new_x, x), np.where(better, new_y, y), np.where(better, new_z, z)
        if not better.any():
            break
    return x, y, z


def _zero_slope(surface: Heights, p: Array, free: Array) -> Array:
    """Zero of the slope along the free axes next to p, where steps no longer change the height.

    Newton steps continue while each halves the slope and is far shorter than the finest feature, so they cannot end
    at another summit.
    """
    slope = np.where(free, surface.gradient(*p), 0.0)
    for _ in range(10):
        hessian = _hessian(surface, p, free)
        if np.linalg.eigvalsh(hessian).max() >= 0:
            break
        step = np.zeros(2)
        step[free] = -np.linalg.solve(hessian, slope[free])
        new = p + step
        if np.abs(step).max() > 1e-3 * surface.feature_size or new.min() < 0 or new.max() > surface.L:
            break
        new_slope = np.where(free, surface.gradient(*new), 0.0)
        if np.linalg.norm(new_slope) > 0.5 * np.linalg.norm(slope):
            break
        p, slope = new, new_slope
    return p


def _hessian(surface: Heights, p: Array, free: Array) -> Array:
    xx, xy, yy = (float(h) for h in surface.hessian(*p))
    return np.array([[xx, xy], [xy, yy]])[np.ix_(free, free)]
