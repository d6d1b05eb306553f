"""Periodic orbits by collocation on Gauss points, with a mesh that follows the corners of the motion.

The orbit is u(s) over the phase s = Omega tau. On each interval of the mesh the second derivative a = d2u/ds2 is a
polynomial through the Gauss points, where the equation of motion holds (Ascher, Mattheij & Russell 1995, chapter 5).
Newton's method eliminates a on each interval; a chain of 2 x 2 matrices over the intervals remains, whose product is
the monodromy matrix. The mesh has nodes where the motion passes corners of the law, and between them all intervals
have the same share of the error.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.interpolate import PPoly

from asperity.arrays import Array
from asperity.errors import ConvergenceError
from asperity.vibration.equation import TURN, Equation

_M = 5  # Gauss points on an interval
_NEWTON = 14  # iterations of Newton's method, with those after a change of the mesh
_RTOL = 3e-5  # last Newton step over the amplitude
_ROUGH = 1e-2  # Newton step over the amplitude below which the mesh is changed
_MARGIN = 0.1  # error of an interval of a new mesh, over the allowed error
_GROWTH = (0.25, 2.0)  # of intervals from mesh to mesh
_FEWEST, _MOST = 8, 3000  # intervals
_RESOLVED = 1.5  # longest interval in time, over 1/omega_s: the multipliers are those of small free motion
_BESIDE = 1e-7  # phase between corners that share a node


def _basis() -> tuple[Array, Array, Array, Array, Array]:
    """Gauss points and weights on [0, 1], last two modes, and what maps coefficients of a function to values.

    On an interval of length h the coefficients are u and h u' at its beginning, and h^2 u'' at the Gauss points. They
    map to the powers of the place x in [0, 1], and to u and h u' at the Gauss points and at the end (6, 2, 7).
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
class Orbit:
    """A periodic orbit on a branch, or the guess of one.

    Attributes:
        nodes: phases s = Omega tau between intervals, from 0 to a turn (intervals + 1,)
        corners: those at which u passes a corner of the law
        c: coefficients of u and of the tangent of the branch, see `_basis` (intervals, 7, 2)
        Omega: frequency of the forcing over omega_s
        rate: derivative of Omega along the branch
        trace: of the monodromy matrix over a period of the forcing
        determinant: of that matrix, by the damping
        error: estimated error of du/ds over its amplitude
        moved: distance from the guess, over the amplitude
    """

    nodes: Array
    corners: Array
    c: Array
    Omega: float
    rate: float
    trace: float = np.nan
    determinant: float = np.nan
    error: float = np.nan
    moved: float = np.nan

    @classmethod
    def rest(cls, omega: float) -> Orbit:
        """No motion, as a guess."""
        nodes = np.linspace(0.0, TURN, _FEWEST + 1)
        return cls(nodes, np.empty(0), np.zeros((_FEWEST, _M + 2, 2)), omega, 1.0)

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
        """Piecewise polynomials of the phase: u and the tangent."""
        powers = np.tensordot(_POWERS[::-1], self.c, (1, 1))
        return PPoly.construct_fast(powers / (self.h.T ** _HIGHEST[:, None])[..., None], self.nodes, "periodic")

    def on(self, nodes: Array, corners: Array) -> Orbit:
        """The same functions on another mesh."""
        new = replace(self, nodes=nodes, corners=corners)
        h, first = new.h[..., None], nodes[:-1, None]
        return replace(new, c=np.concatenate([self.at(first), h * self.at(first, 1), h**2 * self.at(new.inside, 2)], 1))

    @property
    def size(self) -> float:
        """Half of the range of u at the nodes."""
        return 0.5 * float(np.ptp(self.c[:, 0, 0])) + 1e-300

    def product(self, one: Array, a: float, other: Array, b: float) -> float:
        """Product of directions, coefficients (intervals, 7) and Omega, over the squares of amplitude and frequency."""
        mean = self.h[:, 0] @ (one[:, 0] * other[:, 0]) / TURN
        return float(mean / self.size**2 + a * b / self.Omega**2)

    def errors(self) -> Array:
        """Error of du/ds on each interval over its amplitude, by the last modes of its derivative (intervals,)."""
        last, steepest = np.abs(self.c[:, 2:, 0] @ _MODES.T) / self.h, 0.5 * np.ptp(self.c[:, 1, 0] / self.h[:, 0])
        return 0.1 * np.maximum(last[:, 1], 0.3 * last[:, 0]) / (steepest + 1e-300)

    def passes(self, levels: Array) -> Array:
        """Phases at which u passes levels, rising (passes,)."""
        s = np.append(np.hstack([self.nodes[:-1, None], self.inside]), TURN)
        u = self.at(s)[:, 0]
        above = u > levels[:, None]
        k, i = np.nonzero(above[:, 1:] != above[:, :-1])
        level, low, high = levels[k], s[i], s[i + 1]
        at = low + (level - u[i]) / (u[i + 1] - u[i]) * (high - low)
        for _ in range(2 if at.size else 0):
            with np.errstate(divide="ignore", invalid="ignore"):
                step = (level - self.at(at)[:, 0]) / self.at(at, 1)[:, 0]
            at = np.clip(at + np.nan_to_num(step), low, high)
        at = np.sort(at)
        return at[np.diff(at, prepend=0.0, append=TURN)[:-1] > _BESIDE]

    def fitted(self, levels: Array, tol: float) -> Orbit:
        """The same functions on a mesh with nodes where u passes levels, whose intervals have errors below `tol`.

        The old mesh is moved with its corners before its intervals are changed.
        """
        corners, longest = self.passes(levels), min(TURN / _FEWEST, _RESOLVED * self.Omega)
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

    @cached_property
    def extremes(self) -> tuple[Array, Array]:
        """Phases of the largest and of the smallest u, and u there."""
        u = PPoly.construct_fast(np.ascontiguousarray(self.at.c[..., 0]), self.nodes)
        s = np.append(self.nodes, u.derivative().roots(discontinuity=False, extrapolate=False))
        values = u(s)
        i = np.array([np.nanargmax(values), np.nanargmin(values)])
        return s[i], values[i]

    @property
    def u_max(self) -> float:
        """Largest displacement."""
        return float(self.extremes[1][0])

    @property
    def u_min(self) -> float:
        """Smallest displacement; contact is lost where it is below -1."""
        return float(self.extremes[1][1])

    @property
    def rise(self) -> float:
        """Derivative of the largest displacement along the branch."""
        return float(self.at(self.extremes[0][0])[1])

    @cached_property
    def first(self) -> complex:
        """First harmonic of u, the real part of first exp(i s)."""
        u = self.c[..., 0] @ _INSIDE[:, 0].T
        return complex(np.sum(self.h * _B * u * np.exp(-1j * self.inside))) / np.pi

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
        return float(self.at(0.0)[0]), float(self.Omega * self.at(0.0, 1)[0])

    @property
    def radius(self) -> float:
        """Largest modulus of a Floquet multiplier."""
        half, root = 0.5 * abs(self.trace), 0.25 * self.trace**2 - self.determinant
        return half + float(np.sqrt(root)) if root > 0 else float(np.sqrt(self.determinant))

    @property
    def stable(self) -> bool:
        """Whether all multipliers lie in the unit circle (up to round-off)."""
        return self.radius <= 1.0 + 1e-7

    def polynomial(self, x: float) -> float:
        """Characteristic polynomial of the multipliers: 0 for 1 at a fold, for -1 at a period doubling."""
        return x * x - self.trace * x + self.determinant

    def __repr__(self) -> str:
        return f"Orbit(Omega = {self.Omega:.6g}, u_max = {self.u_max:.6g}, stable = {self.stable})"


