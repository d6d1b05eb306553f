"""Accuracy as an input: meshes and load steps refined until the force has the requested error bar.

A coarse mesh shows where the surface is touched, which guides the finer meshes. The first of these measures the error
of the load steps, which depends little on the mesh: the finer ones need no more steps than it found, and all forces are
corrected for their steps; a part of the correction is its bar. The error of the mesh follows from two of them
(`refinement`).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from functools import partial
from math import inf, isfinite, nan
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt
from scipy.interpolate import PchipInterpolator

from asperity.adaptive.mesh_levels import Level, Runner
from asperity.adaptive.mesh_plan import (
    FIRST,
    FIRST_STEP,
    GUIDE,
    LEAST_STEP,
    STEP_ORDERS,
    bar_share,
    cheapest_substeps,
    error_of,
    extrapolate,
    extrapolate_mesh,
    partner,
    plan_next,
    planned_steps,
    safety_of,
    scatter,
)
from asperity.adaptive.roughness import AREA_BAR, FORCE_BAR, Omission, Roughness
from asperity.arrays import Floats
from asperity.curve import Curve
from asperity.errors import InputError, Interrupted, MeshError
from asperity.mesh.block import BlockMesh
from asperity.mesh.resolution import advice, resolving_size
from asperity.model.load_path import BACKWARD_EULER, MIDPOINT
from asperity.model.material import Material
from asperity.model.problem import Problem
from asperity.model.settings import AccuracyTarget, penalty_too_soft
from asperity.quasistatic.solve_contact import ContactResult, Hooks, PartialResult
from asperity.quasistatic.stepping import Callback
from asperity.runtime.parallel import on_root, on_root_bcast
from asperity.surface import Surface

if TYPE_CHECKING:
    from mpi4py import MPI

    from asperity.quasistatic.checkpoint import Checkpoint

# Part of the load-step correction taken for its bar; of the rule of first order much more is corrected
PATH_TRANSFER = {MIDPOINT: 0.5, BACKWARD_EULER: 1.0}


@dataclass(frozen=True)
class Budget:
    """Error bars of P* at the rows of a curve, absolute, by their origin; `total` is their sum.

    Attributes:
        mesh: of the element size, the quadrature included, which the extrapolation removes with it
        roughness: of the waves that the mesh leaves out
        load_step: of the integration of plasticity along the path
        algebraic: of the equations left unsolved, from the balance of forces

    Examples:
        >>> mesh, none = np.array([0.02]), np.zeros(1)
        >>> budget = Budget(mesh, roughness=none, load_step=np.array([0.01]), algebraic=none)
        >>> budget.to_dict()["total"]
        [0.03]
    """

    mesh: Floats
    roughness: Floats
    load_step: Floats
    algebraic: Floats

    @property
    def total(self) -> Floats:
        """Sum of the parts."""
        return self.mesh + self.roughness + self.load_step + self.algebraic

    def to_dict(self) -> dict[str, list[float]]:
        """Columns of the budget for summary.json."""
        return {k: getattr(self, k).tolist() for k in ("mesh", "roughness", "load_step", "algebraic", "total")}

    @staticmethod
    def unknown(rows: int) -> Budget:
        """The budget of a force that has no error bar."""
        return Budget(*(np.full(rows, nan) for _ in range(4)))


@dataclass(frozen=True)
class AccurateResult:
    """A curve with error bars.

    Attributes:
        curve: rows of the finest mesh, force and P_star extrapolated, error_P_star filled in; as computed, and without
            it, when the force has no error bar
        raw: the same rows as computed
        budget: parts of the error bar, rows as in the curve, NaN where there is none
        levels: what was computed, in order
        contact: the result of the mesh of the curve, with its last state
        worst: greatest relative bar that is judged, NaN without one
        met: whether the bar is within the tolerance along the first loading
        reason: "done", or what stopped the refinement

    Examples:
        >>> from asperity.surface import Flat
        >>> block = asp.Problem.of(Flat(L=1.0), asp.Material(E=1.0, nu=0.3), delta_max=0.01, steps=2)

        >>> result = refine(block, asp.AccuracyTarget(0.01))
        >>> result.reason, len(result.curve), bool(result.budget.total.max() < 1e-6)
        ('done', 6, True)
    """

    curve: Curve
    raw: Curve
    budget: Budget
    levels: tuple[Level, ...]
    contact: ContactResult
    worst: float
    met: bool
    reason: str

    def to_dict(self) -> dict[str, Any]:
        """Sections "accuracy" and "error_budget" of summary.json."""
        return {
            "accuracy": {
                "met": self.met,
                "worst_relative_bar": self.worst if isfinite(self.worst) else None,
                "levels": [asdict(level) for level in self.levels],
                "P_star_of_finest_mesh": self.raw.P_star.tolist(),
            },
            "error_budget": self.budget.to_dict() if isfinite(self.worst) else None,
        }


def steady(relative: Floats, reach: int = 2) -> Floats:
    """Error bars that do not vanish where an error happens to change sign.

    Each is at least the root mean square over its neighbours, `reach` to either side, and over the branch.

    Args:
        relative: estimated relative errors along a branch (n,)
    """
    padded = np.pad(relative**2, reach, mode="edge")
    window = np.lib.stride_tricks.sliding_window_view(padded, 2 * reach + 1)
    mean_square = np.maximum(window.mean(axis=1), np.mean(relative**2))
    return np.maximum(np.abs(relative), np.sqrt(mean_square))


def loading_force(curve: Curve, delta_star: Floats) -> Floats:
    """P* of the first loading at given approaches, by shape-preserving interpolation of its logarithms.

    One step with a force is continued as that of a single contact, (delta*)^(3/2).

    Raises:
        InputError: no step has a force
    """
    branch = curve.loading()
    branch = branch.where(branch.P_star > 0.0)
    if not len(branch):
        raise InputError("accuracy.tolerance: the force is zero in every step: raise loading.delta_max")
    if len(branch) == 1:
        return np.asarray(branch.P_star[0] * (delta_star / branch.delta_star[0]) ** 1.5)
    law = PchipInterpolator(np.log(branch.delta_star), np.log(branch.P_star), extrapolate=True)
    return np.exp(law(np.log(delta_star)))


def solve_to_tolerance(
    surface: Surface,
    material: Material,
    goal: AccuracyTarget,
    *,
    comm: MPI.Comm | None = None,
    snapshots: int = 0,
    on_stage: Callable[[str], None] | None = None,
    on_step: Callback | None = None,
    on_curve: Callable[[Curve], None] | None = None,
    checkpoint: Checkpoint | None = None,
    stop: Callable[[], str] | None = None,
    **problem: Any,
) -> AccurateResult:
    """Refine mesh and load steps until the force along the first loading has the requested error bar; collective.

    The call for scripts: `refine` of `Problem.of(surface, material, **problem)`.

    Args:
        surface, material: as in `solve_contact`
        goal: tolerance and limits
        comm: communicator; default all ranks
        snapshots, on_stage, on_step, checkpoint, stop: see `solve_contact.Hooks`
        on_curve: called with the curve with error bars that each mesh after the guide gives
        problem: delta_max or force_max, steps, height, sides and other arguments of `Problem.of`; the steps of the
            result are a multiple, see `mesh_plan.planned_steps`

    Raises:
        InputError: mesh sizes or substeps are given, or see `refine`
        PartialResult: see `refine`

    Examples:
        >>> from asperity.surface import Flat
        >>> steel = asp.Material(E=1.0, nu=0.3)
        >>> result = asp.solve_to_tolerance(Flat(L=1.0), steel, asp.AccuracyTarget(0.01), delta_max=0.01, steps=2)
        >>> print(f"{result.curve.force[-1] / 0.01:.6f} within {result.worst:.1%}, exact {steel.confined_modulus:.6f}")
        1.346154 within 0.0%, exact 1.346154
    """
    if problem.keys() & {"size", "block", "substeps"}:
        raise InputError(
            "accuracy.tolerance chooses mesh and substeps: leave out mesh.h_contact, mesh.file and substeps"
        )
    hooks = Hooks(on_stage, on_step, stop, checkpoint, snapshots)
    return refine(Problem.of(surface, material, **problem), goal, comm, hooks, on_curve)


def refine(
    problem: Problem,
    target: AccuracyTarget,
    comm: MPI.Comm | None = None,
    hooks: Hooks | None = None,
    on_curve: Callable[[Curve], None] | None = None,
) -> AccurateResult:
    """Refine mesh and load steps until the force along the first loading has the requested error bar; collective.

    Args:
        problem: what to solve; the element sizes and the substeps are chosen here, the steps are a multiple of its own
        target: tolerance and limits
        comm: communicator; default all ranks
        hooks: progress, checkpoints, snapshots
        on_curve: called with the curve with error bars that each mesh after the guide gives

    Raises:
        InputError: target.max_dofs does not even allow the guide; or the contact is a penalty too soft for an error bar
        PartialResult: a load step does not converge before there is an error bar, the run was stopped, or
            target.max_dofs allows no mesh except the guide

    Examples:
        >>> from asperity.surface import Flat
        >>> block = asp.Problem.of(Flat(L=1.0), asp.Material(E=1.0, nu=0.3), delta_max=0.01, steps=2)

        >>> result = refine(block, asp.AccuracyTarget(0.01))
        >>> result.met, len(result.levels)
        (True, 2)
    """
    from mpi4py import MPI

    surface, material, goal = problem.surface, problem.material, target
    if soft := penalty_too_soft(problem.formulation.method, problem.formulation.penalty):
        raise InputError(soft)
    steps = planned_steps(problem.load_path.steps)
    planned = replace(problem, load_path=replace(problem.load_path, steps=steps))
    comm = MPI.COMM_WORLD if comm is None else comm
    run = Runner(planned, goal.max_dofs, comm, hooks or Hooks())
    guide = run(GUIDE)
    depth = float(guide.curve.loading().delta[-1])
    roughness = on_root(comm, partial(_roughness, planned, depth, goal.tolerance))
    run.aim(guide, None if roughness is None else roughness.contact_map())
    whole, path, substeps, stopped = guide.curve, None, 1, ""
    del guide
    if material.plastic:
        integrator = problem.load_path.integrator
        result, path, substeps, stopped = _choose_substeps(run, whole, steps, integrator, goal)
    else:
        result = run(FIRST * GUIDE)
    sizes = [run.levels[0].h / surface.L]
    curves = [_without_path_error(whole, path, 1)]
    while True:
        level = run.levels[-1]
        sizes.append(level.h / surface.L)
        judged = _judged(result.curve, steps)
        coarse = partner(sizes)
        settled = _without_path_error(result.curve, path, level.substeps)
        path_bar = path.bar[level.substeps] if path else None
        algebraic = result.checks.force_balance
        missed = on_root_bcast(comm, partial(_left_out, roughness, result.block))
        if missed is not None:
            settled = _with_area(settled, missed)
        # a mesh that misses waves is as rough a partner as the guide
        ratio, safety = sizes[coarse] / sizes[-1], safety_of(coarse == 0 or missed is not None)
        curve, budget = _correct(settled, curves[coarse], ratio, safety, judged, path_bar, algebraic, missed)
        worst = worst_error(curve, steps)
        unresolved = curve.unresolved() or curves[coarse].unresolved()
        at = curve.delta_star[judged]
        mesh = relative((budget.mesh + budget.roughness)[judged], curve.P_star[judged])
        of_steps = path.bar[substeps].at(at) if path else np.zeros(len(at))
        rest = algebraic + of_steps
        left = np.maximum(goal.tolerance - rest, 0.1 * goal.tolerance)  # for the mesh, when the load steps have theirs
        wanted = plan_next(sizes, error_of(float(np.max(mesh / left)), ratio, coarse == 0), 1.0)
        if unresolved:  # by a single node the force grows with its size, and the difference of two meshes is no error
            wanted = sizes[-1] / FIRST_STEP
        room = (goal.max_dofs / result.dofs) ** (1.0 / run.growth_of_dofs())
        known = f"the force is known to {worst:.2%}, not to the {goal.tolerance:.2%} of accuracy.tolerance"
        limit = ""
        if not unresolved:
            limit = _limit_of_steps(algebraic, float(of_steps.max()), goal.tolerance, stopped)
        if unresolved:
            known, worst = f"the force has no error bar, {unresolved}", nan
            curve = replace(result.curve, error_P_star=np.full(len(curve), nan))
            budget = Budget.unknown(len(curve))
        if on_curve is not None:
            on_curve(curve)
        found = AccurateResult(curve, result.curve, budget, tuple(run.levels), result, worst, True, "done")
        if worst <= goal.tolerance:
            return found
        size = max(wanted, sizes[-1] / max(room, LEAST_STEP))
        limit = limit or run.limit(goal, sizes[-1], wanted if room < LEAST_STEP else size, substeps)
        if limit:
            if missed is not None:
                limit += f"; waves shorter than the elements limit it too, {advice(level.h / max(room, 1.0))}"
            return replace(found, met=False, reason=f"{known}: {limit}")
        curves.append(settled)
        try:
            result = run(size, substeps)
        except (PartialResult, Interrupted, MeshError) as e:
            if isinstance(stop := e.__cause__ or e, Interrupted):
                raise PartialResult(str(e), replace(result, curve=curve)) from stop
            failed = str(e)
            if isinstance(e, PartialResult):
                failed = (
                    f"on the next mesh, of {e.result.dofs} dofs, no step converges beyond delta/L = "
                    f"{e.result.solver.delta:.6g}, use more loading.steps"
                )
            return replace(found, met=False, reason=f"{known}: {failed}")


def _limit_of_steps(algebraic: float, of_steps: float, tolerance: float, stopped: str) -> str:
    """Why no mesh meets the tolerance; empty when one may.

    Args:
        algebraic, of_steps: relative error bars of the equations and of the load steps
        tolerance: requested
        stopped: what limited the parts of the load steps
    """
    if algebraic + of_steps <= 0.9 * tolerance:
        return ""
    if algebraic > of_steps:
        return f"{algebraic:.2g} is left by the equations, lower solver.rtol or raise accuracy.tolerance"
    return stopped or "what is left comes from the load steps, raise loading.steps"


def _judged(curve: Curve, steps: int) -> npt.NDArray[np.bool_]:
    """Rows whose bar is judged: the first loading from the end of the first of the planned steps on.

    The midpoint rule puts smaller ones before, where the contact is too small for a mesh made for the planned ones.
    """
    loading = curve.branch == "load"
    return loading & (curve.delta_star >= 0.999 * curve.delta_star[loading].max() / steps)


def relative(bar: Floats, P_star: Floats) -> Floats:
    """Error bars over the force; unbounded where there is none."""
    return np.divide(bar, P_star, out=np.full(len(bar), inf), where=P_star > 0.0)


def worst_error(curve: Curve, steps: int) -> float:
    """Greatest relative error bar along the first loading in `steps` planned steps, from the first one's end on."""
    judged = _judged(curve, steps)
    return float(np.max(relative(curve.error_P_star[judged], curve.P_star[judged])))


