# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

"""Normal form of a law about a preload: the restoring force of the equations of motion."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from asperity.arrays import Array
from asperity.dynamics.law.law import EXTRAPOLATE, Law
from asperity.errors import InputError, RangeError
from asperity.runtime.display import short_repr

_SMALLEST = 1e-75  # its cube must not underflow


@dataclass(frozen=True)
class Restoring:
    """Normal form of a law about a preload: the restoring force f(u) with f(0) = 0, f'(0) = 1.

    Attributes:
        law: the law.
        load: preload W (force).
        z_s: static deflection (length).
        scale: z_s F'(z_s) (force); F^ = F / scale.
        n_loc: local exponent, scale / W.
        a2, a3: coefficients of f = u + a2 u^2 + a3 u^3 + ...
        kappa: backbone curvature, omega/omega_s = 1 + kappa a^2.
        u_range: smallest and largest displacement u at which the law is known.

    Raises:
        InputError: load or static deflection beyond floating-point range, or stiffness not positive.
        RangeError: the law does not reach the load.

    Examples:
        >>> r = asp.ContactOscillator(asp.PowerLaw(2.0), load=4.0).restoring
        >>> r.z_s, r.n_loc, r.a2
        (2.0, 2.0, 0.5)
        >>> r.f([-2.0, -1.0, 0.0, 1.0])  # contact is lost below u = -1
        array([-0.5, -0.5,  0. ,  1.5])
    """

    law: Law
    load: float
    z_s: float = field(init=False)
    scale: float = field(init=False)
    n_loc: float = field(init=False)
    a2: float = field(init=False)
    a3: float = field(init=False)
    kappa: float = field(init=False)
    u_range: tuple[float, float] = field(init=False)

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
        low, high = self.law.z_range
        if self.law.contact:
            low = -np.inf
        values: dict[str, Any] = {
            "z_s": z,
            "scale": z * p1,
            "n_loc": z * p1 / self.load,
            "a2": z * p2 / (2 * p1),
            "a3": z * z * p3 / (6 * p1),
            "kappa": self.law.kappa(z),
            "u_range": (-np.inf, np.inf) if self.law.extrapolate else (low / z - 1.0, high / z - 1.0),
        }
        for name, value in values.items():
            object.__setattr__(self, name, value if isinstance(value, tuple) else float(value))

    @property
    def singular(self) -> bool:
        """Whether the stiffness is infinite at contact loss (n < 1)."""
        return self.contact and float(self.df(np.array([-1.0 + 1e-12]))[0]) > 10.0

    @property
    def contact(self) -> bool:
        """Whether contact is lost at u = -1."""
        return self.law.contact

    def pull(self, u: Array) -> tuple[Array, Array]:
        """Return the contact force over `scale`, zero in flight, and its derivative with respect to u."""
        force, slope = self.law.both(self.z_s * (1.0 + u))
        return force / self.scale, slope * (self.z_s / self.scale)

    def pull_at(self, u: float) -> tuple[float, float]:
        """Return `pull` at one displacement."""
        force, slope = self.law.at(self.z_s * (1.0 + u))
        return force / self.scale, slope * (self.z_s / self.scale)

    def pull_only(self, u: Array) -> Array:
        """Return the contact force over `scale` alone, for the inner loop of time integration."""
        return self.law.push(self.z_s * (1.0 + u)) / self.scale

    def f(self, u: ArrayLike) -> Array:
        """Return the restoring force f(u), same shape as `u`."""
        return self.pull(np.asarray(u, float))[0] - 1.0 / self.n_loc

    def df(self, u: ArrayLike) -> Array:
        """Return the derivative f'(u), same shape as `u`."""
        return self.pull(np.asarray(u, float))[1]

    def potential(self, u: ArrayLike) -> Array:
        """Return the potential V(u) with V(0) = 0, same shape as `u`."""
        return self.law.well(np.asarray(u, float), self.z_s, self.load, self.scale)

    def pulled(self, u: ArrayLike) -> Array:
        """Return the energy stored in the contact, the integral of `pull` from u = -1."""
        z = self.z_s * (1.0 + np.asarray(u, float))
        return self.law.potential(z) / (self.scale * self.z_s)

    def check_range(self, u_min: float, u_max: float) -> None:
        """Raise `RangeError` if an orbit leaves the range of the law."""
        low, high = self.u_range
        if u_max > high * (1 + 1e-9) or u_min < low:
            worst = u_max if u_max > high else u_min
            raise RangeError(
                f"the orbit reaches u = {worst:.6g}, outside the law, known for u from {low:g} to "
                f"{high:.6g}; choose a smaller preload or amplitude, or {EXTRAPOLATE}"
            )
