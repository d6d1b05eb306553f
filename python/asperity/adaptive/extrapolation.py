"""Force, area, gap, stiffness and flow of the limit of two meshes, with their error bars: a function a quantity.

The force on a mesh is extrapolated from a coarser one (`limits`), and so is what follows from the force. What is left
of the error of the load steps, of the waves that a mesh leaves out, and of the equations is added to the bar.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property

import numpy as np

from asperity.adaptive.guide import Omission
from asperity.adaptive.limits import (
    AREA_ORDER,
    EDGE_ORDER,
    FLOW_ORDERS,
    GAP_ORDERS,
    USUAL_ORDER,
    Orders,
    limit_of_area,
    limit_of_meshes,
    orders_of,
    partner,
    shares,
    steady,
)
from asperity.adaptive.loading import (
    TINY,
    loading_force,
    open_area,
    over_force,
    relative,
    rising,
    rows_of_loading,
    scaled,
    shifted,
)
from asperity.arrays import Flags, Floats
from asperity.curve import WITH_ERRORS, Curve
from asperity.curve.slope import SINGLE_CONTACT, legs, slopes
from asperity.quasistatic.thin_film import ThinFilm

# Deviation of the force over that of the area from mesh to mesh, both relative: 0.11 and 0.15 on meshes of scale 1 and
# 2 of twelve single spots, each at another place of the block. In a solid that yields the force is that of a full
# indentation, its pressure times the area, and deviates by half of the open area, the deviation of the area
SCATTER, FLOWING = 0.12, 0.5
STEEPEST = 2.0  # power of the force that the approach is moved by: a force that stands still gives none
MOST = 20.0  # bar of the logarithm of a flow beyond which nothing is known
AREA, GAP = "area_fraction", "mean_gap"
MEASURES = (AREA, *(name for name in WITH_ERRORS if name != "k_n"))  # of the contact, functions of the force


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
        return np.sqrt(self.mesh**2 + self.roughness**2 + self.load_step**2) + self.algebraic

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


@dataclass(frozen=True)
class Pair:
    """Two meshes of a load path, compared along the first loading of the finer one."""

    fine: PressedMesh
    coarse: PressedMesh
    judged: Flags  # rows of the loading whose bars are; larger ones before say nothing about their neighbours (n,)
    compliance: float = 0.0  # see `without_omission`
    flows: bool = False  # whether the solid yields

    @cached_property
    def at(self) -> Floats:
        """Approaches (n,) [L]."""
        return self.fine.curve.loading().delta_star

    @cached_property
    def singular(self) -> Floats:
        """Part of the edges of spots where the pressure is singular (n,)."""
        return self.fine.missed.at(self.at)[2]

    def limit(self, coarse: Floats, fine: Floats, orders: Orders | None = None) -> tuple[Floats, Floats]:
        """Limit of a quantity over its value on the finer mesh, and its relative bar; see `limit_of_meshes`."""
        orders = orders or orders_of(self.coarse.scale)
        return limit_of_meshes(coarse, fine, self.coarse.scale / self.fine.scale, self.singular, self.judged, orders)

    @cached_property
    def force(self) -> tuple[Floats, Floats]:
        """Limit of the force at the approaches, see `limit`: its bar holds the range of the orders alone."""
        return self.limit(loading_force(self.coarse.curve, self.at), self.fine.curve.loading().P_star)

    def shares(self) -> tuple[Floats, Floats]:
        """Of the change of the force from mesh to mesh, see `limits.shares`."""
        return shares(self.coarse.scale / self.fine.scale, self.singular, orders_of(self.coarse.scale))

    def cut(self, mesh: PressedMesh) -> Floats:
        """Relative bar of force and stiffness on a mesh by facets that are cut at random (n,)."""
        return (FLOWING if self.flows else SCATTER) * open_area(mesh.curve, self.at)

    def omitted(self, mesh: PressedMesh) -> Floats:
        """Relative bar of the force on a mesh by the waves that it leaves out (n,)."""
        return other_half(mesh.missed.at(self.at)[0])

    @cached_property
    def scatter(self) -> Floats:
        """Relative bar of limits of force and stiffness by facets that are cut at random (n,)."""
        return of_limit(self.shares()[0], self.cut(self.fine), self.cut(self.coarse))

    @cached_property
    def roughness(self) -> Floats:
        """Relative bar of the limit of the force by the waves that the meshes leave out (n,)."""
        return of_limit(self.shares()[0], self.omitted(self.fine), self.omitted(self.coarse))

    def expected(self, meshes: Sequence[PressedMesh]) -> Callable[[float], Floats]:
        """Relative bar (n,) expected of the force on a mesh, by how much finer than the last one it is.

        Args:
            meshes: those before it, one of which its limit is found with
        """
        scales, order = [mesh.scale for mesh in meshes], USUAL_ORDER + self.singular * (EDGE_ORDER - USUAL_ORDER)
        cut, omitted = ([error(mesh) for mesh in meshes] for error in (self.cut, self.omitted))
        spread = self.force[1] / self.shares()[1] / (self.coarse.scale**order - self.fine.scale**order)

        def bar(finer: float) -> Floats:
            scale = scales[-1] / finer
            other = partner([*scales, scale])
            weight, share = shares(scales[other] / scale, self.singular, orders_of(scales[other]))
            parts = (
                share * spread * (scales[other] ** order - scale**order),
                of_limit(weight, cut[-1] / finer**AREA_ORDER, cut[other]),
                of_limit(weight, omitted[-1] / finer**order, omitted[other]),
            )
            return np.sqrt(np.sum(np.square(parts), axis=0))

        return bar

    def at_force(self, name: str, P_star: Floats) -> tuple[Floats, Floats]:
        """A measure on the coarser and the finer mesh at given forces."""
        return over_force(self.coarse.curve, name, P_star), over_force(self.fine.curve, name, P_star)


def correct(
    pair: Pair, raw: Curve, steps: Floats, algebraic: float, greatest: float | None = None
) -> tuple[Curve, Budget]:
    """Extrapolated curve of the finer of two meshes with its error bars.

    The force is extrapolated at the approach. Area, mean gap, stiffnesses and flow are functions of the force: the
    meshes are compared at the same force, where they do not have the error of the force. Later branches start from the
    end of the first loading: their bars keep its size.

    Args:
        pair: the meshes
        raw: the curve of the finer mesh as computed
        steps: relative error left of the load steps (n,)
        algebraic: relative error of the equations left unsolved
        greatest: force at which the loadings end where the load path gives it, see `at_given_forces` [force]
    """
    curve, budget = force_limit(pair, steps, algebraic)
    if greatest is not None:  # it is the corrected curve that reaches it
        curve, budget = at_given_forces(curve, budget, raw, greatest)
    first = curve.loading()
    for name in MEASURES:
        coarse, fine = pair.at_force(name, first.P_star)
        if np.isfinite(coarse).all() and np.nanmax(fine, initial=0.0) > 0.0:
            curve = with_measure(curve, name, *LIMITS.get(name, stiffness_limit)(pair, curve, name, coarse, fine))
        elif name in ThinFilm.columns:
            curve = curve.with_bar(name, getattr(curve, name), closed_bar(pair, name))
    pressure = relative(curve.P_star, raw.P_star, 1.0) / relative(curve.area_fraction, raw.area_fraction, 1.0)
    curve = replace(curve, mean_pressure=raw.mean_pressure * pressure)
    return curve.with_bar("k_n", curve.k_n, slope_bar(curve, budget)), budget


def force_limit(pair: Pair, steps: Floats, algebraic: float) -> tuple[Curve, Budget]:
    """The curve of the finer mesh with the limit of its force, and the parts of the bar, see `correct`."""
    curve = pair.fine.curve
    loading = curve.branch == "load"
    factor, spread = pair.force
    curve = scaled(curve, factor)
    parts = np.hypot(spread, pair.scatter), pair.roughness, steps, np.full(len(steps), algebraic)
    budget = Budget(*((part * curve.P_star[loading])[rows_of_loading(loading)] for part in parts))
    return replace(curve, error_P_star=budget.total), budget


def area_limit(pair: Pair, curve: Curve, name: str, coarse: Floats, fine: Floats) -> tuple[Floats, Floats]:
    """Limit of the contact area and its bar, by the place of the edge.

    Args:
        pair: the meshes
        curve: with the forces at which the limit is sought, and the measures before
        name: of the measure
        coarse, fine: its values at these forces along the loading (n,)

    Returns:
        limit and bar (n,), in the unit of the measure
    """
    edges = pair.at_force("edge_fraction", curve.loading().P_star)
    chance = [open_area(mesh.curve, pair.at) for mesh in (pair.coarse, pair.fine)]
    factor, bar = limit_of_area((coarse, fine), edges, chance, pair.fine.missed.at(pair.at)[3], pair.judged)
    return factor * fine, bar * factor * fine


def gap_limit(pair: Pair, curve: Curve, name: str, coarse: Floats, fine: Floats) -> tuple[Floats, Floats]:
    """Limit of the mean gap and its bar, by its order and by the waves that the meshes leave out, see `area_limit`."""
    factor, bar = pair.limit(coarse, fine, GAP_ORDERS)
    left_out = pair.compliance * pair.roughness * curve.loading().P_star
    return factor * fine, np.hypot(bar * factor * fine, left_out)


def stiffness_limit(pair: Pair, curve: Curve, name: str, coarse: Floats, fine: Floats) -> tuple[Floats, Floats]:
    """Limit of a stiffness and its bar, by the order of the force and by facets cut at random, see `area_limit`."""
    factor, bar = pair.limit(coarse, fine)
    return factor * fine, np.hypot(bar, pair.scatter) * factor * fine


def flow_limit(pair: Pair, curve: Curve, name: str, coarse: Floats, fine: Floats) -> tuple[Floats, Floats]:
    """Limit of a flow through the gap and its bar, see `area_limit`.

    Where the last channels close, the flow may change by more than its size: the bar is that of the logarithm, upwards.
    It holds what the bar of the area makes of the flow, by their slope along the curve. Where one of the meshes is
    closed, the flow may be anything up to what goes through the other one. It falls along the loading: no bar exceeds
    the flow of a step before with its bar.
    """
    first = curve.loading()
    factor, bar = pair.limit(coarse, fine, FLOW_ORDERS)
    area, known = first.area_fraction, (first.area_fraction > 0.0) & (fine > 0.0)
    if np.count_nonzero(known) > 1:
        steepness = np.gradient(np.log(fine[known]), np.log(area[known]))
        bar[known] = np.hypot(bar[known], steepness * (first.error_area_fraction / np.maximum(area, TINY))[known])
    bar = np.expm1(np.minimum(bar, MOST))
    for pressed in (pair.coarse.curve.loading(), pair.fine.curve.loading()):
        last = np.max(pressed.P_star[getattr(pressed, name) > 0.0], initial=0.0)
        bar = np.where(last < first.P_star, np.maximum(bar, 1.0), bar)
    value, bar = factor * fine, bar * factor * fine
    return value, np.minimum(bar, np.minimum.accumulate(value + bar))


def closed_bar(pair: Pair, name: str) -> Floats:
    """Bar of a flow that a mesh has at one step of the loading at most (rows,); NaN where a later branch opens it.

    The flow falls along the loading: it is no more than the meshes have at the step before.
    """
    flows = [getattr(mesh.curve, name) for mesh in (pair.coarse, pair.fine)]
    if not any(map(np.any, flows)):
        return np.zeros(len(flows[1]))  # closed from the first touch on
    loading, coarse = pair.fine.curve.branch == "load", pair.coarse.curve.loading()
    greatest = np.maximum(np.interp(pair.at, coarse.delta_star, getattr(coarse, name)), flows[1][loading])
    bar = np.full(len(loading), np.nan)
    bar[loading] = np.append(greatest[:1], greatest[:-1])
    return bar


LIMITS = {
    AREA: area_limit,
    GAP: gap_limit,
    **dict.fromkeys(ThinFilm.columns, flow_limit),
}  # of others that of stiffness


def with_measure(curve: Curve, name: str, limit: Floats, bar: Floats) -> Curve:
    """A curve with the limit of a measure along its loading and its bar (n,), see also `shifted`.

    Later branches are moved as the end of the loading: they close the same gap farther on, and as many times the rest.
    """
    loading, before = curve.branch == "load", getattr(curve, name)
    rows = rows_of_loading(loading)
    if name == GAP:
        values = before + (limit - before[loading])[rows]
    else:
        values = before * relative(limit, before[loading], 1.0)[rows]
    return curve.with_bar(name, values, bar[rows] + shifted(curve, curve.error_P_star, values, name != GAP))


def slope_bar(curve: Curve, budget: Budget) -> Floats:
    """Error bars of the slope k_n [force/length].

    Errors of the force at neighbouring steps are nearly the same part of it, which is that of the slope too. What
    steps miss shows in the change of the exponent, and what changes over more of them is that of cut facets; both
    are by chance.
    """
    _, change = slopes(curve.delta, curve.force, curve.branch)
    for name in np.unique(curve.branch):
        rows = curve.branch == name
        change[rows] = steady(change[rows])
    cut = open_area(curve, curve.loading().delta_star)[rows_of_loading(curve.branch == "load")]
    bar = relative(budget.total, curve.P_star, 0.0) + np.hypot(change, cut)
    return np.asarray(bar * np.abs(curve.k_n))


def of_elastic_solve(curve: Curve) -> Curve:
    """A curve of an elastic solid without friction: its slope k_n is the elastic stiffness, where that is known.

    The elastic solve of a step does not know what the steps before and after missed, as differences do. At an approach
    the slope has the error of the force there too, for it grows with the force by less than its first power.
    """
    known = curve.k_n_elastic > 0.0
    bar = np.hypot(curve.error_k_n_elastic, relative(curve.error_P_star, curve.P_star, 0.0) * curve.k_n_elastic)
    return curve.with_bar("k_n", np.where(known, curve.k_n_elastic, curve.k_n), np.where(known, bar, curve.error_k_n))


def at_given_forces(curve: Curve, budget: Budget, raw: Curve, greatest: float) -> tuple[Curve, Budget]:
    """A corrected curve at the forces that were computed, which a load path gives: its approaches are corrected.

    The approach is moved as the power of the force that it is there; what a change of the exponent from step to step
    makes of the force is in its bar. Later branches are moved as the end of the first loading.

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
    factor = np.where(touched, relative(P[loading], first.P_star, 1.0), 1.0)

    power = np.full(len(first), 1.0 / SINGLE_CONTACT)
    if np.count_nonzero(known := touched & rising(first.P_star, 1e-6)) > 1:
        power[known] = np.gradient(np.log(first.delta[known]), np.log(first.P_star[known]))
    power[np.abs(power) > STEEPEST] = 1.0 / SINGLE_CONTACT
    longer = (factor**power)[rows]
    _, bend = slopes(first.delta, first.force, first.branch)
    bent = np.nan_to_num(bend) * np.abs(np.log(factor)) * P[loading]
    budget = Budget(*(getattr(budget, part.name) * factor[rows] for part in fields(budget)))
    budget = replace(budget, mesh=np.hypot(budget.mesh, bent[rows]))
    moved = replace(curve, delta=longer * curve.delta, delta_star=longer * curve.delta_star, P_star=P)
    return replace(moved, error_P_star=budget.total).with_force(force), budget


