"""Branches of periodic orbits with their extremes, stability and events, and dense rows along them.

Events are folds, grazing, period doublings and largest displacements; they are roots along the branch, and become
points. Between two points the orbits follow the cubic through states and tangents. Rows are added until straight lines
between them are accurate, in displacement at fixed frequency and in frequency at fixed displacement.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from scipy.optimize import minimize_scalar

from asperity.arrays import Array, Flags
from asperity.dynamics.orbits import Orbits, Path, Point, hermite, value
from asperity.errors import ConvergenceError
from asperity.runtime.display import short_repr

_RTOL = 7.5e-4  # relative error of a straight line between rows; the error of the cubic adds to it
_MISSED = 2e-4  # that error, over the amplitude
_FLAT = (1e-9, 1e-4)  # relative changes of Omega and of u_max below which the other is not checked
_CHECKS = 4  # largest number of times that points are added between points
_DEPTH = 12  # largest number of halvings of a segment
_NEUTRAL = 1e-4  # largest multipliers this close to 1 do not determine the stability next to the point
_TOP, _CHANGE = "largest u_max", "change of stability"  # points, but not events
_TRIALS = 14  # orbits at which a pair of events between two points is searched
_DIP = 2.5  # psi^2 of the multipliers below which it is

_Test = tuple[str, Callable[[Point], float]]  # event, and the quantity that vanishes there


@dataclass(frozen=True)
class Event:
    """Special orbit on a branch, of the kind "fold", "period doubling" or "grazing" (u_min = -1).

    Attributes:
        branch: index of its branch in the response
        Omega, u_max, u_min, a1: as in `Branch`
    """

    kind: str
    branch: int
    Omega: float
    u_max: float
    u_min: float
    a1: float

    __repr__ = short_repr


@dataclass(frozen=True)
class Branch:
    """Periodic orbits in order along a branch (arrays of shape (points,)).

    Attributes:
        kind: "main", "sub2" (of period 2, from a period doubling) or "detached"
        order: forcing periods per period of the orbit
        Omega: forcing frequency over omega_s
        u_max, u_min: extreme displacements; contact is lost where u_min < -1
        a1: amplitude at the forcing frequency
        stable: linear stability
        radius: largest modulus of a Floquet multiplier
        error: estimated error of the orbit, relative to its amplitude
        det_error: deviation of the monodromy determinant from Liouville's
        valid: False where the law is unphysical (a Taylor law with u_min < -1)
        points: points of the continuation, with their tangents
        end: reason why the branch ends
    """

    kind: str
    order: int
    Omega: Array
    u_max: Array
    u_min: Array
    a1: Array
    stable: Flags
    radius: Array
    error: Array
    det_error: Array
    valid: Flags
    points: tuple[Point, ...]
    end: str

    __repr__ = short_repr

    def __len__(self) -> int:
        return self.Omega.size


@dataclass(frozen=True)
class Solution:
    """One periodic orbit at a given frequency; attributes as in `Branch`, and its states at forcing phase 0.

    Attributes:
        states: u and v at the beginning of each forcing period (order, 2)
    """

    branch: int
    kind: str
    order: int
    Omega: float
    u_max: float
    u_min: float
    a1: float
    stable: bool
    error: float
    states: Array

    __repr__ = short_repr

    @property
    def start(self) -> tuple[float, float]:
        """State (u, v) at forcing phase 0, for `ContactOscillator.simulate`."""
        u, v = self.states[0]
        return float(u), float(v)


def first_harmonic(p: Point) -> float:
    """Amplitude at the forcing frequency."""
    return float(np.hypot(*p.extremes[2:]))


def measure(orbits: Orbits, points: Sequence[Point], kind: str, end: str) -> Branch:
    """Collect the corrected points of a branch."""
    u_max, u_min, a1, omega, radius, error, off = np.array(
        [(*p.extremes[:2], first_harmonic(p), p.parameter, p.radius, p.error, p.det_error) for p in points]
    ).T
    contact = orbits.equation.restoring.contact
    return Branch(
        kind, orbits.order, omega, u_max, u_min, a1, np.array([p.stable for p in points]), radius, error, off,
        np.ones(omega.size, bool) if contact else u_min >= -1.0, tuple(points), end,
    )  # fmt: skip


class Line(NamedTuple):
    """Dense rows along a branch as in `Branch`; phase of u over the force in degrees, 0 to -180 if linear."""

    Omega: Array
    u_max: Array
    u_min: Array
    a1: Array
    phase: Array
    stable: Flags


class _Cubics:
    """Omega, u_max, u_min and the first harmonic along a branch: cubics between its points."""

    def __init__(self, orbits: Orbits, points: Sequence[Point]) -> None:
        cubics = []
        for a, b in pairwise(points):
            w, length = orbits.segment(a, b)[1:]
            count = w.size // 2
            at = [np.append(p.parameter, p.extremes) for p in (a, b)]
            slopes = [
                length / (np.linalg.norm(w * p.pieces(count).tangent) + 1e-300) * np.append(p.t_parameter, p.slopes)
                for p in (a, b)
            ]
            cubics.append(hermite(at[0], at[1] - at[0], *slopes))
        self._cubics = np.array(cubics)

    def at(self, place: Array) -> Array:
        """Omega, u_max, u_min, a1 and phase (5, rows); a place is a point's index plus the fraction of the way on."""
        i = np.minimum(place.astype(int), len(self._cubics) - 1)
        omega, u_max, u_min, c, s = value(np.moveaxis(self._cubics[i], 0, -1), place - i)
        phase = np.degrees((np.arctan2(-s, c) + 1.5 * np.pi) % (2.0 * np.pi) - 1.5 * np.pi)  # so that -180 is no edge
        return np.array([omega, u_max, u_min, np.hypot(c, s), phase])


