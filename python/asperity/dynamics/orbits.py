"""Periodic orbits as fixed points of the period map, and their branches by pseudo-arclength continuation.

An orbit is known by its states at equally spaced phases of the forcing, a quarter of a period apart: a single piece of
a very unstable one would amplify every error. One of twice the period has twice as many. Lengths along a branch are
relative: to the amplitude, and to the frequency. Near a resonance, however narrow, a Floquet multiplier comes close to
1 or -1: a step changes its phase by at most half of the distance, and so shrinks geometrically instead of jumping over
the resonance.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from asperity.arrays import Array
from asperity.dynamics.equation import TURN, Equation, Motions, motions
from asperity.dynamics.point import PIECES, SMALLEST, TOO_MUCH, Path, Point, hermite, root, value
from asperity.vibration.settings import Setting
from asperity.errors import ConvergenceError
from asperity.runtime.display import short_repr

_RTOL = 1e-4  # tolerance of the integrator over that of the orbits
_FINEST, _COARSEST = 1e-13, 1e-9  # of it
_NEWTON = 8  # iterations of the corrector
_NEWTON_RTOL = 1e-6  # relative size of its last step; the remaining error is of the order of the square
_LOST = 1e9  # relative state beyond which Newton's method has left the orbit
_CUT = 0.35  # of a step that does not converge
_HMIN = 1e-9  # smallest step along the branch
_TURNED = 1e-5  # step that is taken though the branch seems to turn: at a symmetric one that splits
_LONGEST = 0.4  # longest step, relative to amplitude and frequency
_ACROSS = 25.0  # steps through the window, at least
_STRIDE = 0.03  # longest step outside it, over the frequency
_PREDICTED = 0.03  # allowed error of the prediction
_INSIDE = 7e-3  # the same inside the window, over the rate of the frequency along the branch, at least `_STEEP`
_STEEP = 0.03
_WEAK = 1e-3  # relative amplitude of a resonance that steps may jump over
WORK = 250  # steps of the integrator that count as much as a point
_CROSSING_RTOL = 1e-14  # tolerance of the fraction of a segment at which a frequency is crossed
_ROUND_OFF = 1e-15  # relative round-off of the contact force
_NOISE = 30.0  # steps of Newton's method that round-off causes, over it


@dataclass
class Orbits:
    """Orbits of one or more forcing periods as zeros of a function of states and Omega.

    Attributes:
        equation, setting: what moves, and by what
        window: of Omega
        tol: allowed error of the orbits, relative to the amplitude
        limits: Omega up to which a branch is followed outside the window
        work, max_work: steps of the integrator so far, in points, and those after which a path ends
    """

    equation: Equation
    setting: Setting
    window: tuple[float, float]
    tol: float = 1e-5
    max_work: float = 6000.0
    limits: tuple[float, float] = field(init=False)
    work: float = field(default=0.0, init=False)

    __repr__ = short_repr

    def __post_init__(self) -> None:
        self.limits = self.window
        self._rtol = min(max(_RTOL * self.tol, _FINEST), _COARSEST)

    def is_inside(self, omega: float) -> bool:
        """Whether a frequency is in the window."""
        return self.window[0] <= omega <= self.window[1]

    def scales(self, amplitude: float, y: Array) -> Array:
        """Weights of the unknowns y (states, Omega) in lengths along the branch."""
        omega = abs(y[-1]) + 1e-300
        w, size = np.empty(y.size), amplitude * np.sqrt(y.size // 2)
        w[0::2], w[1::2] = 1.0 / size, 1.0 / (size * max(1.0, omega))
        w[-1] = 1.0 / omega
        return w

    def map(self, states: Array, omega: float, phase: ArrayLike, **more: Any) -> Motions:
        """Motions from states (lanes, 2) at phases over a piece of the period."""
        m = motions(
            self.equation, states, omega, self.setting.forcing(omega), grows=self.setting.growth(omega), start=phase,
            length=TURN / PIECES, rtol=self._rtol, **more,
        )  # fmt: skip
        self.work += m.steps / WORK
        return m

    def through(self, states: ArrayLike, omega: float) -> Array:
        """Guess of the unknowns from the states at forcing phase 0 of each period (order, 2)."""
        rows: list[Array] = [np.reshape(states, (-1, 2))]
        for k in range(PIECES - 1):
            rows.append(self.map(rows[-1], omega, k * TURN / PIECES, derivatives=False).end)
        return np.append(np.stack(rows, 1).ravel(), omega)

    def correct(
        self, y: Array, normal: Array, amplitude: float, *, limit: float = np.inf, rtol: float = _NEWTON_RTOL
    ) -> Point:
        """Correct a guess y (states, Omega) by Newton's method in the plane through it with the given normal.

        The tangent is oriented along the normal. The last step is below `rtol`, relative to the amplitude.

        Raises:
            ConvergenceError: the iteration does not converge, or moves further than `limit`
        """
        w = self.scales(min(amplitude, 1.0) + 1e-300, y)
        plane = normal / w
        plane = plane / np.sqrt(plane @ plane)
        previous, travelled = np.inf, 0.0
        rtol = max(rtol, _NOISE * _ROUND_OFF / (self.equation.restoring.n_loc * min(amplitude, 1.0) + 1e-300))
        rows, ahead = np.arange(y.size - 1).reshape(-1, 2), -np.roll(np.eye(y.size - 1), 2, axis=1)
        phases = TURN / PIECES * np.arange(len(rows))  # at which the pieces begin
        for _ in range(_NEWTON):
            states = y[:-1].reshape(-1, 2)
            m = self.map(states, float(y[-1]), phases)
            residual = (m.end - np.concatenate([states[1:], states[:1]])).ravel() * w[:-1]
            if not np.abs(residual).max() < _LOST:
                break
            matrix = np.zeros((y.size, y.size))
            matrix[:-1, :-1] = ahead
            matrix[rows[:, :, None], rows[:, None, :]] += m.by_end[:, :, :2]
            matrix[:-1, -1] = m.by_end[:, :, 2].ravel()
            matrix *= np.append(w[:-1], 0.0)[:, None] / w
            matrix[-1] = plane
            try:
                inverse = np.linalg.inv(matrix)
            except np.linalg.LinAlgError as error:
                raise ConvergenceError("singular Jacobian") from error
            step = inverse[:, :-1] @ residual
            y = y - step / w
            length = float(np.sqrt(step @ step))
            travelled += length
            if not travelled < limit or not length < 4.0 * previous:
                break
            if length <= rtol:
                grown = float(np.abs(inverse[:-1, :-1]).sum(axis=1).max())
                local = float(m.error.sum()) * grown / (min(amplitude, 1.0) + 1e-300)
                return self._point(y, inverse[:, -1] / w, m, -step / w, local)
            previous = length
        raise ConvergenceError("no convergence in the corrector")

    def _point(self, y: Array, tangent: Array, m: Motions, step: Array, error: float) -> Point:
        """Point from the last motions of Newton's method, moved by its last step."""
        changes = np.array([step, tangent])
        by_lane = np.concatenate(
            [changes[:, :-1].reshape(2, -1, 2), np.broadcast_to(changes[:, None, -1:], (2, len(m.end), 1))], axis=2
        )
        top, low = int(m.high[:, 0].argmax()), int(m.low[:, 0].argmin())
        waves = 2.0 * PIECES / (TURN * len(m.end)) * m.wave
        moves = np.array([
            by_lane[:, top] @ m.high[top, 1:], by_lane[:, low] @ m.low[low, 1:],
            *np.einsum("cij,ikj->kc", by_lane, waves[:, :, 1:]),
        ])  # fmt: skip
        extremes = np.array([m.high[top, 0], m.low[low, 0], *waves[:, :, 0].sum(axis=0)]) + moves[:, 0]
        monodromy = np.linalg.multi_dot(m.by_end[::-1, :, :2])
        liouville = float(np.exp(-2.0 * self.equation.zeta * m.damping.sum()))
        size = max(liouville, 1e-6 * float(np.sum(monodromy**2)), 1e-12)
        off = abs(float(np.linalg.det(monodromy)) - liouville) / size
        a = 0.5 * (extremes[0] - extremes[1]) + 1e-300
        length = np.linalg.norm(tangent * self.scales(a, y))
        error = max(error * min(1.0, 1.0 / a), _ROUND_OFF / (self.equation.restoring.n_loc * a))
        return Point(
            y, tangent / length, extremes, moves[:, 1] / length, float(np.trace(monodromy)), liouville, off, error
        )

    def at(self, y: Array, amplitude: float, direction: float = 1.0) -> Point:
        """Correct a guess at its Omega, which first changes with the sign of `direction` along the tangent."""
        normal = np.zeros(y.size)
        normal[-1] = np.copysign(1.0, direction)
        found = self.correct(y, normal, amplitude)
        return replace(found, y=np.append(found.y[:-1], y[-1]))

    def segment(self, a: Point, b: Point) -> tuple[Array, Array, float]:
        """Cubic (4, unknowns) from a to b over [0, 1], weights of the unknowns, and the length of the chord."""
        w = self.scales(a.amplitude, a.y)
        chord = b.y - a.y
        length = float(np.linalg.norm(w * chord))
        out, into = (length / (np.linalg.norm(w * p.tangent) + 1e-300) * p.tangent for p in (a, b))
        return hermite(a.y, chord, out, into), w, length

    def between(self, a: Point, b: Point, fraction: float) -> Point:
        """Point of the branch at a fraction of the way from a to b: cubic prediction, corrected."""
        cubic, w, length = self.segment(a, b)
        normal = w**2 * (cubic[1] + 2.0 * fraction * cubic[2] + 3.0 * fraction**2 * cubic[3])
        if not np.any(normal):
            normal = w**2 * cubic[1:].sum(axis=0)
        guess = value(cubic, fraction)
        point = self.correct(guess, normal, min(a.amplitude, b.amplitude))
        if np.linalg.norm(w * (point.y - guess)) > 0.5 * length + 1e-6:
            raise ConvergenceError("another orbit was found between two points")
        return point

    def locate(self, a: Point, b: Point, at: Callable[[Point], float], xtol: float = 1e-9) -> Point:
        """Find the point between neighbours where `at`, of opposite signs there, vanishes."""
        point = a

        def off(s: float) -> float:
            nonlocal point
            point = self.between(a, b, s)
            return at(point)

        root(off, at(a), at(b), xtol)
        return point

    def crossings(self, points: Sequence[Point], omega: float) -> Iterator[Point]:
        """Each orbit of a path at exactly this Omega, in order along the path.

        Where the cubic between two points turns back the segment is split, so that each piece has at most one crossing.
        The failure of a correction is a `ConvergenceError`.
        """
        for a, b in pairwise(points):
            if a.Omega == omega:
                yield a
            start, first, second, third = (float(c) for c in self.segment(a, b)[0][:, -1])
            polygon = (start, start + first / 3.0, b.Omega - (3.0 * third + 2.0 * second + first) / 3.0)
            if not min(*polygon, b.Omega) <= omega <= max(*polygon, b.Omega):
                continue  # the control polygon of the cubic lies on one side
            pieces = [a, *(self.between(a, b, s) for s in self.turns(a, b)), b]
            for left, right in pairwise(pieces):
                if (left.Omega - omega) * (right.Omega - omega) < 0:
                    yield self._crossing(left, right, omega)
        if points[-1].Omega == omega:
            yield points[-1]

    def _crossing(self, a: Point, b: Point, omega: float) -> Point:
        """Orbit at a frequency between two neighbours on its two sides."""
        cubic, w, length = self.segment(a, b)
        s = root(lambda s: float(value(cubic[:, -1], s)) - omega, a.Omega - omega, b.Omega - omega)
        try:
            guess = np.append(value(cubic, s)[:-1], omega)
            found = self.at(guess, min(a.amplitude, b.amplitude), b.Omega - a.Omega)
            if np.linalg.norm(w * (found.y - guess)) < 0.2 * length:
                return found
        except ConvergenceError:
            pass
        found = self.locate(a, b, lambda p: p.Omega - omega, _CROSSING_RTOL)
        return replace(found, y=np.append(found.y[:-1], omega))

    def turns(self, a: Point, b: Point) -> list[float]:
        """Fractions of the segment, in order, at which the Omega of the cubic turns back."""
        _, first, second, third = self.segment(a, b)[0][:, -1]
        inside = second * second - 3.0 * third * first
        if inside < 0:
            return []
        q = -second - np.copysign(np.sqrt(inside), second)  # of 3 third s^2 + 2 second s + first = 0
        found = {float(x / y) for x, y in ((q, 3.0 * third), (first, q)) if abs(x) < abs(y) and x * y > 0}
        return sorted(found)

    def trace(self, first: Point, stop: Callable[[list[Point]], str | None]) -> Path:
        """Trace the branch along the tangent of `first` until it leaves the limits of Omega.

        It has a point at each end of the window that it passes. `stop` receives the points after each step, and may
        return a reason to end the path.
        """
        limits, (low, high) = self.limits, self.window
        points, h = [first], 0.05
        while True:
            here, omega = points[-1], points[-1].Omega
            w = self.scales(here.amplitude, here.y)
            unit = here.tangent / np.linalg.norm(w * here.tangent)
            longest = (high - low) / _ACROSS if self.is_inside(omega) else _STRIDE * omega
            h = min(h, longest / max(abs(unit[-1]), 1e-9), _LONGEST, self._resonance(here, float(unit[-1])))
            h = max(h, 2.0 * _HMIN)
            cubic, length = np.array([here.y - unit, unit, 0.0 * unit, 0.0 * unit]), 1.0
            if len(points) > 1:  # through the last two points
                before, chord = points[-2], here.y - points[-2].y
                length = float(np.linalg.norm(w * chord))
                out = length / np.linalg.norm(w * before.tangent) * before.tangent
                cubic = hermite(before.y, chord, out, length * unit)
            while True:
                if h < _HMIN:
                    return Path(tuple(points), "step too small")
                if self.work > self.max_work:
                    return Path(tuple(points), TOO_MUCH)
                guess = value(cubic, 1.0 + h / length)
                try:
                    point = self.correct(guess, w**2 * unit, here.amplitude, limit=3.0 * h)
                except ConvergenceError:
                    h *= _CUT
                    continue
                miss, along = w * (point.y - guess), w * point.tangent / np.linalg.norm(w * point.tangent)
                allowed = _PREDICTED
                if self.is_inside(point.Omega):  # at a fold the error at fixed frequency would diverge
                    allowed = min(allowed, _INSIDE * max(abs(along[-1]), abs(float((w * unit)[-1])), _STEEP))
                error = float(np.linalg.norm(miss - (miss @ along) * along)) / allowed
                if error > 2.0 or float(along @ (w * unit)) < 0.5:
                    h *= max(0.2, min(0.6, (0.5 / max(error, 1e-9)) ** 0.25))
                    continue
                # Omega turns where a multiplier passes 1, or else the step has jumped to where the branch comes back;
                # not so at the period doubling that a branch of twice the period passes
                if here.order == 1 and h > _TURNED and here.fold * here.rate * point.fold * point.rate < 0:
                    h *= _CUT
                    continue
                break
            passed = [e for e in {*limits, low, high} if (e - omega) * (e - point.Omega) < 0]
            if passed:
                edge = min(passed, key=lambda e: abs(e - omega))
                try:
                    point = self._crossing(here, point, edge)
                except (ConvergenceError, ValueError):
                    if h > 1e-6:
                        h *= _CUT
                        continue
                    return Path(tuple(points), "window")
            if not limits[0] <= point.Omega <= limits[1]:
                return Path(tuple(points), "window")
            points.append(point)
            reason = stop(points)
            if passed and point.Omega in limits:
                reason = "window"
            if reason:
                return Path(tuple(points), reason)
            h *= min(2.0, max(0.3, (0.6 / max(error, 1e-6)) ** 0.25))

    def _resonance(self, p: Point, rate: float) -> float:
        """Longest step near a resonance, by the phase of the multipliers; `rate` is that of Omega along the branch."""
        if p.determinant <= SMALLEST:
            return np.inf
        decay, turn = -0.5 * np.log(p.determinant), TURN * p.order / p.Omega**2
        near = min(abs(p.phase_square(sign)) for sign in (1.0, -1.0)) ** 0.5
        w = self.scales(p.amplitude, p.y)
        drift = float(np.linalg.norm((w * p.tangent)[:-1])) / max(abs(p.rate), 1e-9)
        if drift * abs(p.fold) / turn < _WEAK * max(decay, 1e-6):
            return np.inf
        return (0.5 * near + max(0.5 * decay, 1e-3)) / (turn * max(abs(rate), 1e-9))
