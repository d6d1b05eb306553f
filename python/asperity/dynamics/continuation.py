"""Pseudo-arclength continuation of harmonic-balance solutions, with adaptive harmonics.

The step length follows the error of the cubic predictor in each harmonic, relative to that harmonic. Near a
superharmonic resonance, however narrow, its harmonic grows: the step then shrinks geometrically instead of
jumping over the resonance (Seydel 2010, chapter 4; Krack & Gross 2019).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from scipy.optimize import brentq

from asperity.arrays import Array
from asperity.dynamics.cubic import hermite, value
from asperity.dynamics.harmonic_balance import MAX_HARMONICS, Balance, resize, tail
from asperity.errors import ConvergenceError

MIN_HARMONICS = 8  # per forcing period
_NEWTON = 8  # iterations of the corrector
_NEWTON_RTOL = 3e-6  # relative size of its last step; the remaining error is of the order of the square
_CUT = 0.35  # of a step that does not converge
_HMIN = 1e-9  # smallest step along the branch
_CROSSING_RTOL = 1e-14  # tolerance of the fraction of a segment at which a parameter is crossed
_STRIDE = 0.03  # longest step outside the window, over the parameter
_OUTSIDE_WORK = 10.0  # of a point there, over that of one inside
# allowed error of the cubic between two points inside, over the orbit, at fixed parameter: rows are then within 5e-4 of
# corrected orbits (six responses)
_CUBIC = 2e-4
_STEEP = 0.03  # smallest rate of the parameter along the branch in that error, which would diverge at a fold


@dataclass(frozen=True)
class Point:
    """One periodic orbit on a branch, with the unit tangent of the branch."""

    x: Array  # Fourier coefficients (2 K + 1)
    parameter: float  # Omega (or F^ while the forcing is raised)
    t: Array  # tangent in x
    t_parameter: float  # tangent in the parameter; it changes sign at a fold
    error: float  # relative truncation estimate, see `harmonic_balance.tail`

    def resized(self, count: int) -> Point:
        """Same point with `count` harmonics."""
        if self.x.size == 2 * count + 1:
            return self
        return replace(self, x=resize(self.x, count), t=resize(self.t, count))

    def turned(self) -> Point:
        """Same point with the opposite direction."""
        return replace(self, t=-self.t, t_parameter=-self.t_parameter)


@dataclass(frozen=True)
class Path:
    """Points in order along a branch, and the reason why it ends."""

    points: tuple[Point, ...]
    end: str
    begin: str = "window"


@dataclass(frozen=True)
class Tracing:
    """How branches are traced."""

    window: tuple[float, float]  # of the parameter
    tol: float  # relative truncation error allowed
    zeta: float  # determines how small a harmonic may be and still indicate a resonance
    max_step: float  # in the parameter
    min_harmonics: int = MIN_HARMONICS
    max_points: int = 3000  # work after which a path ends; points of many harmonics count more
    smooth: bool = True  # whether Newton's method converges quadratically (the stiffness is bounded)
    limits: tuple[float, float] | None = None  # up to which a branch is followed outside the window; None: its ends
    loose: float = 0.0  # relative truncation error allowed there

    def is_inside(self, parameter: float) -> bool:
        """Whether a parameter is in the window."""
        return self.window[0] <= parameter <= self.window[1]

    def tol_at(self, parameter: float) -> float:
        """Relative truncation error allowed at a parameter."""
        return self.tol if self.limits is None or self.is_inside(parameter) else self.loose


Equations = Callable[[Array, float], tuple[Array, Array, Array]]


def in_omega(balance: Balance, forcing: float) -> Equations:
    """Balance at fixed forcing as a function of (x, Omega)."""
    return lambda x, omega: balance.evaluate(x, omega, forcing)


def in_forcing(balance: Balance, omega: float) -> Equations:
    """Balance at fixed Omega as a function of (x, F^)."""

    def equations(x: Array, forcing: float) -> tuple[Array, Array, Array]:
        residual, jacobian, _ = balance.evaluate(x, omega, forcing)
        slope = np.zeros(x.size)
        slope[balance.order] = -1.0
        return residual, jacobian, slope

    return equations


def correct(
    equations: Equations,
    x: Array,
    parameter: float,
    normal: Array,
    normal_p: float,
    *,
    limit: float = np.inf,
    rtol: float = _NEWTON_RTOL,
) -> tuple[Array, float, Array, float]:
    """Correct a guess (x, parameter) by Newton's method in the plane through it with the given normal.

    The last step is below `rtol`, relative to x or to 1 if that is less. The unit tangent of the branch follows x and
    the parameter, oriented along the normal.

    Raises:
        ConvergenceError: the iteration does not converge, or moves further than `limit`
    """
    size = x.size
    matrix = np.empty((size + 1, size + 1))
    rhs = np.zeros((size + 1, 2))
    rhs[size, 1] = 1.0
    previous, travelled = np.inf, 0.0
    scale = min(np.sqrt(x @ x), 1.0) + 1e-9  # a step is small where it is so against the contact, not the flight
    for _ in range(_NEWTON):
        residual, jacobian, slope = equations(x, parameter)
        matrix[:size, :size] = jacobian
        matrix[:size, size] = slope
        matrix[size, :size] = normal
        matrix[size, size] = normal_p
        rhs[:size, 0] = residual
        try:
            both = np.linalg.solve(matrix, rhs)
        except np.linalg.LinAlgError as error:
            raise ConvergenceError("singular Jacobian") from error
        step = both[:, 0]
        x = x - step[:size]
        parameter = parameter - step[size]
        length = float(np.sqrt(step @ step))
        travelled += length
        if not travelled < limit or not length < 4.0 * previous:
            break
        if length <= rtol * scale:
            tangent = both[:, 1]
            tangent = tangent / np.sqrt(tangent @ tangent)
            return x, float(parameter), tangent[:size], float(tangent[size])
        previous = length
    raise ConvergenceError("no convergence in the corrector")


def adapt(equations: Equations, point: Point, normal: Array, normal_p: float, tol: float, min_harmonics: int) -> Point:
    """Raise the harmonics of a point until its truncation estimate is below `tol`, or lower them; see `correct`."""
    count = point.x.size // 2
    while point.error > tol and count < MAX_HARMONICS:
        count = min(MAX_HARMONICS, 4 * -(-count * 5 // 16))
        x, parameter, t, tp = correct(
            equations, resize(point.x, count), point.parameter, resize(normal, count), normal_p
        )
        point = Point(x, parameter, t, tp, tail(x))
    if count > min_harmonics:
        lower = max(min_harmonics, 4 * (count // 5))
        if tail(resize(point.x, lower)) < 0.03 * tol:
            point = point.resized(lower)
    return point


def start(equations: Equations, x: Array, parameter: float, direction: float, how: Tracing) -> Point:
    """Turn a solution into the first point of a path; the parameter first changes with the sign of `direction`."""
    normal, sense = np.zeros(x.size), float(np.copysign(1.0, direction))
    x, parameter, t, tp = correct(equations, x, parameter, normal, sense)
    point = Point(x, parameter, t, tp, tail(x))
    return adapt(equations, point, normal, sense, how.tol_at(parameter), how.min_harmonics)


def trace(
    equations: Equations, first: Point, how: Tracing, stop: Callable[[list[Point]], str | None] | None = None
) -> Path:
    """Trace the branch along the tangent of `first` until it leaves the limits of the parameter.

    It has a point at each end of the window that it passes. `stop` receives the points after each step, and may return
    a reason to end the path.
    """
    limits = how.limits or how.window
    points = [first]
    h, work = 0.25 * how.max_step, 0.0
    while True:
        here = points[-1]
        amplitude, inside = float(np.sqrt(here.x @ here.x)), how.is_inside(here.parameter)
        max_step = how.max_step if inside else _STRIDE * here.parameter
        h = min(h, max_step / max(abs(here.t_parameter), 1e-6), 0.4 * amplitude + 0.5 * max_step)
        predict = predictor(points)
        while True:
            if h < _HMIN:
                return Path(tuple(points), "step too small")
            work += (0.5 + (here.x.size / 128) ** 2) * (1.0 if inside else _OUTSIDE_WORK)
            if work > how.max_points:
                return Path(tuple(points), "too much work")
            point, error, factor = _step(equations, here, *predict(h), h, how)
            if point is not None:
                break
            h *= factor
        passed = [e for e in {*limits, *how.window} if (e - here.parameter) * (e - point.parameter) < 0]
        try:
            point = adapt(equations, point, here.t, here.t_parameter, how.tol_at(point.parameter), how.min_harmonics)
            if passed:
                edge = min(passed, key=lambda e: abs(e - here.parameter))
                point = _at_edge(equations, here, point, edge, how)
        except ConvergenceError:
            if h > 1e-6:
                h *= _CUT
                continue
            if passed:
                return Path(tuple(points), "window")
        if not limits[0] <= point.parameter <= limits[1]:
            return Path(tuple(points), "window")
        points.append(point)
        if passed and point.parameter in limits:
            return Path(tuple(points), "window")
        reason = stop(points) if stop else None
        if reason:
            return Path(tuple(points), reason)
        h *= min(2.0, max(0.3, (0.6 / max(error, 1e-6)) ** 0.25))


def _step(
    equations: Equations, here: Point, guess: Array, guess_p: float, h: float, how: Tracing
) -> tuple[Point | None, float, float]:
    """Correct the prediction of a step of length `h`: point, error of the prediction, and factor of the step.

    The point is None where the step must be repeated with the length times the factor.
    """
    rtol, watch = newton_rtol(how.tol_at(guess_p), how.smooth), max(1e-6, min(1e-3, 0.1 * how.zeta))
    try:
        x, parameter, t, tp = correct(equations, guess, guess_p, here.t, here.t_parameter, limit=h, rtol=rtol)
    except ConvergenceError:
        return None, np.inf, _CUT
    error = _prediction_error(guess, x, here.x, watch)
    point = Point(x, parameter, t, tp, tail(x))
    aligned = float(t @ here.t) + tp * here.t_parameter
    if how.limits is not None and how.is_inside(parameter):
        error = max(error, _cubic_error(guess, guess_p, here, point) / _CUBIC)
    if error > 2.0 or aligned < 0.5:
        return None, error, max(0.2, min(0.6, (0.5 / max(error, 1e-9)) ** 0.25))
    return point, error, 1.0


def newton_rtol(tol: float, smooth: bool) -> float:
    """Size of the last Newton step whose remaining error is well below the truncation error `tol`."""
    return max(_NEWTON_RTOL, float(np.sqrt(1e-2 * tol))) if smooth else _NEWTON_RTOL


def between(equations: Equations, a: Point, b: Point, fraction: float, rtol: float = _NEWTON_RTOL) -> Point:
    """Point of the branch at a fraction of the way from a to b: cubic Hermite prediction, corrected."""
    cubic, length = _segment(a, b)
    y, chord = value(cubic, fraction), cubic[1:].sum(axis=0) / length
    x, p, t, tp = correct(equations, y[:-1], float(y[-1]), chord[:-1], float(chord[-1]), rtol=rtol)
    return Point(x, p, t, tp, tail(x))


def _segment(a: Point, b: Point) -> tuple[Array, float]:
    """Cubic of (x, parameter) from a to b and the length of its chord."""
    count = max(a.x.size, b.x.size) // 2
    a, b = a.resized(count), b.resized(count)
    chord = np.append(b.x - a.x, b.parameter - a.parameter)
    length = float(np.sqrt(chord @ chord))
    out, into = length * np.append(a.t, a.t_parameter), length * np.append(b.t, b.t_parameter)
    return hermite(np.append(a.x, a.parameter), chord, out, into), length


def _parameter(a: Point, b: Point) -> Array:
    """Coefficients of the parameter alone in the cubic from a to b."""
    count = max(a.x.size, b.x.size) // 2
    gap, chord = b.resized(count).x - a.resized(count).x, b.parameter - a.parameter
    length = float(np.sqrt(gap @ gap + chord * chord))
    return hermite(a.parameter, chord, length * a.t_parameter, length * b.t_parameter)


def locate(
    equations: Equations,
    a: Point,
    b: Point,
    at: Callable[[Point], float],
    fa: float,
    fb: float,
    *,
    xtol: float = 1e-8,
    rtol: float = _NEWTON_RTOL,
) -> Point:
    """Find the point between neighbours a and b where `at` vanishes, to the fraction `xtol` of their distance.

    `at` has the values fa and fb, of opposite signs, at a and b.
    """
    point = a

    def value(s: float) -> float:
        nonlocal point
        if s in (0.0, 1.0):
            return fb if s else fa
        point = between(equations, a, b, s, rtol)
        return at(point)

    brentq(value, 0.0, 1.0, xtol=xtol, rtol=_CROSSING_RTOL)
    return point


def predictor(points: Sequence[Point]) -> Callable[[float], tuple[Array, float]]:
    """Extrapolation by arc length with the cubic through the last two points and their tangents."""
    here = points[-1]
    tangent = np.append(here.t, here.t_parameter)
    cubic, origin, length = np.array([np.append(here.x, here.parameter), tangent, 0 * tangent, 0 * tangent]), 0.0, 1.0
    if len(points) > 1:
        both, chord = _segment(points[-2].resized(here.x.size // 2), here)
        if chord > 1e-12:
            cubic, origin, length = both, 1.0, chord

    def predict(h: float) -> tuple[Array, float]:
        y = value(cubic, origin + h / length)
        return y[:-1], float(y[-1])

    return predict


def _prediction_error(guess: Array, x: Array, before: Array, watch: float) -> float:
    """Largest error of the predictor in any harmonic, in units of a sixth of that harmonic."""
    count = x.size // 2
    miss = guess - x
    miss_k = np.sqrt(miss[1 : count + 1] ** 2 + miss[count + 1 :] ** 2)
    now = x[1 : count + 1] ** 2 + x[count + 1 :] ** 2
    then = before[1 : count + 1] ** 2 + before[count + 1 :] ** 2
    size = np.sqrt(np.minimum(now, then))
    floor = watch * np.sqrt(now.sum())
    return 6.0 * float((miss_k / (size + floor)).max())


def _cubic_error(guess: Array, guess_p: float, here: Point, point: Point) -> float:
    """Error of the cubic from `here` to a point in the middle, at fixed parameter, relative to the orbit.

    With the fourth derivative D of the branch the error of the prediction is h^2 (h + g)^2 D / 24, where g is the step
    before, and that of the cubic between its ends h^4 D / 384: at most 1/36 of it, as h is at most 2 g.
    """
    miss, miss_p = point.x - guess, point.parameter - guess_p
    along = float(miss @ point.t) + miss_p * point.t_parameter
    across = float(np.abs(miss - along * point.t).sum()) + abs(miss_p - along * point.t_parameter)
    steep = max(abs(here.t_parameter), abs(point.t_parameter), _STEEP)
    return across / 36.0 / (steep * float(np.sqrt(point.x @ point.x)))


def _at_edge(equations: Equations, inside: Point, outside: Point, edge: float, how: Tracing) -> Point:
    """Solution exactly at the edge of the window, between two points."""
    cubic = _segment(inside, outside)[0]
    s = brentq(lambda s: float(value(cubic[:, -1], s)) - edge, 0.0, 1.0)
    return start(equations, value(cubic, s)[:-1], edge, outside.parameter - inside.parameter, how)


def crossings(equations: Equations, points: Sequence[Point], parameter: float) -> Iterator[Point]:
    """Each orbit of a path at exactly this parameter, in order along the path.

    Where the cubic between two points turns back the segment is split, so that each piece has at most one crossing,
    which is located along the branch. The failure of a correction is a `ConvergenceError`.
    """
    for a, b in pairwise(points):
        if a.parameter == parameter:
            yield a
        start, first, second, third = _parameter(a, b)
        polygon = (start, start + first / 3.0, b.parameter - (3.0 * third + 2.0 * second + first) / 3.0, b.parameter)
        if not min(polygon) <= parameter <= max(polygon):  # the control polygon of the cubic lies on one side
            continue
        pieces = [a, *(between(equations, a, b, s) for s in turns(a, b)), b]
        for left, right in pairwise(pieces):
            f_left, f_right = left.parameter - parameter, right.parameter - parameter
            if f_left * f_right < 0:
                p = locate(
                    equations, left, right, lambda p: p.parameter - parameter, f_left, f_right, xtol=_CROSSING_RTOL
                )
                yield replace(p, parameter=parameter)
    if points[-1].parameter == parameter:
        yield points[-1]


def turns(a: Point, b: Point) -> list[float]:
    """Fractions of the segment, in order, at which the parameter of the cubic turns back."""
    _, first, second, third = _parameter(a, b)
    root = second * second - 3.0 * third * first
    if root < 0:
        return []
    q = -second - np.copysign(np.sqrt(root), second)  # of 3 third s^2 + 2 second s + first = 0, without cancellation
    found = {float(x / y) for x, y in ((q, 3.0 * third), (first, q)) if abs(x) < abs(y) and x * y > 0}
    return sorted(found)