def dense(orbits: Orbits, branch: Branch, *, checked: bool = True) -> Line:
    """Compute rows along a branch, so close that straight lines between them deviate from the cubic by `_RTOL`.

    The cubics are checked by orbits in the middle of each, unless `checked` is false.
    """
    if len(branch) == 1:
        c, s = branch.points[0].extremes[2:]
        phase = np.degrees((np.arctan2(-s, c) + 1.5 * np.pi) % (2.0 * np.pi) - 1.5 * np.pi)
        return Line(branch.Omega, branch.u_max, branch.u_min, branch.a1, np.array([phase]), branch.stable)
    branch = _checked(orbits, branch) if checked else branch
    cubics = _Cubics(orbits, branch.points)
    places: Array = np.arange(len(branch), dtype=float)
    values = cubics.at(places)
    done: Flags = np.zeros(len(branch) - 1, bool)
    for depth in range(_DEPTH):
        left = np.flatnonzero(~done)
        if not left.size:
            break
        middle = 0.5 * (places[left] + places[left + 1])
        between = cubics.at(middle)
        off = _deviation(values[:, left], values[:, left + 1], between) > _RTOL
        if depth == 0:  # a cubic may cross its chord in the middle
            quarters = cubics.at(0.75 * places[left] + 0.25 * places[left + 1])
            off |= _deviation(values[:, left], values[:, left + 1], quarters) > _RTOL
        done[left[~off]] = True
        done = np.insert(done, left[off], False)
        places = np.insert(places, left[off] + 1, middle[off])
        values = np.insert(values, left[off] + 1, between[:, off], axis=1)
    omega, u_max, u_min, a1, phase = values
    return Line(omega, u_max, u_min, a1, phase, _stability(orbits, branch, places))


def _checked(orbits: Orbits, branch: Branch) -> Branch:
    """Branch with further orbits in the middle of segments whose cubics miss them."""
    points = list(branch.points)
    left = list(range(len(points) - 1))
    for _ in range(_CHECKS):
        new: list[tuple[int, Point]] = []
        for i in left:
            with suppress(ConvergenceError):
                p = orbits.between(points[i], points[i + 1], 0.5)
                if _missed(orbits, points[i], points[i + 1], p):
                    new.append((i, p))
        for shift, (i, p) in enumerate(new):
            points.insert(i + 1 + shift, p)
        left = [j for shift, (i, _) in enumerate(new) for j in (i + shift, i + shift + 1)]
    return branch if len(points) == len(branch) else measure(orbits, points, branch.kind, branch.end)


def _missed(orbits: Orbits, a: Point, b: Point, p: Point) -> bool:
    """Whether the cubic from a to b misses an orbit between them, whose place on it is that of the nearest state."""
    w, _ = orbits.segment(a, b)[1:]
    count = w.size // 2
    chord = w * (b.pieces(count).y - a.pieces(count).y)
    place = float((w * (p.pieces(count).y - a.pieces(count).y)) @ chord) / float(chord @ chord + 1e-300)
    cubic = _Cubics(orbits, (a, b)).at(np.array([np.clip(place, 0.0, 1.0)]))[:, 0]
    off = np.abs(np.array([p.parameter, *p.extremes[:2]]) - cubic[:3])
    return bool(off[0] > _MISSED * p.parameter or max(off[1:]) > _MISSED * p.amplitude)


def _deviation(a: Array, b: Array, middle: Array) -> Array:
    """Relative distance of rows from the line between their neighbours, along u_max and Omega."""
    worst = np.zeros(middle.shape[1])
    for x, y, flat in ((0, 1, _FLAT[0]), (1, 0, _FLAT[1])):
        gap = b[x] - a[x]
        part = np.clip((middle[x] - a[x]) / np.where(gap == 0, np.inf, gap), 0.0, 1.0)
        off = np.abs(a[y] + part * (b[y] - a[y]) - middle[y]) / np.abs(middle[y])
        worst = np.maximum(worst, np.where(np.abs(gap) > flat * np.abs(middle[x]), off, 0.0))
    return worst


def _stability(orbits: Orbits, branch: Branch, places: Array) -> Flags:
    """Stability of the rows: it changes at points only, because special orbits are points."""
    stable = branch.stable[:-1].copy()
    neutral = np.abs(branch.radius - 1.0) < _NEUTRAL
    for i in np.flatnonzero(neutral[:-1] | neutral[1:] | (branch.stable[:-1] != branch.stable[1:])):
        with suppress(ConvergenceError):
            stable[i] = orbits.between(branch.points[i], branch.points[i + 1], 0.5).stable
    segment = np.minimum(places.astype(int), len(branch) - 2)
    at_point = places == np.round(places)
    return np.where(at_point, branch.stable[np.round(places).astype(int)], stable[segment])


