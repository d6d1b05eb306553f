"""Equation of motion of a mass on a contact, which everything else integrates or balances.

    u'' + 2 zeta g(u) u' + f(u) = F^ cos(Omega tau)

With ``G(u)``, the integral of the damping factor g from 0, and Lienard's variable ``w = u' + 2 zeta G(u)``, the motion
obeys ``u' = w - 2 zeta G(u), w' = F^ cos(Omega tau) - f(u)``, which is continuous at contact loss for every damping.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from asperity.arrays import Array
from asperity.errors import InputError
from asperity.force_law.damping import Damping, LoopDamping
from asperity.force_law.law import Law
from asperity.runtime.display import short_repr

_SMALLEST = 1e-75  # its cube must not underflow
_SMALL = 0.05  # below this |u| the potential is integrated: differences of potentials cancel
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
    def singular(self) -> bool:
        """Whether the stiffness is infinite at contact loss (n < 1)."""
        return self.contact and float(self.df(np.array([-1.0 + 1e-12]))[0]) > 10.0

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
        value = self.pulled(inside) - self.pulled(0.0) - rest * inside
        small = np.abs(u) < _SMALL
        if small.any():
            kink = np.minimum(u[small], max(self.kink, 0.0))
            value = np.array(value)
            value[small] = 0.0
            for start, half in ((0.0, 0.5 * kink), (kink, 0.5 * (u[small] - kink))):
                at = np.asarray(start)[..., None] + half[..., None] * (1.0 + _GAUSS_X)
                value[small] += half * (self.f(at) @ _GAUSS_W)
        return value + rest * (inside - u)

    def pulled(self, u: ArrayLike) -> Array:
        """Energy stored in the contact, the integral of `pull` from u = -1."""
        z = self.z_s * (1.0 + np.asarray(u, float))
        return self.law.potential(z) / (self.scale * self.z_s)


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

    def loss(self, u: float) -> float:
        """2 zeta G(u), the difference between w and the speed, at one displacement."""
        stored = u if self.damping == "always" else float(primitive(self.restoring, self.damping, np.array([u]))[0])
        return 2.0 * self.zeta * stored


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


def primitive(restoring: Restoring, damping: Damping, u: Array) -> Array:
    """Integral G(u) of the damping factor from 0; constant in flight except for "always"."""
    if isinstance(damping, LoopDamping):
        u = np.maximum(u, -1.0)
        added = damping.integral(restoring.z_s * np.abs(u)) / (restoring.z_s * damping.background)
        return np.asarray(u + np.sign(u) * added)
    if damping == "always":
        return u
    if damping == "contact":
        return np.maximum(u, -1.0)
    return restoring.n_loc * restoring.potential(u) + u
