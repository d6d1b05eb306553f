"""Hardness and modulus of a problem with a tip as its tool, by its first unloading."""

from __future__ import annotations

from dataclasses import dataclass
from math import hypot, nan, pi, sqrt

import numpy as np

from asperity.arrays import Array
from asperity.curve import Curve
from asperity.model.problem import Problem
from asperity.reference.halfspace import added_to_spot
from asperity.surface import Pyramid, Surface
from asperity.surface.shapes import Indenter

#: Factor of the stiffness by the faces of a pyramid: of a flat punch with as many sides, as after much flow (King, Int.
#: J. Solids Struct. 23 (1987) 1657), and of the pyramid on an elastic half-space
BETA = {3: (1.034, 1.175), 4: (1.012, 1.076)}
OF_BLOCK = 0.1  # error of the compliance of the block over it: contacts to 0.28 L^2, blocks of 0.3 L and more
UPPER, HIGHER = 0.49, 0.61  # least force over the greatest one, of the rows that are fitted, and of those of the bar
FEWEST = 4  # rows


@dataclass(frozen=True)
class Indentation:
    """Hardness and modulus, and the numbers that they follow from.

    Attributes:
        hardness, error_hardness: force over the projected area of contact where the unloading begins, and bar
            [force/length^2]
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


def spot_of(surface: Surface) -> tuple[tuple[float, float], float] | None:
    """Place of the only summit [L], and spots over the part of one on the patch; None for another surface."""
    if not isinstance(surface, Indenter):
        return None
    assert surface.centre is not None
    x, y = (c / surface.L for c in surface.centre)
    return (x, y), 2.0 ** sum(c in (0.0, 1.0) for c in (x, y))


def added_by_block(problem: Problem, area_fraction: float) -> float:
    """Approach that the block adds to that of a spot on a half-space, over L and P*; nan without an area.

    Args:
        problem: whose composite surface has one summit
        area_fraction: of the part of its spot on the patch
    """
    found = spot_of(problem.composite)
    assert found is not None
    (x, y), whole = found
    radius, L = sqrt(whole * area_fraction / pi), problem.surface.L
    if not radius > 0.0:
        return nan
    height = (problem.height + float(problem.surface.height(x * L, y * L)) - problem.surface.mean()) / L
    return added_to_spot(radius, (x, y), height, problem.material.nu, problem.sides)


def indentation_of(problem: Problem, curve: Curve) -> Indentation | None:
    """Hardness and modulus by the first unloading of a tip; None without one, see `oliver_pharr`."""
    spot, L = spot_of(problem.rigid), problem.surface.L
    if spot is None or spot_of(problem.composite) is None or not len(curve):
        return None
    unit = added_by_block(problem, float(curve.area_fraction[int(curve.force.argmax())]))
    beta = BETA[problem.rigid.faces] if isinstance(problem.rigid, Pyramid) else (1.0, 1.0)
    compliance = unit / (L * problem.material.reduced_modulus)
    return oliver_pharr(curve, L, beta=beta, compliance=compliance, whole=spot[1]) if unit == unit else None


def oliver_pharr(
    curve: Curve, side: float, *, beta: tuple[float, float] = (1.0, 1.0), compliance: float = 0.0, whole: float = 1.0
) -> Indentation | None:
    """Hardness and modulus of an indentation, E' = sqrt(pi)/2 S/(beta sqrt(A)); None without a first unloading.

    Oliver & Pharr, J. Mater. Res. 7 (1992) 1564: the upper half of the unloading follows B (delta - delta_f)^m, whose
    slope at its beginning is the stiffness S. A is the area of contact of the curve, not one by the shape of the tip.
    The bar has the error of the area, that of the force, what the upper of these rows alone change in the slope, and a
    tenth of what the compliance changes; half the range of beta, at whose end an elastic solid is, adds to it.

    Args:
        curve: with a first unloading
        side: of the patch [length]
        beta: least and greatest factor of the shape of the tip, 1 for one of revolution; their mean counts
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
    middle, of_shape = 0.5 * sum(beta), (beta[1] - beta[0]) / sum(beta)
    modulus = 0.5 * sqrt(pi * whole / area) * slope / middle
    bar = of_shape + hypot(0.5 * of_area, of_force, other / slope - 1.0, OF_BLOCK * slope * compliance)
    hardness = force / area
    return Indentation(
        hardness, hardness * hypot(of_area, of_force), modulus, modulus * bar, slope, end, exponent, middle
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
