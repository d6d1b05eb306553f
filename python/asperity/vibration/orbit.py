"""Periodic orbits by collocation on Gauss points, with a mesh that follows the corners of the motion.

The orbit is u(s) over the phase s = Omega tau. On each interval of the mesh the second derivative a = d2u/ds2 is a
polynomial through the Gauss points, where the equation of motion holds (Ascher, Mattheij & Russell 1995, chapter 5).
Newton's method eliminates a on each interval; a chain of 2 x 2 matrices over the intervals remains, whose product is
the monodromy matrix. The mesh has nodes where the motion passes corners of the law, and between them all intervals
have the same share of the error.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.interpolate import PPoly

from asperity.arrays import Array
from asperity.errors import ConvergenceError
from asperity.vibration.equation import TURN, Equation

Forcing = Callable[[float], tuple[float, float]]
_M = 5  # Gauss points on an interval
_NEWTON = 14  # iterations of Newton's method, with those after a change of the mesh
_RTOL = 3e-5  # last Newton step over the amplitude
_ROUGH = 1e-2  # Newton step over the amplitude below which the mesh is changed
_MARGIN = 0.1  # error of an interval of a new mesh, over the allowed error
_GROWTH = (0.25, 2.0)  # of intervals from mesh to mesh
_FEWEST, _MOST = 8, 3000  # intervals
_RESOLVED = 1.5  # longest interval in time, over 1/omega_s: the multipliers are those of small free motion
_BESIDE = 1e-7  # phase between corners that share a node
_MET = 1e-10  # slope at a corner times its squared distance from a node, over the largest slope


def _basis() -> tuple[Array, Array, Array, Array, Array]:
    """Gauss points and weights on [0, 1], last two modes, and what maps coefficients of a wave to functions.

    On an interval of length h a wave has the coefficients u and h u' at its beginning, and h^2 u'' at the Gauss points.
    They map to the powers of the place x in [0, 1], and to u, h u' at the Gauss points and at the end (6, 2, 7).
    """
    x, w = np.polynomial.legendre.leggauss(_M)
    points, k = 0.5 * (x + 1.0), np.arange(_M)[:, None]
    modes = np.array([(2 * m + 1) * np.polynomial.legendre.Legendre.basis(m)(x) * 0.5 * w for m in (_M - 2, _M - 1)])
    powers = np.eye(_M + 2)
    powers[2:, 2:] = np.linalg.inv(np.vander(points, increasing=True)) / ((k + 1.0) * (k + 2.0))
    at = np.append(points, 1.0)[:, None] ** np.arange(_M + 2)
    slope = np.arange(_M + 2) * np.append(np.zeros((_M + 1, 1)), at[:, :-1], axis=1)
    return points, 0.5 * w, modes, powers, np.stack([at @ powers, slope @ powers], axis=1)


_C, _B, _MODES, _POWERS, _AT = _basis()
_P, _HIGHEST = np.arange(_M), np.arange(_M + 1, -1, -1)
_INSIDE, (_END_U, _END_W) = _AT[:-1], _AT[-1]


@dataclass(frozen=True, eq=False)
class Wave:
    """Functions of the phase: u and a direction, the tangent of a branch for example.

    Attributes:
        nodes: phases between intervals, from 0 to a turn (intervals + 1,)
        corners: those at which u passes a corner of the law
        c: coefficients of both, see `_basis` (intervals, 7, 2)
    """

    nodes: Array
    corners: Array
    c: Array

    @classmethod
    def harmonic(cls, z: complex, omega: float) -> Wave:
        """The real part of z exp(i s), and no direction."""
        nodes = np.linspace(0.0, TURN, max(_FEWEST, int(8.0 / omega)) + 1)
        none = cls(nodes, np.empty(0), np.zeros((nodes.size - 1, _M + 2, 2)))
        node, inside = (z * np.exp(1j * s) for s in (nodes[:-1, None], none.inside))
        u = np.concatenate([node.real, -none.h * node.imag, -(none.h**2) * inside.real], axis=1)
        return replace(none, c=np.stack([u, 0.0 * u], axis=2))

    @cached_property
    def h(self) -> Array:
        """Lengths of the intervals (intervals, 1)."""
        return np.diff(self.nodes)[:, None]

    @property
    def inside(self) -> Array:
        """Phases of the Gauss points (intervals, 5)."""
        return self.nodes[:-1, None] + _C * self.h

    @cached_property
    def at(self) -> PPoly:
        """Both functions as piecewise polynomials of the phase."""
        powers = np.tensordot(_POWERS[::-1], self.c, (1, 1))
        return PPoly.construct_fast(powers / (self.h.T ** _HIGHEST[:, None])[..., None], self.nodes, "periodic")

    def on(self, nodes: Array, corners: Array) -> Wave:
        """The same functions on another mesh."""
        new = Wave(nodes, corners, self.c)
        h, first = new.h[..., None], nodes[:-1, None]
        return replace(new, c=np.concatenate([self.at(first), h * self.at(first, 1), h**2 * self.at(new.inside, 2)], 1))

    @cached_property
    def samples(self) -> tuple[Array, Array]:
        """Phases of the nodes and Gauss points, rising, and u there (points,)."""
        s = np.append(np.hstack([self.nodes[:-1, None], self.inside]), TURN)
        return s, self.at(s)[:, 0]

    @property
    def size(self) -> float:
        """Half of the range of u at the nodes."""
        return 0.5 * float(np.ptp(self.c[:, 0, 0])) + 1e-300

    @property
    def steepest(self) -> float:
        """Half of the range of du/ds at the nodes."""
        return 0.5 * float(np.ptp(self.c[:, 1, 0] / self.h[:, 0])) + 1e-300

    def mean(self, one: Array, other: Array) -> float:
        """Mean over the phase of a product of functions, given by their coefficients (intervals, 7)."""
        return float(self.h[:, 0] @ (one[:, 0] * other[:, 0])) / TURN

    @property
    def first(self) -> Array:
        """First harmonics: the real parts of first exp(i s) (2,)."""
        inside = np.tensordot(_INSIDE[:, 0], self.c, (1, 1))
        return np.tensordot((self.h * _B * np.exp(-1j * self.inside)).T, inside, ((0, 1), (0, 1))) / np.pi

    def errors(self) -> Array:
        """Error of the slope of u on each interval over its amplitude, by the last modes of u'' (intervals,)."""
        last = np.abs(self.c[:, 2:, 0] @ _MODES.T) / self.h
        return 0.1 * np.maximum(last[:, 1], 0.3 * last[:, 0]) / self.steepest

    def passes(self, levels: Array) -> Array:
        """Phases at which u passes levels, rising (passes,)."""
        s, u = self.samples
        above = u > levels[:, None]
        k, i = np.nonzero(above[:, 1:] != above[:, :-1])
        level, low, high = levels[k], s[i], s[i + 1]
        at = low + (level - u[i]) / (u[i + 1] - u[i]) * (high - low)
        for _ in range(2 if at.size else 0):
            with np.errstate(divide="ignore", invalid="ignore"):
                better = at - (self.at(at)[:, 0] - level) / self.at(at, 1)[:, 0]
            at = np.where((better >= low) & (better <= high), better, at)
        at = np.sort(at)
        return at[np.diff(at, prepend=0.0, append=TURN)[:-1] > _BESIDE]

    def misses(self, corners: Array) -> bool:
        """Whether the mesh has no node where u passes corners."""
        i = np.searchsorted(self.nodes, corners)
        apart = np.minimum(corners - self.nodes[i - 1], self.nodes[i] - corners)
        return bool(np.any(np.abs(self.at(corners, 1)[:, 0]) * apart**2 > _MET * self.steepest))

    def fitted(self, corners: Array, tol: float, longest: float) -> Wave:
        """The same functions on a mesh with nodes at corners, on which intervals have errors below `tol`.

        The old mesh is moved with its corners before its intervals are changed, up to `longest` (phase).
        """
        before, ends = (np.concatenate([[0.0], inner, [TURN]]) for inner in (self.corners, corners))
        nodes = np.interp(self.nodes, before, ends) if before.size == ends.size else self.nodes
        growth = np.clip((_MARGIN * tol / (self.errors() + 1e-300)) ** (1.0 / (_M + 1)), *_GROWTH)
        wanted = np.append(0.0, np.cumsum(np.diff(nodes) / np.minimum(growth * np.diff(nodes), longest)))
        marks = np.interp(ends, nodes, wanted)
        first = np.append(0, np.cumsum(np.ceil(np.diff(marks)).astype(int)))
        if first[-1] > _MOST:
            raise ConvergenceError("the mesh becomes too fine")
        new = np.interp(np.interp(np.arange(first[-1] + 1), first, marks), wanted, nodes)
        new[first] = ends
        return self.on(new, corners)


@dataclass(frozen=True, eq=False)
class Orbit:
    """A periodic orbit on a branch.

    Attributes:
        wave: u over the phase s = Omega tau, and the tangent of the branch
        Omega: frequency of the forcing over omega_s
        rate: derivative of Omega along the branch
        trace: of the monodromy matrix over a period of the forcing
        determinant: of that matrix, by the damping
        error: estimated error of du/ds over its amplitude
        moved: distance from the guess, over the amplitude
    """

    wave: Wave
    Omega: float
    rate: float
    trace: float
    determinant: float
    error: float
    moved: float

    @cached_property
    def _extremes(self) -> tuple[Array, Array]:
        """Phases of the largest and of the smallest u, and u there."""
        (s, u), at = self.wave.samples, self.wave.at
        i = np.array([u.argmax(), u.argmin()])
        place = s[i]
        for _ in range(4):
            second = at(place, 2)[:, 0]
            turns = second * (-1.0, 1.0) > 0.0
            place = place - np.where(turns, at(place, 1)[:, 0] / np.where(turns, second, 1.0), 0.0)
            place = np.clip(place, s[i - 1] - TURN * (i == 0), s[(i + 1) % s.size] + TURN * (i == s.size - 1))
        value = at(place)[:, 0]
        better = (value - u[i]) * (1.0, -1.0) > 0.0
        return np.where(better, place, s[i]), np.where(better, value, u[i])

    @property
    def u_max(self) -> float:
        """Largest displacement."""
        return float(self._extremes[1][0])

    @property
    def u_min(self) -> float:
        """Smallest displacement; contact is lost where it is below -1."""
        return float(self._extremes[1][1])

    @property
    def amplitude(self) -> float:
        """Half of the range of u."""
        return 0.5 * (self.u_max - self.u_min) + 1e-300

    @cached_property
    def rise(self) -> float:
        """Derivative of the largest displacement along the branch."""
        return float(self.wave.at(self._extremes[0][0])[1])

    @cached_property
    def first(self) -> complex:
        """First harmonic of u, the real part of first exp(i s)."""
        return complex(self.wave.first[0])

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
        u, slope = self.wave.c[0, :2, 0] / (1.0, self.wave.h[0, 0])
        return float(u), float(self.Omega * slope)

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

    def __repr__(self) -> str:
        return f"Orbit(Omega = {self.Omega:.6g}, u_max = {self.u_max:.6g}, stable = {self.stable})"


class Collocation:
    """Orbits of an equation under a forcing.

    Args:
        equation: what moves
        forcing: F^ and its derivative at a frequency Omega
        tol: allowed error of the slope du/ds on an interval, over its amplitude
    """

    def __init__(self, equation: Equation, forcing: Forcing, tol: float) -> None:
        self.equation, self.forcing, self.tol = equation, forcing, tol
        self.iterations = 0  # so far

    def correct(
        self, wave: Wave, omega: float, rate: float = 1.0, *, fixed: bool = False, limit: float = np.inf
    ) -> Orbit:
        """Correct a guess by Newton's method in the plane through it across a direction, on a mesh that it refines.

        Args:
            wave, omega: the guess, and in the wave the direction
            rate: change of Omega in the direction
            fixed: the frequency stays
            limit: allowed distance from the guess, over the amplitude

        Raises:
            ConvergenceError: the iteration does not converge, or moves further than `limit`
        """
        levels, longest = self.equation.corners, min(TURN / _FEWEST, _RESOLVED * omega)
        wave = wave.fitted(wave.passes(levels), self.tol, longest)
        moved, previous = 0.0, np.inf
        for _ in range(_NEWTON):
            self.iterations += 1
            change, change_omega, trace, loss = self._newton(wave, omega, rate, fixed)
            last, wave = wave, replace(wave, c=wave.c + change * (1.0, 0.0))
            omega += float(change_omega[0])
            amplitude = wave.size
            size = max(float(np.abs(change[:, 0, 0]).max()) / amplitude, abs(change_omega[0] / omega))
            moved += size
            if not moved < limit or not size < 4.0 * previous or not omega > 0.0:
                break
            previous = size
            if size > _ROUGH:
                continue
            corners, errors = wave.passes(levels), wave.errors()
            if errors.max() > self.tol or wave.misses(corners):
                wave, previous = wave.fitted(corners, self.tol, longest), np.inf
            elif size < _RTOL:
                tangent, turns = change[..., 1], change_omega[1]
                length = np.sqrt(last.mean(tangent, tangent) / amplitude**2 + (turns / omega) ** 2)
                found = replace(wave, c=np.stack([wave.c[..., 0], tangent / length], axis=2))
                determinant = float(np.exp(-2.0 * self.equation.zeta * loss / omega))
                error = float(np.sqrt(np.sum(errors**2)))
                return Orbit(found, omega, float(turns / length), trace, determinant, error, moved)
        raise ConvergenceError("no convergence in the corrector")

    def _newton(self, wave: Wave, omega: float, rate: float, fixed: bool) -> tuple[Array, Array, float, float]:
        """Newton step and tangent of the branch, of the wave (intervals, 7, 2) and of Omega (2,).

        Also the trace of the monodromy matrix, and INT g ds.
        """
        h, c, zeta = wave.h, wave.c[..., 0], self.equation.zeta
        u, w = (c @ at.T for at in (_INSIDE[:, 0], _INSIDE[:, 1]))
        w, a, cosine = w / h, c[:, 2:] / h**2, np.cos(wave.inside)
        force, grows = self.forcing(omega)
        with np.errstate(over="ignore", invalid="ignore"):  # far from an orbit a law may overflow
            f, f_u, g, g_u = self.equation.terms(u)
        K, D = f_u + 2.0 * zeta * omega * g_u * w, 2.0 * zeta * omega * g / h
        residual = omega**2 * a - force * cosine + f + 2.0 * zeta * omega * g * w
        by_omega = 2.0 * omega * a - grows * cosine + 2.0 * zeta * g * w
        matrix = K[..., None] * _INSIDE[:, 0, 2:] + D[..., None] * _INSIDE[:, 1, 2:]
        matrix[:, _P, _P] += (omega / h) ** 2
        try:
            x = np.linalg.solve(matrix, -np.stack([residual, by_omega, K, h * (K * _C + D)], axis=-1))
        except np.linalg.LinAlgError as error:
            raise ConvergenceError("singular Jacobian") from error
        if not np.isfinite(x).all():
            raise ConvergenceError("the motion is not finite")
        # maps of (1, change of Omega, of u, of w) from node to node, and by prefix products from the first node
        chain = np.zeros((len(c), 4, 4))
        chain[:] = np.eye(4)
        chain[:, 2] += _END_U[2:] @ x
        chain[:, 3] += _END_W[2:] @ x / h
        chain[:, 2, 3] += h[:, 0]
        chain[:, 2, 0] += c @ _END_U - np.roll(c[:, 0], -1)
        chain[:, 3, 0] += c @ _END_W / h[:, 0] - np.roll(c[:, 1] / h[:, 0], -1)
        reach = 1
        while reach < len(chain):
            chain[reach:] = chain[reach:] @ chain[:-reach]
            reach *= 2
        end = chain[-1, 2:]
        node = np.concatenate([np.eye(4)[None], chain[:-1]])
        maps = np.concatenate([node[:, 2:3], h[..., None] * node[:, 3:], x @ node], axis=1)
        # unknowns: change of Omega, of u and of w at the phase 0
        system = np.vstack([np.hstack([-end[:, 1:2], np.eye(2) - end[:, 2:]]), [rate, 0.0, 0.0]])
        known = np.array([[end[0, 0], 0.0], [end[1, 0], 0.0], [0.0, 1.0]])
        if not fixed:
            plane = (h[:, 0] * wave.c[:, 0, 1] / (TURN * wave.size**2)) @ maps[:, 0]
            system[2] = plane[1:] + (rate / omega**2, 0.0, 0.0)
            known[2, 0] = -plane[0]
        try:
            columns = np.vstack([[1.0, 0.0], np.linalg.solve(system, known)])
        except np.linalg.LinAlgError as error:
            raise ConvergenceError("singular Jacobian") from error
        return maps @ columns, columns[1], float(np.trace(end[:, 2:])), float(np.sum(h * _B * g))
