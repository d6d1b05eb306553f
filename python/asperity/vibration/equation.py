"""Equation of motion of a mass on a contact, u'' + 2 zeta g(u) u' + f(u) = F^ cos(Omega tau).

The displacement u = (z - z_s)/z_s is positive in compression, and contact is lost at u = -1. With g(0) = 1 zeta is the
damping ratio of small motion:

    "always"         g = 1                     a dashpot to ground; limits every resonance
    "contact"        g = 1 in contact, else 0  acts only while the bodies touch
    "hunt-crossley"  g = F_s / W               proportional to the contact force (Hunt & Crossley 1975)
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from asperity.arrays import Array
from asperity.errors import InputError
from asperity.model.dynamics import DAMPING
from asperity.model.limits import one_of, positive
from asperity.runtime.display import short_repr
from asperity.vibration.law import Law

TURN = 2.0 * np.pi
_SMALLEST = 1e-75  # of the static deflection, whose cube must not underflow
_RAMP = 1e-3  # of u, from separation, over which a damper in contact begins to act
_BENT = 2.0  # change of the second derivative of f at a knot from where the mesh of an orbit has a node there
_BESIDE = 1e-4  # distance in u at which that change is measured


@dataclass(frozen=True)
class Equation:
    """A law about a preload in its normal form, with damping and forcing.

    The restoring force is f(u) with f(0) = 0, f'(0) = 1.

    Attributes:
        law: static law, force over approach
        load: preload W (force); default that of the law
        zeta: damping ratio of small motion, 0 to below 1
        damping: one of `model.dynamics.DAMPING`
        F_hat: F/(n_loc W) of a force, b/z_s of a displacement of the base, m b''/(n_loc W) of its acceleration
        excitation: one of `model.dynamics.EXCITATIONS`
        z_s: static deflection (length)
        scale: z_s F'(z_s) (force); F^ = F / scale
        n_loc: local exponent, scale / W
        a2: coefficient of f = u + a2 u^2 + ...
        kappa: backbone curvature, omega/omega_s = 1 + kappa a^2

    Raises:
        InputError: an argument, load or static deflection is not legal, or the stiffness not positive
        RangeError: the law does not reach the load
    """

    law: Law
    load: float = None  # type: ignore[assignment]  # that of the law
    zeta: float = 0.01
    damping: str = "always"
    F_hat: float = field(default=0.0, kw_only=True, repr=False)
    excitation: str = field(default="force", kw_only=True, repr=False)
    z_s: float = field(init=False, repr=False)
    scale: float = field(init=False, repr=False)
    n_loc: float = field(init=False, repr=False)
    a2: float = field(init=False, repr=False)
    kappa: float = field(init=False, repr=False)

    __repr__ = short_repr

    def __post_init__(self) -> None:
        if not isinstance(self.law, Law):
            raise InputError(f"law must be a contact law (PowerLaw, CurveLaw, ...), got {type(self.law).__name__}")
        positive("zeta", self.zeta, zero=True)
        if self.zeta >= 1:
            raise InputError(f"zeta = {self.zeta:g} is not legal: it must be below 1")
        one_of("damping", self.damping, DAMPING)
        load = positive("load", self.law.default_load if self.load is None else self.load)
        z = self.law.deflection(load)
        if not all(_SMALLEST < value < 1.0 / _SMALLEST for value in (z, load)):
            raise InputError(
                f"the static deflection is {z:g} under load = {load:g}, beyond floating-point range: both must "
                f"lie between {_SMALLEST:g} and {1.0 / _SMALLEST:g}; choose another load or other units"
            )
        _, stiffness, n_loc, kappa = map(float, self.law.at_load(load))
        if not stiffness > 0:
            raise InputError(f"the law has stiffness {stiffness:g} at the operating point; it must be positive")
        a2 = z * self.law.derivatives(z)[1] / (2 * stiffness)
        derived = {"load": load, "z_s": z, "scale": z * stiffness, "n_loc": n_loc, "a2": a2, "kappa": kappa}
        for name, value in derived.items():
            object.__setattr__(self, name, float(value))

    @property
    def contact(self) -> bool:
        """Whether contact is lost at u = -1."""
        return self.law.contact

    @property
    def model(self) -> str:
        """ "exact" or "taylor"."""
        return "exact" if self.contact else "taylor"

    @property
    def known_to(self) -> float:
        """Displacement up to which the law is known; motion beyond it is on a continuation."""
        return self.law.known_to / self.z_s - 1.0

    def f(self, u: ArrayLike) -> Array:
        """Restoring force f(u), same shape as `u`."""
        return (self.law.force(self.z_s * (1.0 + np.asarray(u, float))) - self.load) / self.scale

    def slope(self, u: ArrayLike) -> Array:
        """Derivative f'(u), same shape as `u`."""
        return self.law.slope(self.z_s * (1.0 + np.asarray(u, float))) * (self.z_s / self.scale)

    def rate(self, u: Array, f: Array) -> Array:
        """Damping factor g at displacements and their restoring forces, same shape as `u`."""
        if self.damping == "always":
            return np.ones_like(u)
        if self.damping == "hunt-crossley":
            return 1.0 + self.n_loc * f
        return np.clip((1.0 + u) / _RAMP, 0.0, 1.0)

    def terms(self, u: Array) -> tuple[Array, Array, Array, Array]:
        """The restoring force f, f', the damping factor g and g' at displacements, each of the shape of `u`."""
        f, slope = self.f(u), self.slope(u)
        ramp = ((u > -1.0) & (u < _RAMP - 1.0)) / _RAMP
        growth = {"always": 0.0 * u, "contact": ramp, "hunt-crossley": self.n_loc * slope}
        return f, slope, self.rate(u, f), growth[self.damping]

    @cached_property
    def corners(self) -> Array:
        """Displacements at which f or g is not smooth, rising: contact loss, and knots at which f' bends sharply."""
        knots = np.asarray(self.law.knots, float) / self.z_s - 1.0
        knots = knots[knots > _BESIDE - 1.0]
        before, at, after = (self.slope(knots + side) for side in (-_BESIDE, 0.0, _BESIDE))
        sharp = knots[~(np.abs(after - 2.0 * at + before) < _BENT * _BESIDE)]
        return np.union1d(sharp, [-1.0] * self.contact + [_RAMP - 1.0] * (self.damping == "contact"))

    def forcing(self, omega: Any) -> Any:
        """F^ at frequencies Omega: that of a displacement of the base grows with their square."""
        return self.F_hat * omega ** (2 if self.excitation == "base" else 0)

    def growth(self, omega: Any) -> Any:
        """Its derivative with respect to Omega."""
        return 2.0 * self.F_hat * omega if self.excitation == "base" else 0.0 * omega

    @property
    def amplitude(self) -> str:
        """Amplitude of the excitation, in words."""
        name = {"force": "F^", "base": "base b/z_s", "acceleration": "base b''/(omega_s^2 z_s)"}[self.excitation]
        return f"{name} = {self.F_hat:g}"

    def transmissibility(self, omega: float, first: complex) -> float:
        """Motion of the mass over that of the base, by the first harmonic of u; NaN for a force.

        The base moves by -F^/Omega^2 times the second derivative of its motion: as cos(Omega tau), like the force.
        """
        base = self.forcing(omega) / omega**2
        return np.nan if self.excitation == "force" else float(abs(first + base) / base)
