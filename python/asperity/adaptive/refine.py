"""Accuracy as an input: meshes and load steps refined until the force has the requested error bar.

A half-space shows which spots of the surface carry the force, and the meshes resolve them (`guide`). The first mesh
measures the error of the load steps (`load_step_error`), which depends little on the mesh: the finer ones need no more
steps than it found and all forces are corrected for them. The error of the mesh follows from two of them
(`extrapolation`).
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import asdict, dataclass, replace
from math import inf, isfinite, nan
from typing import TYPE_CHECKING, Any

import numpy as np

from asperity.adaptive.extrapolation import (
    Budget,
    PressedMesh,
    at_given_forces,
    correct,
    judged_rows,
    of_elastic_solve,
    relative,
    without_omission,
)
from asperity.adaptive.guide import Guide, guide_of, planned_steps
from asperity.adaptive.load_step_error import LoadStepError, choose_substeps
from asperity.adaptive.mesh_levels import Level, LevelSolver
from asperity.adaptive.mesh_plan import EDGE_ORDER, LEAST_STEP, MARGIN, RATIO, next_step, partner, planned_order, second
from asperity.arrays import Flags, Floats
from asperity.curve import Curve
from asperity.errors import Interrupted, MeshError
from asperity.model.problem import Problem
from asperity.model.settings import AccuracyTarget
from asperity.quasistatic.contact_result import ContactResult, PartialResult, refuse_wrong
from asperity.quasistatic.solve_problem import Callbacks
from asperity.runtime.display import brief
from asperity.runtime.parallel import on_root
from asperity.units import per_cent

if TYPE_CHECKING:
    from mpi4py import MPI


def refine(
    problem: Problem,
    target: AccuracyTarget,
    comm: MPI.Comm | None = None,
    hooks: Callbacks | None = None,
    guide: Guide | None = None,
) -> AccurateResult:
    """Refine mesh and load steps until the force along the first loading has the requested error bar; collective.

    Args:
        problem: what to solve; the element sizes and the substeps are chosen here, the steps are a multiple of its own
        target: tolerance and limits
        comm: communicator; default all ranks
        hooks: progress, checkpoints, snapshots
        guide: half-space of the problem on rank 0, where there is one

    Raises:
        InputError: target.max_dofs does not even allow the first mesh; the contact is a penalty too soft for an error
            bar; or the kinematics of the material is not chosen yet
        PartialResult: a load step does not converge before there is an error bar, the run was stopped, or
            target.max_dofs allows no mesh except the first

    Examples:
        >>> from asperity.surface import Flat
        >>> block = asp.Problem.of(Flat(L=1.0), asp.Material(E=1.0, nu=0.3), delta_max=0.01, steps=2)
        >>> result = refine(block, asp.AccuracyTarget(0.01))
        >>> result.reason, len(result.levels), len(result.curve), bool(result.budget.total.max() < 1e-6)
        ('done', 2, 6, True)
    """
    from mpi4py import MPI

    problem.material.check_decided()
    problem.formulation.check_bar()
    path_of = problem.load_path
    planned = replace(problem, load_path=replace(path_of, steps=planned_steps(path_of.steps)))
    comm, hooks = MPI.COMM_WORLD if comm is None else comm, hooks or Callbacks()
    hooks.stage("half-space estimate, full roughness")
    guide = on_root(comm, lambda: guide or guide_of(problem))
    run = LevelSolver(planned, guide, target, comm, hooks)
    if problem.path_dependent:
        result, path = choose_substeps(run, target.tolerance)
    else:
        result, path = run(1.0), LoadStepError.none()
    estimate = MeshErrorEstimate(run, target, path)
    estimate.add(result)
    result.solver.drop_matrices()
    result = run(run.scales[-1] / second(run.scales[-1]), path.substeps)
    while True:
        with suppress(Interrupted):  # this mesh is judged first; the next one is not begun
            hooks.stage(f"half-space estimate, roughness of mesh {len(run.scales)}")
        accurate, finer = estimate.judge(result)
        if hooks.on_curve is not None:
            hooks.on_curve(accurate.curve)
        if finer is None:
            return accurate
        result.solver.drop_matrices()  # room for the next mesh; its state stays, in case that mesh fails
        try:
            result = run(finer, path.substeps)
        except (PartialResult, Interrupted, MeshError) as e:
            if isinstance(stop := e.__cause__ or e, Interrupted):
                raise PartialResult(str(e), replace(result, curve=accurate.curve)) from stop
            failed = str(e)
            if isinstance(e, PartialResult):
                failed = (
                    f"on the next mesh, of {e.result.dofs} dofs, no step converges beyond delta/L = "
                    f"{e.result.solver.delta:.6g}, use more loading.steps"
                )
            return replace(accurate, verdict=accurate.verdict.because(failed))


@dataclass(frozen=True)
class Verdict:
    """Whether the tolerances are met, and why nothing more is done."""

    kind: str  # "met"; "unknown", where the force has no bar; "force" or "area", which is not known well enough
    bar: float = nan  # greatest relative bar of that quantity; inf where a step has none
    wanted: float = nan  # its tolerance
    reason: str = ""  # why the force has no bar, why no mesh follows; empty while one may

    def because(self, why: str) -> Verdict:
        """The same with another reason."""
        return replace(self, reason=": ".join(filter(None, (self.reason, why))))

    def __str__(self) -> str:
        if self.kind == "met":
            return "done"
        if self.kind == "unknown":
            return f"the force has no error bar, {self.reason}"
        known, key, early = {
            "force": ("the force", "tolerance", "the mesh is not touched at the first ones"),
            "area": ("the contact area", "area_tolerance", "at the first ones it is a single node"),
        }[self.kind]
        if self.bar == inf:
            known += f" has no error bar at every step, because {early}"
        else:
            known += f" is known to {per_cent(self.bar)}, not to the {per_cent(self.wanted)} of accuracy.{key}"
        return ": ".join(filter(None, (known, self.reason)))


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
        worst, worst_area: greatest relative bars of force and area that are judged, NaN without one
        verdict: whether the bars are within the tolerances along the first loading
    """

    curve: Curve
    raw: Curve
    budget: Budget
    levels: tuple[Level, ...]
    contact: ContactResult
    worst: float
    worst_area: float
    verdict: Verdict

    @property
    def met(self) -> bool:
        """Whether the tolerances are met."""
        return self.verdict.kind == "met"

    @property
    def reason(self) -> str:
        """The word "done", or what stopped the refinement."""
        return str(self.verdict)

    def __repr__(self) -> str:
        return f"AccurateResult({self.curve!r}, met={self.met}, worst={self.worst:.3g}, {brief(self.reason)})"

    def checked(self) -> AccurateResult:
        """This result, unless it violates a balance (CheckError).

        A mesh too coarse to be touched is none: the reason says so, and there is no bar.
        """
        if self.met or self.contact.checks.violated.keys() != {"touch"}:
            refuse_wrong(self.contact.checks, self)
        return self

    def to_dict(self) -> dict[str, Any]:
        """Sections "accuracy" and "error_budget" of summary.json."""
        return {
            "accuracy": {
                "met": self.met,
                "worst_relative_bar": self.worst if isfinite(self.worst) else None,
                "worst_relative_bar_of_area": self.worst_area if isfinite(self.worst_area) else None,
                "levels": [asdict(level) for level in self.levels],
                "P_star_of_finest_mesh": self.raw.P_star.tolist(),
            },
            "error_budget": self.budget.to_dict() if isfinite(self.worst) else None,
        }


