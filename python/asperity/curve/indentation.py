"""Hardness and modulus by the first unloading of an indentation."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from math import hypot, pi, sqrt
from typing import Any

import numpy as np

from asperity.arrays import Array
from asperity.curve.curve import Curve
from asperity.runtime.display import short_repr

UPPER, HIGHER = 0.49, 0.61  # least force over the greatest one, of the rows that are fitted, and of those of the bar
FEWEST = 4  # rows


@dataclass(frozen=True)
class Indentation:
    """Hardness and modulus, and the numbers that they follow from.

    Attributes:
        hardness, error_hardness: greatest force over the projected area of contact there, and bar [force/length^2]
        modulus, error_modulus: E' = E/(1 - nu^2) by Oliver and Pharr, and bar [force/length^2]
        stiffness: dF/d(delta) at the beginning of the unloading, of a half-space [force/length]
        final_depth: approach at which the fitted unloading ends [length]
        exponent: of the fitted unloading
        beta: factor of the shape of the tip
    """

    hardness: float
    error_hardness: float
    modulus: float
    error_modulus: float
    stiffness: float
    final_depth: float
    exponent: float
    beta: float

    __repr__ = short_repr

    def to_dict(self) -> dict[str, Any]:
        """Section of summary.json."""
        return asdict(self)


def oliver_pharr(
    curve: Curve, side: float, *, beta: float = 1.0, compliance: float = 0.0, whole: float = 1.0
) -> Indentation | None:
    """Hardness and modulus of an indentation, E' = sqrt(pi)/2 S/(beta sqrt(A)); None without a first unloading.

    Oliver & Pharr, J. Mater. Res. 7 (1992) 1564: the upper half of the unloading follows B (delta - delta_f)^m, whose
    slope at its beginning is the stiffness S. A is the area of contact of the curve, not one by the shape of the tip.
    The bar has the error of the area, that of the force, and what the upper of these rows alone change in the slope.

    Args:
        curve: with a first unloading
        side: of the patch [length]
        beta: factor of the shape of the tip, 1 for one of revolution
        compliance: of all but a half-space, as of a block of finite height [length/force]
        whole: tips over the part of one on the patch

    Examples:
        >>> delta = np.array([1.0, 2.0, 1.9, 1.8, 1.7, 1.6])
        >>> rows = [{"delta": d, "force": d**1.5, "area_fraction": d} for d in delta]
        >>> names = ["load", "load", *["unload"] * 4]
        >>> curve = asp.Curve.from_rows([row | {"branch": name} for row, name in zip(rows, names)])
        >>> found = oliver_pharr(curve, 1.0)
        >>> round(found.exponent, 4), round(found.stiffness / (1.5 * 2**0.5), 4)
        (1.5, 1.0)
    """
    unloading = next((leg for leg in curve.legs() if leg.branch[-1] == "unload"), None)
    if unloading is None or not unloading.area_fraction[0] > 0.0:
        return None
    force, area = float(unloading.force[0]), float(unloading.area_fraction[0]) * side**2
    depth = unloading.delta - compliance * unloading.force
    rows = [np.flatnonzero(unloading.force >= part * force) for part in (UPPER, HIGHER)]
    if len(rows[0]) < FEWEST:
        return None
    slope, end, exponent = _fit(depth[rows[0]], unloading.force[rows[0]])
    other = _fit(depth[rows[1]], unloading.force[rows[1]])[0] if len(rows[1]) >= FEWEST else slope
    top = int(np.argmax(curve.force))
    of_area = float(np.nan_to_num(unloading.error_area_fraction[0] / unloading.area_fraction[0]))
    of_force = float(np.nan_to_num(curve.bar("P_star", top)))
    modulus = 0.5 * sqrt(pi * whole / area) * slope / beta
    bar = hypot(0.5 * of_area, of_force, other / slope - 1.0)
    hardness = force / area
    return Indentation(
        hardness, hardness * hypot(of_area, of_force), modulus, modulus * bar, slope, end, exponent, beta
    )


def _fit(depth: Array, force: Array) -> tuple[float, float, float]:
    """Slope at the first row, final depth and exponent of B (depth - final)^m through an unloading: least squares."""
    from scipy.optimize import minimize_scalar

    span, logarithm = float(np.ptp(depth)), np.log(force)

    def line(gap: float) -> tuple[Array, float]:
        x = np.log(depth - depth.min() + gap)
        found, left, *_ = np.polyfit(x, logarithm, 1, full=True)
        return found, float(left[0]) if len(left) else 0.0

    best = minimize_scalar(
        lambda g: line(float(np.exp(g)))[1], bounds=np.log([1e-3 * span, 1e3 * span]), method="bounded"
    )
    gap = float(np.exp(best.x))
    exponent = float(line(gap)[0][0])
    return exponent * float(force[0]) / (float(depth[0] - depth.min()) + gap), float(depth.min()) - gap, exponent
