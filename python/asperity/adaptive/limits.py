"""The limit of a quantity on two meshes with its error bar, and the mesh that has a given bar.

The meshes of a run differ by one number, their scale: the element sizes over those of `guide.spots_of`. The force
differs from its limit by c scale^p. The order p depends on the scene; the limit is therefore the mean of those that the
ends of a range of orders give, and half their distance is its error bar (Richardson's extrapolation; Roache, J. Fluids
Eng. 116 (1994) 405). The area of contact has another bar, by the place of its edge.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import inf

import numpy as np

from asperity.adaptive.guide import REACH
from asperity.arrays import Flags, Floats
from asperity.curve.curve import EDGE

Orders = tuple[float, float]

# Range of the order of the force in the scale, also of meshes as coarse as the first one (docs/accuracy.md)
MESH_ORDERS, FIRST_ORDERS = (1.6, 2.4), (1.2, 2.4)
USUAL_ORDER = 2.0  # which is expected of the next mesh
GAP_ORDERS = (0.7, 2.4)  # the same of the mean gap at a given force, the lower end near full contact
FLOW_ORDERS = (0.7, inf)  # and of the flow through the gap: between spots its order is seen from 0.8 to 4
# Lowest order where the pressure is singular at the edge of the contact, as of a flat punch; and that of the bar of the
# area, of the edges of spots (docs/theory.md)
EDGE_ORDER, AREA_ORDER = 1.0, 1.5
FIRST = 3.0  # scale of the first mesh
RATIO = 2.0  # of the first two scales
GREATEST_STEP = 3.0  # from a scale to the next: what a bar needs is known to this factor
LEAST_STEP = RATIO ** (1.0 / 3.0)  # least one from a scale to the next
LEAST_RATIO = RATIO / LEAST_STEP  # of two scales: below it scatter hides the order
MARGIN = 0.9  # part of a limit, such as the tolerance, that is planned for
NEIGHBOURS = 2 * REACH + 1  # steps that are averaged
SHARP = 0.3  # what EDGE is where the surface ends in a sharp edge, which lies anywhere in the facets
ALIKE = 2.0  # neighbouring steps that place the edge of the contact alike


def shares(ratio: float, singular: Floats | float = 0.0, orders: Orders = MESH_ORDERS) -> tuple[Floats, Floats]:
    """Error of the finer of two meshes, and error bar of their limit, both over the difference of the meshes.

    Where the pressure is singular the edge of the contact falls between nodes by chance: the bar holds all from the
    first order to a finer mesh without error.

    Args:
        ratio: of their scales
        singular: part of the edges of spots where the pressure is singular (n,), see `guide.spots_of`
        orders: least and greatest order of the quantity in the scale
    """
    part = np.asarray(singular, dtype=float)
    edge, low, high = (1.0 / (ratio**p - 1.0) for p in (EDGE_ORDER, *orders))
    low, high = low + part * (edge - low), (1.0 - part) * high
    return 0.5 * (low + high), 0.5 * (low - high)


def orders_of(coarse: float) -> Orders:
    """Range of the order of the force between the mesh of a scale and a finer one."""
    return FIRST_ORDERS if coarse > RATIO else MESH_ORDERS


def next_step(bar: Callable[[float], float], tolerance: float) -> float:
    """How much finer the next mesh is: the least step after which its bar is expected to meet the tolerance.

    Rounded: the rounding of the bar differs with the ranks, and gmsh makes another mesh of any other size.

    Args:
        bar: expected of a mesh by how much finer it is
    """
    steps = np.arange(LEAST_STEP, GREATEST_STEP, 0.01).round(2)
    return next((float(finer) for finer in steps if bar(finer) <= MARGIN * tolerance), GREATEST_STEP)


def partner(scales: Sequence[float]) -> int:
    """Place of the mesh to extrapolate the last one from: the nearest coarser by LEAST_RATIO, or the first."""
    enough = [k for k, scale in enumerate(scales[:-1]) if scale >= 0.999 * LEAST_RATIO * scales[-1]]
    return enough[-1] if enough else 0


def limit_of_meshes(
    coarse: Floats, fine: Floats, ratio: float, singular: Floats | float = 0.0, judged: Flags | None = None,
    orders: Orders = MESH_ORDERS,
) -> tuple[Floats, Floats]:  # fmt: skip
    """Limit of a quantity along the loading over its value on the finer of two meshes, and the relative error bar.

    Error and order of a mesh change slowly with the load; where the edges of the contact cut facets, both meshes are
    off by chance. The logarithm of the error is therefore averaged over neighbouring steps. The bar holds the range
    of the orders, and what the average changes.

    Args:
        coarse, fine: values on the meshes, not negative (n,)
        ratio, singular, orders: see `shares`
        judged: rows that are averaged among themselves; None for all

    Returns:
        factor (n,), 1 where a value vanishes, and the bar (n,)
    """
    known = (coarse > 0.0) & (fine > 0.0)
    change = np.log(np.divide(coarse, fine, out=np.ones(len(fine)), where=known))
    weight, share = shares(ratio, singular, orders)
    smooth = averaged(weight * change, judged)
    bar = np.hypot(steady(share * change, judged), steady(weight * change - smooth, judged))
    return np.where(known, np.exp(-smooth), 1.0), bar


def limit_of_area(
    areas: Sequence[Floats], edges: Sequence[Floats], chance: Sequence[Floats], sharp: Floats, judged: Flags
) -> tuple[Floats, Floats]:
    """Area of contact at a force over the area on the finer of two meshes, and the relative error bar.

    The nodes place the edge of the contact too far inside or outside by a part of the facets that it crosses. The part
    is alike at neighbouring steps, and the areas of both meshes show it: by least squares, with the prior knowledge
    that two of its standard deviations are EDGE, and that the coarser mesh may deviate as much from the finer one. The
    bar keeps EDGE, or SHARP, for what is known does not narrow it much. Near full contact the edges are those of holes,
    which are smaller and end by single nodes that are released: their place is known half as well.

    Args:
        areas, edges, chance: of the coarser and the finer mesh at the same forces: part in contact (n,); part of the
            facets that its edge crosses (n,); error of the area by the random place of the edge, relative (n,)
        sharp: part of the edges, by their lengths, that are sharp (n,), see `guide.spots_of`
        judged: rows that show the part

    Returns:
        factor (n,), and the bar (n,)
    """
    (coarse, fine), (wide, narrow) = areas, edges
    place = EDGE * (1.0 + fine)
    random = [error * area for error, area in zip(chance, areas, strict=True)]
    square = 0.25 * np.sum(np.square([*random, place * np.nan_to_num(wide)]), axis=0)
    known = (square > 0.0) & np.isfinite(wide) & np.isfinite(narrow)
    weight = np.divide(known, ALIKE * square, out=np.zeros(len(fine)), where=known)
    more, missing = np.nan_to_num(wide - narrow), fine - coarse
    precision, shown = (averaged(weight * more * of, judged) * NEIGHBOURS for of in (more, missing))
    part = shown / (precision + (2.0 / place) ** 2)
    left = place + sharp * (SHARP - place)
    crossed = np.divide(np.nan_to_num(narrow), fine, out=np.zeros(len(fine)), where=fine > 0.0)
    return np.maximum(1.0 + part * crossed, 0.0), np.hypot(chance[1], left * crossed)


def averaged(values: Floats, judged: Flags | None = None) -> Floats:
    """Mean over the neighbours, REACH to either side (n,); that of judged rows over judged rows alone."""
    padded = np.pad(values, REACH, mode="edge")
    found = np.asarray(np.lib.stride_tricks.sliding_window_view(padded, NEIGHBOURS).mean(axis=1))
    if judged is not None:
        found[judged] = averaged(values[judged])
    return found


def steady(relative: Floats, judged: Flags | None = None) -> Floats:
    """Error bars that do not vanish where an error happens to change sign.

    Each is at least the root mean square over its neighbours, see `averaged`.

    Args:
        relative: estimated relative errors along a branch (n,)
        judged: rows whose neighbours are judged rows
    """
    return np.maximum(np.abs(relative), np.sqrt(averaged(relative**2, judged)))
