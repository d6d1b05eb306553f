"""Indentation of a problem with a tip as its tool."""

from __future__ import annotations

from math import pi, sqrt

from asperity.curve import Curve
from asperity.curve.indentation import Indentation, oliver_pharr
from asperity.model.problem import Problem
from asperity.reference.halfspace import added_to_spot
from asperity.surface import Pyramid, Surface
from asperity.surface.shapes import Indenter

#: Factor of the stiffness of a punch of three and of four sides (King, Int. J. Solids Struct. 23 (1987) 1657).
BETA = {3: 1.034, 4: 1.012}


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
        return float("nan")
    height = (problem.height + float(problem.surface.height(x * L, y * L)) - problem.surface.mean()) / L
    return added_to_spot(radius, (x, y), height, problem.material.nu, problem.sides)


def indentation_of(problem: Problem, curve: Curve) -> Indentation | None:
    """Hardness and modulus by the first unloading of a tip; None without one, see `oliver_pharr`."""
    spot, L = spot_of(problem.rigid), problem.surface.L
    if spot is None or spot_of(problem.composite) is None or not len(curve):
        return None
    unit = added_by_block(problem, float(curve.area_fraction[int(curve.force.argmax())]))
    beta = BETA[problem.rigid.faces] if isinstance(problem.rigid, Pyramid) else 1.0
    compliance = unit / (L * problem.material.reduced_modulus)
    return oliver_pharr(curve, L, beta=beta, compliance=compliance, whole=spot[1]) if unit == unit else None
