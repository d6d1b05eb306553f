"""The next mesh, and the limit of the force estimated from two meshes or from two sizes of load steps.

The meshes of a family differ by one number, their scale: the element sizes over those of `spots.sizes_of_spots`. The
force differs from the limit by c scale^p. The order p depends on the scene; the limit is therefore the mean of those
that the ends of a range of orders give, and half their distance is its error bar.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from asperity.arrays import Floats
from asperity.model.load_path import BACKWARD_EULER, MIDPOINT
from asperity.model.settings import H_MAX

MESH_ORDERS = (1.7, 2.1)  # range of the order of the force in the scale (docs/accuracy.md)
MESH_ORDER = sum(MESH_ORDERS) / 2.0  # typical one, to plan with
AREA_ORDER = 1.5  # of the bar of the contact area, that of the edges of spots (docs/contact.md)
RATIO = 2.0  # of the first two scales
LEAST_STEP, GREATEST_STEP = 1.25, 3.0  # from one scale to the next
LEAST_RATIO = RATIO / LEAST_STEP  # of two scales: below it scatter hides the order
TYPICAL_BAR = 0.018  # relative, that two meshes of the scales RATIO and 1 give at the worst step
FINEST = 0.3  # scale of a second mesh: what takes less, the bar of a coarser one shows first
GROWTH = 0.5  # growth of the element size around the contact at scale 1; it goes with the root of the scale
MOST_SCALE = 8.0  # of a first mesh: its elements are larger than the spots, and few are left to save
MARGIN = 0.9  # part of a limit, such as the tolerance, that is planned for
DOFS_ORDER = 2.0  # time and dofs grow as scale^-order: refinement is nearly confined to the contact
COARSE, COARSER = 0.1, 2.5  # size of the mesh that compares small and finite strain [L], at most so much of the run's
STICK = "stick"  # where nodes are touched within a step (docs/contact.md)
STEP_ORDERS = {MIDPOINT: 2.0, STICK: 1.5, BACKWARD_EULER: 1.0}  # of the force in the load step
# Part of the load-step correction taken for its bar; of the rule of first order much more is corrected
PATH_TRANSFER = {MIDPOINT: 0.5, STICK: 1.0, BACKWARD_EULER: 1.0}
MOST_SUBSTEPS = 32
REACH = 2  # steps to either side that support the bar of a step: two meshes agree by chance at one approach


def step_rule(plastic: bool, sticks: bool, integrator: str) -> str:
    """What the error of the load steps follows: the rule of plasticity, or that of stick, whose order is lower.

    Args:
        plastic: whether the solid yields
        sticks: whether the points in contact stick
        integrator: of plasticity

    Returns:
        key of STEP_ORDERS
    """
    return STICK if sticks and not (plastic and integrator == BACKWARD_EULER) else integrator


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


def size_for_strain(h: float | None, tolerance: float | None) -> float:
    """Element size of the coarse mesh on which small and finite strain are compared [L].

    Args:
        h: of the run [L]; None where it is not given
        tolerance: of a run that chooses its meshes, None of one on one mesh
    """
    return COARSE if tolerance is not None or h is None else min(COARSE, COARSER * h)


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


def weight(ratio: float) -> float:
    """Error of the finer of two meshes over their difference; its mean for the range of orders."""
    return float(np.mean([1.0 / (ratio**p - 1.0) for p in MESH_ORDERS]))


def bar_share(ratio: float) -> float:
    """Error bar of the limit of two meshes over their difference; half of what the range of orders leaves open."""
    low, high = (1.0 / (ratio**p - 1.0) for p in MESH_ORDERS)
    return 0.5 * (low - high)


def first_scale(tolerance: float) -> float:
    """Scale of the second mesh, which usually meets a tolerance of the force with the first, RATIO times coarser.

    At most 1: where elements are larger than the spots, those of single elements agree by chance.
    """
    return float(np.clip((MARGIN * tolerance / TYPICAL_BAR) ** (1.0 / MESH_ORDER), FINEST, 1.0))


def expected_bar(scale: float) -> float:
    """Relative error bar of the force that `first_scale` expects of a scale."""
    return TYPICAL_BAR * scale**MESH_ORDER


def next_scale(scales: Sequence[float], excess: float) -> float:
    """Scale of the next mesh, whose bar is expected to be MARGIN times the wanted one; one mesh away at most.

    Args:
        scales: of the meshes so far
        excess: bar of the last one over the wanted bar
    """
    last, place = scales[-1], partner(scales)
    error = excess / _bar_of_error(scales[place] / last)
    for step in np.linspace(LEAST_STEP, GREATEST_STEP, 100):
        new = [*scales, last / step]
        if error * step**-MESH_ORDER * _bar_of_error(new[partner(new)] / new[-1]) <= MARGIN:
            break
    return float(last / step)


def _bar_of_error(ratio: float) -> float:
    """Error bar of two meshes over the error of the finer one, when it has the typical order."""
    return bar_share(ratio) * (ratio**MESH_ORDER - 1.0)


def scale_for_area(scale: float, bar: float, wanted: float) -> float:
    """Scale of a mesh that has the wanted bar of the contact area, one mesh away at most.

    Args:
        scale: of the last mesh
        bar: relative error bar of the area on it
        wanted: relative error bar requested
    """
    ratio = (bar / (MARGIN * wanted)) ** (1.0 / AREA_ORDER)
    return scale if bar <= wanted else scale / float(np.clip(ratio, LEAST_STEP, GREATEST_STEP))


def partner(scales: Sequence[float]) -> int:
    """Place of the mesh to extrapolate the last one from: the nearest coarser by LEAST_RATIO, or the first.

    Args:
        scales: of all meshes
    """
    return max((k for k, s in enumerate(scales[:-1]) if s >= 0.999 * LEAST_RATIO * scales[-1]), default=0)


def cheapest_substeps(bars: Mapping[int, Floats], mesh: Floats, tolerance: float, order: float) -> int:
    """Equal parts of each load step with which the tolerance is met at the least cost: more leave more to the mesh.

    Args:
        bars: relative error bars of the load steps at some approaches (n,), by their parts; of more parts than the
            last, they are taken to fall with the order
        mesh: relative error bars of the mesh there (n,)
        tolerance: relative error bar requested
        order: of the error in the step

    Returns:
        the parts; the most of `bars` when no number would do
    """
    last = max(bars)
    known = dict(bars)
    while 2 * max(known) <= MOST_SUBSTEPS:
        known[2 * max(known)] = bars[last] * (2 * max(known) / last) ** -order
    costs = {}
    for n, bar in known.items():
        if np.all(bar < 0.9 * tolerance):
            finer = max(float(np.max(mesh / np.sqrt(tolerance**2 - bar**2))), 1.0)
            costs[n] = n * finer ** (DOFS_ORDER / MESH_ORDER)
    return min(costs, key=lambda n: costs[n], default=last)
