"""Branches of periodic orbits: their paths, extremes, stability and events.

Events are folds, grazing, period doublings and largest displacements; they are roots along the branch, and become
points. Orbits are added until straight lines between them are accurate, in displacement at fixed frequency and in
frequency at fixed displacement.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np
from scipy.optimize import minimize_scalar

from asperity.arrays import Array, Flags
from asperity.dynamics.equation import TURN
from asperity.dynamics.orbits import Orbits
from asperity.dynamics.point import PIECES, Path, Point, hermite, root, value
from asperity.errors import ConvergenceError
from asperity.runtime.display import short_repr

_RTOL = 9e-4  # relative error of a straight line between rows
_FLAT = (1e-9, 1e-4)  # relative changes of Omega and of u_max below which the other is not checked
_PLACES = np.array([0.25, 0.5, 0.75])  # of a segment, where it is compared with its chord
_TOP = "largest u_max"  # a point, but no event
_TRIALS = 14  # orbits at which a pair of doublings between two points is searched
_DIP = 2.5  # psi^2 of the multipliers below which it is
_SAME = 1e-3  # relative distance below which two orbits are identical


def _column(of: Callable[[Point], Any], words: str) -> Any:
    def column(branch: Branch) -> Array:
        return np.array([of(p) for p in branch.points])

    column.__doc__ = f"{words}, shape (points,)."
    return cached_property(column)


@dataclass(frozen=True)
class Branch:
    """Periodic orbits in order along a branch.

    Attributes:
        kind: "main", "sub2" (of period 2, from a period doubling) or "detached"
        points: the orbits, with the tangents of the branch
        end: reason why the branch ends
        contact: whether the law loses contact
    """

    kind: str
    points: tuple[Point, ...]
    end: str
    contact: bool = field(default=True, repr=False)

    __repr__ = short_repr

    Omega = _column(lambda p: p.Omega, "Forcing frequencies over omega_s")
    u_max = _column(lambda p: p.u_max, "Largest displacements")
    u_min = _column(lambda p: p.u_min, "Smallest displacements; contact is lost where they are below -1")
    a1 = _column(lambda p: p.a1, "Amplitudes at the forcing frequency")
    phase = _column(lambda p: p.phase, "Phases of u over the force in degrees, 0 to -180 if linear")
    stable = _column(lambda p: p.stable, "Linear stability")
    radius = _column(lambda p: p.radius, "Largest modulus of a Floquet multiplier")
    error = _column(lambda p: p.error, "Estimated errors of the orbits, relative to their amplitude")
    det_error = _column(lambda p: p.det_error, "Deviations of the monodromy determinant from Liouville's")

    @property
    def order(self) -> int:
        """Forcing periods per period of the orbits."""
        return self.points[0].order

    @cached_property
    def valid(self) -> Flags:
        """False where the law is unphysical (a Taylor law with u_min < -1), shape (points,)."""
        return np.asarray(self.contact | (self.u_min >= -1.0))

    def __len__(self) -> int:
        return len(self.points)


@dataclass(frozen=True)
class Solution(Point):
    """One orbit of a response, at a given frequency or a special one.

    Attributes:
        kind: that of its branch, or of an event: "fold", "period doubling" or "grazing" (u_min = -1)
        branch: index of its branch in the response
    """

    kind: str
    branch: int

    @classmethod
    def at(cls, kind: str, branch: int, p: Point) -> Solution:
        """Orbit at a point of a branch."""
        return cls(**vars(p), kind=kind, branch=branch)

    def __repr__(self) -> str:
        return f"Solution({self.kind}, Omega = {self.Omega:.6g}, u_max = {self.u_max:.6g}, stable = {self.stable})"


def dense(orbits: Orbits, points: Sequence[Point], rtol: float = _RTOL) -> tuple[Point, ...]:
    """Points with more orbits between them, so close that straight lines deviate from the cubics by `rtol`."""
    rows, left = list(points[:1]), list(reversed(points[1:]))
    while left:
        a, b = rows[-1], left[-1]
        with suppress(ConvergenceError):
            if _deviation(orbits, a, b) > rtol and a.Omega != b.Omega:
                left.append(orbits.between(a, b, 0.5))
                continue
        rows.append(left.pop())
    return tuple(rows)


def _deviation(orbits: Orbits, a: Point, b: Point) -> float:
    """Relative distance of the cubic from the line between two points, along u_max and Omega."""
    w, length = orbits.segment(a, b)[1:]
    (x, y), slopes = (
        np.array([(p.Omega, p.u_max) for p in (a, b)]).T,
        [length / np.linalg.norm(w * p.tangent) * np.array([p.rate, p.slopes[0]]) for p in (a, b)],
    )
    start, chord = np.array([x[0], y[0]]), np.array([x[1] - x[0], y[1] - y[0]])
    between = value(hermite(start, chord, *slopes)[:, :, None], _PLACES)
    worst = 0.0
    for i, j, flat in ((0, 1, _FLAT[0]), (1, 0, _FLAT[1])):
        if abs(chord[i]) > flat * abs(start[i]):
            part = np.clip((between[i] - start[i]) / chord[i], 0.0, 1.0)
            worst = max(worst, float(np.max(np.abs(start[j] + part * chord[j] - between[j]) / np.abs(between[j]))))
    return worst


def located(orbits: Orbits, path: Sequence[Point]) -> tuple[tuple[Point, ...], list[tuple[str, Point]]]:
    """Path with its events as points, and these with their names: outside the window period doublings alone."""
    points = _with_pairs(orbits, path)
    tests: dict[str, Callable[[Point], float]] = {
        "fold": lambda p: p.rate,
        "grazing": lambda p: p.u_min + 1.0,
        "period doubling": lambda p: p.flip,
        _TOP: lambda p: float(p.slopes[0]),
    }
    found: list[tuple[int, float, str, Point]] = []
    inside = np.array([orbits.is_inside(p.Omega) for p in points])
    for name, at in tests.items():
        values = np.array([at(p) for p in points])
        if name == "fold" and len(values) > 1:  # it also vanishes at the ends of a period-2 branch, which are no folds
            values[0], values[-1] = values[0] or values[1], values[-1] or values[-2]
        changes = (values[:-1] > 0) != (values[1:] > 0)
        for i in np.flatnonzero(changes & ((inside[1:] & inside[:-1]) | (name == "period doubling"))):
            if name == _TOP and values[i] < 0:  # a minimum of u_max
                continue
            a, b = points[i], points[i + 1]
            with suppress(ConvergenceError):
                p = orbits.locate(a, b, at)
                if p is not a:
                    found.append((int(i), orbits.segment(a, p)[2], name, p))
    found.sort(key=lambda item: item[:2])
    for shift, (i, _, _, p) in enumerate(found):
        points.insert(i + 1 + shift, p)
    return tuple(points), [(name, p) for _, _, name, p in found if name != _TOP]


def _with_pairs(orbits: Orbits, path: Sequence[Point]) -> list[Point]:
    """Points with one more inside each pair of folds or of period doublings that lies between two points."""
    points = list(path[:1])
    for a, b in pairwise(path):
        if len(back := orbits.turns(a, b)) == 2:
            with suppress(ConvergenceError):
                points.append(orbits.between(a, b, 0.5 * sum(back)))
        points.append(b)
    if points[0].order > 1:
        return points
    # psi^2 of multipliers -rho exp(+-i psi) is smooth along the branch, and negative between two doublings
    square = np.array([p.phase_square(-1.0) for p in points])
    new: list[tuple[int, Point]] = []

    def trial(s: float) -> float:
        left = int(s)
        p = orbits.between(points[left], points[left + 1], s - left)
        if p.flip < 0:
            new.append((left, p))
            raise StopIteration
        return p.phase_square(-1.0)

    dips = (square[1:-1] < square[:-2]) & (square[1:-1] <= square[2:]) & (square[1:-1] < _DIP)
    for i in np.flatnonzero(dips) + 1:
        if min(p.flip for p in points[i - 1 : i + 2]) >= 0:
            with suppress(StopIteration, ConvergenceError):
                ends = (i - 1, i + 1)
                minimize_scalar(trial, bounds=ends, method="bounded", options={"maxiter": _TRIALS, "xatol": 1e-6})
    for shift, (i, p) in enumerate(new):
        points.insert(i + 1 + shift, p)
    return points


def doubled(orbits: Orbits, flip: Point) -> Point:
    """Period doubling as the first point of the branch of twice the period."""
    m = orbits.map(flip.y[:-1].reshape(-1, 2), flip.Omega, TURN / PIECES * np.arange(PIECES))
    monodromy = np.linalg.multi_dot(m.by_end[::-1, :, :2])
    directions = [np.linalg.svd(monodromy + np.eye(2))[2][-1]]
    for piece in m.by_end[:-1, :, :2]:
        directions.append(piece @ directions[-1])
    y, t = np.concatenate([flip.y[:-1], flip.y]), np.concatenate([*directions, *(-d for d in directions), [0.0]])
    t = t / np.linalg.norm(orbits.scales(flip.amplitude, y) * t)
    top, low = int(m.high[:, 0].argmax()), int(m.low[:, 0].argmin())
    rise = abs(m.high[top, 1:3] @ t[2 * top : 2 * top + 2])
    fall = abs(m.low[low, 1:3] @ t[2 * low : 2 * low + 2])
    return replace(
        flip, y=y, tangent=t, slopes=np.array([rise, -fall, 0.0, 0.0]),
        trace=flip.trace**2 - 2.0 * flip.determinant, determinant=flip.determinant**2,
    )  # fmt: skip


def subharmonic(orbits: Orbits, flip: Point, known: Sequence[Path]) -> Path:
    """Trace the branch of twice the period from a period doubling until it leaves the window or ends at another one."""
    edges = _at_edges(orbits, known)

    def stop(points: list[Point]) -> str | None:
        return _doubling(orbits, points) or ("window" if any(is_same(q, points[-1]) for q in edges) else None)

    return orbits.trace(doubled(orbits, flip), stop)


def _doubling(orbits: Orbits, points: list[Point]) -> str | None:
    """Replace the last point of a branch of twice the period by the period doubling that its last step passes."""
    a, b = points[-2:]
    odd_a = _odd(a)

    def side(p: Point) -> float:
        return float(_odd(p) @ odd_a)

    if len(points) < 3 or side(b) > 0:
        return None
    points.pop()  # it repeats an orbit of the branch, shifted by half of its period
    cubic, w, _ = orbits.segment(a, b)
    at = root(lambda s: side(replace(a, y=value(cubic, s))), side(a), side(b))
    end = replace(a, y=value(cubic, at), tangent=-odd_a / np.linalg.norm(w * odd_a))
    points.append(replace(end, y=end.y - _odd(end)))
    return "period doubling"


def _odd(p: Point) -> Array:
    """Half of the difference of the two forcing periods of an orbit, 0 for Omega."""
    return 0.5 * (p.y - _shifted(p, 1).y)


def _shifted(p: Point, periods: int) -> Point:
    """The same orbit, seen from a later forcing period."""
    y, t = (np.append(np.roll(x[:-1], 2 * PIECES * periods), x[-1]) for x in (p.y, p.tangent))
    return replace(p, y=y, tangent=t)


def _at_edges(orbits: Orbits, known: Sequence[Path]) -> list[Point]:
    """Orbits of known paths on an edge of the window, from which these lead on."""
    ends = {*orbits.window, *orbits.limits}
    return [q for path in known for q in path.points if q.Omega in ends]


def through(orbits: Orbits, first: Point, known: Sequence[Path]) -> Path | None:
    """Trace the branch through an orbit in both directions, unless one of the known paths contains it.

    The result is None then, and where the true period of the orbit is shorter.
    """
    if first.order > 1 and np.abs(_odd(first))[::2].max() < 1e-3 * first.amplitude:
        return None
    if any(is_same(q, first) for path in known for q in orbits.crossings(path.points, first.Omega)):
        return None
    copies = [_shifted(first, k) for k in range(first.order)]  # the same orbit, seen from each forcing period
    edges = _at_edges(orbits, known)

    def closed(points: list[Point]) -> str | None:
        if first.order > 1 and (doubling := _doubling(orbits, points)):
            return doubling
        if any(is_same(q, points[-1]) for q in edges):
            return "window"
        if len(points) < 6:
            return None
        a, b = points[-2:]
        w = orbits.scales(a.amplitude, a.y)
        chord = w * (b.y - a.y)
        for copy in copies:
            to = w * (copy.y - a.y)
            s = float(to @ chord) / float(chord @ chord)
            if 0 <= s <= 1 and np.linalg.norm(to - s * chord) < 0.1 * np.linalg.norm(chord):
                points[-1] = copy
                return "closed"
        return None

    forward = orbits.trace(first, closed)
    if forward.end == "closed":  # begin at an end of the window, so that no piece begins inside
        points = forward.points
        edge = next((i for i, p in enumerate(points) if p.Omega in orbits.window), None)
        if edge is None:
            return Path(points, "closed", "closed")
        shift = next(k for k, copy in enumerate(copies) if copy is points[-1])
        return Path((*points[edge:], *(_shifted(p, shift) for p in points[1 : edge + 1])), "window", "window")
    backward = orbits.trace(first.turned(), closed)
    turned = tuple(p.turned() for p in reversed(backward.points[1:]))
    return Path(turned + forward.points, forward.end, backward.end)


def is_same(a: Point, b: Point) -> bool:
    """Whether two points are one orbit, seen from whichever forcing period."""
    close = max(_SAME, 10.0 * max(a.error, b.error)) * max(a.amplitude, 1e-300)
    return abs(a.Omega - b.Omega) <= 1e-9 and distance(a, b) < close


def distance(a: Point, b: Point) -> float:
    """Greatest difference of the states of two orbits, up to a shift by whole forcing periods."""
    if a.order != b.order:
        return np.inf
    return min(float(np.abs(a.states - np.roll(b.states, k, axis=0)).max()) for k in range(a.order))
