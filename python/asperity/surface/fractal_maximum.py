"""The highest point of a sum of plane waves: branch and bound that adds shorter waves as the cells get smaller."""

from __future__ import annotations

import numpy as np

from asperity.arrays import Array
from asperity.errors import warn
from asperity.surface.base import Surface, SurfaceWarning
from asperity.surface.maximum import climb
from asperity.surface.plane_waves import BLOCK, DEVIATIONS, Waves

_START = 32  # cells per side at first
_SPLIT = 4  # parts per side of each cell that may hold the summit
_ANGLES = 2**26  # evaluated per level; cells beyond that are dropped, with a warning
_CELLS = 2**17  # divided per level
_TIE = 1e-12  # heights with a smaller relative difference count as equal


def highest_point(
    surface: Surface, waves: Waves, offset: float, indices: int, random: bool
) -> tuple[float, float, float]:
    """(x, y, z) of the highest point of the closed patch.

    The height in a cell of half-diagonal r is bounded by three terms: the quadratic about the centre of the
    waves below an index f, a bound of their third derivative times r^3/6, and a bound of all shorter waves.
    The index f minimises the sum of the last two. Cells that cannot hold a higher point than the best one
    known are dropped, the others are divided, and a Newton ascent starts at the best centre.

    Args:
        surface: the height field offset - sum a cos(theta)
        waves: row by row, the index f rising within each row
        offset: height without the waves (length)
        indices: number of the indices f
        random: whether the phases are random; the bound of their sum is then a statistical one

    Returns:
        Position and height (length)
    """
    L = surface.L
    # rows by index, lengths over L
    a, kx, ky, phi = (w.reshape(-1, indices).T * s for w, s in zip(waves, (1 / L, L, L, 1.0), strict=True))
    third, rest = _bounds(a, np.hypot(kx, ky), random)
    best = max((climb(surface, cx, cy) for cx in (0.0, L) for cy in (0.0, L)), key=lambda p: p[2])
    half = 0.5 / _START
    centres: Array = np.arange(1, 2 * _START, 2) * half
    x, y = np.tile(centres, _START), np.repeat(centres, _START)
    bound: Array = np.full(x.size, np.inf)
    missed = -np.inf
    while x.size:
        r = np.sqrt(2) * half / _SPLIT
        beyond = third * r**3 / 6 + rest
        f = int(beyond.argmin())
        most = min(_CELLS, _ANGLES // max(1, f * a.shape[1]))
        if x.size > most:
            order = np.argpartition(bound, -most)
            missed = max(missed, float(bound[order[:-most]].max()))
            x, y = x[order[-most:]], y[order[-most:]]
        x, y, z, bound = _divide(x, y, half, *(w[:f].ravel() for w in (a, kx, ky, phi)))
        half /= _SPLIT
        bound += beyond[f] + offset / L
        top = np.argsort(z)[-4:]
        heights = surface.height(x[top] * L, y[top] * L)
        start = top[int(heights.argmax())]
        best = max(best, climb(surface, float(x[start] * L), float(y[start] * L)), key=lambda p: p[2])
        slack = _TIE * max(abs(best[2]) / L, float(np.abs(z).max()))
        keep = bound > best[2] / L + slack
        if not keep.any() or beyond[f] <= slack:
            break
        x, y, bound = x[keep], y[keep], bound[keep]
    if missed * L > best[2]:
        warn(
            f"surface: too many summits of similar height: the highest one found, {best[2]:.6g}, may be too low by "
            f"up to {missed * L - best[2]:.2g} (a smaller D or f_max gives fewer).",
            SurfaceWarning,
        )
    return best


def _bounds(a: Array, k: Array, random: bool) -> tuple[Array, Array]:
    """Bounds for f = 0, 1, ...: of the third derivative of the waves below index f, of the sum of the others.

    Args:
        a, k: amplitudes and wave numbers, row per index f (indices, ridges)
        random: whether the bounds may be statistical ones
    """

    def bound(w: Array) -> Array:
        total = np.cumsum(w.sum(axis=1))
        spread = DEVIATIONS * np.sqrt(0.5 * np.cumsum((w**2).sum(axis=1)))
        return np.append(0.0, np.minimum(total, spread) if random else total)

    return bound(a * k**3), bound(a[::-1])[::-1]


def _divide(
    x: Array, y: Array, half: float, a: Array, kx: Array, ky: Array, phi: Array
) -> tuple[Array, Array, Array, Array]:
    """Divide cells; return the centres x, y of the parts, -sum a cos(theta) there, and the bound of its quadratic.

    The parts have the same positions in every cell, so one matrix product turns the waves at the centres of the cells
    into heights, slopes and curvatures at the centres of the parts.
    """
    d = half * ((2 * np.arange(_SPLIT) + 1) / _SPLIT - 1)
    dx, dy = (c.ravel() for c in np.meshgrid(d, d))
    turn = np.exp(1j * (np.multiply.outer(kx, dx) + np.multiply.outer(ky, dy)))
    weights = (-a, -1j * a * kx, -1j * a * ky, a * kx**2, a * kx * ky, a * ky**2)
    turned = np.hstack([w[:, None] * turn for w in weights])
    right = np.vstack([turned.real, -turned.imag])
    values = np.empty((x.size, right.shape[1]))
    step = max(1, BLOCK // max(1, a.size))
    for i in range(0, x.size, step):
        part = slice(i, i + step)
        theta = np.multiply.outer(x[part], kx) + np.multiply.outer(y[part], ky) + phi
        values[part] = np.hstack([np.cos(theta), np.sin(theta)]) @ right
    z, zx, zy, xx, xy, yy = (q.ravel() for q in values.reshape(x.size, len(weights), dx.size).swapaxes(0, 1))
    h = half / _SPLIT
    bend = np.maximum(0.5 * (xx + yy) + np.hypot(0.5 * (xx - yy), xy), 0.0)
    bound = z + (np.abs(zx) + np.abs(zy)) * h + bend * h**2
    return (x[:, None] + dx).ravel(), (y[:, None] + dy).ravel(), z, bound
