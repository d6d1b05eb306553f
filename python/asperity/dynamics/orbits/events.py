"""Special orbits along a path: folds, grazing, period doublings and greatest deflections, located and inserted."""

from __future__ import annotations

import numpy as np

from asperity.dynamics.law.law import Array
from asperity.dynamics.orbits.branch import Branch, Event, measure
from asperity.dynamics.orbits.continuation import Equations, Path, Point, adapt, between, locate, newton_rtol
from asperity.dynamics.orbits.harmonic_balance import Balance, resize
from asperity.dynamics.orbits.stability import NOTHING, Floquet, extrema, floquet, rise, stack
from asperity.errors import ConvergenceError

_TOP = "greatest u_max"  # a point of the branch, but no event
_CORNER = 0.003  # largest distance of a branch from the chord between neighbours, relative to its extent


def finish(
    balance: Balance, equations: Equations, path: Path, kind: str, number: int, tol: float
) -> tuple[Branch, list[Event], list[Point]]:
    """Locate the events and the tops of a path, insert them and measure every point."""
    points = _refined(equations, path.points, tol)
    search = {"rtol": newton_rtol(tol, not balance.restoring.singular), "xtol": 0.03 * float(np.sqrt(tol))}
    multipliers = _multipliers(balance, points)
    if balance.zeta > 0 and balance.order == 1 and _open_tongues(balance, equations, points, multipliers):
        multipliers = _multipliers(balance, points)
    flip = multipliers.flip
    c = stack([p.x for p in points])
    omega = np.array([p.parameter for p in points])
    u_min, _ = extrema(c)
    fold = np.array([p.t_parameter for p in points])

    def graze(p: Point) -> float:
        return float(extrema(stack([p.x]))[0][0]) + 1.0

    def doubling(p: Point) -> float:
        return float(_multipliers(balance, [p]).flip[0])

    def top(p: Point) -> float:
        return float(rise(stack([p.x]), stack([p.t]))[0])

    tests = [("fold", fold, lambda p: p.t_parameter), ("grazing", u_min + 1.0, graze)]
    if balance.zeta > 0 and balance.order == 1:
        tests.append(("period doubling", flip, doubling))
    tests.append((_TOP, rise(c, stack([p.t for p in points])), top))
    inserted: list[tuple[int, float, str, Point]] = []
    for name, values, function in tests:
        for i in np.flatnonzero((values[:-1] > 0) != (values[1:] > 0)):
            if name == _TOP and values[i] < 0:  # a least u_max
                continue
            try:
                p = locate(equations, points[i], points[i + 1], function, values[i], values[i + 1], **search)
                p = adapt(equations, p, p.t, p.t_parameter, tol, p.x.size // 2)
            except ConvergenceError:
                continue
            gap = np.linalg.norm(p.x - resize(points[i].x, p.x.size // 2)) + abs(p.parameter - omega[i])
            inserted.append((int(i), float(gap), name, p))
    inserted.sort(key=lambda item: item[:2])
    if inserted:
        at = [i + 1 for i, *_ in inserted]
        multipliers = multipliers.insert(at, _multipliers(balance, [p for *_, p in inserted]))
    for shift, (i, _, _, p) in enumerate(inserted):
        points.insert(i + 1 + shift, p)
    branch = measure(balance, points, kind, path.end, multipliers)
    events = []
    for shift, (i, _, name, _) in enumerate(inserted):
        if name == _TOP:
            continue
        j = i + 1 + shift
        events.append(
            Event(
                name,
                number,
                float(branch.Omega[j]),
                float(branch.u_max[j]),
                float(branch.u_min[j]),
                float(branch.a1[j]),
            )
        )
    return branch, events, [p for _, _, name, p in inserted if name == "period doubling"]


def _refined(equations: Equations, points: tuple[Point, ...], tol: float) -> list[Point]:
    """Add points where straight lines between neighbours would show as corners in a plot."""
    count = 8
    span = abs(max(p.parameter for p in points) - min(p.parameter for p in points)) + 1e-12
    x = np.array([resize(p.x, count) for p in points])
    height = float(np.abs(x).max()) + 1e-12
    t = np.array([resize(p.t, count) for p in points])
    slope = np.column_stack([t / height, [p.t_parameter / span for p in points]])
    gap = np.diff(x, axis=0)
    length = np.sqrt((gap**2).sum(axis=1) + np.diff([p.parameter for p in points]) ** 2)
    # the cubic through both points and tangents leaves the chord, half-way, by (t_a - t_b) h / 8
    sag = np.abs(slope[:-1] - slope[1:]).max(axis=1) * length / 8.0
    out = [points[0]]
    for i, p in enumerate(points[1:]):
        pieces = min(4, int(np.ceil(np.sqrt(sag[i] / _CORNER))))
        for j in range(1, pieces):
            try:
                q = between(equations, points[i], p, j / pieces)
                out.append(adapt(equations, q, q.t, q.t_parameter, tol, q.x.size // 2))
            except ConvergenceError:
                continue
        out.append(p)
    return out


def _multipliers(balance: Balance, points: list[Point]) -> Floquet:
    return floquet(balance, stack([p.x for p in points]), np.array([p.parameter for p in points]))


def _open_tongues(balance: Balance, equations: Equations, points: list[Point], data: Floquet) -> bool:
    """Insert a point inside each period-doubling tongue narrower than a step; True when there is one.

    Multipliers near -1 are -rho exp(+-i psi); psi^2 is smooth along the branch, vanishes where they meet on
    the real axis and is negative in a tongue, so its minimum is found by parabolic interpolation.
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
    """psi^2 with multipliers -rho exp(+-i psi); negative where they are real and below zero."""
    h = -data.trace / (2.0 * np.sqrt(np.maximum(data.determinant, NOTHING)))
    inside = np.arccos(np.clip(h, -1.0, 1.0)) ** 2
    return np.where(h > 1.0, -(np.arccosh(np.maximum(h, 1.0)) ** 2), inside)
