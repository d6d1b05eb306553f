# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

"""Power law of a contact: the fit to a curve as a reversible spring."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from asperity.arrays import Array
from asperity.dynamics.law.checks import positive, within
from asperity.dynamics.law.law import Law
from asperity.errors import InputError
from asperity.runtime.display import short_repr

EXPONENT = (0.25, 100.0)  # outside, no practical number of harmonics describes the orbits
COEFFICIENT = (1e-100, 1e100)


@dataclass(frozen=True)
class PowerLaw(Law):
    """``F = K z^n`` for z > 0, zero otherwise.

    Attributes:
        n: exponent, 0.25 to 100
        K: coefficient (force/length^n), 1e-100 to 1e100
        ci_n: 95 % confidence interval of n, or None
        ci_K: 95 % confidence interval of K, or None
        correlation: correlation of the estimates of ln K and n
        fitted_to: largest approach of the fitted points (length); notes report results beyond it

    Raises:
        InputError: n or K is out of range, or an interval does not contain its value

    Examples:
        >>> law = asp.PowerLaw(1.5, K=2.0)
        >>> law.force([0.0, 1.0, 4.0])
        array([ 0.,  2., 16.])
        >>> round(law.deflection(16.0), 6), law.n_loc(1.0), round(law.kappa(1.0), 6)
        (4.0, 1.5, -0.041667)
    """

    n: float
    K: float = 1.0
    ci_n: tuple[float, float] | None = None
    ci_K: tuple[float, float] | None = None
    correlation: float = 0.0
    fitted_to: float = np.inf

    __repr__ = short_repr

    def __post_init__(self) -> None:
        within("n", self.n, EXPONENT)
        within("K", self.K, COEFFICIENT)
        for name, value, ci in (("n", self.n, self.ci_n), ("K", self.K, self.ci_K)):
            if ci is not None and not (0 < ci[0] <= value <= ci[1]):
                raise InputError(f"ci_{name} = {ci} must be positive and hold {name} = {value:g}")

    @classmethod
    def from_fit(cls, fit: Any, length: float = 1.0, force: float = 1.0) -> PowerLaw:
        """Law ``F = force * k (z/length)^n`` of a `PowerLawFit`, with its confidence intervals.

        Args:
            fit: fit in dimensionless variables, with k, n, ci_k, ci_n, correlation and range
            length: unit of the approach (L for delta*)
            force: unit of the force (A_0 E' for P*)
        """
        shift = np.log(length)
        half_n = 0.5 * (fit.ci_n[1] - fit.ci_n[0])
        half_k = 0.5 * np.log(fit.ci_k[1] / fit.ci_k[0])
        covariance = fit.correlation * half_n * half_k
        half_K = np.sqrt(max(half_k**2 - 2 * shift * covariance + shift**2 * half_n**2, 0.0))
        mixed, product = covariance - shift * half_n**2, half_n * half_K
        with np.errstate(over="ignore"):
            K = float(force * fit.k * np.float64(length) ** -fit.n)
        return cls(
            n=float(fit.n),
            K=K,
            ci_n=(max(float(fit.n - half_n), 1e-12), float(fit.n + half_n)),
            ci_K=(float(K * np.exp(-half_K)), float(K * np.exp(half_K))),
            correlation=float(np.clip(mixed / product, -1, 1)) if product > 0 else 0.0,
            fitted_to=float(fit.range[1] * length),
        )

    def scaled(self, force: float) -> PowerLaw:
        """Law with its force multiplied by a factor, without intervals."""
        return replace(self, K=self.K * force, ci_K=None, ci_n=None)

    @property
    def known_to(self) -> float:
        return self.fitted_to

    def both(self, z: Array) -> tuple[Array, Array]:
        s = np.maximum(z, 0.0)
        with np.errstate(divide="ignore", invalid="ignore"):  # n < 1: infinite stiffness at the point of separation
            slope = np.where(s > 0, self.K * s ** (self.n - 1.0), 0.0)
        return slope * s, self.n * slope

    def push(self, z: Array) -> Array:
        return self.K * np.maximum(z, 0.0) ** self.n

    def at(self, z: float) -> tuple[float, float]:
        if z <= 0.0:
            return 0.0, 0.0
        slope = self.K * z ** (self.n - 1.0)
        return slope * z, self.n * slope

    def potential(self, z: ArrayLike) -> Array:
        return self.K * np.maximum(np.asarray(z, float), 0.0) ** (self.n + 1.0) / (self.n + 1.0)

    def derivatives(self, z: float) -> tuple[float, float, float]:
        n, p1 = self.n, self.n * self.K * z ** (self.n - 1.0)
        return p1, (n - 1) * p1 / z, (n - 1) * (n - 2) * p1 / z**2

    def deflection(self, load: float) -> float:
        with np.errstate(over="ignore"):
            return float(np.float64(positive("load", load) / self.K) ** (1.0 / self.n))

    def describe(self) -> str:
        return f"power law n = {self.n:g}, K = {self.K:g}"
