# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

"""Events along a path: folds, grazing, period doublings and largest displacements, located and inserted."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from asperity.arrays import Array
from asperity.dynamics.branch import Branch, Event, measure
from asperity.dynamics.continuation import (
    Equations,
    Path,
    Point,
    adapt,
    between,
    locate,
    newton_rtol,
    predictor,
    turns,
)
from asperity.dynamics.harmonic_balance import Balance, resize
from asperity.dynamics.stability import NEGLIGIBLE, Floquet, extrema, floquet, rise, stack
from asperity.errors import ConvergenceError

_TOP, _LIMIT, _CHANGE = "largest u_max", "limit of the law", "change of stability"  # points, but not events
_INSIDE = 1e-7  # relative distance of the last point from the limit of the law
_STEEP = 0.03  # smallest rate of the parameter along the branch used in errors, which would diverge at a fold
_CUBIC = 1e-4  # allowed error of the cubic between neighbours, relative to the orbit


def locate_events(
    balance: Balance, equations: Equations, path: Path, kind: str, number: int, tol: float
) -> tuple[Branch, list[Event], list[Point]]:
    """Insert the events and the maxima of u_max into a path and measure every point.

    Args:
        balance: equations, with the order of the path.
        equations: the same at fixed forcing, see `in_omega`.
        path: the traced path.
        kind: see `Branch`.
        number: index of the branch in the response.
        tol: relative truncation error allowed.

    Returns:
        The branch, its events, and its period doublings as points.
    """
    points = _refined(equations, path.points, tol)
    multipliers = _multipliers(balance, points)
    if balance.zeta > 0 and balance.order == 1 and _open_tongues(balance, equations, points, multipliers):
        multipliers = _multipliers(balance, points)
    inserted = _located(balance, equations, points, _tests(balance, points, multipliers), tol)
    if inserted:
        at = [i + 1 for i, _, _ in inserted]
        multipliers = multipliers.insert(at, _multipliers(balance, [p for _, _, p in inserted]))
    for shift, (i, _, p) in enumerate(inserted):
        points.insert(i + 1 + shift, p)
    branch = measure(balance, points, kind, path.end, multipliers)
    events = [
        _event(branch, number, name, i + 1 + shift)
        for shift, (i, name, _) in enumerate(inserted)
        if name not in (_TOP, _LIMIT, _CHANGE)
    ]
    return branch, events, [p for _, name, p in inserted if name == "period doubling"]


@dataclass(frozen=True)
class _Test:
    """Quantity that changes its sign at an event.

    Attributes:
        name: of the event.
        values: at the points of a path (points,).
        at: the quantity at any point.
    """

    name: str
    values: Array
    at: Callable[[Point], float]


def _tests(balance: Balance, points: list[Point], multipliers: Floquet) -> list[_Test]:
    """Return the quantities whose zeros are events, or the maxima of u_max."""
    low, high = balance.restoring.u_range
    c = stack([p.x for p in points])
    u_min, u_max = extrema(c)
    fold = np.array([p.t_parameter for p in points])
    if len(points) > 1:  # it also vanishes at the ends of a period-2 branch, which are not folds
        fold[0], fold[-1] = fold[0] or fold[1], fold[-1] or fold[-2]

    def graze(p: Point) -> float:
        return float(extrema(stack([p.x]))[0][0]) + 1.0

    def room(lowest: Array, highest: Array) -> Array:
        return np.minimum(high - highest - _INSIDE * abs(high), lowest - low - _INSIDE)

    def inside(p: Point) -> float:
        return float(room(*extrema(stack([p.x])))[0])

    def doubling(p: Point) -> float:
        return float(_multipliers(balance, [p]).flip[0])

    def top(p: Point) -> float:
        return float(rise(stack([p.x]), stack([p.t]))[0])

    tests = [_Test("fold", fold, lambda p: p.t_parameter), _Test("grazing", u_min + 1.0, graze)]
    tests.append(_Test("period doubling" if balance.zeta > 0 else _CHANGE, multipliers.flip, doubling))
    if np.isfinite([low, high]).any():
        tests.append(_Test(_LIMIT, room(u_min, u_max), inside))
    tests.append(_Test(_TOP, rise(c, stack([p.t for p in points])), top))
    return tests


def _located(
    balance: Balance, equations: Equations, points: list[Point], tests: list[_Test], tol: float
) -> list[tuple[int, str, Point]]:
    """Return the zeros of the tests in order along a path: the point before, the name, and the zero as a point."""
    search = {"rtol": newton_rtol(tol, not balance.restoring.singular), "xtol": 0.03 * float(np.sqrt(tol))}
    found: list[tuple[int, float, str, Point]] = []
    for test in tests:
        values = test.values
        for i in np.flatnonzero((values[:-1] > 0) != (values[1:] > 0)):
            if test.name == _TOP and values[i] < 0:  # a minimum of u_max
                continue
            a, b = points[i], points[i + 1]
            try:
                p = locate(equations, a, b, test.at, values[i], values[i + 1], **search)
                p = adapt(equations, p, p.t, p.t_parameter, tol, p.x.size // 2)
            except ConvergenceError:
                continue
            gap = np.linalg.norm(p.x - resize(a.x, p.x.size // 2)) + abs(p.parameter - a.parameter)
            found.append((int(i), float(gap), test.name, p))
    found.sort(key=lambda item: item[:2])
    return [(i, name, p) for i, _, name, p in found]


def _event(branch: Branch, number: int, name: str, row: int) -> Event:
    """Return the event in a row of a measured branch."""
    values = (float(column[row]) for column in (branch.Omega, branch.u_max, branch.u_min, branch.a1))
    return Event(name, number, *values)


def _refined(equations: Equations, points: tuple[Point, ...], tol: float) -> list[Point]:
    """Add points where the cubic between neighbours is not accurate enough for dense rows."""
    out = [points[0]]
    for i, (a, b) in enumerate(pairwise(points)):
        neighbour = points[i - 1] if i else points[2] if len(points) > 2 else None
        error = (_cubic_error(neighbour, a, b) if i else _cubic_error(neighbour, b, a)) if neighbour else 0.0
        pieces = min(4, int(np.ceil((error / _CUBIC) ** 0.25)))
        inner = [j / pieces for j in range(1, pieces)]
        back = turns(a, b)
        if len(back) == 2:  # two folds between two points: they need a point between them
            inner = sorted({*inner, 0.5 * sum(back)})
        for s in inner:
            try:
                q = between(equations, a, b, s)
                out.append(adapt(equations, q, q.t, q.t_parameter, tol, q.x.size // 2))
            except ConvergenceError:
                continue
        out.append(b)
    return out


def _cubic_error(before: Point, a: Point, b: Point) -> float:
    """Estimate the error of the cubic from a to b in the middle, at fixed parameter, relative to the orbit.

    The estimate comes from the error at b of the cubic through `before` and a: with the fourth derivative D of the
    branch the two errors are h^4 D / 384 and h^2 (h + g)^2 D / 24, where g is the previous step.
    """
    count = max(a.x.size, b.x.size) // 2
    first, start, stop = (p.resized(count) for p in (before, a, b))
    gap = stop.x - start.x
    ahead = np.sign((start.x - first.x) @ start.t + (start.parameter - first.parameter) * start.t_parameter)
    h = float(np.sqrt(gap @ gap + (stop.parameter - start.parameter) ** 2))
    g = float(np.sqrt((start.x - first.x) @ (start.x - first.x) + (start.parameter - first.parameter) ** 2))
    x, parameter = predictor([first, start])(float(ahead * h))
    miss = np.append(stop.x - x, stop.parameter - parameter)
    along = np.append(stop.t, stop.t_parameter)
    miss -= (miss @ along) * along
    steep = max(abs(start.t_parameter), abs(stop.t_parameter), _STEEP)
    return float(np.abs(miss).sum()) / 16.0 * (h / (h + g)) ** 2 / (steep * float(np.sqrt(stop.x @ stop.x)))


def _multipliers(balance: Balance, points: list[Point]) -> Floquet:
    return floquet(balance, stack([p.x for p in points]), np.array([p.parameter for p in points]))


def _open_tongues(balance: Balance, equations: Equations, points: list[Point], data: Floquet) -> bool:
    """Insert a point inside each period-doubling tongue narrower than a step; return whether there is one.

    Multipliers near -1 are -rho exp(+-i psi). psi^2 is smooth along the branch, vanishes where they meet on the
    real axis and is negative in a tongue; its minimum is found by parabolic interpolation.
    """
    square = _phase_square(data)
    omega = np.array([p.parameter for p in points])
    dips = np.flatnonzero((square[1:-1] < square[:-2]) & (square[1:-1] <= square[2:]) & (square[1:-1] < 2.5)) + 1
    new: list[tuple[int, Point]] = []
    for i in dips:
        around = slice(i - 1, i + 2)
        if (data.flip[around] < 0).any() or not abs(np.sign(np.diff(omega[around])).sum()) == 2:
            continue
        x, y = list(omega[around]), list(square[around])
        for _ in range(5):
            fit = np.polyfit(np.array(x) - x[1], y, 2)
            target = x[1] - 0.5 * fit[1] / fit[0] if fit[0] > 0 else x[1]
            if min(abs(target - value) for value in x) < 1e-6 * abs(omega[i + 1] - omega[i - 1]):
                break
            left = i - 1 if (target < omega[i]) == (omega[i - 1] < omega[i]) else i
            s = (target - omega[left]) / (omega[left + 1] - omega[left])
            if not 0.0 < s < 1.0:
                break
            try:
                p = between(equations, points[left], points[left + 1], float(s))
            except ConvergenceError:
                break
            f = _multipliers(balance, [p])
            if f.flip[0] < 0:
                new.append((left, p))
                break
            x.append(p.parameter)
            y.append(float(_phase_square(f)[0]))
            best = np.argsort(y)[:3]  # keep the three lowest, ordered along the branch
            x, y = [x[j] for j in best], [y[j] for j in best]
            order = np.argsort(x)
            x, y = [x[j] for j in order], [y[j] for j in order]
    for shift, (left, p) in enumerate(new):
        points.insert(left + 1 + shift, p)
    return bool(new)


def _phase_square(data: Floquet) -> Array:
    """Return psi^2 of multipliers -rho exp(+-i psi); negative where they are real and negative."""
    h = -data.trace / (2.0 * np.sqrt(np.maximum(data.determinant, NEGLIGIBLE)))
    inside = np.arccos(np.clip(h, -1.0, 1.0)) ** 2
    return np.where(h > 1.0, -(np.arccosh(np.maximum(h, 1.0)) ** 2), inside)
