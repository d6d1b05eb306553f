"""The global maximum of a surface: branch and bound over cells, refined by Newton iteration."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from asperity.arrays import Array

_MAX_CELLS = 4_000_000
_LEVELS = 40
_TIED = 10_000  # cells; so many that do not become fewer hold a ridge, or peaks of one height
_CLIMBS = 100_000  # of them in which an ascent starts
_TO_RIDGE = 2  # Newton steps from such a cell to its highest point
_FEWER = 0.5  # ratio of the cells of two levels that counts as becoming fewer


class SmoothSurface(Protocol):
    """Heights over the patch [0, L]^2 with derivatives and a bound of the curvature, see `base.Surface`."""

    @property
    def L(self) -> float: ...

    @property
    def feature_size(self) -> float: ...

    def curvature_bound(self) -> float: ...

    def height(self, x: ArrayLike, y: ArrayLike) -> Array: ...

    def gradient(self, x: ArrayLike, y: ArrayLike) -> tuple[Array, Array]: ...

    def hessian(self, x: ArrayLike, y: ArrayLike) -> tuple[Array, Array, Array]: ...


def global_maximum(surface: SmoothSurface) -> tuple[float, float, float]:
    """(x, y, z) of the highest point of the closed patch, by branch and bound from square cells."""
    L, K = surface.L, surface.curvature_bound()
    n = int(np.clip(np.ceil(8 * L / surface.feature_size), 64, 1024))
    half: Array = np.full(n * n, L / (2 * n))
    x, y = (c.ravel() for c in np.meshgrid(*2 * [(np.arange(n) + 0.5) * (L / n)]))
    z = surface.height(x, y)
    best = max((climb(surface, cx, cy) for cx in (0.0, L) for cy in (0.0, L)), key=lambda p: p[2])
    return refine(surface, x, y, z, half, half, np.full(n * n, K), _improve(surface, x, y, z, best, 0.0))


def refine(
    surface: SmoothSurface,
    x: Array,
    y: Array,
    z: Array,
    half_x: Array,
    half_y: Array,
    K: Array,
    best: tuple[float, float, float],
) -> tuple[float, float, float]:
    """Higher one of the best point and the highest point of some cells.

    In a cell of half-diagonal r about c no height exceeds z(c) + |grad z(c)| r + K r^2/2, K being a bound of the
    curvature in the cell. Cells that cannot hold a higher point than the best one known are dropped, the others are
    quartered; a Newton ascent starts at each centre above the best known height. A grating has no single summit:
    along its ridges the cells only multiply. An ascent then starts in each cell, or in those of the highest
    centres, and the highest one ends the search.

    Args:
        surface: the height field
        x, y, z: centres of the cells, and the heights there, each (n,) (length)
        half_x, half_y: half their sides (n,) (length)
        K: bounds of the spectral norm of the Hessian in them (n,) (1/length)
        best: highest point known
    """
    before = x.size if x.size > _TIED else np.inf
    for _ in range(_LEVELS):
        slack = 1e-14 * max(abs(best[2]), float(np.abs(z).max(initial=0.0)))
        zx, zy = surface.gradient(x, y)
        r = np.hypot(half_x, half_y)
        bound = z + np.hypot(zx, zy) * r + 0.5 * K * r**2
        keep = np.flatnonzero(bound > best[2] + slack)
        if not keep.size or (0.5 * K * r**2).max() <= slack:
            break
        if keep.size > max(_TIED, _FEWER * before):
            keep = keep[np.argsort(z[keep])[-_CLIMBS:]]  # the centres nearest to a ridge are the highest across it
            tops = climb_all(surface, x[keep], y[keep], float(r.max()), _TO_RIDGE)
            return _improve(surface, *tops, best, slack)
        before = keep.size
        if keep.size > _MAX_CELLS // 4:
            keep = keep[np.argpartition(bound[keep], -_MAX_CELLS // 4)[-_MAX_CELLS // 4 :]]
        half_x, half_y, K = (np.repeat(v[keep], 4) * part for v, part in ((half_x, 0.5), (half_y, 0.5), (K, 1.0)))
        x = np.repeat(x[keep], 4) + half_x * np.tile([-1, 1, -1, 1], keep.size)
        y = np.repeat(y[keep], 4) + half_y * np.tile([-1, -1, 1, 1], keep.size)
        z = surface.height(x, y)
        best = _improve(surface, x, y, z, best, slack)
    return best


def _improve(
    surface: SmoothSurface,
    x: Array,
    y: Array,
    z: Array,
    best: tuple[float, float, float],
    slack: float,
) -> tuple[float, float, float]:
    """Climb from the highest of the given points if it is above the best point; return the better one."""
    top = int(np.argmax(z))
    if z[top] <= best[2] + slack:
        return best
    found = climb(surface, float(x[top]), float(y[top]))
    return found if found[2] > best[2] else best


def climb(surface: SmoothSurface, x: float, y: float) -> tuple[float, float, float]:
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


def climb_all(surface: SmoothSurface, x: Array, y: Array, step: float, rounds: int = 8) -> tuple[Array, Array, Array]:
    """Points near the local maxima of the closed patch that ascents from (x, y) end in, and their heights.

    A few Newton steps of limited length, all points at once; :func:`climb` finds one of them to round-off.

    Args:
        surface: the height field
        x, y: starting points, each (n,) (length)
        step: longest step (length)
        rounds: number of steps
    """
    L = surface.L
    z = surface.height(x, y)
    for _ in range(rounds):
        zx, zy = surface.gradient(x, y)
        fixed_x = ((x <= 0) & (zx < 0)) | ((x >= L) & (zx > 0))
        fixed_y = ((y <= 0) & (zy < 0)) | ((y >= L) & (zy > 0))
        xx, xy, yy = surface.hessian(x, y)
        zx, zy, xy = np.where(fixed_x, 0.0, zx), np.where(fixed_y, 0.0, zy), np.where(fixed_x | fixed_y, 0.0, xy)
        # a Hessian that is not negative definite is shifted until it is
        top = 0.5 * (xx + yy) + np.hypot(0.5 * (xx - yy), xy)
        shift = np.maximum(top + 1e-3 * (np.abs(xx) + np.abs(yy)), 0.0)
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


def _zero_slope(surface: SmoothSurface, p: Array, free: Array) -> Array:
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


def _hessian(surface: SmoothSurface, p: Array, free: Array) -> Array:
    xx, xy, yy = (float(h) for h in surface.hessian(*p))
    return np.array([[xx, xy], [xy, yy]])[np.ix_(free, free)]