@dataclass(frozen=True)
class _Along:
    """A relative error along the loading: values at approaches (n,), constant before the first and after the last."""

    delta_star: Floats
    value: Floats

    def at(self, delta_star: Floats) -> Floats:
        """Value at other approaches."""
        return np.interp(delta_star, self.delta_star, self.value)


@dataclass(frozen=True)
class _PathError:
    """Error of the force from the load steps, relative, by the number of parts of each.

    Attributes:
        correction: error of the force
        bar: error left after the correction
    """

    correction: dict[int, _Along]
    bar: dict[int, _Along]


def _choose_substeps(
    run: Runner, guide: Curve, steps: int, integrator: str, goal: AccuracyTarget
) -> tuple[ContactResult, _PathError, int, str]:
    """Solve on the first guided mesh for the error of the load steps, and choose the parts of each for the finer ones.

    It is loaded in steps of 1, 2, 4 ... parts, and the limit extrapolated from the last two runs. What is found
    corrects other meshes as well; a part of the correction, which need not carry over and is itself only known to
    leading order, is the bar.

    Args:
        run: solver of levels
        guide: curve of the guiding mesh with whole steps
        steps: planned ones
        integrator: of plasticity
        goal: tolerance and limits

    Returns:
        the result with the most parts, at least two; the error; the parts chosen, no more than these; and what limited
        them, if anything did
    """
    order, transfer = STEP_ORDERS[integrator], PATH_TRANSFER[integrator]
    result = run(FIRST * GUIDE)
    at = result.curve.delta_star[_judged(result.curve, steps)]
    P, n = {1: loading_force(result.curve, at)}, 1
    ratio = run.levels[0].h / run.levels[-1].h
    _, _, spread = extrapolate_mesh(loading_force(guide, at), P[1], ratio, safety_of(True))
    while True:
        n *= 2
        del result
        result = run(FIRST * GUIDE, n)
        P[n] = loading_force(result.curve, at)
        limit, _ = extrapolate(P[n // 2], P[n], 2.0, order)
        errors = {k: values / limit - 1.0 for k, values in P.items()}
        bars = {k: transfer * steady(error) for k, error in errors.items()}
        chosen = cheapest_substeps(bars, steady(spread / P[1]), goal.tolerance, order)
        stopped = run.limit(goal, FIRST * GUIDE, FIRST * GUIDE, 2 * n) if chosen > n else ""
        if stopped or chosen <= n:
            correction, bar = ({k: _Along(at, v) for k, v in of.items()} for of in (errors, bars))
            return result, _PathError(correction, bar), min(chosen, n), stopped


def _without_path_error(curve: Curve, path: _PathError | None, substeps: int) -> Curve:
    """The curve corrected for its load steps.

    Along the first loading by the corrections of the rows; later branches start from its end and take its correction
    there.
    """
    if path is None:
        return curve
    factor = 1.0 / (1.0 + path.correction[substeps].at(curve.delta_star))
    return _scaled(curve, factor[curve.branch == "load"])


def _rows_of_loading(loading: npt.NDArray[np.bool_]) -> npt.NDArray[np.int64]:
    """Place of each row among those of the first loading (rows,); of later branches that of its last one."""
    return np.where(loading, np.cumsum(loading), np.count_nonzero(loading)) - 1


def _scaled(curve: Curve, factor: Floats) -> Curve:
    """A curve with the forces of its first loading times a factor (n,), those of later branches times its last one."""
    of_row = factor[_rows_of_loading(curve.branch == "load")]
    return replace(
        curve, force=curve.force * of_row, P_star=curve.P_star * of_row, mean_pressure=curve.mean_pressure * of_row
    )


def _area_error(curve: Curve, delta_star: Floats) -> Floats:
    """Error of the area of contact over the area along the first loading, no more than 1, at given approaches."""
    branch = curve.loading()
    area, error = branch.area_fraction, branch.error_area_fraction
    share = np.divide(error, area, out=np.ones(len(branch)), where=area > error)
    return np.interp(delta_star, branch.delta_star, share)


def _correct(
    fine: Curve,
    coarse: Curve,
    ratio: float,
    safety: float,
    judged: npt.NDArray[np.bool_],
    path: _Along | None,
    algebraic: float,
    missed: Omission | None,
) -> tuple[Curve, Budget]:
    """Extrapolated curve of the finest level with its error bars.

    Later branches start from the end of the first loading: their bars keep its size.

    Args:
        fine, coarse: of the finest level and of the one to extrapolate from, without the error of their load steps
        ratio: of their element sizes
        safety: factor on the bar of the mesh
        judged: rows whose bars are; those before have larger ones that say nothing about their neighbours
        path: relative error left of the load steps
        algebraic: relative error of the equations left unsolved
        missed: what the mesh leaves out of a rough surface
    """
    loading = fine.branch == "load"
    at = fine.delta_star[loading]
    raw = fine.P_star[loading]
    touching = np.where(raw > 0.0, raw, inf)  # what has no force has no relative error
    _, error, spread = extrapolate_mesh(loading_force(coarse, at), raw, ratio, safety)
    curve = _scaled(fine, 1.0 / (1.0 + error / touching))  # positive, however much too stiff the coarse mesh is
    bar = spread / touching
    mesh_bar = steady(bar)
    mesh_bar[judged[loading]] = steady(bar[judged[loading]])
    mesh_bar = np.maximum(mesh_bar, scatter(_area_error(coarse, at), _area_error(fine, at), ratio))
    path_bar = np.zeros(len(raw)) if path is None else path.at(at)
    rows = _rows_of_loading(loading)
    rough_bar: Floats = np.zeros(len(raw))
    if missed is not None:
        rough_bar = FORCE_BAR * np.abs(missed.at(at)[0])
        before = coarse.loading()
        change = fine.area_fraction[loading] - np.interp(at, before.delta_star, before.area_fraction)
        area_bar = curve.error_area_fraction + (bar_share(ratio, safety) * np.abs(change))[rows]
        curve = replace(curve, error_area_fraction=area_bar)
    P = curve.P_star
    scale = np.where(loading, P, P[loading][-1])
    mesh_bar, rough_bar, path_bar = (bar[rows] * scale for bar in (mesh_bar, rough_bar, path_bar))
    budget = Budget(mesh_bar, rough_bar, path_bar, np.full(len(P), algebraic) * scale)
    return replace(curve, error_P_star=budget.total), budget


def _with_area(curve: Curve, missed: Omission) -> Curve:
    """A curve whose areas of contact are corrected for the roughness that its mesh leaves out, with their bars."""
    loading = curve.branch == "load"
    change = missed.at(curve.delta_star[loading])[1][_rows_of_loading(loading)]
    area, error = (column * (1.0 + change) for column in (curve.area_fraction, curve.error_area_fraction))
    pressure = np.divide(curve.mean_pressure, 1.0 + change)
    error = error + AREA_BAR * np.abs(area - curve.area_fraction)
    return replace(curve, area_fraction=area, error_area_fraction=error, mean_pressure=pressure)


def _roughness(problem: Problem, depth: float, tolerance: float) -> Roughness | None:
    """The half-space of a surface whose waves coarse meshes miss, None of a smooth surface; in one process."""
    largest = FIRST * GUIDE * problem.surface.L
    if resolving_size(problem.surface, depth, tolerance, largest) == inf:
        return None
    return Roughness(problem, depth, problem.load_path.steps)


def _left_out(roughness: Roughness | None, block: BlockMesh | None) -> Omission | None:
    return None if roughness is None or block is None else roughness.left_out(block)