def without_omission(curve: Curve, missed: Omission, compliance: float) -> Curve:
    """A curve corrected for half of what the top of its mesh leaves out: forces, gaps, areas with their bars.

    A half-space does not know what the solid makes of a top: of flat tops with sharp edges it takes out too much. The
    bar therefore holds the other half, whatever part of it is true. An area that ends at such edges is not corrected.

    Args:
        compliance: of the block, compression over P* [length]; at a given approach the mean gap is the larger by it
    """
    loading = curve.branch == "load"
    force, area, _, sharp = missed.at(curve.delta_star[loading])
    area, sharp = (values[rows_of_loading(loading)] for values in (area, sharp))
    by = 1.0 + 0.5 * (1.0 - sharp) * area
    error = np.hypot(by * curve.error_area_fraction, 0.5 * area * curve.area_fraction)
    corrected = scaled(curve, 1.0 + 0.5 * force).with_bar(AREA, by * curve.area_fraction, error)
    return replace(corrected, mean_gap=curve.mean_gap + compliance * (corrected.P_star - curve.P_star))


def of_limit(weight: Floats, fine: Floats | float, coarse: Floats | float) -> Floats:
    """What independent errors of two meshes make of their limit, by the weight of their difference."""
    return np.hypot((1.0 + weight) * fine, weight * coarse)


def other_half(missed: Floats) -> Floats:
    """Half of a change that is not corrected, over the value with the half that is."""
    return np.abs(0.5 * missed / (1.0 + 0.5 * missed))
