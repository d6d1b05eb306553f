# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

"""The next mesh, and the limit of the force estimated from two meshes or from two sizes of load steps.

The meshes of a family differ by one number, the element size in the contact. The force differs from the limit by
c h^p, and the order p depends on the scene (docs/accuracy.md has the orders measured). The limit is therefore the mean
of those that the ends of a range of orders give, and half their distance, times a safety factor, is its error bar.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from math import ceil, inf

import numpy as np

from asperity.arrays import Floats
from asperity.model.load_path import BACKWARD_EULER, MIDPOINT
from asperity.model.settings import MEAN, POINT

MESH_ORDERS = (1.3, 3.5)  # range of the order of the force in the element size, measured by benchmarks/accuracy.py
MESH_ORDER = 2.0  # typical one, to plan with
AREA_ORDER = 1.3  # of the bar of the contact area, to plan with; that of the edges of spots is 1.5 (docs/contact.md)
FACET_STEP = 3.0  # greatest one to the next size for what cut facets leave, which falls as the bar of the area does
SAFETY = 1.3  # on half the range of limits
SCATTER = 0.15  # error of the force over that of the area of contact, both relative, which facets cut at random leave
#: The same of a rough solid that yields, by dilatation: the force of a flattened spot is its area times the hardness.
YIELDED = {POINT: 0.5, MEAN: 0.375}
OF_GUIDE = 1.6  # times that where the coarser mesh is the guiding one, on which small spots hardly have an element
GUIDE_EXCESS = 2.0  # what the guide makes errors look larger than they are, by its own grading (docs/accuracy.md)
GUIDE = 0.1  # size of the guiding mesh [L]
FIRST = 0.5**0.5  # of the next one, over that of the guide
SMALLEST_RATIO, LARGEST_RATIO = 1.6, 4.0  # of two sizes; below, scatter from mesh to mesh hides the order
LEAST_STEP = 1.2  # from one size to the next
FIRST_STEP = 2.5  # greatest one after the second mesh, for the guide only shows roughly how large errors are
COARSER = 2.5  # elements of the mesh that compares small and finite strain over those of the run, or of a finer attempt
MARGIN = 0.9  # part of the tolerance that is planned for
COST_ORDER = 2.6  # time grows as h^-COST_ORDER
DOFS_ORDER = 2.0  # dofs grow as h^-DOFS_ORDER: refinement is nearly confined to the contact
STICK = "stick"  # where nodes are touched within a step (docs/contact.md)
STEP_ORDERS = {MIDPOINT: 2.0, STICK: 1.5, BACKWARD_EULER: 1.0}  # of the force in the load step
MOST_SUBSTEPS = 32
LEAST_STEPS = 5  # planned ones, for the difference of two meshes at one or two approaches may vanish by chance
GROWTH = 0.25, 0.04  # growth of the element size around the contact, and the size in it that this belongs to [L]
FLOWING_GROWTH = 1.5  # times that around small spots that flow, whose error is in them (docs/accuracy.md)


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
    return steps * ceil(LEAST_STEPS / steps)


def growth(size: float, flowing: bool = False) -> float:
    """Growth of the element size around the contact.

    What surrounds the contact is refined too, by half the order: with the same growth on all meshes some 0.2 % of the
    force of a single spot would stay that no refinement of the contact shows (docs/accuracy.md).

    Args:
        size: of the elements in the contact [L]
        flowing: whether the contact consists of spots of a rough surface that flow
    """
    value, at = GROWTH
    return float((FLOWING_GROWTH if flowing else 1.0) * value * (size / at) ** 0.5)


def size_for_strain(h: float | None, tolerance: float | None) -> float:
    """Element size of the coarse mesh on which small and finite strain are compared [L].

    Args:
        h: of the run [L]; None where it is not given
        tolerance: of a run that chooses its meshes, None of one on one mesh
    """
    return GUIDE if tolerance is not None or h is None else min(GUIDE, COARSER * h)


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


def extrapolate_mesh(
    coarse: Floats, fine: Floats, ratio: float, safety: float = SAFETY
) -> tuple[Floats, Floats, Floats]:
    """Limit of the force with the element size when the order is only known to lie in MESH_ORDERS.

    Args:
        coarse, fine: forces on two meshes (n,)
        ratio: coarse over fine element size, above 1
        safety: factor on half the range of limits

    Returns:
        limit (n,), fine - limit (n,), and the error bar of the limit (n,)
    """
    low, high = (extrapolate(coarse, fine, ratio, p)[0] for p in MESH_ORDERS)
    limit = 0.5 * (low + high)
    return limit, fine - limit, 0.5 * safety * np.abs(low - high)


def bar_share(ratio: float, safety: float = SAFETY) -> float:
    """Error bar of `extrapolate_mesh` over the difference of the two forces."""
    low, high = (1.0 / (ratio**p - 1.0) for p in MESH_ORDERS)
    return 0.5 * safety * (low - high)


def scatter(coarse: Floats, fine: Floats, ratio: float, share: float = SCATTER) -> Floats:
    """Error bar of the limit from where the edges of the contact happen to cut the facets of two meshes, relative.

    A spot of a few facets is larger or smaller by chance from mesh to mesh, and its force with it. Two such meshes may
    agree by chance, and their difference shows nothing; the area that cut facets leave open shows it.

    Args:
        coarse, fine: error of the area of contact over the area, on two meshes (n,)
        ratio: coarse over fine element size, above 1
        share: error of the force over that of the area, see `facet_share`
    """
    weight = float(np.mean([1.0 / (ratio**p - 1.0) for p in MESH_ORDERS]))  # of the coarse force in the limit
    return share * np.hypot((1.0 + weight) * fine, weight * coarse)


def facet_share(rough: bool, plastic: bool, dilatation: str) -> float:
    """Error of the force over that of the area of contact, both relative, which facets cut at random leave.

    Args:
        rough: whether the meshes leave out waves of the surface
        plastic: whether the solid yields
        dilatation: of its elements
    """
    return OF_GUIDE * (YIELDED[dilatation] if plastic else SCATTER) if rough else SCATTER


def error_of(bar: float, ratio: float, guide: bool) -> float:
    """Error of the finer of two meshes when it has the typical order, from the error bar that they give.

    Args:
        bar: that they give
        ratio: of their sizes
        guide: whether the coarser one is the guide
    """
    error = bar / bar_share(ratio, safety_of(guide)) / (ratio**MESH_ORDER - 1.0)
    return error / GUIDE_EXCESS if guide else error


def safety_of(guide: bool) -> float:
    """Safety factor of an extrapolation, from the guide (or one as rough) or another mesh."""
    return OF_GUIDE * SAFETY if guide else SAFETY


def plan_next(sizes: Sequence[float], error: float, wanted: float) -> float:
    """Element size of the next mesh [L], on the cheapest way to the wanted error bar.

    The force on a mesh h has the error bar that two meshes give it. It is met at once by a mesh that is fine enough to
    extrapolate from one of those before, or at less cost by one in between and a last one that need not be so fine.

    Args:
        sizes: of the meshes so far, the guide first [L]
        error: relative, of the force on the last one
        wanted: relative error bar requested
    """
    last, third = sizes[-1], len(sizes) == 2
    # the third mesh is not extrapolated from the guide, which is graded in another way
    least, greatest = (SMALLEST_RATIO, FIRST_STEP) if third else (LEAST_STEP, LARGEST_RATIO)
    ways = [(inf, last / greatest)]
    for size in sizes[1:]:
        enough = ratio_for(error * (size / last) ** MESH_ORDER, MARGIN * wanted)
        step = max(last / size * enough, least)
        if enough < LARGEST_RATIO and step <= greatest and size / last * step <= LARGEST_RATIO:
            ways.append((step**COST_ORDER, last / step))
    for step in np.linspace(least, greatest, 100):
        enough = ratio_for(error * step**-MESH_ORDER, MARGIN * wanted)
        if enough < LARGEST_RATIO:
            ways.append((step**COST_ORDER * (1.0 + enough**COST_ORDER), last / step))
    return float(min(ways)[1])


def size_for_facets(size: float, bars: Floats, wanted: Floats) -> float:
    """Element size at which cut facets leave the wanted bars of the force, one mesh away at most [L].

    Args:
        size: of the last mesh [L]
        bars: relative error bars that they leave on it (n,), see `scatter`
        wanted: relative error bars requested (n,)
    """
    return size / min(max(float(np.max(bars / (MARGIN * wanted))), 1.0) ** (1.0 / AREA_ORDER), FACET_STEP)


def size_for_area(size: float, bar: float, wanted: float) -> float:
    """Element size of a mesh that has the wanted bar of the contact area, a mesh or two away at most [L].

    Args:
        size: of the last mesh [L]
        bar: relative error bar of the area on it
        wanted: relative error bar requested
    """
    ratio = (bar / (MARGIN * wanted)) ** (1.0 / AREA_ORDER)
    return size if bar <= wanted else size / float(np.clip(ratio, LEAST_STEP, FIRST_STEP))


def partner(sizes: Sequence[float]) -> int:
    """Place of the mesh to extrapolate the last one from: the nearest that is coarser by SMALLEST_RATIO, or the guide.

    Args:
        sizes: of all meshes, the guide first [L]
    """
    return max((k for k, h in enumerate(sizes[:-1]) if h >= 0.999 * SMALLEST_RATIO * sizes[-1]), default=0)


def meshes(bar: float, wanted: float) -> Iterator[float]:
    """Sizes of all meshes of a run [L], one after the other, when the force has the typical order.

    Args:
        bar: relative error bar on the second mesh, the first to have one
        wanted: relative error bar requested
    """
    sizes = [GUIDE, FIRST * GUIDE]
    yield from sizes
    error = first = error_of(bar, 1.0 / FIRST, guide=True)
    while bar > wanted:
        sizes.append(plan_next(sizes, error, wanted))
        yield sizes[-1]
        coarse = partner(sizes)
        error = first * (sizes[-1] / sizes[1]) ** MESH_ORDER
        bar = error / error_of(1.0, sizes[coarse] / sizes[-1], coarse == 0)


def cheapest_substeps(bars: Mapping[int, Floats], mesh: Floats, tolerance: float, order: float) -> int:
    """Equal parts of each load step with which the tolerance is met at the least cost: more leave more to the mesh.

    Args:
        bars: relative error bars of the load steps at some approaches (n,), by their parts; of more parts than the
            last, they are taken to fall with the order
        mesh: relative error bars of the last mesh there (n,)
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
            finer = max(float(np.max(mesh / (tolerance - bar))), 1.0)
            costs[n] = n * finer ** (COST_ORDER / MESH_ORDER)
    return min(costs, key=lambda n: costs[n], default=last)


def ratio_for(error: float, wanted: float) -> float:
    """Ratio to a finer element size whose bar should be the wanted one, when the coarser one has this error."""
    ratios = np.linspace(SMALLEST_RATIO, LARGEST_RATIO, 200)
    bars = np.array([bar_share(ratio) * (1.0 - ratio**-MESH_ORDER) for ratio in ratios]) * error
    enough = np.flatnonzero(bars <= wanted)
    return float(ratios[enough[0]]) if len(enough) else LARGEST_RATIO
