"""Force, area, gap and stiffness of the limit of two meshes, with the parts of their error bars.

The force on a mesh is extrapolated from a coarser one (`limits`), and so are gap and stiffnesses. What is left of the
error of the load steps, of the waves that a mesh leaves out, and of the equations is added to the bar.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from functools import cached_property
from math import inf
from typing import Any

import numpy as np
from scipy.interpolate import PchipInterpolator

from asperity.adaptive.guide import Omission
from asperity.adaptive.limits import limit_of_area, limit_of_meshes, steady
from asperity.adaptive.mesh_plan import FLOW_ORDERS, GAP_ORDERS, orders_of, shares
from asperity.arrays import Array, Flags, Floats
from asperity.contact.thin_film import ThinFilm
from asperity.curve import WITH_ERRORS, Curve
from asperity.curve.curve import EDGE
from asperity.curve.slope import SINGLE_CONTACT, legs, slopes
from asperity.errors import InputError

# Deviation of the force over that of the area from mesh to mesh, both relative: 0.11 and 0.15 on meshes of scale 1 and
# 2 of twelve single spots, each at another place of the block. In a solid that yields the force is that of a full
# indentation, its pressure times the area, and deviates by half of the open area, the deviation of the area
SCATTER, FLOWING = 0.12, 0.5
STEEPEST = 2.0  # power of the force that the approach is moved by: a force that stands still gives none
MOST = 20.0  # bar of the logarithm of a flow beyond which nothing is known
TINY = 1e-300  # P* below which there is no logarithm
MEASURES = ("area_fraction", *(name for name in WITH_ERRORS if name != "k_n"))  # of the contact, functions of the force


Orders = tuple[float, float]


@dataclass(frozen=True)
class Budget:
    """Error bars of P* at the rows of a curve, absolute, by their origin."""

    mesh: Floats  # of the element size, the quadrature included, which the extrapolation removes with it
    roughness: Floats  # of the waves that the mesh leaves out
    load_step: Floats  # of the integration of plasticity and of stick along the path
    algebraic: Floats  # of the equations left unsolved, from the residual forces

    @property
    def total(self) -> Floats:
        """Root of the sum of squares, for the parts are independent; the equations are left unsolved to one side."""
        return self.apart_from_mesh(self.mesh)

    def apart_from_mesh(self, mesh: Floats | float = 0.0) -> Floats:
        """The same with another part of the mesh, by default none."""
        return np.sqrt(mesh**2 + self.roughness**2 + self.load_step**2) + self.algebraic

    def to_dict(self) -> dict[str, list[float]]:
        """Columns of the budget for summary.json."""
        return {part.name: getattr(self, part.name).tolist() for part in fields(self)} | {"total": self.total.tolist()}


@dataclass(frozen=True)
class PressedMesh:
    """A mesh that was pressed."""

    scale: float
    dofs: int
    curve: Curve  # for half of what its top leaves out, and without the error of its load steps
    missed: Omission  # what its top leaves out

    def doubt(self) -> str:
        """Why there is nothing to extrapolate from; empty where there is."""
        return "no node is touched" if self.curve.untouched() else self.curve.unresolved()


def without_omission(curve: Curve, missed: Omission, compliance: float) -> Curve:
    """A curve corrected for half of what the top of its mesh leaves out: forces, gaps, areas with their bars.

    A half-space does not know what the solid makes of a top: of flat tops with sharp edges it takes out too much. The
    bar therefore holds the other half, whatever part of it is true.

    Args:
        compliance: of the block, compression over P* [length]; at a given approach the mean gap is the larger by it
    """
    loading = curve.branch == "load"
    force, area, _ = missed.at(curve.delta_star[loading])
    area = area[rows_of_loading(loading)]
    areas, error = (column * (1.0 + 0.5 * area) for column in (curve.area_fraction, curve.error_area_fraction))
    error = np.hypot(error, other_half(area) * areas)
    pressure = np.divide(curve.mean_pressure, 1.0 + 0.5 * area)
    corrected = replace(curve, area_fraction=areas, error_area_fraction=error, mean_pressure=pressure)
    corrected = scaled(corrected, 1.0 + 0.5 * force)
    return replace(corrected, mean_gap=curve.mean_gap + compliance * (corrected.P_star - curve.P_star))


def other_half(missed: Floats) -> Floats:
    """Half of a change that is not corrected, over the value with the half that is."""
    return np.abs(0.5 * missed / (1.0 + 0.5 * missed))


@dataclass(frozen=True)
class Pair:
    """Two meshes of a load path, compared along the first loading of the finer one."""

    fine: PressedMesh
    coarse: PressedMesh
    judged: Flags  # rows of the loading whose bars are; larger ones before say nothing about their neighbours (n,)
    flows: bool  # whether the solid yields

    @cached_property
    def at(self) -> Floats:
        """Approaches (n,) [L]."""
        return self.fine.curve.loading().delta_star

    @cached_property
    def singular(self) -> Floats:
        """Part of the edges of spots where the pressure is singular (n,)."""
        *_, singular = self.fine.missed.at(self.at)
        return singular

    def limit(self, coarse: Floats, fine: Floats, orders: Orders | None = None) -> tuple[Floats, Floats]:
        """Limit of a quantity over its value on the finer mesh, and its relative bar; see `limit_of_meshes`."""
        orders = orders or orders_of(self.coarse.scale)
        return limit_of_meshes(coarse, fine, self.coarse.scale / self.fine.scale, self.singular, self.judged, orders)

    def of_limit(self, error: Callable[[PressedMesh], Floats]) -> Floats:
        """What independent errors of both meshes make of the limit of the force."""
        part, _ = shares(self.coarse.scale / self.fine.scale, self.singular, orders_of(self.coarse.scale))
        return np.hypot((1.0 + part) * error(self.fine), part * error(self.coarse))

    @cached_property
    def scatter(self) -> Floats:
        """Relative bar of force and stiffness by facets that are cut at random (n,)."""
        return (FLOWING if self.flows else SCATTER) * self.of_limit(lambda mesh: _open_area(mesh.curve, self.at))

    def at_force(self, name: str, P_star: Floats) -> tuple[Floats, Floats]:
        """A measure on the coarser and the finer mesh at given forces."""
        coarse, fine = (over_force(mesh.curve, name, P_star) for mesh in (self.coarse, self.fine))
        return coarse, fine


def correct(
    fine: PressedMesh, coarse: PressedMesh, judged: Flags, path: Callable[[Floats], Floats], algebraic: float,
    compliance: float, flows: bool = False,
) -> tuple[Curve, Budget]:  # fmt: skip
    """Extrapolated curve of the finer of two meshes with its error bars.

    The force is extrapolated at the approach. Area, mean gap and stiffnesses are functions of the force: the meshes are
    compared at the same force, where they do not have the error of the force. Later branches start from the end of the
    first loading: their bars keep its size. The slope k_n is that of the corrected force, see `slope_bar`.

    Args:
        judged: rows whose bars are
        path: relative error left of the load steps
        algebraic: relative error of the equations left unsolved
        compliance: see `without_omission`
        fine, coarse, flows: see `Pair`
    """
    loading = fine.curve.branch == "load"
    rows, pair = rows_of_loading(loading), Pair(fine, coarse, judged[loading], flows)
    factor, spread = pair.limit(loading_force(coarse.curve, pair.at), fine.curve.P_star[loading])
    curve = scaled(fine.curve, factor)
    P = np.where(loading, curve.P_star, curve.P_star[loading][-1])
    rough = pair.of_limit(lambda mesh: other_half(mesh.missed.at(pair.at)[0]))
    mesh, rough, steps = (bar[rows] * P for bar in (np.hypot(spread, pair.scatter), rough, path(pair.at)))
    budget = Budget(mesh, rough, steps, algebraic * P)
    curve = replace(curve, error_P_star=budget.total)
    for name in MEASURES:
        coarser, finer = pair.at_force(name, P[loading])
        if np.isnan(coarser).any() or not np.nanmax(finer, initial=0.0) > 0.0:
            if name in ThinFilm.columns and not any(np.any(getattr(one.curve, name) != 0.0) for one in (coarse, fine)):
                closed: dict[str, Any] = {f"error_{name}": np.zeros(len(curve))}  # from the first touch on
                curve = replace(curve, **closed)
            continue
        if name == "area_fraction":
            curve = with_area(curve, pair, (coarser, finer))
        elif name == "mean_gap":
            curve = with_gap(curve, pair, (coarser, finer), compliance * budget.roughness)
        elif name in ThinFilm.columns:
            curve = with_flow(curve, pair, name, (coarser, finer))
        else:
            factor, bar = pair.limit(coarser, finer)
            curve, _ = with_limit(curve, name, factor * finer, np.hypot(bar, pair.scatter))
    return replace(curve, error_k_n=slope_bar(curve, budget, _open_area(curve, pair.at)[rows])), budget


def with_limit(curve: Curve, name: str, limit: Floats, bar: Floats) -> tuple[Curve, Floats]:
    """A curve with the limit of a measure along its loading and the relative bar (n,), and what multiplied each row.

    Later branches are moved as the end of the loading; see also `shifted`.
    """
    loading, before = curve.branch == "load", getattr(curve, name)
    rows = rows_of_loading(loading)
    moved = np.divide(limit, before[loading], out=np.ones(len(limit)), where=before[loading] > 0.0)[rows]
    values, error = before * moved, (bar * limit)[rows]
    error = error + shifted(curve, curve.error_P_star, values)
    return replace(curve, **{name: values, f"error_{name}": error}), moved


def with_area(curve: Curve, pair: Pair, areas: tuple[Floats, Floats]) -> Curve:
    """A curve with the area of contact of the limit of two meshes, at whose forces it is given, see `limit_of_area`."""
    edges = pair.at_force("edge_fraction", curve.loading().P_star)
    chance = [_open_area(mesh.curve, pair.at) for mesh in (pair.coarse, pair.fine)]
    factor, bar = limit_of_area(areas, edges, chance, pair.singular, pair.judged)
    curve, moved = with_limit(curve, "area_fraction", factor * areas[1], bar)
    return replace(curve, mean_pressure=curve.mean_pressure / moved)


def with_gap(curve: Curve, pair: Pair, gaps: tuple[Floats, Floats], rough: Floats) -> Curve:
    """A curve with the mean gap of the limit of two meshes; later branches close the same gap farther on.

    Args:
        gaps: on the coarser and the finer mesh at the forces of the loading [length]
        rough: error by the waves that the mesh leaves out (rows,) [length]
    """
    loading = curve.branch == "load"
    rows, (factor, bar) = rows_of_loading(loading), pair.limit(*gaps, GAP_ORDERS)
    limit, before = factor * gaps[1], curve.mean_gap
    gap, error = before + (limit - before[loading])[rows], np.hypot((bar * limit)[rows], rough)
    return replace(curve, mean_gap=gap, error_mean_gap=error + shifted(curve, curve.error_P_star, gap))


def with_flow(curve: Curve, pair: Pair, name: str, flows: tuple[Floats, Floats]) -> Curve:
    """A curve with a flow through the gap of the limit of two meshes, at whose forces it is given.

    Where the last channels close, the flow may change by more than its size: the bar is that of the logarithm, upwards.
    It holds what the bar of the area makes of the flow, by their slope along the curve. Where one of the meshes is
    closed, the flow may be anything up to what goes through the other one.
    """
    loading, fine = curve.loading(), flows[1]
    factor, bar = pair.limit(*flows, FLOW_ORDERS)
    area, known = loading.area_fraction, (loading.area_fraction > 0.0) & (fine > 0.0)
    if np.count_nonzero(known) > 1:
        steepness = np.gradient(np.log(fine[known]), np.log(area[known]))
        bar[known] = np.hypot(bar[known], steepness * (loading.error_area_fraction / np.maximum(area, TINY))[known])
    bar = np.expm1(np.minimum(bar, MOST))
    for mesh in (pair.coarse, pair.fine):
        pressed = mesh.curve.loading()
        last = np.max(pressed.P_star[getattr(pressed, name) > 0.0], initial=0.0)
        bar = np.where(last < loading.P_star, np.maximum(bar, 1.0), bar)
    return with_limit(curve, name, factor * fine, bar)[0]


def over_force(curve: Curve, name: str, P_star: Floats) -> Floats:
    """A measure of the contact along the first loading at given forces P*; NaN where it is known at less than 2 steps.

    Logarithms are interpolated, shape-preserving; beyond the ends the power of the force goes on.
    """
    branch, values = curve.loading(), getattr(curve, name)[curve.branch == "load"]
    known = (branch.P_star > np.maximum.accumulate(np.append(0.0, branch.P_star[:-1]))) & (values > 0.0)
    if np.count_nonzero(known) < 2:
        return np.full(len(P_star), np.nan)
    x, y = np.log(branch.P_star[known]), np.log(values[known])
    return _in_logarithms(x, y, np.log(np.maximum(P_star, TINY)), (y[1] - y[0]) / (x[1] - x[0]))


def _in_logarithms(x: Floats, y: Floats, at: Floats, before: float) -> Floats:
    """Values at `at` of a shape-preserving cubic through (x, y), all three logarithms.

    Below the first point the power `before` goes on, beyond the last one its tangent.
    """
    law, inside = PchipInterpolator(x, y), np.clip(at, x[0], x[-1])
    slope = np.where(at < x[0], before, law(x[-1], 1))
    return np.asarray(np.exp(law(inside) + slope * (at - inside)))


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


def slope_bar(curve: Curve, budget: Budget, edges: Floats) -> Floats:
    """Error bars of the slope k_n [force/length].

    Errors of the force at neighbouring steps are nearly the same part of it, which is that of the slope too. What
    steps miss shows in the change of the exponent, and what changes over more of them is that of cut facets; both
    are by chance.

    Args:
        edges: error that facets cut at random leave in a stiffness, relative (n,)
    """
    _, change = slopes(curve.delta, curve.force, curve.branch)
    for name in np.unique(curve.branch):
        rows = curve.branch == name
        change[rows] = steady(change[rows])
    bar = relative(budget.total, curve.P_star, 0.0) + np.hypot(change, edges)
    return np.asarray(bar * np.abs(curve.k_n))


def of_elastic_solve(curve: Curve) -> Curve:
    """A curve of an elastic solid without friction: its slope k_n is the elastic stiffness, where that is known.

    The elastic solve of a step does not know what the steps before and after missed, as differences do. At an approach
    the slope has the error of the force there too, for it grows with the force by less than its first power.
    """
    known = curve.k_n_elastic > 0.0
    bar = np.hypot(curve.error_k_n_elastic, relative(curve.error_P_star, curve.P_star, 0.0) * curve.k_n_elastic)
    k_n, error = np.where(known, curve.k_n_elastic, curve.k_n), np.where(known, bar, curve.error_k_n)
    return replace(curve, k_n=k_n, error_k_n=error)


def at_given_forces(curve: Curve, budget: Budget, raw: Curve, greatest: float) -> tuple[Curve, Budget]:
    """A corrected curve at the forces that were computed, which a load path gives: its approaches are corrected.

    The approach is moved as the power of the force that it is there; what a change of the exponent from step to step
    makes of the force is in its bar. Measures are those at the other force, see `over_force`, their bars with them.
    Later branches are moved as the end of the first loading.

    Args:
        curve, budget: with corrected forces
        raw: the same rows as computed
        greatest: force at which the loadings end, each found within a small tolerance [force]
    """
    loading = curve.branch == "load"
    rows, first = rows_of_loading(loading), curve.where(loading)
    ends = [end - 1 for _, end in legs(curve.branch) if curve.branch[end - 1] != "unload"]
    force, P = raw.force.copy(), raw.P_star.copy()
    force[ends], P[ends] = greatest, raw.P_star[ends] * greatest / raw.force[ends]
    touched = (first.P_star > 0.0) & (P[loading] > 0.0)
    factor = np.divide(P[loading], first.P_star, out=np.ones(len(first)), where=touched)

    power = np.full(len(first), 1.0 / SINGLE_CONTACT)
    rising = first.P_star > (1.0 + 1e-6) * np.maximum.accumulate(np.append(0.0, first.P_star[:-1]))
    if np.count_nonzero(known := touched & rising) > 1:
        power[known] = np.gradient(np.log(first.delta[known]), np.log(first.P_star[known]))
    power[np.abs(power) > STEEPEST] = 1.0 / SINGLE_CONTACT
    longer = np.asarray(factor**power)[rows]
    _, bend = slopes(first.delta, first.force, first.branch)
    budget = Budget(*(getattr(budget, part.name) * factor[rows] for part in fields(budget)))
    bent = np.nan_to_num(bend) * np.abs(np.log(factor)) * P[loading]
    budget = replace(budget, mesh=np.hypot(budget.mesh, bent[rows]))
    columns: dict[str, Any] = {"P_star": P, "error_P_star": budget.total}
    columns |= {name: longer * getattr(curve, name) for name in ("delta", "delta_star")}
    for name in MEASURES:
        of, there = getattr(first, name), over_force(first, name, P[loading])
        known = touched & (of > 0.0) & np.isfinite(there)
        by = np.divide(there, of, out=np.ones(len(first)), where=known)[rows]
        columns |= {key: by * getattr(curve, key) for key in (name, f"error_{name}")}
    area = columns["area_fraction"]
    smaller = np.divide(curve.area_fraction, area, out=np.ones(len(P)), where=area > 0.0)
    columns["mean_pressure"] = curve.mean_pressure * factor[rows] * smaller
    found = replace(curve, **columns).with_force(force)
    steeper = np.divide(found.k_n, curve.k_n, out=np.ones(len(P)), where=curve.k_n > 0.0)
    return replace(found, error_k_n=curve.error_k_n * steeper), budget


def loading_force(curve: Curve, delta_star: Floats) -> Floats:
    """P* of the first loading at given approaches, by shape-preserving interpolation of its logarithms.

    Before the first step with a force it is continued as that of a single contact, (delta*)^(3/2): a cubic through
    steps that follow closely on a late first touch would leave all bounds. Beyond the last step its tangent is.

    Raises:
        InputError: no step has a force
    """
    branch = curve.loading()
    branch = branch.where(branch.P_star > 0.0)
    if not len(branch):
        raise InputError("accuracy.tolerance: the force is zero in every step: raise loading.delta_max")
    x, y, at = np.log(branch.delta_star), np.log(branch.P_star), np.log(delta_star)
    if len(branch) == 1:
        return np.asarray(np.exp(y[0] + SINGLE_CONTACT * (at - x[0])))
    return _in_logarithms(x, y, at, SINGLE_CONTACT)


def judged_rows(curve: Curve, steps: int) -> Flags:
    """Rows whose bar is judged: the first loading from the end of the first of the planned steps on.

    The midpoint rule puts smaller ones before, where the contact is too small for a mesh made for the planned ones.
    """
    loading = curve.branch == "load"
    return loading & (curve.delta_star >= 0.999 * curve.delta_star[loading].max() / steps)


def relative(bar: Floats, P_star: Floats, without: float = inf) -> Floats:
    """Error bars over the force; `without` where there is none."""
    return np.divide(bar, P_star, out=np.full(len(bar), without), where=P_star > 0.0)


def scaled(curve: Curve, factor: Floats) -> Curve:
    """A curve with the forces of its first loading times a factor (n,), those of later branches times its last one."""
    of_row = factor[rows_of_loading(curve.branch == "load")]
    curve = replace(curve, P_star=curve.P_star * of_row, mean_pressure=curve.mean_pressure * of_row)
    return curve.with_force(curve.force * of_row)


def rows_of_loading(loading: Flags) -> Array:
    """Place of each row among those of the first loading (rows,); of later branches that of its last one."""
    return np.where(loading, np.cumsum(loading), np.count_nonzero(loading)) - 1


def _open_area(curve: Curve, delta_star: Floats) -> Floats:
    """Error of the area of contact over the area along the first loading, no more than 1, at given approaches.

    A spot of a few facets is larger or smaller by chance from mesh to mesh, and its force with it. Two such meshes may
    agree by chance, and their difference shows nothing; the area that cut facets leave open shows it. It is twice what
    the area deviates by.
    """
    branch = curve.loading()
    area, edge = branch.area_fraction, np.nan_to_num(branch.edge_fraction)
    error = np.sqrt(np.maximum(branch.error_area_fraction**2 - (EDGE * edge) ** 2, 0.0))
    share = np.divide(error, area, out=np.ones(len(branch)), where=area > error)
    return np.interp(delta_star, branch.delta_star, share)