class MeshErrorEstimate:
    """Judges one level after the other; collective.

    Args:
        run: solver of levels
        goal: tolerances
        path: error of the load steps
    """

    def __init__(self, run: LevelSolver, goal: AccuracyTarget, path: LoadStepError) -> None:
        self._run, self._goal, self._path = run, goal, path
        self._meshes: list[PressedMesh] = []

    def add(self, result: ContactResult) -> PressedMesh:
        """Take up the result of the last level."""
        run, missed = self._run, self._run.left_out(result)
        curve = self._path.removed(result.curve, run.levels[-1].substeps)
        if not curve.untouched():
            curve = without_omission(curve, missed, run.compliance)
        self._meshes.append(PressedMesh(run.scales[-1], result.dofs, curve, missed))
        return self._meshes[-1]

    def judge(self, result: ContactResult) -> tuple[AccurateResult, float | None]:
        """Judge the force by the result of the last level, after at least one before it.

        Returns:
            What is known so far, and how much finer the next mesh is; None where there is none, because the
            tolerances are met, or for the reason of the result
        """
        run = self._run
        fine = self.add(result)
        coarse = self._meshes[partner([mesh.scale for mesh in self._meshes])]
        given, algebraic, plastic = run.problem.load_path, result.checks.unsolved, run.problem.material.plastic
        judged = judged_rows(result.curve, given.steps)
        doubt, finer, worst = self._doubt(fine, coarse), RATIO, (nan, nan)
        if not doubt:
            of_steps = self._path.bar[run.levels[-1].substeps]
            curve, budget = correct(fine, coarse, judged, of_steps, algebraic, run.compliance, plastic)
            doubt = curve.unresolved()
        if doubt:
            # by a single node the force grows with its size, and the difference of two meshes is no error
            nothing = np.full(len(result.curve), nan)
            curve, budget = replace(result.curve, error_P_star=nothing), Budget(*4 * [nothing])
            verdict, limit = Verdict("unknown", reason=doubt), ""
        else:
            if given.force_max is not None:  # it is the corrected curve that reaches it
                curve, budget = at_given_forces(curve, budget, result.curve, given.force_max)
            if not run.problem.path_dependent:
                curve = of_elastic_solve(curve)
            worst = _worst(curve, judged)
            verdict = self._verdict(*worst)
            force, area = worst[0] / self._goal.tolerance, worst[1] / (self._goal.area_tolerance or inf)
            order = planned_order(fine.missed.singular.max(), plastic)
            finer = max(next_step(force, order), next_step(area, EDGE_ORDER))
            limit = self._no_mesh_helps(worst[0], curve.delta_star[judged], algebraic)
        found = AccurateResult(curve, result.curve, budget, tuple(run.levels), result, *worst, verdict)
        if found.met:
            return found, None
        limit = limit or run.limit(finer)
        if not limit:
            return found, finer
        if not doubt and np.any(relative(budget.roughness, curve.P_star)[judged] > self._goal.tolerance):
            limit += "; waves shorter than the elements limit it too: cut them off"
        return replace(found, verdict=verdict.because(limit)), None

    def _doubt(self, fine: PressedMesh, coarse: PressedMesh) -> str:
        """Why two meshes give no error bar; empty where they do."""
        alike = min(coarse.scale / fine.scale, fine.dofs / coarse.dofs) < 0.999 * LEAST_STEP
        return fine.doubt() or coarse.doubt() or self._path.unknown or alike * "two meshes are nearly the same"

    def _no_mesh_helps(self, worst: float, at: Floats, algebraic: float) -> str:
        """Why no other mesh would meet the tolerance of the force; empty where one may."""
        goal, of_steps = self._goal, float(self._path.bar[self._path.substeps](at).max())
        if worst <= goal.tolerance or algebraic + of_steps <= MARGIN * goal.tolerance:
            return ""
        if algebraic > of_steps:
            return f"{algebraic:.2g} is left by the equations, lower solver.rtol or raise accuracy.tolerance"
        return "what is left comes from the load steps, raise loading.steps"

    def _verdict(self, worst: float, area: float) -> Verdict:
        """Verdict of the bars of force and area."""
        goal = self._goal
        if not worst <= goal.tolerance:
            return Verdict("force", worst, goal.tolerance)
        if goal.area_tolerance is not None and not area <= goal.area_tolerance:
            return Verdict("area", area, goal.area_tolerance)
        return Verdict("met", worst, goal.tolerance)


def _worst(curve: Curve, judged: Flags) -> tuple[float, float]:
    """Greatest relative bars of force and area at the judged rows."""
    force = relative(curve.error_P_star[judged], curve.P_star[judged])
    area = relative(curve.error_area_fraction[judged], curve.area_fraction[judged])
    return float(np.max(force)), float(np.max(np.where(np.isnan(area), inf, area)))
