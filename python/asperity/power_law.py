"""The power law P* = k (delta*)^n of a curve, with its confidence intervals."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from asperity.errors import InputError

Array = NDArray[Any]


@dataclass(frozen=True)
class PowerLawFit:
    """P* = k (delta*)^n by least squares; meaningless without norm and range.

    Attributes:
        k: dimensionless coefficient.
        n: exponent.
        norm: "linear" (least squares of P*) or "log" (of ln P*).
        range: smallest and largest delta* used.
        points: number of points.
        r2: coefficient of determination, on the scale of the norm.
        ci_k: confidence interval of k (symmetric in ln k, so always positive).
        ci_n: confidence interval of n.
        correlation: of the estimates of ln k and n.
        confidence: level of the intervals.
    """

    k: float
    n: float
    norm: str
    range: tuple[float, float]
    points: int
    r2: float
    ci_k: tuple[float, float]
    ci_n: tuple[float, float]
    correlation: float
    confidence: float

    def __call__(self, delta_star: ArrayLike) -> Array:
        """Return P* at delta*; 0 where delta* is not positive."""
        return self.k * np.maximum(np.asarray(delta_star, dtype=float), 0.0) ** self.n

    def stiffness(self, E_prime: float, L: float) -> float:
        """Return K = k A_0 E'/L^n (force/length^n) of F = K delta^n, with A_0 = L^2."""
        return self.k * L**2 * E_prime / L**self.n

    def to_dict(self) -> dict[str, Any]:
        """Return the section "fit" of summary.json."""
        return {
            "k": self.k,
            "n": self.n,
            "norm": self.norm,
            "range": list(self.range),
            "points": self.points,
            "r2": self.r2,
            "ci": {"k": list(self.ci_k), "n": list(self.ci_n), "confidence": self.confidence},
        }


def fit_power_law(
    delta_star: ArrayLike,
    P_star: ArrayLike,
    norm: Literal["linear", "log"] = "linear",
    *,
    confidence: float = 0.95,
) -> PowerLawFit:
    """Fit P* = k (delta*)^n.

    The log-log regression is closed form; it also starts the linear-scale least squares (Gauss-
    Newton in ln k and n). Intervals come from the residual variance and Student's t with
    points - 2 degrees of freedom (Seber and Wild, Nonlinear Regression, 1989, section 5.1): they
    assume scatter that is independent from point to point, which the points of one smooth curve
    do not have, so they measure misfit rather than chance.

    Args:
        delta_star: delta/L, positive, at least 3 different values, shape (m,).
        P_star: P/(A_0 E'), positive, shape (m,).
        norm: "linear" or "log".
        confidence: level of the intervals, between 0 and 1.

    Raises:
        InputError: fewer than 3 points, values that are not positive and finite, fewer than 3
            different deflections, or an unknown norm.
    """
    from scipy.optimize import least_squares
    from scipy.stats import t as student

    d, p = _fit_data(delta_star, P_star)
    if norm not in ("linear", "log"):
        raise InputError(f'norm must be "linear" or "log", not {norm!r}.')
    if not 0 < confidence < 1:
        raise InputError(f"confidence must lie between 0 and 1, not {confidence!r}.")
    # scaled by the largest values, so that neither units nor a steep law spoil the conditioning
    x, y = np.log(d / d.max()), p / p.max()
    design = np.stack([np.ones_like(x), x], axis=1)
    solution = np.linalg.lstsq(design, np.log(y), rcond=None)[0]
    if norm == "linear":
        solution = least_squares(
            lambda s: np.exp(design @ s) - y,
            solution,
            jac=lambda s: np.exp(design @ s)[:, None] * design,
            method="lm",
            xtol=1e-15,
            ftol=1e-15,
            gtol=1e-15,
        ).x
        model = np.exp(design @ solution)
        jacobian, target = model[:, None] * design, y
    else:
        model, jacobian, target = design @ solution, design, np.log(y)
    rss = float(np.sum((target - model) ** 2))
    tss = float(np.sum((target - target.mean()) ** 2))
    covariance = np.linalg.inv(jacobian.T @ jacobian) * (rss / (d.size - 2))
    # ln k = s_0 + ln(max p) - n ln(max d)
    back = np.array([[1.0, -math.log(d.max())], [0.0, 1.0]])
    covariance = back @ covariance @ back.T
    ln_k, n = back @ solution + [math.log(p.max()), 0.0]
    spread_k, spread_n = np.sqrt(np.diag(covariance)) * student.ppf((1 + confidence) / 2, d.size - 2)
    scale = math.sqrt(covariance[0, 0] * covariance[1, 1])
    return PowerLawFit(
        k=math.exp(ln_k),
        n=float(n),
        norm=norm,
        range=(float(d.min()), float(d.max())),
        points=int(d.size),
        r2=1.0 - rss / tss if tss > 0 else math.nan,
        ci_k=(math.exp(ln_k - spread_k), math.exp(ln_k + spread_k)),
        ci_n=(float(n - spread_n), float(n + spread_n)),
        correlation=float(covariance[0, 1] / scale) if scale > 0 else 0.0,
        confidence=confidence,
    )


def _fit_data(delta_star: ArrayLike, P_star: ArrayLike) -> tuple[Array, Array]:
    d, p = (np.asarray(values, dtype=float) for values in (delta_star, P_star))
    if d.ndim != 1 or d.shape != p.shape:
        raise InputError(f"A fit needs two lists of one length, not shapes {d.shape}, {p.shape}.")
    for name, values in (("delta*", d), ("P*", p)):
        bad = np.flatnonzero(~((values > 0) & np.isfinite(values)))
        if bad.size:
            raise InputError(
                f"{name} = {values[bad[0]]:g} at point {bad[0]}: a power law is fitted to "
                "positive, finite values only; leave out points before first touch."
            )
    if np.unique(d).size < 3:
        raise InputError(
            f"{np.unique(d).size} different deflections: a power law needs at least 3; use more load steps."
        )
    return d, p


def interface_deflection(delta: ArrayLike, force: ArrayLike, *, height: float, area: float, modulus: float) -> Array:
    """Return the deflection of the rough interface alone, delta - P h_b/(A_0 M) (length).

    The flat-to-base deflection contains the elastic compression of the block as a whole.

    Args:
        delta: deflection (length).
        force: P (force), same shape.
        height: h_b of the block (length).
        area: A_0 (length^2).
        modulus: M (force/length^2): E (1-nu)/((1+nu)(1-2 nu)) with sides u.n = 0, E with free
            sides.
    """
    return np.asarray(delta, float) - np.asarray(force, float) * height / (area * modulus)
