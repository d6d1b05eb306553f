"""Periodic orbits by collocation on Gauss points, with a mesh that follows the corners of the motion.

The orbit is u(s) over the phase s = Omega tau. On each interval of the mesh the second derivative a = d2u/ds2 is a
polynomial through the Gauss points, where the equation of motion holds (Ascher, Mattheij & Russell 1995, chapter 5).
Newton's method eliminates a on each interval; a chain of 2 x 2 matrices over the intervals remains, whose product is
the monodromy matrix. Intervals are halved until their share of the error is below the tolerance: near the loss and the
return of contact the mesh is fine, elsewhere coarse.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from asperity.arrays import Array
from asperity.errors import ConvergenceError
from asperity.vibration.equation import TURN, Equation

Forcing = Callable[[float], tuple[float, float]]
_M = 5  # Gauss points on an interval
_UNITS = 2**40  # of the phase in a turn; ends of intervals are multiples
_NEWTON = 14  # iterations of Newton's method, with those after a change of the mesh
_RTOL = 3e-5  # last Newton step over the amplitude
_REST = 1e-9  # the same, after which corners need not be met
_ROUGH = 1e-2  # Newton step over the amplitude below which the mesh is changed
_UNIT = TURN / _UNITS
_FEWEST, _MOST = 8, 3000  # intervals
_RESOLVED = 1.5  # longest interval in time, over 1/omega_s: the multipliers are those of small free motion
_FINEST = 2**18  # units of the smallest interval
_MOVED = 2**16  # units by which a corner may be beside its node


def _basis() -> tuple[Array, Array, Array, Array]:
    """Gauss points and weights on [0, 1], monomial coefficients of the Lagrange polynomials, and last two modes."""
    x, w = np.polynomial.legendre.leggauss(_M)
    points = 0.5 * (x + 1.0)
    modes = np.array([(2 * k + 1) * np.polynomial.legendre.Legendre.basis(k)(x) * 0.5 * w for k in (_M - 2, _M - 1)])
    return points, 0.5 * w, np.linalg.inv(np.vander(points, increasing=True)), modes


_C, _B, _LAGRANGE, _MODES = _basis()
_P = np.arange(_M)
_CUTS = np.append(0.0, _C)
_ONCE, _TWICE = _P + 1.0, (_P + 1.0) * (_P + 2.0)


def _weights(x: Array) -> tuple[Array, Array, Array]:
    """Weights (..., M) of a at the Gauss points for a, its integral and its double integral from 0 to x in [0, 1]."""
    power = x[..., None] ** _P
    once = x[..., None] * power / (_P + 1.0)
    return power @ _LAGRANGE, once @ _LAGRANGE, x[..., None] * once / (_P + 2.0) @ _LAGRANGE


_, _A1, _A2 = _weights(_C)
_END1, _END2 = (w[0] for w in _weights(np.ones(1))[1:])


class Mesh:
    """Intervals of a period.

    Attributes:
        own, corners: nodes of the mesh, and where the motion passes corners of the law (nodes,); phases in units of a
            turn over 2^40, rising, `own` from 0
        start: all of them, at which the intervals begin (intervals,)
        units, h: their lengths in units, and in radians (intervals,)
        phases, cosines: of the Gauss points (intervals, 5)
    """

    def __init__(self, own: Array, corners: Array) -> None:
        self.own, self.corners = own, corners
        near = np.searchsorted(own, corners)
        around = np.concatenate([[0], own, [_UNITS]])
        apart = np.minimum(corners - around[near], around[near + 1] - corners) > _FINEST
        self.start = start = np.sort(np.concatenate([own, corners[apart]]))
        self.units = np.append(start[1:], _UNITS) - start
        self.h = self.units * _UNIT
        self.phases = start[:, None] * _UNIT + _C * self.h[:, None]
        self.cosines = np.cos(self.phases)

    @classmethod
    def even(cls, intervals: int) -> Mesh:
        """Mesh of equal intervals."""
        count = max(intervals, _FEWEST)
        return cls(np.arange(count) * (_UNITS // count), np.empty(0, int))

    def halved(self, error: Array, tol: float, longest: float) -> Array:
        """Nodes in the middle of the intervals whose error (intervals,) is above `tol`, three where it is far above.

        So are those longer than `longest` (radians).
        """
        large = np.flatnonzero(((error > tol) | (self.h > longest)) & (self.units > 4 * _FINEST))
        quarter = self.units[large] // 4
        worse = (error[large] > 2.0**4 * tol) | (self.h[large] > 2.0 * longest)
        first, second = self.start[large][worse], quarter[worse]
        return np.concatenate([self.start[large] + 2 * quarter, first + second, first + 3 * second])

    def joined(self, error: Array, tol: float, longest: float) -> Mesh:
        """Mesh without nodes between neighbours whose common error is below `tol`, up to `longest` (radians)."""
        units = self.units
        both, larger = units[:-1] + units[1:], np.maximum(units[:-1], units[1:])
        grown = 4.0 * np.maximum(error[:-1], error[1:]) * (both / larger) ** (_M + 1)
        needless = np.append(False, (grown < tol) & (both * _UNIT <= longest))
        for i in np.flatnonzero(needless):
            needless[i] = not needless[i - 1]
        gone = self.start[needless]
        kept = self.own[~np.isin(self.own, gone)]
        return Mesh(kept, self.corners) if kept.size < self.own.size else self

    def at(self, new: Array, corners: Array) -> Mesh:
        """Mesh with more nodes, and others at corners; this one where nothing changes."""
        moved = corners.size != self.corners.size or np.any(np.abs(corners - self.corners) > _MOVED)
        if not new.size and not moved:
            return self
        return Mesh(np.union1d(self.own, new), corners if moved else self.corners)


@dataclass(frozen=True)
class Wave:
    """A function of the phase.

    Attributes:
        mesh: the intervals
        u, w: values and slopes at the beginning of each interval (intervals,)
        a: second derivatives at its Gauss points (intervals, 5)
    """

    mesh: Mesh
    u: Array
    w: Array
    a: Array

    @classmethod
    def harmonic(cls, mesh: Mesh, z: complex) -> Wave:
        """The real part of z exp(i s)."""
        node, inside = z * np.exp(1j * _UNIT * mesh.start), z * np.exp(1j * mesh.phases)
        return cls(mesh, node.real, -node.imag, -inside.real)

    def values(self) -> tuple[Array, Array]:
        """Values and slopes at the Gauss points (intervals, 5)."""
        h, w = self.mesh.h[:, None], self.w[:, None]
        return self.u[:, None] + h * (_C * w + h * (self.a @ _A2.T)), w + h * (self.a @ _A1.T)

    def at(self, s: Array) -> tuple[Array, Array, Array]:
        """Values, slopes and second derivatives at phases s, each of the shape of s."""
        mesh, unit = self.mesh, s * (1.0 / _UNIT)
        i = np.searchsorted(mesh.start, unit, side="right") - 1
        h, x = mesh.h[i], (unit - mesh.start[i]) / mesh.units[i]
        none, once, twice = (np.einsum("...k,...k", weights, self.a[i]) for weights in _weights(x))
        return self.u[i] + h * (x * self.w[i] + h * twice), self.w[i] + h * once, none

    def on(self, mesh: Mesh) -> Wave:
        """The same function on another mesh."""
        if mesh is self.mesh:
            return self
        points = np.column_stack([mesh.start * _UNIT, mesh.phases])
        u, w, a = self.at(points)
        return Wave(mesh, u[:, 0], w[:, 0], a[:, 1:])

    def plus(self, *terms: tuple[float, Wave]) -> Wave:
        """Sum with multiples of functions on the same mesh."""
        u, w, a = self.u, self.w, self.a
        for factor, one in terms:
            u, w, a = u + factor * one.u, w + factor * one.w, a + factor * one.a
        return Wave(self.mesh, u, w, a)

    def times(self, factor: float) -> Wave:
        """Multiple of the function."""
        return Wave(self.mesh, factor * self.u, factor * self.w, factor * self.a)

    def dot(self, other: Wave) -> float:
        """Mean of the product with a function on the same mesh."""
        return float(self.mesh.h @ (self.u * other.u)) / TURN

    @property
    def first(self) -> complex:
        """First harmonic: the real part of first exp(i s)."""
        mesh = self.mesh
        return complex(np.sum(mesh.h[:, None] * _B * self.values()[0] * np.exp(-1j * mesh.phases))) / np.pi

    @property
    def amplitude(self) -> float:
        """Half of the range at the nodes."""
        return 0.5 * float(self.u.max() - self.u.min()) + 1e-300

    def errors(self) -> Array:
        """Error of the slope on each interval over its amplitude, by the last modes of a (intervals,)."""
        last = np.abs(self.a @ _MODES.T)
        size = 0.5 * float(self.w.max() - self.w.min()) + 1e-300
        return 0.1 * self.mesh.h * np.maximum(last[:, 1], 0.3 * last[:, 0]) / size

    def passes(self, levels: Array) -> Array:
        """Phases in units at which the function passes levels, rising (passes,)."""
        u = np.append(np.column_stack([self.u, self.values()[0]]).ravel(), self.u[0])
        s = np.append(np.column_stack([self.mesh.start * _UNIT, self.mesh.phases]).ravel(), TURN)
        above = u > levels[:, None]
        k, i = np.nonzero(above[:, 1:] != above[:, :-1])
        low, high, level = s[i], s[i + 1], levels[k]
        at = low + (level - u[i]) / (u[i + 1] - u[i]) * (high - low)
        for _ in range(2 if at.size else 0):
            value, slope, _ = self.at(np.minimum(at, TURN * (1.0 - 1e-15)))
            with np.errstate(divide="ignore", invalid="ignore"):
                better = at - (value - level) / slope
            at = np.where((better >= low) & (better <= high), better, at)
        return np.unique((at / _UNIT).astype(int))

    def extreme(self, sign: float) -> tuple[float, float]:
        """The largest (sign 1) or the smallest value (sign -1), and its phase."""
        u, w = self.values()
        u, w = np.column_stack([self.u, u]), np.column_stack([self.w, w])
        i, k = divmod(int(np.argmax(sign * u)), _M + 1)
        best, place = float(u[i, k]), float(_CUTS[k])
        i, x = (i, place) if sign * w[i, k] >= 0.0 or k else (i - 1, 1.0)
        h = float(self.mesh.h[i])
        c = self.a[i] @ _LAGRANGE.T  # the polynomial of a
        slope, value = h * np.append(self.w[i] / h, c / _ONCE)[::-1], h * h * np.append([0.0, 0.0], c / _TWICE)[::-1]
        curve = c[::-1]
        for _ in range(5):
            second = h * float(np.polyval(curve, x))
            if not sign * second < 0.0:
                break
            x = min(max(x - float(np.polyval(slope, x)) / second, 0.0), 1.0)
        top = float(self.u[i] + h * x * self.w[i] + np.polyval(value, x))
        phase = float(self.mesh.start[i] * _UNIT + h * x)
        if sign * top >= sign * best:
            return top, phase
        return best, float(self.mesh.start[i] * _UNIT + h * place)


@dataclass(frozen=True)
class Orbit:
    """A periodic orbit on a branch.

    Attributes:
        wave: u over the phase s = Omega tau
        Omega: frequency of the forcing over omega_s
        along, rate: tangent of the branch: u over the phase, and Omega
        trace: of the monodromy matrix over a period of the forcing
        determinant: of that matrix, by the damping
        error: estimated error of du/ds over its amplitude
        moved: distance from the guess, over the amplitude
    """

    wave: Wave
    Omega: float
    along: Wave
    rate: float
    trace: float
    determinant: float
    error: float
    moved: float

    @cached_property
    def _extremes(self) -> tuple[tuple[float, float], ...]:
        return tuple(self.wave.extreme(sign) for sign in (1.0, -1.0))

    @property
    def u_max(self) -> float:
        """Largest displacement."""
        return self._extremes[0][0]

    @property
    def u_min(self) -> float:
        """Smallest displacement; contact is lost where it is below -1."""
        return self._extremes[1][0]

    @property
    def amplitude(self) -> float:
        """Half of the range of u."""
        return 0.5 * (self.u_max - self.u_min) + 1e-300

    @cached_property
    def rise(self) -> float:
        """Derivative of the largest displacement along the branch."""
        return float(self.along.at(np.array(self._extremes[0][1]))[0])

    @cached_property
    def first(self) -> complex:
        """First harmonic of u, the real part of first exp(i s)."""
        return self.wave.first

    @property
    def a1(self) -> float:
        """Amplitude at the forcing frequency."""
        return abs(self.first)

    @property
    def phase(self) -> float:
        """Phase of u over the force at the forcing frequency, -270 to 90 degrees, so that -180 is no edge."""
        return float(np.degrees((np.angle(self.first) + 1.5 * np.pi) % TURN - 1.5 * np.pi))

    @property
    def start(self) -> tuple[float, float]:
        """State u, v = du/dtau at the forcing phase 0, for `ContactOscillator.simulate`."""
        return float(self.wave.u[0]), float(self.Omega * self.wave.w[0])

    @property
    def radius(self) -> float:
        """Largest modulus of a Floquet multiplier."""
        half, root = 0.5 * abs(self.trace), 0.25 * self.trace**2 - self.determinant
        return half + float(np.sqrt(root)) if root > 0 else float(np.sqrt(self.determinant))

    @property
    def stable(self) -> bool:
        """Whether all multipliers lie in the unit circle (up to round-off)."""
        return self.radius <= 1.0 + 1e-7

    @property
    def fold(self) -> float:
        """Characteristic polynomial of the multipliers at 1."""
        return 1.0 - self.trace + self.determinant

    @property
    def flip(self) -> float:
        """Characteristic polynomial of the multipliers at -1."""
        return 1.0 + self.trace + self.determinant

    def turned(self, sign: float) -> Orbit:
        """The same orbit with the tangent times a sign."""
        return self if sign > 0 else replace(self, along=self.along.times(-1.0), rate=-self.rate)

    def __repr__(self) -> str:
        return f"Orbit(Omega = {self.Omega:.6g}, u_max = {self.u_max:.6g}, stable = {self.stable})"


class Collocation:
    """Orbits of an equation under a forcing.

    Args:
        equation: what moves
        forcing: F^ and its derivative at a frequency Omega
        tol: allowed error of the slope du/ds on an interval, over its amplitude
    """

    def __init__(self, equation: Equation, forcing: Forcing, tol: float = 3e-7) -> None:
        self.equation, self.forcing, self.tol = equation, forcing, tol
        self.iterations = 0  # so far

    def correct(
        self, wave: Wave, omega: float, across: Wave | None = None, rate: float = 1.0, *, limit: float = np.inf
    ) -> Orbit:
        """Correct a guess by Newton's method in the plane through it across a direction, on a mesh that it refines.

        Args:
            wave, omega: the guess
            across, rate: the direction: u over the phase, and Omega; without the first the orbit is that of `omega`
            limit: allowed distance from the guess, over the amplitude

        Raises:
            ConvergenceError: the iteration does not converge, or moves further than `limit`
        """
        corners = self.equation.corners
        travelled, previous = 0.0, np.inf
        longest = min(TURN / _FEWEST, _RESOLVED * omega)
        mesh = wave.mesh.joined(wave.errors(), self.tol, longest).at(np.empty(0, int), wave.passes(corners))
        for _ in range(_NEWTON):
            if mesh is not wave.mesh:
                wave, across, previous = wave.on(mesh), None if across is None else across.on(mesh), np.inf
            self.iterations += 1
            change, change_omega, tangent, tangent_omega, trace, loss = self._newton(wave, omega, across, rate)
            wave, omega = wave.plus((1.0, change)), omega + change_omega
            amplitude = wave.amplitude
            size = max(float(np.abs(change.u).max()) / amplitude, abs(change_omega / omega))
            travelled += size
            if not travelled < limit or not size < 4.0 * previous or not omega > 0.0:
                break
            previous = size
            if size < _ROUGH:
                errors = wave.errors()
                more = wave.mesh.halved(errors, self.tol, 1.01 * longest)
                mesh = wave.mesh.at(more, wave.passes(corners))
                if mesh.start.size > _MOST:
                    raise ConvergenceError("the mesh becomes too fine")
                # where the motion touches a corner, two passes may come as close as round-off and never rest
                if size < _RTOL and (mesh is wave.mesh or (not more.size and size < _REST)):
                    length = np.sqrt(tangent.dot(tangent) / amplitude**2 + (tangent_omega / omega) ** 2)
                    error = float(np.sqrt(np.sum(errors**2)))
                    determinant = float(np.exp(-2.0 * self.equation.zeta * loss / omega))
                    along = tangent.times(1.0 / length)
                    return Orbit(wave, omega, along, tangent_omega / length, trace, determinant, error, travelled)
        raise ConvergenceError("no convergence in the corrector")

    def _newton(
        self, wave: Wave, omega: float, across: Wave | None, rate: float
    ) -> tuple[Wave, float, Wave, float, float, float]:
        """Newton step of u and Omega, the tangent of the branch, trace of the monodromy matrix, INT g ds."""
        mesh, a, zeta = wave.mesh, wave.a, self.equation.zeta
        h, cosine = mesh.h[:, None], mesh.cosines
        u, w = wave.values()
        force, grows = self.forcing(omega)
        with np.errstate(over="ignore", invalid="ignore"):  # far from an orbit a law may overflow
            f, f_u, g, g_u = self.equation.terms(u)
        residual = omega**2 * a - force * cosine + f + 2.0 * zeta * omega * g * w
        K = f_u + 2.0 * zeta * omega * g_u * w
        D = 2.0 * zeta * omega * g
        matrix = (h**2 * K)[..., None] * _A2 + (h * D)[..., None] * _A1
        matrix[:, _P, _P] += omega**2
        right = np.stack(
            [-residual, grows * cosine - 2.0 * omega * a - 2.0 * zeta * g * w, -K, -(K * _C * h + D)], axis=-1
        )
        try:
            x = np.linalg.solve(matrix, right)
        except np.linalg.LinAlgError as error:
            raise ConvergenceError("singular Jacobian") from error
        if not np.isfinite(x).all():
            raise ConvergenceError("the motion is not finite")
        # maps of (1, change of Omega, of u, of w) from node to node, and by prefix products from the first node
        chain = np.zeros((a.shape[0], 4, 4))
        chain[:, 0, 0] = chain[:, 1, 1] = 1.0
        chain[:, 2], chain[:, 3] = h**2 * (_END2 @ x), h * (_END1 @ x)
        chain[:, 2, 2] += 1.0
        chain[:, 2, 3] += h[:, 0]
        chain[:, 3, 3] += 1.0
        chain[:, 2, 0] += wave.u + h[:, 0] * wave.w + h[:, 0] ** 2 * (a @ _END2) - np.roll(wave.u, -1)
        chain[:, 3, 0] += wave.w + h[:, 0] * (a @ _END1) - np.roll(wave.w, -1)
        reach = 1
        while reach < len(chain):
            chain[reach:] = chain[reach:] @ chain[:-reach]
            reach *= 2
        state = chain[-1, 2:]
        nodes = np.concatenate([np.eye(4)[None, 2:], chain[:-1, 2:]])
        monodromy = state[:, 2:]
        # unknowns: change of Omega, of u and of w at the phase 0
        system = np.empty((3, 3))
        system[:2, 0] = -state[:, 1]
        system[:2, 1:] = np.eye(2) - monodromy
        known = np.array([[state[0, 0], 0.0], [state[1, 0], 0.0], [0.0, 1.0]])
        if across is None:
            system[2] = rate, 0.0, 0.0
        else:
            weight = h[:, 0] * across.u / (TURN * wave.amplitude**2)
            system[2] = weight @ nodes[:, 0, 1] + rate / omega**2, weight @ nodes[:, 0, 2], weight @ nodes[:, 0, 3]
            known[2, 0] = -weight @ nodes[:, 0, 0]
        try:
            solved = np.linalg.solve(system, known)
        except np.linalg.LinAlgError as error:
            raise ConvergenceError("singular Jacobian") from error
        waves = []
        for part, one in zip(solved.T, (1.0, 0.0), strict=True):
            columns = np.append(one, part)
            at_nodes = nodes @ columns
            da = x[..., 0] * one + x[..., 1] * part[0] + x[..., 2] * at_nodes[:, :1] + x[..., 3] * at_nodes[:, 1:]
            waves.append(Wave(mesh, at_nodes[:, 0], at_nodes[:, 1], da))
        loss = float(np.sum(h * _B * g))
        return waves[0], float(solved[0, 0]), waves[1], float(solved[0, 1]), float(np.trace(monodromy)), loss