class Collocation:
    """Orbits of an equation.

    Args:
        equation: with its forcing
        tol: allowed error of the slope du/ds on an interval, over its amplitude
    """

    def __init__(self, equation: Equation, tol: float) -> None:
        self.equation, self.tol = equation, tol

    def correct(self, guess: Orbit, *, fixed: bool = False, limit: float = np.inf) -> Orbit:
        """Correct a guess by Newton's method in the plane through it across its tangent, on a mesh that is fitted.

        Args:
            guess: its tangent may have any length
            fixed: the frequency stays
            limit: allowed distance from the guess, over the amplitude

        Raises:
            ConvergenceError: the iteration does not converge, or moves further than `limit`
        """
        here, moved, previous = guess.fitted(self.equation.corners, self.tol), 0.0, np.inf
        for _ in range(_NEWTON):
            change, (step, turns), trace, loss = self._newton(here, fixed)
            here = replace(here, c=here.c + change * (1.0, 0.0), Omega=here.Omega + (not fixed) * float(step))
            size = max(float(np.abs(change[:, 0, 0]).max()) / here.size, abs(step / here.Omega))
            moved += size
            if not moved < limit or not size < 4.0 * previous or not here.Omega > 0.0:
                break
            previous = size
            if size < _RTOL and (errors := here.errors()).max() < self.tol:
                length = here.product(change[..., 1], turns, change[..., 1], turns) ** 0.5
                c, rate = np.stack([here.c[..., 0], change[..., 1] / length], axis=2), float(turns / length)
                determinant = float(np.exp(-2.0 * self.equation.zeta * loss / here.Omega))
                error = float(np.sqrt(np.sum(errors**2)))
                return Orbit(here.nodes, here.corners, c, here.Omega, rate, trace, determinant, error, moved)
            if size < _ROUGH:
                here, previous = here.fitted(self.equation.corners, self.tol), np.inf
        raise ConvergenceError("no convergence in the corrector")

    def _newton(self, at: Orbit, fixed: bool) -> tuple[Array, Array, float, float]:
        """Newton step and tangent of the branch, as coefficients (intervals, 7, 2) and Omega (2,).

        Also the trace of the monodromy matrix, and INT g ds.
        """
        h, c, omega, zeta = at.h, at.c[..., 0], at.Omega, self.equation.zeta
        u, w, a, cosine = c @ _INSIDE[:, 0].T, c @ _INSIDE[:, 1].T / h, c[:, 2:] / h**2, np.cos(at.inside)
        force, grows = self.equation.forcing(omega), self.equation.growth(omega)
        with np.errstate(over="ignore", invalid="ignore"):  # far from an orbit a law may overflow
            f, f_u, g, g_u = self.equation.terms(u)
        K, D = f_u + 2.0 * zeta * omega * g_u * w, 2.0 * zeta * omega * g / h
        residual = omega**2 * a - force * cosine + f + 2.0 * zeta * omega * g * w
        by_omega = 2.0 * omega * a - grows * cosine + 2.0 * zeta * g * w
        matrix = K[..., None] * _INSIDE[:, 0, 2:] + D[..., None] * _INSIDE[:, 1, 2:]
        matrix[:, _P, _P] += (omega / h) ** 2
        # unknowns: change of Omega, of u and of w at the phase 0
        system, known = np.zeros((3, 3)), np.zeros((3, 2))
        system[2, 0], known[2, 1] = at.rate, 1.0
        try:
            x = np.linalg.solve(matrix, -np.stack([residual, by_omega, K, h * (K * _C + D)], axis=-1))
            # maps of (1, change of Omega, of u, of w) from node to node, and by prefix products from the first node
            chain = np.tile(np.eye(4), (len(c), 1, 1))
            chain[:, 2] += _END_U[2:] @ x
            chain[:, 3] += _END_W[2:] @ x / h
            chain[:, 2, 3] += h[:, 0]
            chain[:, 2, 0] += c @ _END_U - np.roll(c[:, 0], -1)
            chain[:, 3, 0] += c @ _END_W / h[:, 0] - np.roll(c[:, 1] / h[:, 0], -1)
            reach = 1
            while reach < len(chain):
                chain[reach:] = chain[reach:] @ chain[:-reach]
                reach *= 2
            end, node = chain[-1, 2:], np.concatenate([np.eye(4)[None], chain[:-1]])
            maps = np.concatenate([node[:, 2:3], h[..., None] * node[:, 3:], x @ node], axis=1)
            system[:2], known[:2, 0] = np.hstack([-end[:, 1:2], np.eye(2) - end[:, 2:]]), end[:, 0]
            if not fixed:
                plane = (h[:, 0] * at.c[:, 0, 1] / (TURN * at.size**2)) @ maps[:, 0]
                system[2], known[2, 0] = plane[1:] + system[2] / omega**2, -plane[0]
            columns = np.vstack([[1.0, 0.0], np.linalg.solve(system, known)])
        except np.linalg.LinAlgError as error:
            raise ConvergenceError("singular Jacobian") from error
        if not np.isfinite(columns).all():
            raise ConvergenceError("the motion is not finite")
        return maps @ columns, columns[1], float(np.trace(end[:, 2:])), float(np.sum(h * _B * g))
