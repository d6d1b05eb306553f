"""Equation of motion of a mass on a contact, which everything else integrates or balances.

    u'' + 2 zeta g(u) u' + f(u) = F^ cos(Omega tau)

The displacements are cut into cells, in each of which f and g are smooth: ln F is a cubic in ln(1 + u), or f a cubic
in u (flight, and a Taylor law), and g is linear in u, or in the contact force.
"""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property
from itertools import pairwise
from math import exp, log
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from asperity.arrays import Array
from asperity.errors import InputError
from asperity.force_law.damping import Damping, LoopDamping
from asperity.force_law.law import Law
from asperity.force_law.taylor import TaylorLaw
from asperity.runtime.display import short_repr

_SMALLEST = 1e-75  # its cube must not underflow
_SMALL = 0.05  # below this |u| the potential is integrated: differences of potentials cancel
_APART = 1e-13  # distance of edges that are one
_CLOSEST = 1e-9  # u + 1 at which a contact of infinite initial stiffness is lost: its force there is a jump
_GAUSS_X, _GAUSS_W = np.polynomial.legendre.leggauss(16)


@dataclass(frozen=True)
class Restoring:
    """Normal form of a law about a preload: the restoring force f(u) with f(0) = 0, f'(0) = 1.

    Attributes:
        law: static law
        load: preload W (force)
        z_s: static deflection (length)
        scale: z_s F'(z_s) (force); F^ = F / scale
        n_loc: local exponent, scale / W
        a2, a3: coefficients of f = u + a2 u^2 + a3 u^3 + ...
        kappa: backbone curvature, omega/omega_s = 1 + kappa a^2

    Raises:
        InputError: load or static deflection beyond floating-point range, or stiffness not positive
        RangeError: the law does not reach the load
    """

    law: Law
    load: float
    z_s: float = field(init=False)
    scale: float = field(init=False)
    n_loc: float = field(init=False)
    a2: float = field(init=False)
    a3: float = field(init=False)
    kappa: float = field(init=False)

    __repr__ = short_repr

    def __post_init__(self) -> None:
        z = self.law.deflection(self.load)
        if not all(_SMALLEST < value < 1.0 / _SMALLEST for value in (z, self.load)):
            raise InputError(
                f"the static deflection is {z:g} under load = {self.load:g}, beyond floating-point range: both must "
                f"lie between {_SMALLEST:g} and {1.0 / _SMALLEST:g}; choose another load or other units"
            )
        p1, p2, p3 = self.law.derivatives(z)
        if not p1 > 0:
            raise InputError(f"the law has stiffness {p1:g} at the operating point; it must be positive")
        values = (z, z * p1, z * p1 / self.load, z * p2 / (2 * p1), z * z * p3 / (6 * p1), self.law.kappa(z))
        for name, value in zip(("z_s", "scale", "n_loc", "a2", "a3", "kappa"), values, strict=True):
            object.__setattr__(self, name, float(value))

    @property
    def contact(self) -> bool:
        """Whether contact is lost at u = -1."""
        return self.law.contact

    @property
    def known_to(self) -> float:
        """Displacement up to which the law is known; motion beyond it is on a continuation."""
        return self.law.known_to / self.z_s - 1.0

    @property
    def kink(self) -> float:
        """Displacement at which the contact yields again, where the stiffness may jump; inf if it does not."""
        return self.law.yields_at / self.z_s - 1.0

    @property
    def model(self) -> str:
        """ "exact" or "taylor"."""
        return "exact" if self.contact else "taylor"

    def pull(self, u: Array) -> tuple[Array, Array]:
        """Contact force over `scale`, zero in flight, and its derivative with respect to u."""
        force, slope = self.law.both(self.z_s * (1.0 + u))
        return force / self.scale, slope * (self.z_s / self.scale)

    def f(self, u: ArrayLike) -> Array:
        """Restoring force f(u), same shape as `u`."""
        return self.pull(np.asarray(u, float))[0] - 1.0 / self.n_loc

    def df(self, u: ArrayLike) -> Array:
        """Derivative f'(u), same shape as `u`."""
        return self.pull(np.asarray(u, float))[1]

    def potential(self, u: ArrayLike) -> Array:
        """Potential V(u), the integral of f from 0 to u, same shape as `u`."""
        u, rest = np.asarray(u, float), 1.0 / self.n_loc
        inside = np.maximum(u, -1.0) if self.contact else u
        value = self.pulled(inside) - self._still - rest * inside
        small = np.abs(u) < _SMALL
        if small.any():
            value = np.array(value)
            value[small] = self.work(np.zeros(small.sum()), u[small])
        return value + rest * (inside - u)

    def level(self, u: float) -> float:
        """Potential at one displacement."""
        return float(self.potential(u))

    @cached_property
    def _still(self) -> Array:
        """Energy stored in the contact at rest."""
        return self.pulled(0.0)

    @cached_property
    def wall(self) -> float:
        """Potential at separation."""
        return self.level(-1.0)

    def work(self, start: Array, length: Array) -> Array:
        """Integral of f over short intervals, (m,), by Gauss quadrature between the knots of the law."""
        total = np.zeros(start.size)
        if not start.size:
            return total
        knots = self.law.knots / self.z_s - 1.0
        low, high = np.minimum(start, start + length).min(), np.maximum(start, start + length).max()
        inner = knots[(knots > low) & (knots < high)]
        for a, b in pairwise([-np.inf, *inner, np.inf]):
            left, right = (np.clip(edge - start, np.minimum(length, 0.0), np.maximum(length, 0.0)) for edge in (a, b))
            half = 0.5 * (right - left)
            total += half * (self.f((start + left)[:, None] + half[:, None] * (1.0 + _GAUSS_X)) @ _GAUSS_W)
        return np.where(length < 0.0, -total, total)

    def pulled(self, u: ArrayLike) -> Array:
        """Energy stored in the contact, the integral of `pull` from u = -1."""
        z = self.z_s * (1.0 + np.asarray(u, float))
        return self.law.potential(z) / (self.scale * self.z_s)


