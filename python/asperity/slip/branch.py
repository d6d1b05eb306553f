"""Branch of a curve on which a joint slips: its normal law with known slopes, and that of the contact without slip."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from asperity.arrays import Array
from asperity.errors import InputError
from asperity.slip.law import AS_STIFF, LEAST
from asperity.vibration.curve_law import CurveLaw
from asperity.vibration.source import Choice, CurveColumns, leg_rows


def branch_rows(columns: CurveColumns, choice: Choice) -> Array:
    """Rows of the branch of a law, in the order of their force."""
    among = columns.loading
    if choice.name == "unload-reload":
        among = np.isin(np.arange(columns.delta.size), leg_rows(columns, choice.load))
    return columns.rising(among & (columns.force > 0.0))


def column_of(curve: Any, name: str, size: int) -> Array:
    """Column of a `Curve` or a mapping, NaN where unknown (size,)."""
    values = curve.get(name) if isinstance(curve, Mapping) else getattr(curve, name, None)
    return np.full(size, np.nan) if values is None else np.asarray(values, float)


def measured_ratio(
    curve: Any, columns: CurveColumns, rows: Array, block: tuple[float, float], direction: str
) -> tuple[Array, Array] | None:
    """Forces (n,), and tangential over normal compliance of the interface without slip (n,), at the rows of a branch.

    None without the columns k_n_elastic, k_t and k_t_x. `block` has the normal and the tangential compliance of the
    block (length/force), `direction` is that of the motion, "x" or "y".
    """
    mean, along_x = (column_of(curve, name, columns.delta.size)[rows] for name in ("k_t", "k_t_x"))
    k_t = along_x if direction == "x" else 2.0 * mean - along_x
    with np.errstate(divide="ignore", invalid="ignore"):
        normal, tangential = 1.0 / columns.elastic[rows] - block[0], 1.0 / k_t - block[1]
        ratio = tangential / normal
    known = (normal > 0.0) & (tangential > 0.0) & np.isfinite(ratio)
    return (columns.force[rows][known], ratio[known]) if known.any() else None


def stuck_law(law: CurveLaw, forces: Array, ratios: Array, block: float, load: float) -> CurveLaw:
    """Normal force over the displacement w with dP/dw = k_t, the tangential stiffness of the interface without slip.

    Args:
        law: of the normal force over the approach, down to the force `load`
        forces, ratios: see `measured_ratio`
        block: normal compliance of the block (length/force)

    Raises:
        InputError: the curve is as stiff as the block
    """
    z, softness = law.z - block * law.F, 1.0 / law.slopes - block
    known = np.minimum.accumulate((softness > LEAST * block) & (np.diff(z, prepend=0.0) > 0.0))
    if not known[-1] and (not known.any() or law.F[known][-1] < load):
        raise InputError(AS_STIFF)
    z, force = z[known], law.F[known]
    ratio = np.interp(force, forces, ratios)
    steps = 0.5 * (ratio[1:] + ratio[:-1]) * np.diff(z)
    w = ratio[0] * z[0] + np.append(0.0, np.cumsum(steps))
    return CurveLaw(w, force, k=1.0 / (ratio * softness[known]), name="contact without slip")


def down_to_zero(law: CurveLaw) -> CurveLaw:
    """Law whose stiffness does not rise as the force falls to zero, which slips at last.

    Where few facets touch, the first points of a table may have a power below one; below them the force is then
    proportional to the approach.
    """
    if law.slopes[0] * law.z[0] >= law.F[0]:
        return law
    k = np.full(law.z.size, np.nan) if law.k is None else law.k.copy()
    k[0] = law.F[0] / law.z[0]
    return replace(law, k=k, origin=0.0)
