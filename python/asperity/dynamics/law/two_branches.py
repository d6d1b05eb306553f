# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

"""Law of a contact that has yielded: reversible up to the greatest force it has met, yielding above."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from asperity.arrays import Array
from asperity.dynamics.law.law import SMALL, Law, dense
from asperity.errors import InputError

_GAUSS_X, _GAUSS_W = np.polynomial.legendre.leggauss(16)


@dataclass(frozen=True, eq=False)
class TwoBranchLaw(Law):
    """Unloading branch below the greatest force that the contact has met, loading curve above.

    The loading curve is shifted along the approach so that both branches meet. As a spring the law is reversible: above
    `reached` it gives the first cycle. Then the contact has met a greater force, and moves on the unloading branch of
    that force.

    Attributes:
        below: law of unloading and reloading, which reaches `reached`.
        above: law of the first loading, which reaches `reached`.
        reached: greatest force that the contact has met (force).
        shift: approach of `above` less that of `below` where they meet (length, derived).
        yields_at: approach at which the contact yields again (length, derived).

    Raises:
        InputError: `reached` is not positive.
        RangeError: a branch does not reach it.

    Examples:
        A contact that was loaded to 1 and answers 1.5 times as stiffly below:

        >>> law = asp.dynamics.TwoBranchLaw(asp.PowerLaw(1.5, K=2.0), asp.PowerLaw(1.0), reached=1.0)
        >>> z = law.deflection(1.0)
        >>> round(z, 4), law.stiffness([0.999 * z, 1.001 * z]).round(3)
        (0.63, array([2.38, 1.  ]))
        >>> round(float(law.force(z + 0.1)), 6)
        1.1
    """

    below: Law
    above: Law
    reached: float
    shift: float = field(init=False)
    yields_at: float = field(init=False)

    def __post_init__(self) -> None:
        if not (np.isfinite(self.reached) and self.reached > 0):
            raise InputError(f"reached = {self.reached:g} is not legal: it must be finite and greater than 0")
        top = self.below.deflection(self.reached)
        object.__setattr__(self, "shift", self.above.deflection(self.reached) - top)
        object.__setattr__(self, "yields_at", top)

    @property
    def z_range(self) -> tuple[float, float]:
        return (0.0, self.above.z_range[1] - self.shift)

    @property
    def extrapolate(self) -> bool:  # type: ignore[override]
        """Whether approaches beyond the last point of the loading curve are allowed."""
        return self.above.extrapolate

    @property
    def scalar(self) -> bool:  # type: ignore[override]
        """Whether `at` of both branches works on plain floats."""
        return self.below.scalar and self.above.scalar

    @property
    def known_to(self) -> float:
        return self.above.known_to - self.shift

    @property
    def knots(self) -> Array:
        """Approaches at which the law is not smooth (length)."""
        low = np.asarray(getattr(self.below, "knots", ()), float)
        high = np.asarray(getattr(self.above, "knots", ()), float) - self.shift
        return np.concatenate([low[low < self.yields_at], [self.yields_at], high[high > self.yields_at]])

    def both(self, z: Array) -> tuple[Array, Array]:
        z = np.asarray(z, float)
        top = self.yields_at
        low, high = self.below.both(np.minimum(z, top)), self.above.both(np.maximum(z, top) + self.shift)
        return np.where(z <= top, low[0], high[0]), np.where(z <= top, low[1], high[1])

    def push(self, z: Array) -> Array:
        return np.interp(z, *self._dense)

    def at(self, z: float) -> tuple[float, float]:
        return self.below.at(z) if z <= self.yields_at else self.above.at(z + self.shift)

    def well(self, u: Array, z_s: float, load: float, scale: float) -> Array:
        kink = self.yields_at / z_s - 1.0
        if kink < 0.0:
            return super().well(u, z_s, load, scale)
        u = np.asarray(u, float)
        value = self.below.well(np.minimum(u, kink), z_s, load, scale)
        far = u > kink
        if np.any(far):  # split at the kink, which no quadrature across it would see
            more = 0.5 * (u[far] - kink)
            force = self.above.both(self.shift + z_s * (1.0 + kink + more[..., None] * (1.0 + _GAUSS_X)))[0]
            value = np.array(value)
            value[far] += more * ((force - load) / scale @ _GAUSS_W)
            wide = far & (u > kink + SMALL)
            start = self.yields_at + self.shift
            rise = self.above.potential(z_s * (1.0 + u[wide]) + self.shift) - self.above.potential(start)
            base = self.below.well(np.array(kink), z_s, load, scale)
            value[wide] = base + (rise / z_s - load * (u[wide] - kink)) / scale
        return np.asarray(value)

    def potential(self, z: ArrayLike) -> Array:
        z = np.asarray(z, float)
        start = self.yields_at + self.shift
        more = self.above.potential(np.maximum(z, self.yields_at) + self.shift) - self.above.potential(start)
        return np.asarray(self.below.potential(np.minimum(z, self.yields_at)) + more)

    def derivatives(self, z: float) -> tuple[float, float, float]:
        if z <= self.yields_at * (1 + 1e-12):
            return self.below.derivatives(min(z, self.yields_at))
        return self.above.derivatives(z + self.shift)

    def deflection(self, load: float) -> float:
        if load <= self.reached * (1 + 1e-12):
            return self.below.deflection(min(load, self.reached))
        return self.above.deflection(load) - self.shift

    def doubts(self, load: float) -> tuple[str, ...]:
        return self.below.doubts(min(load, self.reached))

    def describe(self) -> str:
        return f"{self.below.describe()}, yielding above {self.reached:.5g}"

    @cached_property
    def _dense(self) -> tuple[Array, Array]:
        known = self.known_to if np.isfinite(self.known_to) else 0.0
        return dense(self, max(self.yields_at, known), self.knots)
