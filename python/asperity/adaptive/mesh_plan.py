"""The next mesh, and the limit of the force estimated from two meshes or from two sizes of load steps.

The meshes of a family differ by one number, their scale: the element sizes over those of `guide.sizes_of_spots`. The
force differs from the limit by c scale^p. The order p depends on the scene; the limit is therefore the mean of those
that the ends of a range of orders give, and half their distance is its error bar.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import ceil, log2
from typing import TYPE_CHECKING

import numpy as np

from asperity.arrays import Floats
from asperity.model.load_path import BACKWARD_EULER, MIDPOINT
from asperity.model.settings import H_MAX

if TYPE_CHECKING:
    from asperity.model.problem import Problem

MESH_ORDERS = (1.7, 2.6)  # range of the order of the force in the scale (docs/accuracy.md)
EDGE_ORDER = 1.0  # lowest one where the pressure is singular at the edge of the contact, as that of a flat punch
MESH_ORDER = sum(MESH_ORDERS) / 2.0  # typical one, to plan with
AREA_ORDER = 1.5  # of the bar of the contact area, that of the edges of spots (docs/theory.md)
RATIO = 2.0  # of the first two scales
LEAST_STEP, GREATEST_STEP = 1.25, 3.0  # from one scale to the next
LEAST_RATIO = RATIO / LEAST_STEP  # of two scales: below it scatter hides the order
MOST_MESHES = 4  # of a run
TYPICAL_BAR = 0.0235  # relative, that two meshes of the scales RATIO and 1 give at the worst step
GROWTH = 0.5  # growth of the element size around the contact at scale 1; it goes with the root of the scale
MOST_SCALE = 8.0  # of a first mesh: its elements are larger than the spots, and few are left to save
MARGIN = 0.9  # part of a limit, such as the tolerance, that is planned for
DOFS_ORDER = 2.0  # time and dofs grow as scale^-order: refinement is nearly confined to the contact
STICK = "stick"  # where nodes are touched within a step (docs/theory.md)
STEP_ORDERS = {MIDPOINT: 2.0, STICK: 1.5, BACKWARD_EULER: 1.0}  # of the force in the load step
# Part of the load-step correction taken for its bar; of the rule of first order much more is corrected
PATH_TRANSFER = {MIDPOINT: 0.5, STICK: 1.0, BACKWARD_EULER: 1.0}
MOST_SUBSTEPS = 32  # parts of a load step: each doubling is one more run of the first mesh
REACH = 2  # steps to either side that support the bar of a step: two meshes agree by chance at one approach


def step_rule(problem: Problem) -> str:
    """What the error of the load steps follows: the rule of plasticity, or that of stick, whose order is lower.

    Returns:
        key of STEP_ORDERS
    """
    integrator, sticks = problem.load_path.integrator, problem.formulation.sticks
    return STICK if sticks and not (problem.material.plastic and integrator == BACKWARD_EULER) else integrator


def planned_steps(steps: int) -> int:
    """Planned load steps of a run with a tolerance: the smallest multiple of those requested that gives a sound bar."""
    return steps * -(-(2 * REACH + 1) // steps)


def growth(scale: float) -> float:
    """Growth of the element size per unit of distance from the contact.

    Half the order of the size: the surroundings are refined with the contact, or they would keep an error that no
    refinement of the contact shows.
    """
    return float(GROWTH * scale**0.5)


def widest(scale: float) -> float:
    """Greatest element size of a mesh [L], which goes with the growth and is H_MAX on the coarsest first mesh."""
    return float(H_MAX * min(1.0, growth(scale) / growth(RATIO)))


def extrapolate(coarse: Floats, fine: Floats, ratio: float, order: float) -> tuple[Floats, Floats]:
    """Limit of a sequence with error c h^order, and the error of its last value.

    Richardson's extrapolation; Roache, J. Fluids Eng. 116 (1994) 405.

    Args:
        coarse, fine: values at two sizes (n,)
        ratio: coarse over fine size, above 1
        order: of the error

    Returns:
        limit (n,) and fine - limit (n,)
    """
    error = (coarse - fine) / (ratio**order - 1.0)
    return fine - error, error


def weight(ratio: float, singular: Floats | float = 0.0) -> Floats:
    """Error of the finer of two meshes over their difference; its mean for the range of orders.

    Args:
        ratio: of their scales
        singular: part of the edges of spots where the pressure is singular (n,), see `guide.singular_part`
    """
    return np.asarray(0.5 * np.sum(_ends(ratio, singular), axis=0))


def bar_share(ratio: float, singular: Floats | float = 0.0) -> Floats:
    """Error bar of the limit of two meshes over their difference; half of what the range of orders leaves open."""
    low, high = _ends(ratio, singular)
    return np.asarray(0.5 * (low - high))


def _ends(ratio: float, singular: Floats | float) -> tuple[Floats, Floats]:
    """Error of the finer of two meshes over their difference at the ends of the range of orders; see `weight`."""
    edge, low, high = (1.0 / (ratio**p - 1.0) for p in (EDGE_ORDER, *MESH_ORDERS))
    part = np.asarray(singular, dtype=float)
    return part * edge + (1.0 - part) * low, np.full(part.shape, high)


def first_scale(tolerance: float) -> float:
    """Scale of the second mesh, which usually meets a tolerance of the force with the first, RATIO times coarser.

    At most 1: where elements are larger than the spots, those of single elements agree by chance. What takes a smaller
    one than 1/GREATEST_STEP, the bar of that one shows first.
    """
    return float(np.clip((MARGIN * tolerance / TYPICAL_BAR) ** (1.0 / MESH_ORDER), 1.0 / GREATEST_STEP, 1.0))


def expected_bar(scale: float) -> float:
    """Relative error bar of the force that `first_scale` expects of a scale."""
    return TYPICAL_BAR * scale**MESH_ORDER


def refinement(scales: Sequence[float], excess: float, singular: float = 0.0) -> float:
    """How much finer the next mesh is, for its bar to be MARGIN times the wanted one.

    Args:
        scales: of the meshes so far
        excess: bar of the last one over the wanted bar
        singular: part of the edges with a singular pressure where it is, see `weight`
    """
    order = MESH_ORDER + singular * (EDGE_ORDER - MESH_ORDER)

    def bar_of_error(scales: Sequence[float]) -> float:
        """Error bar of the last mesh over its error."""
        ratio = scales[partner(scales)] / scales[-1]
        return float(bar_share(ratio, singular) * (ratio**order - 1.0))

    last, error = scales[-1], excess / bar_of_error(scales)
    for step in np.linspace(LEAST_STEP, GREATEST_STEP, 100):
        if error * step**-order * bar_of_error([*scales, last / step]) <= MARGIN:
            break
    return float(step)


def partner(scales: Sequence[float]) -> int:
    """Place of the mesh to extrapolate the last one from: the nearest coarser by LEAST_RATIO, or the first."""
    enough = [k for k, scale in enumerate(scales[:-1]) if scale >= 0.999 * LEAST_RATIO * scales[-1]]
    return enough[-1] if enough else 0


def enough_substeps(bars: Mapping[int, Floats], tolerance: float, order: float) -> int:
    """Fewest equal parts of each load step that meet a part of the tolerance; the mesh takes half of it.

    Args:
        bars: relative error bars of the load steps at some approaches (n,), by their parts, which are powers of 2
        tolerance: relative error bar requested
        order: of the bars in the step, by which those of more parts follow from the last

    Returns:
        the parts; the most of `bars` when no number up to MOST_SUBSTEPS would do
    """
    excess = {n: float(np.max(bar)) / (MARGIN * tolerance) for n, bar in bars.items()}
    most = max(bars)
    more = most * 2 ** max(ceil(log2(max(excess[most], 1.0)) / order), 1)
    return next((n for n in sorted(excess) if excess[n] < 1.0), more if more <= MOST_SUBSTEPS else most)
