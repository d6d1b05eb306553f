"""Force, area, gap and stiffness of the limit of two meshes, with the parts of their error bars.

The force on a mesh is extrapolated from a coarser one (`limit_of_meshes`), and so are gap and stiffness. What is left
of the error of the load steps, of the waves that a mesh leaves out, and of the equations is added to the bar.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from math import inf, nan
from typing import Any

import numpy as np
import numpy.typing as npt

from asperity.adaptive.guide import Omission
from asperity.adaptive.mesh_plan import AREA_ORDER, REACH, bar_share, weight
from asperity.arrays import Floats
from asperity.curve import WITH_ERRORS, Curve
from asperity.curve.slope import SINGLE_CONTACT, legs, slopes
from asperity.errors import InputError

Along = Callable[[Floats], Floats]  # a relative error along the loading, at approaches (n,)

TAKEN = 0.5  # part of what the half-space corrects that is taken: the bar holds the rest, whatever part of it is true
# Deviation of the force over that of the area from mesh to mesh, both relative: 0.11 and 0.15 on meshes of scale 1 and
# 2 of twelve single spots, each at another place of the block
SCATTER = 0.12
# The same where the pressure is that of a full indentation: the force is then that pressure times the area. Limits of
# two meshes of three solids, of hardening E/1000 to E/10, on three surfaces deviate by 0.75 of half the open area
FLOWING = 0.5


@dataclass(frozen=True)
class Budget:
    """Error bars of P* at the rows of a curve, absolute, by their origin.

    Attributes:
        mesh: of the element size, the quadrature included, which the extrapolation removes with it
        roughness: of the waves that the mesh leaves out
        load_step: of the integration of plasticity and of stick along the path
        algebraic: of the equations left unsolved, from the residual forces
    """

    mesh: Floats
    roughness: Floats
    load_step: Floats
    algebraic: Floats

    @property
    def total(self) -> Floats:
        """Root of the sum of squares, for the parts are independent; the equations are left unsolved to one side."""
        return self.apart_from_mesh(self.mesh)

    def apart_from_mesh(self, mesh: Floats | float = 0.0) -> Floats:
        """The same with another part of the mesh, by default none."""
        return np.sqrt(mesh**2 + self.roughness**2 + self.load_step**2) + self.algebraic

    def to_dict(self) -> dict[str, list[float]]:
        """Columns of the budget for summary.json."""
        return {k: getattr(self, k).tolist() for k in ("mesh", "roughness", "load_step", "algebraic", "total")}

    @staticmethod
    def unknown(rows: int) -> Budget:
        """The budget of a force that has no error bar."""
        return Budget(*(np.full(rows, nan) for _ in range(4)))


@dataclass(frozen=True)
class Corrected:
    """A mesh that was pressed: its curve for half of what its top leaves out and without the error of its load steps.

    Attributes:
        curve: of the mesh
        missed: what its top leaves out
    """

    curve: Curve
    missed: Omission

    def doubt(self) -> str:
        """Why there is nothing to extrapolate from; empty where there is."""
        return "no node is touched" if self.curve.untouched() else self.curve.unresolved()


@dataclass(frozen=True)
class Pair:
    """The finest mesh and the one that it is extrapolated from.

    Attributes:
        fine, coarse: meshes
        ratio: of their scales
        singular: part of the edges with a singular pressure along the first loading of the finer one (n,)
        flowing: part of the force there under the greatest pressure of a solid that yields (n,)
    """

    fine: Corrected
    coarse: Corrected
    ratio: float
    singular: Floats
    flowing: Floats

    @property
    def weight(self) -> Floats:
        """Error of the finer mesh over the difference of both along the loading (n,)."""
        return weight(self.ratio, self.singular)


def along(delta_star: Floats, value: Floats) -> Along:
    """The error with these values at ascending approaches (n,), constant before the first and after the last."""
    return lambda at: np.interp(at, delta_star, value)


def correct(pair: Pair, judged: npt.NDArray[np.bool_], path: Along, algebraic: float) -> tuple[Curve, Budget]:
    """Extrapolated curve of the finest level with its error bars.

    Later branches start from the end of the first loading: their bars keep its size.

    Args:
        pair: finest mesh and the one it is extrapolated from
        judged: rows whose bars are; those before have larger ones that say nothing about their neighbours
        path: relative error left of the load steps
        algebraic: relative error of the equations left unsolved
    """
    curve, other, part = pair.fine.curve, pair.coarse.curve, pair.weight
    loading = curve.branch == "load"
    at, rows = curve.delta_star[loading], rows_of_loading(loading)
    before = loading_force(other, at)
    factor, spread = limit_of_meshes(before, curve.P_star[loading], pair.ratio, pair.singular, judged[loading])
    scatter = (SCATTER + (FLOWING - SCATTER) * pair.flowing) * np.hypot(
        (1.0 + part) * _open_area(curve, at), part * _open_area(other, at)
    )
    mesh_bar = np.hypot(spread, scatter)
    left_out = (np.abs(_left(mesh.missed.at(at)[0])) for mesh in (pair.fine, pair.coarse))
    rough_bar = np.hypot(*(w * left for w, left in zip((1.0 + part, part), left_out, strict=True)))
    area = curve.area_fraction[loading]
    change = np.interp(at, other.loading().delta_star, other.loading().area_fraction) - area
    change = np.divide(change, area, out=np.zeros(len(at)), where=area > 0.0)
    left = _by_parts(steady, change / (pair.ratio**AREA_ORDER - 1.0), judged[loading])
    curve = replace(scaled(curve, factor), error_area_fraction=curve.error_area_fraction + (left * area)[rows])
    P = curve.P_star
    scale = np.where(loading, P, P[loading][-1])
    mesh_bar, rough_bar, path_bar = (bar[rows] * scale for bar in (mesh_bar, rough_bar, path(at)))
    budget = Budget(mesh_bar, rough_bar, path_bar, np.full(len(P), algebraic) * scale)
    return replace(curve, error_P_star=budget.total), budget


def _left(missed: Floats) -> Floats:
    """Part of what a top leaves out that is not corrected, over the corrected value."""
    return np.asarray((1.0 - TAKEN) * missed / (1.0 + TAKEN * missed))


def without_omission(curve: Curve, missed: Omission, compliance: float) -> Curve:
    """A curve corrected for TAKEN of what the top of its mesh leaves out: forces, gaps, areas with their bars.

    A half-space does not know what the solid makes of a top: of flat tops with sharp edges it takes out too much.

    Args:
        compliance: of the block, compression over P* [length]; at a given approach the mean gap is the larger by it
    """
    loading = curve.branch == "load"
    force, area = missed.at(curve.delta_star[loading])
    area = area[rows_of_loading(loading)]
    areas, error = (column * (1.0 + TAKEN * area) for column in (curve.area_fraction, curve.error_area_fraction))
    error = error + np.abs(_left(area)) * areas
    pressure = np.divide(curve.mean_pressure, 1.0 + TAKEN * area)
    corrected = replace(curve, area_fraction=areas, error_area_fraction=error, mean_pressure=pressure)
    corrected = scaled(corrected, 1.0 + TAKEN * force)
    return replace(corrected, mean_gap=curve.mean_gap + compliance * (corrected.P_star - curve.P_star))


def with_measures(fine: Curve, pair: Pair, budget: Budget, compliance: float) -> Curve:
    """A curve whose gap, stiffnesses and conductance have error bars; those that follow the spots are extrapolated.

    The mean plane of a block sinks by the approach less the compression, which the force gives: the gap has its error,
    and what flow, free sides or slopes add is that of the finer mesh, with its change from mesh to mesh as a bar. A
    stiffness follows the size of the spots, whose edges cut the facets at random. The slope k_n is that of the
    corrected force, see `slope_bar`.

    Args:
        pair: the meshes; `fine` is the corrected curve of its finer one
        budget: error bars of P*
        compliance: see `without_omission`
    """
    loading = fine.branch == "load"
    at, rows = fine.delta_star[loading], rows_of_loading(loading)
    edges = _open_area(fine, at)

    def beside(curve: Curve) -> Floats:
        """Gap along the loading but for the approach and the compression; a constant for a linear solid."""
        gap = curve.mean_gap + curve.delta - compliance * curve.P_star
        return np.interp(at, curve.loading().delta_star, gap[curve.branch == "load"])

    of_mesh = steady(beside(pair.fine.curve) - beside(pair.coarse.curve))[rows]
    columns: dict[str, Any] = {"error_k_n": slope_bar(fine, budget, edges[rows])}
    columns["mean_gap"] = fine.mean_gap + compliance * (fine.P_star - pair.fine.curve.P_star)
    columns["error_mean_gap"] = compliance * budget.total + of_mesh
    rest = np.divide(budget.apart_from_mesh(), fine.P_star, out=np.zeros(len(fine)), where=fine.P_star > 0.0)
    for name in (name for name in WITH_ERRORS if f"error_{name}" not in columns):
        value, before = getattr(fine, name), _touched(pair.coarse.curve, name, at)
        if np.isnan(before).any() or not np.nanmax(value[loading], initial=0.0) > 0.0:
            continue
        factor, bar = limit_of_meshes(before, value[loading], pair.ratio, pair.singular)
        columns[name] = value = value * factor[rows]
        part = (bar + edges)[rows] + np.where(loading, rest, 0.0)
        columns[f"error_{name}"] = part * value + shifted(fine, budget.total, value)
    return replace(fine, **columns)


def shifted(curve: Curve, bar: Floats, values: Floats) -> Floats:
    """What an error of P* changes in a measure of the contact (n,), on the branches after the first loading.

    There the force keeps its bar while it vanishes, and the measure follows the force: near the end, where the flat
    lifts off, all of it is unknown.

    Args:
        bar: of P* (n,)
        values: of the measure (n,)
    """
    found = np.zeros(len(curve))
    for begin, end in legs(curve.branch)[1:]:
        leg = slice(begin - 1, end)
        order = np.argsort(curve.P_star[leg])
        P, value = (np.append(0.0, column[leg][order]) for column in (curve.P_star, values))
        ends = (np.interp(curve.P_star + sign * bar, P, value) for sign in (1.0, -1.0))
        found[begin:end] = np.max([np.abs(at - values) for at in ends], axis=0)[begin:end]
    return found


def _touched(curve: Curve, name: str, delta_star: Floats) -> Floats:
    """A column along the touched part of the first loading at given approaches; NaN where there is none."""
    branch = curve.loading()
    branch = branch.where(branch.P_star > 0.0)
    if not len(branch):
        return np.full(len(delta_star), np.nan)
    return np.interp(delta_star, branch.delta_star, getattr(branch, name))


def slope_bar(curve: Curve, budget: Budget, edges: Floats) -> Floats:
    """Error bars of the slope k_n [force/length].

    Errors of the force at neighbouring steps are nearly the same part of it, which is that of the slope too. What
    steps miss shows in the change of the exponent, and what changes over more of them is that of cut facets; both
    are by chance.

    Args:
        edges: error that facets cut at random leave in a stiffness, relative (n,)
    """
    share = np.divide(budget.total, curve.P_star, out=np.zeros(len(curve)), where=curve.P_star > 0.0)
    _, change = slopes(curve.delta, curve.force, curve.branch)
    for name in np.unique(curve.branch):
        rows = curve.branch == name
        change[rows] = steady(change[rows])
    return np.asarray((share + np.hypot(change, edges)) * np.abs(curve.k_n))


def loading_force(curve: Curve, delta_star: Floats) -> Floats:
    """P* of the first loading at given approaches, by shape-preserving interpolation of its logarithms.

    Before the first step with a force it is continued as that of a single contact, (delta*)^(3/2): a cubic through
    steps that follow closely on a late first touch would leave all bounds. Beyond the last step its tangent is.

    Raises:
        InputError: no step has a force
    """
    from scipy.interpolate import PchipInterpolator

    branch = curve.loading()
    branch = branch.where(branch.P_star > 0.0)
    if not len(branch):
        raise InputError("accuracy.tolerance: the force is zero in every step: raise loading.delta_max")
    x, y, at = np.log(branch.delta_star), np.log(branch.P_star), np.log(delta_star)
    if len(branch) == 1:
        return np.asarray(np.exp(y[0] + SINGLE_CONTACT * (at - x[0])))
    law = PchipInterpolator(x, y)
    inside = np.clip(at, x[0], x[-1])
    slope = np.where(at < x[0], SINGLE_CONTACT, law(x[-1], 1))
    return np.asarray(np.exp(law(inside) + slope * (at - inside)))


def limit_of_meshes(
    coarse: Floats,
    fine: Floats,
    ratio: float,
    singular: Floats | float = 0.0,
    judged: npt.NDArray[np.bool_] | None = None,
) -> tuple[Floats, Floats]:
    """Limit of a quantity along the loading over its value on the finer of two meshes, and the relative error bar.

    Error and order of a mesh change slowly with the load; where the edges of the contact cut facets, both meshes are
    off by chance. The logarithm of the error is therefore averaged over neighbouring steps. The bar holds the orders in
    `mesh_plan.MESH_ORDERS`, and what the average changes.

    Args:
        coarse, fine: values on the meshes, not negative (n,)
        ratio: of their scales
        singular: see `mesh_plan.weight`
        judged: rows that are averaged among themselves; None for all

    Returns:
        factor (n,), 1 where a value vanishes, and the bar (n,)
    """
    known = (coarse > 0.0) & (fine > 0.0)
    change = np.log(np.divide(coarse, fine, out=np.ones(len(fine)), where=known))
    judged = np.ones(len(fine), dtype=bool) if judged is None else judged
    error = weight(ratio, singular) * change
    smooth = _by_parts(_average, error, judged)
    bar, rest = (_by_parts(steady, part, judged) for part in (bar_share(ratio, singular) * change, error - smooth))
    return np.where(known, np.exp(-smooth), 1.0), np.hypot(bar, rest)


def steady(relative: Floats, reach: int = REACH) -> Floats:
    """Error bars that do not vanish where an error happens to change sign.

    Each is at least the root mean square over its neighbours, `reach` to either side.

    Args:
        relative: estimated relative errors along a branch (n,)
    """
    return np.maximum(np.abs(relative), np.sqrt(_average(relative**2, reach)))


def _average(values: Floats, reach: int = REACH) -> Floats:
    """Mean over the neighbours, `reach` to either side."""
    padded = np.pad(values, reach, mode="edge")
    return np.asarray(np.lib.stride_tricks.sliding_window_view(padded, 2 * reach + 1).mean(axis=1))


def _by_parts(filtered: Callable[[Floats], Floats], values: Floats, judged: npt.NDArray[np.bool_]) -> Floats:
    """Filtered values, those of judged rows from judged rows alone."""
    found = filtered(values)
    found[judged] = filtered(values[judged])
    return found


def judged_rows(curve: Curve, steps: int) -> npt.NDArray[np.bool_]:
    """Rows whose bar is judged: the first loading from the end of the first of the planned steps on.

    The midpoint rule puts smaller ones before, where the contact is too small for a mesh made for the planned ones.
    """
    loading = curve.branch == "load"
    return loading & (curve.delta_star >= 0.999 * curve.delta_star[loading].max() / steps)


def relative(bar: Floats, P_star: Floats) -> Floats:
    """Error bars over the force; unbounded where there is none."""
    return np.divide(bar, P_star, out=np.full(len(bar), inf), where=P_star > 0.0)


def scaled(curve: Curve, factor: Floats) -> Curve:
    """A curve with the forces of its first loading times a factor (n,), those of later branches times its last one."""
    of_row = factor[rows_of_loading(curve.branch == "load")]
    curve = replace(curve, P_star=curve.P_star * of_row, mean_pressure=curve.mean_pressure * of_row)
    return curve.with_force(curve.force * of_row)


def rows_of_loading(loading: npt.NDArray[np.bool_]) -> npt.NDArray[np.int64]:
    """Place of each row among those of the first loading (rows,); of later branches that of its last one."""
    return np.where(loading, np.cumsum(loading), np.count_nonzero(loading)) - 1


def _open_area(curve: Curve, delta_star: Floats) -> Floats:
    """Error of the area of contact over the area along the first loading, no more than 1, at given approaches.

    A spot of a few facets is larger or smaller by chance from mesh to mesh, and its force with it. Two such meshes may
    agree by chance, and their difference shows nothing; the area that cut facets leave open shows it.
    """
    branch = curve.loading()
    area, error = branch.area_fraction, branch.error_area_fraction
    share = np.divide(error, area, out=np.ones(len(branch)), where=area > error)
    return np.interp(delta_star, branch.delta_star, share)
