"""Branches beside the main one: period-2 branches, detached loops, and which are already known."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from asperity.dynamics.law.law import Array
from asperity.dynamics.orbits.continuation import Equations, Path, Point, between, correct, in_omega, start, trace
from asperity.dynamics.orbits.harmonic_balance import Balance, resize, tail
from asperity.dynamics.orbits.initial_orbits import LEAST
from asperity.dynamics.orbits.stability import stack
from asperity.errors import ConvergenceError

_SAME = 1e-4  # two orbits closer than this, relatively, are one


def subharmonic(
    balance: Balance, forcing: float, flip: Point, window: tuple[float, float], options: dict[str, Any]
) -> Path | None:
    """Follow the period-2 branch born at a period doubling until it dies or leaves the window."""
    double = replace(balance, order=2)
    equations = in_omega(double, forcing)
    count = flip.x.size // 2
    x = np.zeros(4 * count + 1)
    x[0] = flip.x[0]
    x[2 : 2 * count + 1 : 2] = flip.x[1 : count + 1]
    x[2 * count + 2 :: 2] = flip.x[count + 1 :]
    k = np.concatenate([[0], np.arange(1, 2 * count + 1), np.arange(1, 2 * count + 1)])
    odd = np.flatnonzero(k % 2)
    jacobian = equations(x, flip.parameter)[1][np.ix_(odd, odd)]
    null = np.zeros(x.size)
    null[odd] = np.linalg.svd(jacobian)[2][-1]

    def returns(points: list[Point]) -> str | None:
        a, b = points[-2], points[-1]
        m = min(a.x.size, b.x.size) // 2
        j = np.concatenate([np.arange(1, m + 1, 2), m + np.arange(1, m + 1, 2)])
        if len(points) > 3 and resize(a.x, m)[j] @ resize(b.x, m)[j] <= 0:
            points.pop()
            return "period doubling"
        return None

    first = Point(x, flip.parameter, null, 0.0, tail(x))
    path = trace(equations, first, window, stop=returns, **{**options, "least": 2 * LEAST})
    return path if len(path.points) > 3 else None


def detached(
    balance: Balance,
    forcing: float,
    order: int,
    x: Array,
    omega: float,
    window: tuple[float, float],
    options: dict[str, Any],
    paths: list[tuple[str, int, Path]],
) -> Path | None:
    """Branch through a given orbit, followed both ways, unless one of the paths already holds it."""
    equations = in_omega(balance, forcing)
    options = {**options, "least": order * LEAST}
    try:
        first = start(equations, x, omega, 1.0, options["tol"], order * LEAST)
    except ConvergenceError:
        return None
    for _, other, path in paths:
        if other == order and _on_path(equations, path, first, order):
            return None

    def closed(points: list[Point]) -> str | None:
        if len(points) < 6:
            return None
        a, b, f = points[-2], points[-1], points[0]
        m = f.x.size // 2
        chord = np.append(b.resized(m).x - a.resized(m).x, b.parameter - a.parameter)
        to = np.append(f.x - a.resized(m).x, f.parameter - a.parameter)
        s = float(to @ chord) / float(chord @ chord)
        if 0 <= s <= 1 and np.linalg.norm(to - s * chord) < 0.1 * np.linalg.norm(chord):
            points[-1] = f
            return "closed"
        return None

    forward = trace(equations, first, window, stop=closed, **options)
    if forward.end == "closed":
        return forward
    back = replace(first, t=-first.t, t_parameter=-first.t_parameter)
    backward = trace(equations, back, window, stop=closed, **options)
    turned = tuple(replace(p, t=-p.t, t_parameter=-p.t_parameter) for p in reversed(backward.points[1:]))
    return Path(turned + forward.points, forward.end if backward.end == "window" else backward.end)


def known(paths: list[tuple[str, int, Path]], order: int, x: Array, omega: float) -> bool:
    """Whether the orbit already stands at an end of one of the paths."""
    for _, other, path in paths:
        if other != order:
            continue
        for p in (path.points[0], path.points[-1]):
            if abs(p.parameter - omega) < 1e-9:
                count = max(p.x.size, x.size) // 2
                a, b = resize(p.x, count), resize(x, count)
                if np.linalg.norm(a - b) < max(_SAME, 10 * p.error) * np.linalg.norm(a):
                    return True
    return False


def _on_path(equations: Equations, path: Path, point: Point, order: int) -> bool:
    """Whether an orbit, or its copy shifted by whole forcing periods, lies on a path."""
    omega = np.array([p.parameter for p in path.points])
    for i in np.flatnonzero((omega[:-1] <= point.parameter) != (omega[1:] <= point.parameter)):
        s = (point.parameter - omega[i]) / (omega[i + 1] - omega[i])
        try:
            q = between(equations, path.points[i], path.points[i + 1], float(s))
            m = q.x.size // 2
            y, _, _, _ = correct(equations, q.x, point.parameter, np.zeros(q.x.size), 1.0)
        except ConvergenceError:
            continue
        a, b = stack([y])[0], stack([resize(point.x, m)])[0]
        shifts = np.exp(2j * np.pi / order * np.outer(np.arange(order), np.arange(m + 1)))
        if np.abs(a - shifts * b).max(axis=1).min() < 1e-3 * np.abs(a).max():
            return True
    return False
