"""Power law of a contact: the fit to a curve as a reversible spring."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from asperity.arrays import Array
from asperity.curve.power_law import PowerLawFit
from asperity.force_law.checks import positive, within
from asperity.force_law.law import Law
from asperity.runtime.display import short_repr

EXPONENT = (0.25, 100.0)  # outside, no practical number of harmonics describes the orbits
COEFFICIENT = (1e-100, 1e100)


@dataclass(frozen=True)
class PowerLaw(Law):
    """``F = K z^n`` for z > 0, zero otherwise.

    Attributes:
        n: exponent, 0.25 to 100
        K: coefficient (force/length^n), 1e-100 to 1e100
        fitted_to: largest approach of the fitted points (length); notes report results beyond it

    Raises:
        InputError: n or K is out of range

    Examples:
        >>> law = asp.PowerLaw(1.5, K=2.0)
        >>> law.force([0.0, 1.0, 4.0])
        array([ 0.,  2., 16.])
        >>> round(law.deflection(16.0), 6), law.n_loc(1.0), round(law.kappa(1.0), 6)
        (4.0, 1.5, -0.041667)
    """

    n: float
    K: float = 1.0
    fitted_to: float = np.inf

    __repr__ = short_repr

    def __post_init__(self) -> None:
        within("n", self.n, EXPONENT)
        within("K", self.K, COEFFICIENT)
        object.__setattr__(self, "known_to", self.fitted_to)

    @classmethod
    def from_fit(cls, fit: PowerLawFit, length: float = 1.0, force: float = 1.0) -> PowerLaw:
        """Law ``F = force * k (z/length)^n`` of a fit in dimensionless variables.

        Args:
            fit: with k, n and range
            length: unit of the approach (L for delta*)
            force: unit of the force (A_0 E' for P*)
        """
        with np.errstate(over="ignore"):
            K = float(force * fit.k * np.float64(length) ** -fit.n)
        return cls(float(fit.n), K, float(fit.range[1] * length))

    def scaled(self, force: float) -> PowerLaw:
        """Law with its force multiplied by a factor."""
        return replace(self, K=self.K * force)

    def both(self, z: Array) -> tuple[Array, Array]:
        s = np.maximum(z, 0.0)
        with np.errstate(divide="ignore", invalid="ignore"):  # n < 1: infinite stiffness at the point of separation
            slope = np.where(s > 0, self.K * s ** (self.n - 1.0), 0.0)
        return slope * s, self.n * slope

    def potential(self, z: ArrayLike) -> Array:
        return self.K * np.maximum(np.asarray(z, float), 0.0) ** (self.n + 1.0) / (self.n + 1.0)

    def derivatives(self, z: float) -> tuple[float, float, float]:
        n, p1 = self.n, self.n * self.K * z ** (self.n - 1.0)
        return p1, (n - 1) * p1 / z, (n - 1) * (n - 2) * p1 / z**2

    def cells(self, about: float) -> tuple[Array, Array]:
        return np.empty(0), np.array([[0.0, np.log(self.K), self.n, 0.0, 0.0]])

    def deflection(self, load: float) -> float:
        with np.errstate(over="ignore"):
            return float(np.float64(positive("load", load) / self.K) ** (1.0 / self.n))

    def describe(self) -> str:
        return f"power law n = {self.n:g}, K = {self.K:g}"
