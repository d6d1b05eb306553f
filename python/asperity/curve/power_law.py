"""Power law P* = k (delta*)^n of a curve, with the intervals of the regression: the misfit of the fit."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from asperity.arrays import Array
from asperity.errors import InputError
from asperity.runtime.display import short_repr
from asperity.units import plus_minus, quantity

CONFIDENCE = 0.95  # of the intervals
_LARGEST_LN = 700.0  # of numbers in floating-point range
_WIDE = 0.3  # part of k above which the two sides of its interval differ in their first digit


@dataclass(frozen=True)
class PowerLawFit:
    """Least-squares fit P* = k (delta*)^n; it depends on the range.

    Attributes:
        k: dimensionless coefficient
        n: exponent
        range: smallest and largest delta* of the fit
        points: number of points
        r2: coefficient of determination
        ci_k: interval of k of the level CONFIDENCE (symmetric in ln k, so always positive)
        ci_n: the same of n

    Examples:
        >>> fit = asp.fit_power_law([0.01, 0.02, 0.04], [0.001, 0.0028, 0.008])
        >>> print(f"P*(0.03) = {fit(0.03):.5f}, K = {fit.stiffness(E_prime=200e9, L=1e-6):.3e} N/m^n")
        P*(0.03) = 0.00518, K = 2.350e+08 N/m^n
    """

    k: float
    n: float
    range: tuple[float, float]
    points: int
    r2: float
    ci_k: tuple[float, float]
    ci_n: tuple[float, float]

    __repr__ = short_repr

    def __call__(self, delta_star: ArrayLike) -> Array:
        """P* at delta*, same shape; 0 where delta* is not positive."""
        return self.k * np.maximum(np.asarray(delta_star, dtype=float), 0.0) ** self.n

    def stiffness(self, E_prime: float, L: float) -> float:
        """K = k A_0 E'/L^n [force/length^n] of F = K delta^n, with A_0 = L^2."""
        return self.k * L**2 * E_prime / L**self.n

    def to_dict(self) -> dict[str, Any]:
        """Section "fit" of summary.json."""
        return {
            "k": self.k,
            "n": self.n,
            "range": list(self.range),
            "points": self.points,
            "r2": self.r2,
            "ci": {"k": list(self.ci_k), "n": list(self.ci_n), "confidence": CONFIDENCE},
        }


def with_misfit(fit: Mapping[str, Any]) -> tuple[str, str]:
    """k and n with their intervals and the digits that these allow.

    Args:
        fit: section "fit" of summary.json

    Examples:
        >>> from asperity.curve.power_law import with_misfit
        >>> with_misfit({"k": 35.179, "n": 2.2203, "ci": {"k": [29.4, 41.9], "n": [2.10, 2.34]}})
        ('35 ± 19 %', '2.22 ± 0.12')
        >>> with_misfit({"k": 35.179, "n": 2.2203})
        ('35.18', '2.22')

        The interval of k is symmetric in ln k, and shown by its ends where it is wide:

        >>> with_misfit({"k": 35.179, "n": 2.2203, "ci": {"k": [11.0, 112.5], "n": [1.9, 2.54]}})
        ('35 (11 to 110)', '2.22 ± 0.32')
    """
    k, n, intervals = fit["k"], fit["n"], fit.get("ci") or {}
    low, high = intervals.get("k", (math.nan, math.nan))
    half = 0.5 * (intervals["n"][1] - intervals["n"][0]) if "n" in intervals else math.nan
    bar = high / k - 1.0  # the greater side: k is positive
    if bar > _WIDE:
        k_text, *ends = (quantity(float(f"{value:.2g}"), "") for value in (k, low, high))
        return f"{k_text} ({ends[0]} to {ends[1]})", plus_minus(n, half)
    return quantity(k, "", bar=bar if bar > 1e-6 else math.nan), plus_minus(n, half)


