"""The limit of a quantity on two meshes and its error bar: extrapolated, or by the place of the edge of the contact."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from asperity.adaptive.guide import REACH
from asperity.adaptive.mesh_plan import MESH_ORDERS, shares
from asperity.arrays import Flags, Floats
from asperity.curve.curve import EDGE

NEIGHBOURS = 2 * REACH + 1  # steps that are averaged
SHARP = 0.3  # what EDGE is where the surface ends in a sharp edge, which lies anywhere in the facets
ALIKE = 2.0  # neighbouring steps that place the edge of the contact alike


def limit_of_meshes(
    coarse: Floats, fine: Floats, ratio: float, singular: Floats | float = 0.0, judged: Flags | None = None,
    orders: tuple[float, float] = MESH_ORDERS,
) -> tuple[Floats, Floats]:  # fmt: skip
    """Limit of a quantity along the loading over its value on the finer of two meshes, and the relative error bar.

    Error and order of a mesh change slowly with the load; where the edges of the contact cut facets, both meshes are
    off by chance. The logarithm of the error is therefore averaged over neighbouring steps. The bar holds the range
    of the orders, and what the average changes.

    Args:
        coarse, fine: values on the meshes, not negative (n,)
        ratio: of their scales
        singular: see `mesh_plan.shares`
        judged: rows that are averaged among themselves; None for all
        orders: least and greatest order of the quantity in the scale

    Returns:
        factor (n,), 1 where a value vanishes, and the bar (n,)
    """
    known = (coarse > 0.0) & (fine > 0.0)
    change = np.log(np.divide(coarse, fine, out=np.ones(len(fine)), where=known))
    judged = np.ones(len(fine), dtype=bool) if judged is None else judged
    weight, share = shares(ratio, singular, orders)
    smooth = _by_parts(_average, weight * change, judged)
    bar, rest = (_by_parts(steady, part, judged) for part in (share * change, weight * change - smooth))
    return np.where(known, np.exp(-smooth), 1.0), np.hypot(bar, rest)


def limit_of_area(
    areas: Sequence[Floats], edges: Sequence[Floats], chance: Sequence[Floats], singular: Floats, judged: Flags
) -> tuple[Floats, Floats]:
    """Area of contact at a force over the area on the finer of two meshes, and the relative error bar.

    The nodes place the edge of the contact too far inside or outside by a part of the facets that it crosses. The part
    is about the same on both meshes and at neighbouring steps, so the areas of both show it: by least squares, with the
    prior knowledge that two of its standard deviations are EDGE. The bar keeps EDGE, or SHARP, for the part does
    change, and half of what is corrected. Near full contact the edges are those of holes, which are smaller and end by
    single nodes that are released: their place is known half as well.

    Args:
        areas, edges, chance: of the coarser and the finer mesh at the same forces: part in contact (n,); part of the
            facets that its edge crosses (n,); error of the area by the random place of the edge, relative (n,)
        singular: see `mesh_plan.shares`
        judged: rows that show the part

    Returns:
        factor (n,), and the bar (n,)
    """
    (coarse, fine), (wide, narrow) = areas, edges
    square = np.sum(np.square([0.5 * error * area for error, area in zip(chance, areas, strict=True)]), axis=0)
    known = (square > 0.0) & np.isfinite(wide) & np.isfinite(narrow)
    weight = np.divide(known, ALIKE * square, out=np.zeros(len(fine)), where=known)
    more, missing = np.nan_to_num(wide - narrow), fine - coarse
    precision, shown = (_by_parts(_average, weight * more * of, judged) * NEIGHBOURS for of in (more, missing))
    place = EDGE * (1.0 + fine)
    part = shown / (precision + (2.0 / place) ** 2)
    left = np.maximum(place + singular * (SHARP - place), 0.5 * np.abs(part))
    crossed = np.divide(np.nan_to_num(narrow), fine, out=np.zeros(len(fine)), where=fine > 0.0)
    factor = np.maximum(1.0 + part * crossed, 0.0)
    return factor, np.hypot(chance[1], left * crossed)


def steady(relative: Floats) -> Floats:
    """Error bars that do not vanish where an error happens to change sign.

    Each is at least the root mean square over its neighbours, REACH to either side.

    Args:
        relative: estimated relative errors along a branch (n,)
    """
    return np.maximum(np.abs(relative), np.sqrt(_average(relative**2)))


def _average(values: Floats) -> Floats:
    """Mean over the neighbours, REACH to either side."""
    padded = np.pad(values, REACH, mode="edge")
    return np.asarray(np.lib.stride_tricks.sliding_window_view(padded, NEIGHBOURS).mean(axis=1))


def _by_parts(filtered: Callable[[Floats], Floats], values: Floats, judged: Flags) -> Floats:
    """Filtered values, those of judged rows from judged rows alone."""
    found = filtered(values)
    found[judged] = filtered(values[judged])
    return found
