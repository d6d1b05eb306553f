"""Cubic Taylor series of a law about its static deflection, the model of weakly nonlinear vibration."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from asperity.arrays import Array
from asperity.errors import RangeError
from asperity.force_law.law import Law


@dataclass(frozen=True)
class TaylorLaw(Law):
    """Cubic Taylor series of a law about a static deflection, without contact loss.

    Attributes:
        z_s: static deflection (length)
        load: force at `z_s`
        p: first three derivatives of the force at `z_s` (force/length, /length^2, /length^3)

    Examples:
        >>> asp.TaylorLaw.about(asp.PowerLaw(1.5), load=1.0).p
        (1.5, 0.75, -0.375)
    """

    z_s: float
    load: float
    p: tuple[float, float, float]

    contact = False

    @classmethod
    def about(cls, law: Law, load: float) -> TaylorLaw:
        """Expand `law` about its static deflection under `load` (force)."""
        z_s = law.deflection(load)
        return cls(z_s, float(load), law.derivatives(z_s))

    def both(self, z: Array) -> tuple[Array, Array]:
        return self.at(np.asarray(z, float))

    def at(self, z: Any) -> Any:
        x = z - self.z_s
        p1, p2, p3 = self.p
        return self.load + x * (p1 + x * (p2 / 2 + x * p3 / 6)), p1 + x * (p2 + x * p3 / 2)

    def potential(self, z: ArrayLike) -> Array:
        p1, p2, p3 = self.p
        primitive = np.polynomial.Polynomial([0.0, self.load, p1 / 2, p2 / 6, p3 / 24])
        return np.asarray(primitive(np.asarray(z, float) - self.z_s) - primitive(-self.z_s))

    def derivatives(self, z: float) -> tuple[float, float, float]:
        return self.at(z)[1], self.p[1] + (z - self.z_s) * self.p[2], self.p[2]

    def deflection(self, load: float) -> float:
        if not np.isclose(load, self.load, rtol=1e-12):
            raise RangeError(f"load = {load:g}: this series was expanded about load {self.load:g}")
        return self.z_s

    @property
    def default_load(self) -> float:
        return self.load

    def describe(self) -> str:
        return f"cubic Taylor series about z_s = {self.z_s:g}"

    def rims(self) -> tuple[float, float]:
        """Displacements u of the nearest saddles below and above the well, infinite where there is none.

        Motion beyond them escapes: a property of the truncated series, not of the contact.
        """
        p1, p2, p3 = self.p
        roots = np.roots([p3 * self.z_s**2 / (6 * p1), p2 * self.z_s / (2 * p1), 1.0])
        saddles = roots[np.abs(roots.imag) < 1e-12].real
        return float(saddles[saddles < 0].max(initial=-np.inf)), float(saddles[saddles > 0].min(initial=np.inf))