def fit_power_law(delta_star: ArrayLike, P_star: ArrayLike) -> PowerLawFit:
    """Fit P* = k (delta*)^n by least squares of P*.

    They begin with the regression of the logarithms (Levenberg-Marquardt in ln k and n, then Newton steps). The
    intervals come from the residual variance and Student's t with points - 2 degrees of freedom (Seber and Wild,
    Nonlinear Regression, 1989, section 5.1), for points that scatter independently. Those of one smooth curve do not:
    there the intervals measure the misfit of the law rather than chance.

    Args:
        delta_star: delta/L, positive, at least 3 different values, shape (m,)
        P_star: P/(A_0 E'), positive, shape (m,)

    Raises:
        InputError: values that are not positive and finite, fewer than 3 different approaches, or k beyond
            floating-point range

    Examples:
        >>> delta = np.array([0.01, 0.02, 0.03, 0.04])
        >>> fit = asp.fit_power_law(delta, 2.0 * delta**1.5 * [1.01, 0.99, 1.0, 1.0])
        >>> print(f"n = {fit.n:.3f} ({fit.ci_n[0]:.2f} to {fit.ci_n[1]:.2f})")
        n = 1.505 (1.47 to 1.54)
    """
    from scipy.optimize import least_squares
    from scipy.special import stdtrit

    d, p = _fit_data(delta_star, P_star)
    # scaled by the largest values for good conditioning in any units and for steep laws
    x, y = np.log(d / d.max()), p / p.max()
    design = np.stack([np.ones_like(x), x], axis=1)
    solution = least_squares(
        lambda s: np.exp(design @ s) - y, np.linalg.lstsq(design, np.log(y), rcond=None)[0],
        jac=lambda s: np.exp(design @ s)[:, None] * design, method="lm", xtol=1e-15, ftol=1e-15, gtol=1e-15,
    ).x  # fmt: skip
    solution = _polished(solution, design, y)
    model = np.exp(design @ solution)
    jacobian = model[:, None] * design
    rss = float(np.sum((y - model) ** 2))
    tss = float(np.sum((y - y.mean()) ** 2))
    covariance = np.linalg.inv(jacobian.T @ jacobian) * (rss / (d.size - 2))
    # ln k = s_0 + ln(max p) - n ln(max d)
    back = np.array([[1.0, -math.log(d.max())], [0.0, 1.0]])
    covariance = back @ covariance @ back.T
    ln_k, n = back @ solution + [math.log(p.max()), 0.0]
    if abs(ln_k) > _LARGEST_LN:
        raise InputError(
            f"the power law through the points has n = {n:g} and ln k = {ln_k:g}, beyond floating-point range: scale "
            "approach and force to about 1"
        )
    spread_k, spread_n = np.sqrt(np.diag(covariance)) * stdtrit(d.size - 2, (1 + CONFIDENCE) / 2)
    return PowerLawFit(
        k=math.exp(ln_k),
        n=float(n),
        range=(float(d.min()), float(d.max())),
        points=int(d.size),
        r2=1.0 - rss / tss if tss > 0 else math.nan,
        ci_k=(_exp(ln_k - spread_k), _exp(ln_k + spread_k)),
        ci_n=(float(n - spread_n), float(n + spread_n)),
    )


def _exp(x: float) -> float:
    """Exponential; inf beyond floating-point range."""
    return math.exp(x) if x < _LARGEST_LN else math.inf


def _polished(solution: Array, design: Array, y: Array) -> Array:
    """Converge to rounding by Newton's method, so that the same points in other units give the same exponent."""
    for _ in range(3):
        model = np.exp(design @ solution)
        curvature = design.T @ ((model * (2.0 * model - y))[:, None] * design)
        if not np.linalg.det(curvature) > 0.0 or not curvature[0, 0] > 0.0:
            break  # not a minimum
        solution = solution - np.linalg.solve(curvature, design.T @ (model * (model - y)))
    return solution


def _fit_data(delta_star: ArrayLike, P_star: ArrayLike) -> tuple[Array, Array]:
    d, p = (np.asarray(values, dtype=float) for values in (delta_star, P_star))
    if d.ndim != 1 or d.shape != p.shape:
        raise InputError(f"A fit needs two lists of equal length, not shapes {d.shape}, {p.shape}.")
    for name, values in (("delta*", d), ("P*", p)):
        bad = np.flatnonzero(~((values > 0) & np.isfinite(values)))
        if bad.size:
            raise InputError(
                f"{name} = {values[bad[0]]:g} at point {bad[0]}: a power law is fitted to "
                "positive, finite values only; leave out points before first touch."
            )
    if np.unique(d).size < 3:
        raise InputError(
            f"{np.unique(d).size} different approaches: a power law needs at least 3; use more load steps."
        )
    return d, p


def interface_approach(delta: ArrayLike, force: ArrayLike, *, height: float, area: float, modulus: float) -> Array:
    """Approach of the rough interface alone, delta - P h_b/(A_0 M) [length].

    The approach of flat and base contains the elastic compression of the whole block, of height h_b on the area A_0;
    its modulus M is E (1-nu)/((1+nu)(1-2 nu)) with sides u.n = 0, E with free sides.
    """
    return np.asarray(delta, float) - np.asarray(force, float) * height / (area * modulus)
