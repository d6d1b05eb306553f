"""From a problem to the force-approach curve: mesh, solid, contact, load path in one call."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, TypedDict

from asperity.curve import Curve
from asperity.errors import ConvergenceError, Interrupted, MeshError
from asperity.fem.forms import FormKernels
from asperity.mesh.block import NEAR, BlockMesh
from asperity.mesh.resolution import judge_mesh
from asperity.model.load_path import Schedule
from asperity.model.problem import Problem
from asperity.model.settings import H_CONTACT, MeshSize
from asperity.quasistatic.contact_result import ContactResult, PartialResult, refuse_wrong
from asperity.quasistatic.contact_solver import ContactSolver
from asperity.quasistatic.legs import Position
from asperity.quasistatic.make import make_block, make_contact_solver
from asperity.quasistatic.measures import Record
from asperity.quasistatic.stepping import Callback, follow
from asperity.quasistatic.stiffness import Stiffness
from asperity.quasistatic.thin_film import ThinFilm
from asperity.runtime.parallel import on_root
from asperity.runtime.usage import Phases, peak

if TYPE_CHECKING:
    from mpi4py import MPI

    from asperity.quasistatic.checkpoint import Checkpoint

ESTIMATE_STEPS = 40  # after which the approach at a given force is only guessed


class CallbackArguments(TypedDict, total=False):
    """The attributes of `Callbacks` as arguments."""

    on_stage: Callable[[str], None] | None
    on_step: Callback | None
    stop: Callable[[], str] | None
    checkpoint: Checkpoint | None
    snapshots: int
    on_ready: Callable[[], None] | None
    stiffness: bool
    flow: bool
    on_curve: Callable[[Curve], None] | None


@dataclass(frozen=True)
class Callbacks:
    """Callbacks of a load path, and what to keep of it.

    Attributes:
        on_stage: called with the name of each stage
        on_step: called after each accepted step
        stop: polled after each step on all ranks; a non-empty string stops the run
        checkpoint: receives the state; one that holds a state is continued from
        snapshots: states of the top to keep per loading
        on_ready: called when mesh and solver are made, before anything is saved
        stiffness: whether to compute the columns k_n_elastic to conductance
        flow: whether to compute the columns transmissivity_x to hydraulic_aperture
        on_curve: with a tolerance, called with the curve with error bars that each mesh after the first gives
    """

    on_stage: Callable[[str], None] | None = None
    on_step: Callback | None = None
    stop: Callable[[], str] | None = None
    checkpoint: Checkpoint | None = None
    snapshots: int = 0
    on_ready: Callable[[], None] | None = None
    stiffness: bool = False
    flow: bool = False
    on_curve: Callable[[Curve], None] | None = None

    def stage(self, name: str) -> None:
        """Announce a stage."""
        if self.on_stage is not None:
            self.on_stage(name)


def solve_problem(
    problem: Problem,
    *,
    block: BlockMesh | None = None,
    comm: MPI.Comm | None = None,
    hooks: Callbacks | None = None,
    checked: bool = True,
    legs: int | None = None,
) -> ContactResult:
    """Press the block of a problem with a rigid flat on one mesh, see `solve_contact`; collective over `comm`.

    Args:
        block: a mesh to use instead of making one (on rank 0)
        comm: communicator; default all ranks
        checked: whether a result that violates a balance is an error
        legs: of the load path to follow, default all; `follow_rest` follows the others
    """
    from mpi4py import MPI

    problem.material.check_decided()
    comm = MPI.COMM_WORLD if comm is None else comm
    hooks = hooks or Callbacks()
    checkpoint, phases = hooks.checkpoint, Phases()
    saved = None if checkpoint is None else checkpoint.load()
    own_mesh = not comm.bcast(block is not None, root=0)  # made for the problem, now or before the run was stopped
    if saved is not None:
        block = saved.block
    on_root(comm, partial(refuse_other_height, problem, block))
    given, L = comm.bcast(block is not None, root=0), problem.surface.L
    if own_mesh and not given:
        hooks.stage("mesh")
    delta_max = problem.load_path.delta_max or 0.0  # that the mesh is made for
    if own_mesh and not delta_max:
        with phases.phase("deflection estimate"):
            delta_max = estimate_approach(problem, comm)
    if own_mesh:
        with phases.phase("mesh"):
            if not given:
                block = make_block(comm, problem, delta_max)
            on_root(comm, partial(judge, problem, block, delta_max))
    hooks.stage("set-up")
    with phases.phase("set-up"):
        solver = make_contact_solver(comm, problem, block, phases)
        if hooks.stiffness:
            solver.probes += (Stiffness(solver.solid),)
        if hooks.flow:
            solver.probes += (ThinFilm(solver.contact_surface, problem.composite, solver.summit),)
    kernels = solver.solid.kernels
    if isinstance(kernels, FormKernels):
        hooks.stage("compilation of the forms")
        with phases.phase("compilation"):
            kernels.compile()
    record = Record(L, problem.material.E, problem.material.reduced_modulus)
    if saved is not None:
        saved.refuse_other_columns(solver, len(problem.schedule.legs))
    position = Position() if saved is None else saved.restore(solver, record)
    saved = None  # rank 0 need not hold its arrays any longer
    if hooks.on_ready is not None:
        hooks.on_ready()
    if checkpoint is not None:
        checkpoint.begin(block)
    hooks.stage(f"load path, {solver.solid.dofs} dofs")
    result = ContactResult(
        curve=record.curve(),
        counts=solver.counts,
        dofs=solver.solid.dofs,
        cells=comm.allreduce(len(solver.solid.cell_nodes)),
        phases=phases,
        memory=0,
        snapshots=(),
        block=block,
        solver=solver,
        record=record,
        position=position,
        complete=False,
        reason="",
    )
    result = _followed(problem, result, hooks, legs)
    if checked:
        refuse_wrong(result.checks, result)
    return result


def follow_rest(problem: Problem, result: ContactResult, hooks: Callbacks) -> ContactResult:
    """The result with the rest of its load path, of which `solve_problem` followed the first legs; collective."""
    hooks.stage("rest of the load path")
    return _followed(problem, result, hooks)


def _followed(problem: Problem, result: ContactResult, hooks: Callbacks, legs: int | None = None) -> ContactResult:
    """The result after some legs of its load path, default all."""
    at, failure, record = result.position, None, result.record
    try:
        at = _follow(problem, result.solver, record, at, hooks, legs)
    except ConvergenceError as e:
        failure = e
    result = replace(
        result,
        curve=record.curve(),
        memory=result.solver.solid.comm.allreduce(peak()),
        snapshots=tuple(record.snapshots),
        position=at,
        complete=failure is None and at.leg == len(problem.schedule.legs),
        reason="done" if failure is None else str(failure),
    )
    if failure is not None:
        raise PartialResult(result.reason, result) from failure
    return result


def refuse_other_height(problem: Problem, block: BlockMesh | None) -> None:
    """Refuse (MeshError) a mesh of another height than that of a problem that has one."""
    wanted = problem.block_height
    if block is not None and wanted is not None and abs(block.height - wanted) > NEAR * problem.surface.L:
        raise MeshError(
            f"mesh.file: the mesh has the height {block.height:g}, block.height is {wanted:g}: make them equal"
        )


def judge(problem: Problem, block: BlockMesh | None, delta_max: float) -> None:
    """Warn of a mesh made for an approach [length] that does not resolve the surface, or refuse it; rank 0."""
    assert block is not None
    h = problem.size.h_contact or H_CONTACT * problem.surface.L
    judge_mesh(block, problem.surface, h, delta_max, problem.composite)


def _follow(
    problem: Problem, solver: ContactSolver, record: Record, position: Position, hooks: Callbacks, legs: int | None
) -> Position:
    """Follow the load path, saving the state and stopping as the hooks request; collective."""
    schedule, checkpoint = problem.schedule, hooks.checkpoint
    last = len(schedule.legs[:legs])

    def on_position(at: Position) -> None:
        reason = "" if hooks.stop is None else hooks.stop()
        ended = at.leg == last
        if checkpoint is not None and (reason or ended or checkpoint.due(solver.counts.steps)):
            checkpoint.save(solver, record, at)
        if reason:
            raise Interrupted(
                f"stopped by {reason} after step {len(record.rows)} at delta/L = {solver.delta:.6g}"
                + ("; --resume continues" if checkpoint is not None and checkpoint.interval else "")
            )

    return follow(solver, schedule, record, hooks.snapshots, hooks.on_step, position, on_position, legs)


def estimate_approach(problem: Problem, comm: MPI.Comm) -> float:
    """Approach at the greatest force, roughly, on a coarse mesh [length]: what the real mesh is made for; collective.

    A force that is not reached soon, or not at all, gives the approach so far: the run itself reports it.
    """
    L, depth = problem.surface.L, problem.composite.maximum()[2] - problem.composite.mean()
    block = make_block(comm, replace(problem, size=MeshSize(0.1 * L)), max(depth, 0.01 * L))
    solver = make_contact_solver(comm, problem, block)

    def give_up(at: Position) -> None:
        if solver.counts.steps >= ESTIMATE_STEPS:
            raise Interrupted("enough for an estimate")

    path = problem.schedule
    schedule = Schedule(
        force_max=path.force_max,
        steps=5 if path.duration is None else 1,  # in time each step is a search
        duration=path.duration,
        hold=path.hold,
        hold_steps=1 if path.hold else None,
    )
    with suppress(ConvergenceError):
        follow(solver, schedule, Record(L, problem.material.E, 1.0), on_position=give_up)
    return max(solver.delta, 1e-3) * L
