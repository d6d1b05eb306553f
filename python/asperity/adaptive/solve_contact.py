"""From a surface and a material to the force-approach curve, on one mesh or to a tolerance.

With a tolerance a half-space shows which spots of the surface carry the force, and the meshes resolve them (`guide`).
The first mesh measures the error of the load steps (`load_step_error`), which depends little on the mesh: the finer
ones need no more steps than it found and all forces are corrected for them. The error of the mesh follows from two of
them (`extrapolation`). Mesh after mesh follows until the force has the requested error bar.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, fields, replace
from math import inf, isfinite, isnan, nan
from typing import TYPE_CHECKING, Any, Unpack, overload

import numpy as np

from asperity.adaptive.extrapolation import (
    Budget,
    Pair,
    PressedMesh,
    correct,
    of_elastic_solve,
    without_omission,
)
from asperity.adaptive.guide import Guide, Omission, guide_of, planned_steps
from asperity.adaptive.limits import EDGE_ORDER, LEAST_STEP, MARGIN, RATIO, next_step, partner
from asperity.adaptive.load_step_error import LoadStepError, choose_substeps
from asperity.adaptive.loading import judged_rows, relative
from asperity.adaptive.meshes import Level, LevelSolver
from asperity.arrays import Flags
from asperity.curve import Curve
from asperity.errors import InputError, Interrupted, MeshError
from asperity.mesh.block import BlockMesh
from asperity.model.material import Material
from asperity.model.problem import Problem, ProblemArguments
from asperity.model.settings import AccuracyTarget, MeshSize
from asperity.quasistatic.contact_result import ContactResult, PartialResult, refuse_wrong
from asperity.quasistatic.solve_problem import CallbackArguments, Callbacks, solve_problem
from asperity.runtime.display import brief
from asperity.runtime.parallel import on_root
from asperity.surface import Surface
from asperity.units import per_cent

if TYPE_CHECKING:
    from mpi4py import MPI


class Arguments(ProblemArguments, CallbackArguments, total=False):
    """What `solve_contact` takes by name: see `ProblemArguments` and `Callbacks`."""


@overload
def solve_contact(
    surface: Surface | Problem,
    material: Material | None = None,
    *,
    tolerance: None = None,
    block: BlockMesh | None = None,
    comm: MPI.Comm | None = None,
    **given: Unpack[Arguments],
) -> ContactResult: ...


@overload
def solve_contact(
    surface: Surface | Problem,
    material: Material | None = None,
    *,
    tolerance: float | AccuracyTarget,
    comm: MPI.Comm | None = None,
    **given: Unpack[Arguments],
) -> AccurateResult: ...


def solve_contact(
    surface: Surface | Problem,
    material: Material | None = None,
    *,
    tolerance: float | AccuracyTarget | None = None,
    block: BlockMesh | None = None,
    comm: MPI.Comm | None = None,
    **given: Unpack[Arguments],
) -> ContactResult | AccurateResult:
    """Press a rough block with a rigid flat; collective over `comm`.

    Args:
        surface: the rough top, or a whole `Problem`
        material: of the block, elastic or elastic-plastic; None with a problem
        tolerance: greatest error bar of the force, relative to the force: mesh and load steps are refined until it is
            reached, and the result is an `AccurateResult`; None takes one mesh
        block: a mesh to use instead of making one (on rank 0), without a tolerance
        comm: communicator; default all ranks
        given: without a problem its other arguments, `delta_max=0.01, steps=4` for example, see `ProblemArguments`; and
            what to call and to keep, `snapshots=4` or `stiffness=True` for example, see `Callbacks`

    Raises:
        InputError: an argument of another type or outside its range, or not exactly one of delta_max, force_max and
            pressure_max
        MeshError: the surface cannot be meshed
        CheckpointError: the checkpoint cannot be continued from
        OutputError: the checkpoint cannot be written
        PartialResult: a step did not converge or the run was stopped; carries the curve up to there
        CheckError: the result, which it carries, violates a balance

    Examples:
        >>> from asperity.surface import Flat
        >>> size, elastic = asp.MeshSize(h_contact=1.0, h_max=1.0), asp.Material(E=1.0, nu=0.3)
        >>> result = asp.solve_contact(Flat(L=1.0), elastic, delta_max=0.01, steps=2, size=size)
        >>> print(result.curve.force.round(6), round(0.01 * elastic.confined_modulus, 6))
        [0.006731 0.013462] 0.013462
        >>> problem = asp.Problem.of(Flat(L=1.0), elastic, delta_max=0.01, steps=2)
        >>> asp.solve_contact(problem, tolerance=0.01).met
        True
    """
    names = {field.name for field in fields(Callbacks)} & given.keys()
    hooks = Callbacks(**{name: given.pop(name) for name in names})  # type: ignore[misc]
    if not isinstance(surface, Problem):
        problem = Problem.of(surface, material, **given)  # type: ignore[arg-type, misc]
    elif material is None and not given:
        problem = surface
    else:
        twice = ", ".join([*(["material"] if material is not None else []), *given])
        raise InputError(f"a problem has its material, load path and settings: leave out {twice}")
    if tolerance is None:
        return solve_problem(problem, block=block, comm=comm, hooks=hooks)
    if block is not None or problem.size != MeshSize() or problem.load_path.substeps != 1:
        raise InputError(
            "a tolerance chooses mesh and substeps: leave out block, size (mesh.h_contact, mesh.file) and substeps"
        )
    # replace refuses a target without a tolerance
    target = replace(tolerance) if isinstance(tolerance, AccuracyTarget) else AccuracyTarget(tolerance)
    return refine(problem, target, comm, hooks).checked()


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
    run, path = LevelSolver(planned, guide, target, comm, hooks), LoadStepError()
    run.refine()
    if problem.path_dependent:
        result, path = choose_substeps(run, target.tolerance)
    else:
        result = run.press()
    pressed = [pressed_mesh(run, result, path)]
    result.solver.drop_matrices()
    try:
        run.refine()
    except InputError as e:
        raise PartialResult(f"the force has no error bar: {e}", run.finish(result)) from None
    result = run.press(path.substeps)
    while True:
        with suppress(Interrupted):  # this mesh is judged first; the next one is not begun
            hooks.stage(f"half-space estimate, roughness of mesh {len(run.meshes)}")
        pressed.append(pressed_mesh(run, result, path))
        accurate, finer = judge(run, result, pressed, path, target)
        if hooks.on_curve is not None:
            hooks.on_curve(accurate.curve)
        if finer is None:
            break
        result.solver.drop_matrices()  # room for the next mesh; its state stays, in case that mesh fails
        try:
            run.refine(finer)
            result = run.press(path.substeps)
        except (PartialResult, Interrupted, MeshError) as e:
            if isinstance(stop := e.__cause__ or e, Interrupted):
                raise PartialResult(str(e), replace(result, curve=accurate.curve)) from stop
            failed = str(e)
            if isinstance(e, PartialResult):
                failed = (
                    f"on the next mesh, of {e.result.dofs} dofs, no step converges beyond delta/L = "
                    f"{e.result.solver.delta:.6g}, use more loading.steps"
                )
            accurate = replace(accurate, verdict=accurate.verdict.because(failed))
            break
    return accurate if result.complete else finished(run, accurate, pressed, path, target)


def finished(
    run: LevelSolver, judged: AccurateResult, pressed: Sequence[PressedMesh], path: LoadStepError, goal: AccuracyTarget
) -> AccurateResult:
    """What is known of a last mesh by its first loading, with the rest of its load path; collective."""

    def whole(result: ContactResult) -> AccurateResult:
        last = replace(pressed[-1], curve=corrected(run, result, path, pressed[-1].missed))
        accurate, _ = judge(run, result, [*pressed[:-1], last], path, goal)
        return replace(accurate, verdict=replace(accurate.verdict, reason=judged.verdict.reason))

    try:
        return whole(run.finish(judged.contact))
    except (PartialResult, Interrupted) as e:
        result = e.result if isinstance(e, PartialResult) else judged.contact
        raise PartialResult(str(e), replace(result, curve=whole(result).curve)) from e.__cause__ or e


def pressed_mesh(run: LevelSolver, result: ContactResult, path: LoadStepError) -> PressedMesh:
    """The result of the last level, corrected for its load steps and for what its top leaves out; collective."""
    missed = run.left_out(result)
    return PressedMesh(run.meshes[-1].scale, result.dofs, corrected(run, result, path, missed), missed)


def corrected(run: LevelSolver, result: ContactResult, path: LoadStepError, missed: Omission) -> Curve:
    """Curve of the last level without the error of its load steps and half of what its top leaves out."""
    curve = path.removed(result.curve, run.levels[-1].substeps)
    return curve if curve.untouched() else without_omission(curve, missed, compliance_of(run.problem))


def compliance_of(problem: Problem) -> float:
    """Compression of the block under a uniform pressure over P* [length]."""
    solid = problem.material
    return problem.height * solid.reduced_modulus / solid.block_modulus(problem.sides)


def judge(
    run: LevelSolver, result: ContactResult, pressed: Sequence[PressedMesh], path: LoadStepError, goal: AccuracyTarget
) -> tuple[AccurateResult, float | None]:
    """Judge the force by the result of the last level, after at least one before it; collective.

    Args:
        run: solver of levels
        pressed: its meshes, the last one that of the result
        path: error of the load steps
        goal: tolerances

    Returns:
        What is known so far, and how much finer the next mesh is; None where there is none, because the
        tolerances are met, or for the reason of the result
    """
    problem, raw, algebraic = run.problem, result.curve, result.checks.unsolved
    plastic, loading, rows = problem.material.plastic, raw.branch == "load", judged_rows(raw, problem.load_path.steps)
    fine, coarse = pressed[-1], pressed[partner([mesh.scale for mesh in pressed])]
    nothing = np.full(len(raw), nan)
    curve, budget, finer, limit = replace(raw, error_P_star=nothing), Budget(*4 * [nothing]), RATIO, ""
    doubt = fine.doubt() or coarse.doubt() or path.unknown
    if min(coarse.scale / fine.scale, fine.dofs / coarse.dofs) < 0.999 * LEAST_STEP:
        doubt = doubt or "two meshes are nearly the same"
    verdict = Verdict(goal, reason=doubt)
    if not doubt:
        pair = Pair(fine, coarse, rows[loading], compliance_of(problem), plastic)
        left = path.left(raw.delta_star[loading], path.substeps)
        found = correct(pair, raw, left, algebraic, problem.load_path.force_max)
        # by a single node the force grows with its size, and the difference of two meshes is no error
        verdict = Verdict(goal, reason=found[0].unresolved())
    if not verdict.reason:
        curve, budget = found
        if not problem.path_dependent:
            curve = of_elastic_solve(curve)
        verdict = Verdict.of(curve, rows, goal)
        bar = pair.expected(pressed)

        def expected(finer: float) -> float:
            """Bar of the force on a mesh so much finer."""
            return float(np.max(np.hypot(bar(finer), left)[pair.judged])) + algebraic

        of_area = next_step(lambda finer: verdict.excess_of_area / finer**EDGE_ORDER, 1.0)
        finer = max(next_step(expected, goal.tolerance), of_area)
        if verdict.force > goal.tolerance:
            limit = no_mesh_helps(algebraic, float(path.left(curve.delta_star[rows], path.substeps).max()), goal)
    accurate = AccurateResult(curve, raw, budget, tuple(run.levels), result, verdict)
    if verdict.met:
        return accurate, None
    limit = limit or run.limit(finer)
    if not limit:
        return accurate, finer
    if np.any(relative(budget.roughness, curve.P_star)[rows] > goal.tolerance):
        limit += "; waves shorter than the elements limit it too: cut them off"
    return replace(accurate, verdict=verdict.because(limit)), None


def no_mesh_helps(algebraic: float, of_steps: float, goal: AccuracyTarget) -> str:
    """Why no other mesh would meet the tolerance of the force, by the greatest other bars; empty where one may."""
    if algebraic + of_steps <= MARGIN * goal.tolerance:
        return ""
    if algebraic > of_steps:
        return f"{algebraic:.2g} is left by the equations, lower solver.rtol or raise accuracy.tolerance"
    return "what is left comes from the load steps, raise loading.steps"


@dataclass(frozen=True)
class Verdict:
    """Whether the tolerances are met, and why nothing more is done."""

    goal: AccuracyTarget
    force: float = nan  # greatest relative bar that is judged; inf where a step has none, NaN where the force has none
    area: float = nan  # the same of the area of contact
    reason: str = ""  # why the force has no bar, why no mesh follows; empty while one may

    @staticmethod
    def of(curve: Curve, judged: Flags, goal: AccuracyTarget) -> Verdict:
        """Verdict of the bars at the judged rows of a curve."""
        force = relative(curve.error_P_star[judged], curve.P_star[judged])
        area = relative(curve.error_area_fraction[judged], curve.area_fraction[judged])
        return Verdict(goal, float(np.max(force)), float(np.max(np.where(np.isnan(area), inf, area))))

    @property
    def excess_of_area(self) -> float:
        """Bar of the area over its tolerance; 0 where there is none."""
        wanted = self.goal.area_tolerance
        return 0.0 if wanted is None else self.area / wanted

    @property
    def met(self) -> bool:
        """Whether the tolerances are met."""
        return self.force <= self.goal.tolerance and not self.excess_of_area > 1.0

    def because(self, why: str) -> Verdict:
        """The same with another reason."""
        return replace(self, reason=": ".join(filter(None, (self.reason, why))))

    def __str__(self) -> str:
        if self.met:
            return "done"
        if isnan(self.force):
            return f"the force has no error bar, {self.reason}"
        known, bar, wanted, early = "the contact area", self.area, "area_tolerance", "it is a single node"
        if self.force > self.goal.tolerance:
            known, bar, wanted, early = "the force", self.force, "tolerance", "the mesh is not touched"
        if bar == inf:
            known += f" has no error bar at every step, because at the first ones {early}"
        else:
            limit = per_cent(getattr(self.goal, wanted))
            known += f" is known to {per_cent(bar)}, not to the {limit} of accuracy.{wanted}"
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
        verdict: whether the bars are within the tolerances along the first loading
    """

    curve: Curve
    raw: Curve
    budget: Budget
    levels: tuple[Level, ...]
    contact: ContactResult
    verdict: Verdict

    @property
    def met(self) -> bool:
        """Whether the tolerances are met."""
        return self.verdict.met

    @property
    def reason(self) -> str:
        """The word "done", or what stopped the refinement."""
        return str(self.verdict)

    def __repr__(self) -> str:
        return f"AccurateResult({self.curve!r}, met={self.met}, worst={self.verdict.force:.3g}, {brief(self.reason)})"

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
                "worst_relative_bar": self.verdict.force if isfinite(self.verdict.force) else None,
                "worst_relative_bar_of_area": self.verdict.area if isfinite(self.verdict.area) else None,
                "levels": [asdict(level) for level in self.levels],
                "P_star_of_finest_mesh": self.raw.P_star.tolist(),
            },
            "error_budget": self.budget.to_dict() if isfinite(self.verdict.force) else None,
        }