@dataclass(frozen=True)
class Forcing:
    """Excitation F^ = amplitude Omega^power: 0 for a force, or an acceleration of the base; 2 for its displacement."""

    amplitude: float
    power: int = 0

    def at(self, omega: Any) -> Any:
        """F^ at frequencies Omega."""
        return self.amplitude * omega**self.power

    def rate(self, omega: float) -> float:
        """Its derivative with respect to Omega."""
        return self.power * self.at(omega) / omega


@dataclass(frozen=True)
class Equation:
    """Restoring force and damping.

    Attributes:
        restoring: normal form of the law
        zeta: damping ratio of small motion
        damping: damping model, see `asperity.force_law.damping`
    """

    restoring: Restoring
    zeta: float
    damping: Damping = "always"

    @cached_property
    def cells(self) -> tuple[Array, Array]:
        """Edges (m,) in u, and cells (m + 1, 8) between them as in solver/period_map.cpp."""
        r, rest = self.restoring, 1.0 / self.restoring.n_loc
        edges: Array = np.empty(0)
        rows: Array = np.zeros((1, 8))
        if r.contact:
            x, law = r.law.cells(r.z_s)
            edges = np.append(_CLOSEST - 1.0 if law[0, 2] < 1.0 else -1.0, np.exp(x) / r.z_s - 1.0)
            rows = np.zeros((x.size + 2, 8))
            rows[0, 2] = -rest
            rows[1:, 0], rows[1:, 1] = 1.0, law[:, 0] - np.log(r.z_s)
            rows[1:, 2:6] = law[:, 1:]
            rows[1:, 2] -= np.log(r.scale)
        elif isinstance(r.law, TaylorLaw):
            rows[0, 2:6] = 0.0, 1.0, r.a2, r.a3
        else:
            raise InputError("a law without contact loss must be a TaylorLaw")
        added: Array = np.empty(0)
        lost = edges[0] if edges.size else -1.0
        if isinstance(self.damping, LoopDamping):
            at = np.array([0.0, *self.damping.deflection]) / r.z_s
            added = np.concatenate([[lost], -at[(at > 0) & (at < 1.0)], at])
        elif self.damping == "contact":
            added = np.array([lost])
        cuts = np.unique(np.concatenate([edges, added]))
        cuts = cuts[np.diff(cuts, prepend=-np.inf) > _APART]
        ends = np.concatenate([cuts[:1] - 2.0, cuts, cuts[-1:] + 2.0]) if cuts.size else np.array([-1.0, 1.0])
        inside = 0.5 * (ends[1:] + ends[:-1])
        rows = rows[np.searchsorted(edges, inside)]
        if self.damping != "hunt-crossley":  # there g is the contact force over the preload
            near = np.minimum(0.25 * np.min(np.diff(cuts), initial=1.0), 1e-3)
            one, two = (rate(r, self.damping, inside + d) for d in (-near, near))
            rows[:, 7] = (two - one) / (2.0 * near)
            rows[:, 6] = 0.5 * (one + two) - rows[:, 7] * inside
        return cuts, np.ascontiguousarray(rows)

    @cached_property
    def of_force(self) -> float:
        """Damping factor over the contact force, where the damping follows that."""
        return self.restoring.n_loc if self.damping == "hunt-crossley" else 0.0

    @cached_property
    def acceleration(self) -> Callable[[float, float], float]:
        """Acceleration without forcing, -f - 2 zeta g v, at a displacement and a speed, as in solver/period_map.cpp."""
        edges, rows = list(map(float, self.cells[0])), [tuple(map(float, row)) for row in self.cells[1]]
        rest, of_force, twice = 1.0 / self.restoring.n_loc, self.of_force, 2.0 * self.zeta

        def acceleration(u: float, v: float) -> float:
            logarithmic, start, a, b, c, d, g0, g1 = rows[bisect_left(edges, u)]
            if logarithmic:
                t = log(1.0 + u) - start
                pull = exp(a + t * (b + t * (c + t * d)))
            else:
                pull = rest + a + u * (b + u * (c + u * d))
            return float(rest - pull - twice * (g0 + g1 * u + of_force * pull) * v)

        return acceleration


def rate(restoring: Restoring, damping: Damping, u: Array) -> Array:
    """Damping factor g(u), same shape as `u`."""
    if isinstance(damping, LoopDamping):
        added = damping.coefficient(restoring.z_s * np.abs(u)) / damping.background
        return np.where(u > -1.0, 1.0 + added, 0.0)
    if damping == "always":
        return np.ones_like(u)
    if damping == "contact":
        return np.where(u > -1.0, 1.0, 0.0)
    return restoring.n_loc * restoring.pull(u)[0]
