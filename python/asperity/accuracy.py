"""Accuracy as an input: meshes and load steps refined until the force has the error bar asked for.

A coarse mesh serves twice: it shows where the surface is touched, which guides the finer meshes, and it measures the
error of the load steps, which hardly depends on the mesh. That of the mesh follows from two guided ones (`refinement`);
the finest needs no more steps than the coarse one told. The midpoint rule along a spreading plastic contact is of
second order; a part of its correction is the bar.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from math import inf
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.interpolate import PchipInterpolator

from .curve import Curve
from .errors import InputError
from .levels import Goal, Level, Runner
from .loading import Callback
from .material import Material
from .refinement import (
    ELASTIC_SAFETY,
    FIRST,
    GUIDE,
    LEAST_STEP,
    MESH_ORDERS,
    MOVED,
    PLASTIC_SAFETY,
    STEP_ORDERS,
    STEPS_SHARE,
    extrapolate,
    extrapolate_mesh,
    partner,
    plan_next,
    safety_of,
)
from .schedule import MIDPOINT
from .statics import ContactResult
from .surface import Surface

Floats = npt.NDArray[np.float64]

MAX_DOUBLINGS = 5  # of the parts of load steps
PATH_TRANSFER = 0.7  # part of the load-step correction taken for its bar (docs/accuracy.md)


@dataclass(frozen=True)
class Budget:
    """Error bars of P* at the rows of a curve, absolute, by their origin; `total` is their sum.

    Attributes:
        mesh: of the element size, the quadrature included, which the extrapolation removes with it
        load_step: of the integration of plasticity along the path
        algebraic: of the equations left unsolved, from the balance of forces
    """

    mesh: Floats
    load_step: Floats
    algebraic: Floats

    @property
    def total(self) -> Floats:
        """Sum of the parts."""
        return self.mesh + self.load_step + self.algebraic

    def to_dict(self) -> dict[str, list[float]]:
        """Columns of the budget for summary.json."""
        return {k: getattr(self, k).tolist() for k in ("mesh", "load_step", "algebraic", "total")}


@dataclass(frozen=True)
class AccurateResult:
    """A curve with error bars.

    Attributes:
        curve: rows of the finest mesh, force and P_star extrapolated, error_P_star filled in
        raw: the same rows as computed
        budget: parts of the error bar, rows as in the curve
        levels: what was computed, in order
        contact: the finest result, with mesh and last state
        worst: greatest relative bar that is judged
        met: whether the bar is within the tolerance along the first loading
        reason: "done", or what stopped the refinement
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
                "worst_relative_bar": self.worst,
                "levels": [asdict(level) for level in self.levels],
                "P_star_of_finest_mesh": self.raw.P_star.tolist(),
            },
            "error_budget": self.budget.to_dict(),
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
    """P* of the first loading at given deflections, by shape-preserving interpolation of its logarithms.

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
    goal: Goal,
    *,
    delta_max: float | None = None,
    force_max: float | None = None,
    steps: int = 10,
    on_stage: Callable[[str], None] | None = None,
    on_step: Callback | None = None,
    **settings: Any,
) -> AccurateResult:
    """Refine mesh and load steps until the force along the first loading has the error bar asked for; collective.

    Args:
        surface, material: as in `statics.solve_contact`, whose other arguments `settings` may hold
        goal: tolerance and limits
        delta_max, force_max, steps: as in `statics.solve_contact`; the steps of the result
        on_stage, on_step: progress call-backs

    Raises:
        InputError: see `statics.solve_contact`; or goal.max_dofs does not even allow the coarse meshes
        PartialResult: a load step does not converge
    """
    if settings.keys() & {"size", "block", "substeps"}:
        raise InputError(
            "accuracy.tolerance chooses mesh and substeps: leave out mesh.h_contact, mesh.file and substeps"
        )
    driven = dict(delta_max=delta_max, force_max=force_max, steps=steps)
    safety = PLASTIC_SAFETY if material.plastic else ELASTIC_SAFETY
    run = Runner(surface, material, goal.max_dofs, driven | settings, on_stage, on_step)
    guide = run(GUIDE)
    path, substeps, of_guide = None, 1, guide.curve
    if material.plastic:
        order = STEP_ORDERS[settings.get("integrator", MIDPOINT)]
        path, substeps, of_guide = _choose_substeps(run, guide.curve, steps, order, STEPS_SHARE * goal.tolerance)
    run.aim(guide)
    del guide  # its memory is needed for the next one
    sizes, curves, before = [run.levels[0].h / surface.L], [of_guide], None
    size = FIRST * GUIDE
    while True:
        result = run(size, substeps)
        sizes.append(run.levels[-1].h / surface.L)
        judged = _judged(result.curve, steps)
        coarse = partner(sizes)
        pair = _Pair(curves[coarse], sizes[coarse] / sizes[-1], safety_of(coarse, safety), before)
        curve, budget = _correct(result, pair, judged, path)
        before = curve
        worst = worst_error(curve, steps)
        if worst <= goal.tolerance:
            return AccurateResult(curve, result.curve, budget, tuple(run.levels), result, worst, True, "done")
        parts = (budget.mesh, budget.total - budget.mesh)
        mesh, rest = (relative(bar[judged], curve.P_star[judged]) for bar in parts)
        left = np.maximum(goal.tolerance - rest, 0.1 * goal.tolerance)  # for the mesh, when the load steps have theirs
        wanted = plan_next(sizes, coarse, float(np.max(mesh / left)), 1.0, safety)
        room = (goal.max_dofs / result.dofs) ** (1.0 / run.growth_of_dofs())
        size = max(wanted, sizes[-1] / max(room, LEAST_STEP))
        limit = run.limit(goal, float(rest.max()), sizes[-1], wanted if room < LEAST_STEP else size)
        if limit:
            reason = (
                f"the force is known to {worst:.2%}, not to the {goal.tolerance:.2%} of accuracy.tolerance: {limit}"
            )
            return AccurateResult(curve, result.curve, budget, tuple(run.levels), result, worst, False, reason)
        curves.append(result.curve)
        del result


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
class _PathError:
    """Error of the force from the load steps, relative, at deflections of the guiding mesh.

    Attributes:
        delta_star: deflections (n,)
        correction: relative error with the steps chosen (n,)
        bar: relative error left after the correction (n,)
    """

    delta_star: Floats
    correction: Floats
    bar: Floats


def _choose_substeps(
    run: Runner, curve: Curve, steps: int, order: float, wanted: float
) -> tuple[_PathError, int, Curve]:
    """Parts of each load step whose error bar is the wanted one, and the guide's curve with as many.

    The guiding mesh is loaded in steps of 1, 2, 4 ... parts, and the limit extrapolated from the last two runs. What is
    found there corrects the finest mesh as well; a part of the correction, which need not carry over and is itself
    only known to leading order, is the bar.

    Args:
        run: solver of levels
        curve: of the guiding mesh with whole steps
        steps: planned ones
        order: of the error in the step
        wanted: relative error bar
    """
    at = curve.delta_star[_judged(curve, steps)]
    curves = {1: curve}
    P = [loading_force(curve, at)]
    for doublings in range(1, MAX_DOUBLINGS + 1):
        n = 2**doublings
        curves[n] = run(GUIDE, n, loading_only=True).curve
        P.append(loading_force(curves[n], at))
        limit, _ = extrapolate(P[-2], P[-1], 2.0, order)
        for n, values in zip(curves, P, strict=True):
            correction = values / limit - 1.0
            path = _PathError(at, correction, PATH_TRANSFER * steady(correction))
            if np.max(path.bar) <= wanted:
                return path, n, curves[n]
    return path, n, curves[n]


@dataclass(frozen=True)
class _Pair:
    """What a level is extrapolated with.

    Attributes:
        coarse: curve of the level to extrapolate from
        ratio: of its element size to that of the finest
        safety: factor on the bar
        before: extrapolated curve of the level before, if there was one
    """

    coarse: Curve
    ratio: float
    safety: float
    before: Curve | None


def _correct(
    result: ContactResult,
    pair: _Pair,
    judged: npt.NDArray[np.bool_],
    path: _PathError | None,
) -> tuple[Curve, Budget]:
    """Extrapolated curve of the finest level with its error bars.

    Along the first loading the corrections are those of the rows. Later branches start from its end: they take its
    corrections there as a factor, and their bars keep its size.

    Args:
        result: of the finest level
        pair: what to extrapolate with
        judged: rows whose bars are; those before have larger ones that say nothing about their neighbours
        path: error of the load steps
    """
    curve = result.curve
    loading = curve.branch == "load"
    at = curve.delta_star[loading]
    raw = curve.P_star[loading]
    touching = np.where(raw > 0.0, raw, inf)  # what has no force has no relative error
    _, mesh, spread = extrapolate_mesh(loading_force(pair.coarse, at), raw, pair.ratio, pair.safety)
    correction, bar = mesh / touching, spread / touching
    path_bar = np.zeros(len(raw))
    if path is not None:
        correction = correction + np.interp(at, path.delta_star, path.correction)
        path_bar = np.interp(at, path.delta_star, path.bar)
    if pair.before is not None:
        moved = np.abs(loading_force(pair.before, at) * (1.0 + correction) / touching - 1.0) * (raw > 0.0)
        bar = np.maximum(bar, MOVED * moved / pair.ratio ** MESH_ORDERS[0])
    mesh_bar = steady(bar)
    mesh_bar[judged[loading]] = steady(bar[judged[loading]])
    rows = np.where(loading, np.cumsum(loading) - 1, len(raw) - 1)
    factor = 1.0 / (1.0 + correction[rows])
    P = curve.P_star * factor
    scale = np.where(loading, P, P[loading][-1] if loading.any() else 0.0)
    algebraic = np.full(len(curve), result.checks.force_balance) * scale
    budget = Budget(mesh_bar[rows] * scale, path_bar[rows] * scale, algebraic)
    corrected = replace(curve, force=curve.force * factor, P_star=P, error_P_star=budget.total)
    return corrected, budget
