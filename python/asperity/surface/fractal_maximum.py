"""The highest point of a sum of plane waves: branch and bound that meets ever shorter waves in ever smaller cells."""

from __future__ import annotations

import warnings
from typing import TYPE_CHECKING

import numpy as np

from asperity.surface.base import Array, SurfaceWarning
from asperity.surface.maximum import climb

if TYPE_CHECKING:
    from asperity.surface.fractal import WeierstrassMandelbrot

_START = 32  # cells a side at first
_SPLIT = 4  # parts a side of each cell that may hold the summit
_LEVELS = 40
_SURE = 10.0  # standard deviations: waves of random phases pass them with a probability below exp(-50) (Chernoff)
_ANGLES = 2**26  # evaluated a level: what more cells would need is left out, with a warning
_CELLS = 2**17  # divided a level
_CHUNK = 2**20  # of them at once
_TIE = 1e-12  # heights closer than this, relatively, are one


def highest_point(surface: WeierstrassMandelbrot) -> tuple[float, float, float]:
    """Return (x, y, z) of the highest point of the closed patch.

    In a cell of half-diagonal r no height exceeds that of the waves up to an index f by the quadratic
    about its centre, plus a bound of their third derivative times r^3/6, plus a bound of all shorter waves;
    f makes the sum of the two least. Cells that cannot hold a higher point than the best one known are
    dropped, the others are divided, and a Newton climb starts at the best centre.
    """
    L = surface.L
    shape = (-1, surface.f_max + 1)  # type: ignore[operator]
    # rows by index, lengths over L
    a, kx, ky, phi = (w.reshape(shape).T * s for w, s in zip(surface._waves, (1 / L, L, L, 1.0), strict=True))
    third, rest = _bounds(surface, a, np.hypot(kx, ky))
    best = max((climb(surface, cx, cy) for cx in (0.0, L) for cy in (0.0, L)), key=lambda p: p[2])
    half = 0.5 / _START
    centres: Array = np.arange(1, 2 * _START, 2) * half
    x, y = np.tile(centres, _START), np.repeat(centres, _START)
    reach: Array = np.full(x.size, np.inf)
    missed = -np.inf
    for _ in range(_LEVELS):
        r = np.sqrt(2) * half / _SPLIT
        beyond = third * r**3 / 6 + rest
        f = int(beyond.argmin())
        most = min(_CELLS, _ANGLES // max(1, f * a.shape[1]))
        if x.size > most:
            order = np.argpartition(reach, -most)
            missed = max(missed, float(reach[order[:-most]].max()))
            x, y = x[order[-most:]], y[order[-most:]]
        x, y, z, reach = _divided(x, y, half, *(w[:f].ravel() for w in (a, kx, ky, phi)))
        half /= _SPLIT
        reach += beyond[f] + surface._offset / L
        top = np.argsort(z)[-4:]
        heights = surface.height(x[top] * L, y[top] * L)
        start = top[int(heights.argmax())]
        best = max(best, climb(surface, float(x[start] * L), float(y[start] * L)), key=lambda p: p[2])
        slack = _TIE * max(abs(best[2]) / L, float(np.abs(z).max()))
        keep = reach > best[2] / L + slack
        if not keep.any() or beyond[f] <= slack:
            break
        x, y, reach = x[keep], y[keep], reach[keep]
    if missed * L > best[2]:
        warnings.warn(
            f"surface: too many summits compete: the highest point, at {best[2]:.6g}, may be low by up to "
            f"{missed * L - best[2]:.2g} (a smaller D or f_max has fewer).",
            SurfaceWarning,
            stacklevel=2,
        )
    return best


def _bounds(surface: WeierstrassMandelbrot, a: Array, k: Array) -> tuple[Array, Array]:
    """Return bounds for f = 0, 1, ...: of the third derivative of the waves below index f, of the sum of the others."""

    def bound(w: Array) -> Array:
        total = np.cumsum(w.sum(axis=1))
        spread = _SURE * np.sqrt(0.5 * np.cumsum((w**2).sum(axis=1)))
        return np.append(0.0, np.minimum(total, spread) if surface.random else total)

    return bound(a * k**3), bound(a[::-1])[::-1]


def _divided(
    x: Array, y: Array, half: float, a: Array, kx: Array, ky: Array, phi: Array
) -> tuple[Array, Array, Array, Array]:
    """Return the centres of the parts of cells, and there -sum a cos(theta) and the most that its quadratic reaches.

    Centres of parts lie alike in each cell, so that one matrix product turns the waves in the centres of cells into
    heights, slopes and curvatures in those of their parts.
    """
    d = half * ((2 * np.arange(_SPLIT) + 1) / _SPLIT - 1)
    dx, dy = (c.ravel() for c in np.meshgrid(d, d))
    turn = np.exp(1j * (np.multiply.outer(kx, dx) + np.multiply.outer(ky, dy)))
    weights = (-a, -1j * a * kx, -1j * a * ky, a * kx**2, a * kx * ky, a * ky**2)
    turned = np.hstack([w[:, None] * turn for w in weights])
    right = np.vstack([turned.real, -turned.imag])
    values = np.empty((x.size, right.shape[1]))
    step = max(1, _CHUNK // max(1, a.size))
    for i in range(0, x.size, step):
        part = slice(i, i + step)
        theta = np.multiply.outer(x[part], kx) + np.multiply.outer(y[part], ky) + phi
        values[part] = np.hstack([np.cos(theta), np.sin(theta)]) @ right
    z, zx, zy, xx, xy, yy = (q.ravel() for q in values.reshape(x.size, len(weights), dx.size).swapaxes(0, 1))
    h = half / _SPLIT
    bend = np.maximum(0.5 * (xx + yy) + np.hypot(0.5 * (xx - yy), xy), 0.0)
    reach = z + (np.abs(zx) + np.abs(zy)) * h + bend * h**2
    return (x[:, None] + dx).ravel(), (y[:, None] + dy).ravel(), z, reach
