"""Events along a path: folds, grazing, period doublings and largest displacements, located and inserted."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from itertools import pairwise

import numpy as np
from scipy.optimize import minimize_scalar

from asperity.arrays import Array
from asperity.dynamics.branch import Branch, Event, measure
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
from asperity.dynamics.harmonic_balance import Balance, resize
from asperity.dynamics.stability import NEGLIGIBLE, Floquet, extrema, floquet, rise, stack
from asperity.errors import ConvergenceError

_TOP, _CHANGE = "largest u_max", "change of stability"  # points, but not events
_TRIALS = 14  # orbits at which a period-doubling tongue between two points is searched


_Test = tuple[str, Array, Callable[[Point], float]]  # event, quantity that vanishes there at points, and anywhere


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
