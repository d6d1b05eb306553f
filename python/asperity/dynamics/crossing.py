# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

"""All orbits of a path at one value of the parameter.

Between two points the branch is approximated by the cubic through both and their tangents. Where the cubic turns
back in the parameter the segment is split, so that each piece has at most one crossing. The crossing is then
located along the branch, with each trial corrected perpendicular to it: unlike a correction at fixed parameter,
this also works near a fold.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from itertools import pairwise

import numpy as np

from asperity.dynamics.continuation import Equations, Point, between, correct, locate
from asperity.dynamics.harmonic_balance import tail
from asperity.errors import ConvergenceError

_RTOL = 1e-14  # tolerance of the fraction of a segment
_NEAR = 1e-4  # largest relative change of an orbit by the last correction, at fixed parameter


def crossings(equations: Equations, points: Iterable[Point], parameter: float) -> Iterator[Point]:
    """Yield each orbit of a path at exactly this parameter, in order along the path.

    Args:
        equations: see `continuation.in_omega`.
        points: consecutive points of a branch, with tangents oriented along it.
        parameter: value at which the path is crossed.

    Raises:
        ConvergenceError: the correction at a crossing of the cubic fails.
    """
    last = None
    for a, b in pairwise(points):
        last = b
        if a.parameter == parameter:
            yield a
        pieces = [a, *(between(equations, a, b, s) for s in turns(a, b)), b] if _may_cross(a, b, parameter) else []
        for left, right in pairwise(pieces):
            f_left, f_right = left.parameter - parameter, right.parameter - parameter
            if f_left * f_right < 0:
                p = locate(equations, left, right, lambda p: p.parameter - parameter, f_left, f_right, xtol=_RTOL)
                yield _at_parameter(equations, p, parameter)
    if last is not None and last.parameter == parameter:
        yield last


def turns(a: Point, b: Point) -> list[float]:
    """Return the fractions of the segment, in order, at which the parameter of the cubic turns back."""
    third, second, first, _ = _cubic(a, b)
    root = second * second - 3.0 * third * first
    if root < 0:
        return []
    q = -second - np.copysign(np.sqrt(root), second)  # of 3 third s^2 + 2 second s + first = 0, without cancellation
    found = {float(x / y) for x, y in ((q, 3.0 * third), (first, q)) if abs(x) < abs(y) and x * y > 0}
    return sorted(found)


def _cubic(a: Point, b: Point) -> tuple[float, float, float, float]:
    """Return the coefficients of the parameter along the segment, highest power first."""
    count = max(a.x.size, b.x.size) // 2
    rise, gap = b.parameter - a.parameter, b.resized(count).x - a.resized(count).x
    length = float(np.sqrt(gap @ gap + rise * rise))
    p, q = length * a.t_parameter, length * b.t_parameter
    return p + q - 2.0 * rise, 3.0 * rise - 2.0 * p - q, p, a.parameter


def _may_cross(a: Point, b: Point, parameter: float) -> bool:
    """Return whether the cubic may cross the parameter: its control polygon lies on both sides."""
    third, second, first, start = _cubic(a, b)
    polygon = (start, start + first / 3.0, b.parameter - (3.0 * third + 2.0 * second + first) / 3.0, b.parameter)
    return min(polygon) <= parameter <= max(polygon)


def _at_parameter(equations: Equations, p: Point, parameter: float) -> Point:
    """Correct the orbit to exactly the parameter, except at a fold, where that system is singular."""
    try:
        near = _NEAR * float(np.linalg.norm(p.x))
        x, _, t, tp = correct(equations, p.x, parameter, np.zeros(p.x.size), 1.0, limit=near)
    except ConvergenceError:
        return Point(p.x, parameter, p.t, p.t_parameter, p.error)
    return Point(x, parameter, t, tp, tail(x))