def locate_events(orbits: Orbits, path: Path, kind: str, number: int) -> tuple[Branch, list[Event], list[Point]]:
    """Branch of a path, `number` of a response, with its events; and the period doublings."""
    points = _with_pairs(orbits, path.points)
    flip = _flip(orbits)
    tests: list[_Test] = [
        ("fold", lambda p: p.t_parameter),
        ("grazing", lambda p: float(p.extremes[1]) + 1.0),
        flip,
        (_TOP, lambda p: float(p.slopes[0])),
    ]
    found = _located(orbits, points, tests)
    all_points = list(points)
    for shift, (i, _, p) in enumerate(found):
        all_points.insert(i + 1 + shift, p)
    branch = measure(orbits, all_points, kind, path.end)
    events = [
        Event(name, number, p.parameter, float(p.extremes[0]), float(p.extremes[1]), first_harmonic(p))
        for _, name, p in found
        if name not in (_TOP, _CHANGE)
    ]
    return branch, events, [p for _, name, p in found if name == flip[0]]


def doublings(orbits: Orbits, points: Sequence[Point]) -> list[Point]:
    """Period doublings along points, without any other event."""
    return [p for _, _, p in _located(orbits, _with_pairs(orbits, points), [_flip(orbits)])]


def _flip(orbits: Orbits) -> _Test:
    return "period doubling" if orbits.equation.zeta > 0 else _CHANGE, lambda p: p.flip


def _located(orbits: Orbits, points: Sequence[Point], tests: Sequence[_Test]) -> list[tuple[int, str, Point]]:
    """Zeros of the tests in order along a path: the point before, the name, and the zero as a point."""
    found: list[tuple[int, float, str, Point]] = []
    for name, at in tests:
        values = np.array([at(p) for p in points])
        if name == "fold" and len(values) > 1:  # it also vanishes at the ends of a period-2 branch, which are no folds
            values[0], values[-1] = values[0] or values[1], values[-1] or values[-2]
        for i in np.flatnonzero((values[:-1] > 0) != (values[1:] > 0)):
            if name == _TOP and values[i] < 0:  # a minimum of u_max
                continue
            a, b = points[i], points[i + 1]
            try:
                p = orbits.locate(a, b, at, values[i], values[i + 1])
            except ConvergenceError:
                continue
            if p is not a:
                w, _ = orbits.segment(a, p)[1:]
                count = w.size // 2
                gap = float(np.linalg.norm(w * (p.pieces(count).y - a.pieces(count).y)))
                found.append((int(i), gap, name, p))
    found.sort(key=lambda item: item[:2])
    return [(i, name, p) for i, _, name, p in found]


def _with_pairs(orbits: Orbits, path: Sequence[Point]) -> list[Point]:
    """Points with one more inside each pair of folds or of period doublings that lies between two points."""
    points = list(path[:1])
    for a, b in pairwise(path):
        if len(back := orbits.turns(a, b)) == 2:
            with suppress(ConvergenceError):
                points.append(orbits.between(a, b, 0.5 * sum(back)))
        points.append(b)
    if orbits.equation.zeta == 0:
        return points
    new: list[tuple[int, Point]] = []
    for sign in (1.0, -1.0)[: 2 if orbits.order == 1 else 1]:
        new += _dips(orbits, points, sign)
    for shift, (i, p) in enumerate(sorted(new, key=lambda item: item[0])):
        points.insert(i + 1 + shift, p)
    return points


def _dips(orbits: Orbits, points: Sequence[Point], sign: float) -> list[tuple[int, Point]]:
    """Point inside each pair of folds (1) or doublings (-1) narrower than a step, with the number of that before.

    Multipliers near `sign` are sign * rho exp(+-i psi). psi^2 is smooth along the branch, vanishes where they meet on
    the real axis and is negative beyond.
    """

    def passed(p: Point) -> bool:
        return (p.fold if sign > 0 else p.flip) < 0

    square = np.array([p.phase_square(sign) for p in points])
    rise = np.sign(np.diff([p.parameter for p in points]))
    dips = (square[1:-1] < square[:-2]) & (square[1:-1] <= square[2:]) & (square[1:-1] < _DIP) & (rise[1:] == rise[:-1])
    new: list[tuple[int, Point]] = []

    def trial(s: float) -> float:
        left = int(s)
        p = orbits.between(points[left], points[left + 1], s - left)
        if passed(p):
            new.append((left, p))
            raise StopIteration
        return p.phase_square(sign)

    for i in np.flatnonzero(dips) + 1:
        if not any(passed(p) for p in points[i - 1 : i + 2]):
            with suppress(StopIteration, ConvergenceError):
                minimize_scalar(
                    trial, bounds=(i - 1, i + 1), method="bounded", options={"maxiter": _TRIALS, "xatol": 1e-6}
                )
    return new
