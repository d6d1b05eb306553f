# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

"""Local polynomial fit of ln F against ln z: the derivatives of a table, with their confidence intervals."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import stdtrit

from asperity.arrays import Array
from asperity.runtime.display import short_repr

_NEAR = 9  # smallest number of points from which the scatter is estimated
_AROUND = float(np.log(1.5))  # distance in ln z within which all points are used
_OF_MEDIAN = 1.4826  # standard deviation of a normal distribution over the median of its magnitude


@dataclass(frozen=True)
class LocalFit:
    """Polynomial fit of ln F against ln z about a point.

    Attributes:
        z: the point (length).
        coefficients: ln F = c_0 + c_1 x + c_2 x^2 + ..., x = ln(z'/z).
        covariance: covariance of the coefficients.
        freedom: degrees of freedom of the residual.
        scatter: standard deviation of ln F about the fit.
        spacing: mean distance of the points in ln z.

    Examples:
        >>> z = np.geomspace(0.1, 1.0, 20)
        >>> fit = asp.TableLaw(z, 3.0 * z**1.5).local_fit(0.5)
        >>> [round(float(d), 4) for d in fit.derivatives()]
        [3.182, 3.182, -3.182]
    """

    z: float
    coefficients: Array
    covariance: Array
    freedom: int
    scatter: float
    spacing: float

    __repr__ = short_repr

    def logarithmic(self) -> Array:
        """Return the first three derivatives of ln F with respect to ln z."""
        c = np.zeros(4)
        c[: self.coefficients.size] = self.coefficients
        return c[1:] * np.array([1.0, 2.0, 6.0])

    def derivatives(self) -> tuple[float, float, float]:
        """Return the first three derivatives of F at z (force/length, /length^2, /length^3)."""
        return log_derivatives(self.logarithmic(), float(np.exp(self.coefficients[0])), self.z)

    def interval(self, quantity: str, confidence: float = 0.95) -> tuple[float, float]:
        """Return the confidence interval of "n_loc" or "kappa" by linear propagation of the covariance."""
        functions = {"n_loc": lambda y: y[0], "kappa": _kappa}
        function = functions[quantity]
        y = self.logarithmic()
        size = self.coefficients.size
        gradient = np.zeros(size)
        for j in range(1, size):
            h = 1e-6 * max(1.0, abs(y[j - 1]))
            up, down = y.copy(), y.copy()
            up[j - 1] += h
            down[j - 1] -= h
            gradient[j] = (function(up) - function(down)) / (2 * h) * (1.0, 2.0, 6.0)[j - 1]
        spread = float(np.sqrt(max(float(gradient @ self.covariance @ gradient), 0.0)))
        half = spread * float(stdtrit(self.freedom, 0.5 * (1 + confidence)))
        return float(function(y)) - half, float(function(y)) + half


def log_derivatives(y: Array, force: float, z: float) -> tuple[float, float, float]:
    """Return the derivatives of F from those of ln F with respect to ln z."""
    a, b, c = y
    q1 = a
    q2 = a * a - a + b
    q3 = a**3 - 3 * a * a + 2 * a + 3 * b * (a - 1) + c
    return q1 * force / z, q2 * force / z**2, q3 * force / z**3


def _kappa(y: Array) -> float:
    p1, p2, p3 = log_derivatives(y, 1.0, 1.0)
    return (3 * p3 / p1 - 5 * (p2 / p1) ** 2) / 48.0


def regress(x: Array, y: Array, degree: int) -> tuple[Array, Array, int]:
    """Fit a polynomial: coefficients (rising powers), their covariance, degrees of freedom."""
    basis = np.vander(x, degree + 1, increasing=True)
    c, *_ = np.linalg.lstsq(basis, y, rcond=None)
    freedom = max(x.size - degree - 1, 1)
    residual = y - basis @ c
    variance = float(residual @ residual) / freedom
    return c, variance * np.linalg.inv(basis.T @ basis), freedom


def roughness(x: Array, y: Array) -> float:
    """Return the relative uncertainty at x = 0 of the slope dy/dx through points that scatter.

    Scatter is the distance of a point from the cubic through its four neighbours; the median near 0 counts
    (after Gasser, Sroka & Jennen-Steinmetz, Biometrika 73 (1986) 625, who take the line through two neighbours).
    A smooth curve has no such scatter, and a few corners, as where the next summit touches, do not change the
    median. A polynomial fitted to many points would misread both as noise.

    Args:
        x, y: at least 5 points in rising order, shape (m,).
    """
    scatter = np.empty(x.size)
    for i in range(x.size):
        first = min(max(i - 2, 0), x.size - 5)
        four = np.delete(np.arange(first, first + 5), i - first)
        away = x[four] - x[i]
        powers = np.vander(away / np.abs(away).max(), increasing=True)
        weights = np.linalg.solve(powers.T, np.array([1.0, 0.0, 0.0, 0.0]))
        scatter[i] = abs(y[i] - weights @ y[four]) / np.sqrt(1.0 + weights @ weights)
    order = np.argsort(np.abs(x), kind="stable")
    count = max(_NEAR, int((np.abs(x) <= _AROUND).sum()))
    near = np.sort(order[:count])
    slope = np.polyfit(x[near], y[near], 1)[0]
    spacing = float(np.abs(x[order[:4]]).max()) / 2.0
    return float(np.sqrt(2.0) * _OF_MEDIAN * np.median(scatter[near]) / (spacing * slope))
