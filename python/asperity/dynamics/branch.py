"""Branches of periodic orbits with their extremes, stability and events, and dense rows along them.

Events are folds, grazing, period doublings and largest displacements; they are located, and become points. Between two
points the orbits follow the cubic through coefficients and tangents, the predictor of the continuation. Rows are added
until straight lines between them are accurate, in displacement at fixed frequency and in frequency at fixed
displacement. They are closer near folds and at the top of a resonance.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from scipy.optimize import minimize_scalar

from asperity.arrays import Array, Flags
from asperity.dynamics.continuation import (
    Equations,
    Path,
    Point,
    adapt,
    between,
    in_omega,
    locate,
    newton_rtol,
    turns,
)
from asperity.dynamics.cubic import hermite, value
from asperity.dynamics.harmonic_balance import Balance, resize, stack
from asperity.dynamics.stability import NEGLIGIBLE, Floquet, extrema, floquet, rise, state_at_phase_zero
from asperity.errors import ConvergenceError
from asperity.runtime.display import short_repr

_ROUND_OFF = 1e-15  # relative round-off of the contact force
_RTOL = 3e-4  # relative error of a straight line between rows; the error of the cubic adds to it
_FLAT = (1e-9, 1e-4)  # relative changes of Omega and of u_max below which the other is not checked
_DEPTH = 12  # largest number of halvings of a segment
_NEUTRAL = 1e-4  # largest multipliers this close to 1 do not determine the stability next to the point
_TOP, _CHANGE = "largest u_max", "change of stability"  # points, but not events
_TRIALS = 14  # orbits at which a period-doubling tongue between two points is searched


_Test = tuple[str, Array, Callable[[Point], float]]  # event, quantity that vanishes there at points, and anywhere


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
        error: estimate of the truncation error, or of the round-off error if larger, relative to the amplitude
        det_error: deviation of the monodromy determinant from Liouville's; 1 where the stability is unreliable
        coefficients: complex Fourier coefficients (points, K + 1) in the angle Omega tau / order
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
    stable: Array
    radius: Array
    error: Array
    det_error: Array
    coefficients: Array
    valid: Array
    points: tuple[Point, ...]
    end: str

    __repr__ = short_repr

    def __len__(self) -> int:
        return self.Omega.size


@dataclass(frozen=True)
class Solution:
    """One periodic orbit at a given frequency; attributes as in `Branch`."""

    branch: int
    kind: str
    order: int
    Omega: float
    u_max: float
    u_min: float
    a1: float
    stable: bool
    error: float
    coefficients: Array

    __repr__ = short_repr

    @property
    def start(self) -> tuple[float, float]:
        """State (u, v) at forcing phase 0, for `ContactOscillator.simulate`."""
        return state_at_phase_zero(self.coefficients, self.Omega, self.order)


def measure(balance: Balance, points: Sequence[Point], kind: str, end: str, f: Floquet) -> Branch:
    """Compute extremes and errors of the corrected points of a branch, with their Floquet data."""
    c = stack([p.x for p in points])
    omega = np.array([p.parameter for p in points])
    u_min, u_max = extrema(c)
    round_off = _ROUND_OFF / (balance.restoring.n_loc * 0.5 * (u_max - u_min))
    valid = np.ones(omega.size, bool) if balance.restoring.contact else u_min >= -1.0
    return Branch(
        kind, balance.order, omega, u_max, u_min, np.abs(c[:, balance.order]), f.stable, f.radius,
        np.maximum([p.error for p in points], round_off), f.error, c, valid, tuple(points), end,
    )  # fmt: skip


class Line(NamedTuple):
    """Dense rows along a branch as in `Branch`; phase of u over the force in degrees, 0 to -180 if linear."""

    Omega: Array
    u_max: Array
    u_min: Array
    a1: Array
    phase: Array
    stable: Flags


def on_cubic(branch: Branch, place: Array) -> tuple[Array, Array]:
    """Omega (rows,) and complex coefficients (rows, K + 1) of the cubics at places along a branch.

    A place is the index of the point before it plus the fraction of the way to the next point.
    """
    i = np.minimum(place.astype(int), len(branch) - 2)
    y = np.column_stack([branch.Omega, branch.coefficients])
    t = np.column_stack([[p.t_parameter for p in branch.points], stack([p.t for p in branch.points])])
    chord = y[i + 1] - y[i]
    length = np.linalg.norm(chord, axis=1)[:, None]
    found = value(hermite(y[i], chord, length * t[i], length * t[i + 1]), (place - i)[:, None])
    return found[:, 0].real, found[:, 1:]


def dense(balance: Balance, branch: Branch) -> Line:
    """Compute rows along a branch, so close that straight lines between them deviate from the cubic by `_RTOL`."""
    places: Array = np.arange(len(branch), dtype=float)
    values = _measured(branch, places)
    done: Flags = np.zeros(len(branch) - 1, bool)
    for depth in range(_DEPTH):
        left = np.flatnonzero(~done)
        if not left.size:
            break
        middle = 0.5 * (places[left] + places[left + 1])
        between = _measured(branch, middle)
        # a cubic may cross its chord in the middle: the first halves are always kept
        off = (_deviation(values[:, left], values[:, left + 1], between) > _RTOL) | (depth == 0)
        done[left[~off]] = True
        done = np.insert(done, left[off], False)
        places = np.insert(places, left[off] + 1, middle[off])
        values = np.insert(values, left[off] + 1, between[:, off], axis=1)
    omega, u_max, u_min, a1, phase = values
    return Line(omega, u_max, u_min, a1, phase, _stability(balance, branch, places))


def _measured(branch: Branch, places: Array) -> Array:
    """Omega, u_max, u_min, a1 and phase (5, rows) of the cubics at the places."""
    omega, c = on_cubic(branch, places)
    (u_min, u_max), first = extrema(c), c[:, branch.order]
    phase = np.degrees((np.angle(first) + 1.5 * np.pi) % (2.0 * np.pi) - 1.5 * np.pi)  # so that -180 is no edge
    return np.array([omega, u_max, u_min, np.abs(first), phase])


def _deviation(a: Array, b: Array, middle: Array) -> Array:
    """Relative distance of rows from the line between their neighbours, along u_max and Omega."""
    worst = np.zeros(middle.shape[1])
    for x, y, flat in ((0, 1, _FLAT[0]), (1, 0, _FLAT[1])):
        gap = b[x] - a[x]
        part = np.clip((middle[x] - a[x]) / np.where(gap == 0, np.inf, gap), 0.0, 1.0)
        off = np.abs(a[y] + part * (b[y] - a[y]) - middle[y]) / np.abs(middle[y])
        worst = np.maximum(worst, np.where(np.abs(gap) > flat * np.abs(middle[x]), off, 0.0))
    return worst


def _stability(balance: Balance, branch: Branch, places: Array) -> Flags:
    """Stability of the rows: it changes at points only, because special orbits are points."""
    if len(branch) == 1:
        return branch.stable
    neutral = np.abs(branch.radius - 1.0) < _NEUTRAL
    stable = branch.stable[:-1].copy()
    unclear = np.flatnonzero(neutral[:-1] | neutral[1:] | (branch.stable[:-1] != branch.stable[1:]))
    equations = replace(balance, order=branch.order)
    if unclear.size:
        omega, c = on_cubic(branch, unclear + 0.5)
        stable[unclear] = floquet(equations, c, omega).stable
    segment = np.minimum(places.astype(int), len(branch) - 2)
    at_point = places == np.round(places)
    return np.where(at_point, branch.stable[np.round(places).astype(int)], stable[segment])


def locate_events(
    balance: Balance, forcing: float, path: Path, kind: str, number: int, tol: float
) -> tuple[Branch, list[Event], list[Point]]:
    """Branch of a path, `number` of a response, with its events; and the period doublings."""
    equations = in_omega(balance, forcing)
    points, multipliers = _with_tongues(balance, equations, _between_folds(equations, path.points))
    found = _located(balance, equations, points, _tests(balance, points, multipliers), tol)
    points, multipliers = _inserted(balance, points, multipliers, [(i, p) for i, _, p in found])
    b = measure(balance, points, kind, path.end, multipliers)
    events = [
        Event(name, number, *(float(column[i + 1 + shift]) for column in (b.Omega, b.u_max, b.u_min, b.a1)))
        for shift, (i, name, _) in enumerate(found)
        if name not in (_TOP, _CHANGE)
    ]
    return b, events, [p for _, name, p in found if name == "period doubling"]


def doublings(balance: Balance, forcing: float, points: Sequence[Point], tol: float) -> list[Point]:
    """Period doublings along points, without any other event."""
    equations = in_omega(balance, forcing)
    points, multipliers = _with_tongues(balance, equations, list(points))
    return [p for _, _, p in _located(balance, equations, points, [_flip(balance, multipliers)], tol)]


def _with_tongues(balance: Balance, equations: Equations, points: list[Point]) -> tuple[list[Point], Floquet]:
    """Points with one more inside each narrow period-doubling tongue, and their multipliers."""
    multipliers = _multipliers(balance, points)
    if balance.zeta > 0 and balance.order == 1:
        tongues = _tongues(balance, equations, points, multipliers)
        return _inserted(balance, points, multipliers, tongues)
    return points, multipliers


def _inserted(
    balance: Balance, points: list[Point], multipliers: Floquet, new: list[tuple[int, Point]]
) -> tuple[list[Point], Floquet]:
    """Insert points behind the given ones, in order along a path."""
    if not new:
        return points, multipliers
    points = list(points)
    for shift, (i, p) in enumerate(new):
        points.insert(i + 1 + shift, p)
    return points, multipliers.insert([i + 1 for i, _ in new], _multipliers(balance, [p for _, p in new]))


def _tests(balance: Balance, points: list[Point], multipliers: Floquet) -> list[_Test]:
    """Quantities whose zeros are events, or the maxima of u_max."""
    u_min, _ = extrema(stack([p.x for p in points]))
    fold = np.array([p.t_parameter for p in points])
    if len(points) > 1:  # it also vanishes at the ends of a period-2 branch, which are not folds
        fold[0], fold[-1] = fold[0] or fold[1], fold[-1] or fold[-2]

    def top(some: list[Point]) -> Array:
        return rise(stack([p.x for p in some]), stack([p.t for p in some]))

    return [
        ("fold", fold, lambda p: p.t_parameter),
        ("grazing", u_min + 1.0, lambda p: float(extrema(stack([p.x]))[0][0]) + 1.0),
        _flip(balance, multipliers),
        (_TOP, top(points), lambda p: float(top([p])[0])),
    ]


def _flip(balance: Balance, multipliers: Floquet) -> _Test:
    name = "period doubling" if balance.zeta > 0 else _CHANGE
    return name, multipliers.flip, lambda p: float(_multipliers(balance, [p]).flip[0])


def _located(
    balance: Balance, equations: Equations, points: list[Point], tests: list[_Test], tol: float
) -> list[tuple[int, str, Point]]:
    """Zeros of the tests in order along a path: the point before, the name, and the zero as a point."""
    rtol = newton_rtol(tol, not balance.restoring.singular)
    found: list[tuple[int, float, str, Point]] = []
    for name, values, at in tests:
        for i in np.flatnonzero((values[:-1] > 0) != (values[1:] > 0)):
            if name == _TOP and values[i] < 0:  # a minimum of u_max
                continue
            a, b = points[i], points[i + 1]
            try:
                p = locate(equations, a, b, at, values[i], values[i + 1], rtol=rtol)
                p = adapt(equations, p, p.t, p.t_parameter, tol, p.x.size // 2)
            except ConvergenceError:
                continue
            gap = np.linalg.norm(p.x - resize(a.x, p.x.size // 2)) + abs(p.parameter - a.parameter)
            found.append((int(i), float(gap), name, p))
    found.sort(key=lambda item: item[:2])
    return [(i, name, p) for i, _, name, p in found]


def _between_folds(equations: Equations, points: Sequence[Point]) -> list[Point]:
    """Points with one more between two folds that lie between the same two points."""
    out = list(points[:1])
    for a, b in pairwise(points):
        if len(back := turns(a, b)) == 2:
            with suppress(ConvergenceError):
                out.append(between(equations, a, b, 0.5 * sum(back)))
        out.append(b)
    return out


def _multipliers(balance: Balance, points: list[Point]) -> Floquet:
    return floquet(balance, stack([p.x for p in points]), np.array([p.parameter for p in points]))


def _tongues(balance: Balance, equations: Equations, points: list[Point], data: Floquet) -> list[tuple[int, Point]]:
    """Point inside each period-doubling tongue narrower than a step, with the number of the point before.

    Multipliers near -1 are -rho exp(+-i psi). psi^2 is smooth along the branch, vanishes where they meet on the
    real axis and is negative in a tongue.
    """
    square = _phase_square(data)
    rise = np.sign(np.diff([p.parameter for p in points]))
    dips = (square[1:-1] < square[:-2]) & (square[1:-1] <= square[2:]) & (square[1:-1] < 2.5) & (rise[1:] == rise[:-1])
    new: list[tuple[int, Point]] = []

    def trial(s: float) -> float:
        left = int(s)
        p = between(equations, points[left], points[left + 1], s - left)
        f = _multipliers(balance, [p])
        if f.flip[0] < 0:
            new.append((left, p))
            raise StopIteration
        return float(_phase_square(f)[0])

    for i in np.flatnonzero(dips) + 1:
        if (data.flip[i - 1 : i + 2] > 0).all():
            with suppress(StopIteration, ConvergenceError):
                minimize_scalar(
                    trial, bounds=(i - 1, i + 1), method="bounded", options={"maxiter": _TRIALS, "xatol": 1e-6}
                )
    return new


def _phase_square(data: Floquet) -> Array:
    """Psi^2 of multipliers -rho exp(+-i psi); negative where they are real and negative."""
    h = -data.trace / (2.0 * np.sqrt(np.maximum(data.determinant, NEGLIGIBLE)))
    inside = np.arccos(np.clip(h, -1.0, 1.0)) ** 2
    return np.where(h > 1.0, -(np.arccosh(np.maximum(h, 1.0)) ** 2), inside)
