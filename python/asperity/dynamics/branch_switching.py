"""Branch switching: branches of twice the period and detached loops, each traced once."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace

import numpy as np

from asperity.arrays import Array
from asperity.dynamics.continuation import Equations, Path, Point, Tracing, crossings, in_omega, locate, start, trace
from asperity.dynamics.harmonic_balance import Balance, resize, tail
from asperity.dynamics.stability import stack, unstack
from asperity.errors import ConvergenceError

_SAME = 1e-3  # relative distance below which two orbits are identical


def subharmonic(
    balance: Balance, forcing: float, flip: Point, how: Tracing, others: Sequence[Point], known: Sequence[Path]
) -> tuple[Path | None, Point | None]:
    """Trace the branch of twice the period from a period doubling until it leaves the window or ends at another one.

    The balance has the order of the branch that doubles its period, `others` are its other period doublings.

    Returns:
        The path, None if it has fewer than 3 points; and that of the others at which it ends
    """
    double = replace(balance, order=2 * balance.order)
    equations = in_omega(double, forcing)
    count = flip.x.size // 2
    x = _doubled(flip.x)
    k = np.concatenate([[0], np.arange(1, 2 * count + 1), np.arange(1, 2 * count + 1)])
    odd = np.flatnonzero(k % 2)
    jacobian = equations(x, flip.parameter)[1][np.ix_(odd, odd)]
    null = np.zeros(x.size)
    null[odd] = np.linalg.svd(jacobian)[2][-1]

    first = Point(x, flip.parameter, null, 0.0, tail(x))
    path = trace(equations, first, how, lambda p: _doubling(equations, p) or _met(p[-1], known, double.order))
    if len(path.points) < 3:
        return None, None
    if path.end != "period doubling" or not others:
        return path, None
    end, before = path.points[-1], path.points[-2]
    ends = [Point(_doubled(p.x), p.parameter, resize(end.t, p.x.size - 1), 0.0, p.error) for p in others]
    gaps = [_gap(p, end) for p in ends]
    i = int(np.argmin(gaps))
    if gaps[i] > _gap(before, end):  # it ends outside the window
        return path, None
    return replace(path, points=(*path.points[:-1], ends[i])), others[i]


def _doubling(equations: Equations, points: list[Point]) -> str | None:
    """Replace the last point of a branch of twice the period by the period doubling that its last step passes."""
    a, b = points[-2], points[-1]
    m = min(a.x.size, b.x.size) // 2
    odd_a = _odd(resize(a.x, m))

    def side(p: Point) -> float:
        return float(_odd(resize(p.x, m)) @ odd_a)

    if len(points) < 3 or side(b) > 0:
        return None
    points.pop()  # it repeats an orbit of the branch, shifted by half of its period
    with suppress(ConvergenceError):
        points.append(_single(locate(equations, a, b, side, side(a), side(b)), odd_a))
    return "period doubling"


def _doubled(x: Array) -> Array:
    """Orbit as one of twice the order."""
    count = x.size // 2
    out = np.zeros(4 * count + 1)
    out[0] = x[0]
    out[2 : 2 * count + 1 : 2] = x[1 : count + 1]
    out[2 * count + 2 :: 2] = x[count + 1 :]
    return out


def _gap(a: Point, b: Point) -> float:
    count = max(a.x.size, b.x.size) // 2
    return float(np.linalg.norm(resize(a.x, count) - resize(b.x, count))) + abs(a.parameter - b.parameter)


def _odd(x: Array) -> Array:
    """Odd harmonics of an orbit, which one of half the order lacks; the others are 0."""
    out = x.copy()
    m = x.size // 2
    out[0] = out[2 : m + 1 : 2] = out[m + 2 :: 2] = 0.0
    return out


def _single(p: Point, odd: Array) -> Point:
    """Orbit of half the order at the end of a branch, whose tangent there is -odd."""
    odd = resize(odd, p.x.size // 2)
    return Point(p.x - _odd(p.x), p.parameter, -odd / np.linalg.norm(odd), 0.0, p.error)


def through(
    balance: Balance, forcing: float, x: Array, omega: float, how: Tracing, known: Sequence[Path]
) -> Path | None:
    """Trace the branch through an orbit x (2 K + 1) in both directions, unless one of the known paths contains it.

    The result is None if its true period is shorter. A `ConvergenceError` says that there is no orbit near.
    """
    equations, order = in_omega(balance, forcing), balance.order
    first = start(equations, x, omega, -1.0, how)
    c = stack([first.x])[0]
    if order > 1 and np.abs(np.delete(c, slice(None, None, order))).max() < 1e-3 * np.abs(c).max():
        return None  # its true period is shorter
    if any(is_same(q, first, order) for path in known for q in crossings(equations, path.points, omega)):
        return None
    copies = [
        replace(first, x=unstack(a, a.size - 1), t=unstack(b, b.size - 1))
        for a, b in zip(shifts(c, order), shifts(stack([first.t])[0], order), strict=True)
    ]

    def closed(points: list[Point]) -> str | None:
        if order == 2 and (doubling := _doubling(equations, points)):
            return doubling
        if met := _met(points[-1], known, order):
            return met
        if len(points) < 6:
            return None
        a, b = points[-2], points[-1]
        m = first.x.size // 2
        chord = np.append(b.resized(m).x - a.resized(m).x, b.parameter - a.parameter)
        for f in copies:
            to = np.append(f.x - a.resized(m).x, f.parameter - a.parameter)
            s = float(to @ chord) / float(chord @ chord)
            if 0 <= s <= 1 and np.linalg.norm(to - s * chord) < 0.1 * np.linalg.norm(chord):
                points[-1] = f
                return "closed"
        return None

    forward = trace(equations, first, how, closed)
    if forward.end == "closed":
        edge = next((p for p in forward.points if p.parameter in how.window), None)
        if edge is None or first.parameter in how.window:
            return replace(forward, begin="closed")
        return through(balance, forcing, edge.x, edge.parameter, how, ())  # so that no piece begins in the window
    backward = trace(equations, first.turned(), how, closed)
    turned = tuple(p.turned() for p in reversed(backward.points[1:]))
    return Path(turned + forward.points, forward.end, backward.end)


def _met(point: Point, known: Sequence[Path], order: int) -> str | None:
    """Reason to end a path at an orbit on an edge of the window that a known path has, which leads on from there."""
    same = (q for path in known for q in path.points if q.parameter == point.parameter)
    return "known" if any(is_same(q, point, order) for q in same) else None


def is_same(a: Point, b: Point, order: int) -> bool:
    """Whether two points are one orbit, up to a shift by whole forcing periods."""
    if abs(a.parameter - b.parameter) > 1e-9:
        return False
    gap = distance(stack([a.x])[0], stack([b.x])[0], order)
    return gap < max(_SAME, 10.0 * max(a.error, b.error))


def distance(a: Array, b: Array, order: int) -> float:
    """Relative distance of two orbits of complex coefficients, up to a shift by whole forcing periods."""
    count = min(a.size, b.size)
    return float(np.abs(a[:count] - shifts(b[:count], order)).max(axis=1).min() / np.abs(b).max())


def shifts(c: Array, order: int) -> Array:
    """Complex coefficients (order, K + 1) of an orbit and of its copies shifted by forcing periods."""
    return c * np.exp(2j * np.pi / order * np.outer(np.arange(order), np.arange(c.size)))
