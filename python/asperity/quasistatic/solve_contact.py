# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

"""From a surface and a material to the force-approach curve: mesh, solid, contact, load path in one call."""

from __future__ import annotations

import resource
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

from asperity.arrays import Floats
from asperity.contact.contact_surface import ContactSurface
from asperity.contact.make import make_contact
from asperity.curve import Curve
from asperity.errors import ConvergenceError, Interrupted, MeshError
from asperity.fem.solid import Solid
from asperity.mesh.block import BlockMesh
from asperity.mesh.distribute import check_distortion, distribute
from asperity.mesh.generate import build_block
from asperity.mesh.resolution import judge_smoothing, warn_of_missed_waves
from asperity.mesh.size_field import SizeField
from asperity.model.load_path import Schedule
from asperity.model.material import Material
from asperity.model.problem import Problem
from asperity.model.settings import H_CONTACT, Formulation, MeshSize, SolverOptions
from asperity.quasistatic.balance import Checks
from asperity.quasistatic.conductance import Conductance
from asperity.quasistatic.contact_solver import ContactSolver, Counts, Probe
from asperity.quasistatic.measures import FirstContact, Snapshot, mean_stress
from asperity.quasistatic.stepping import Callback, Position, Record, follow
from asperity.quasistatic.stiffness import stiffness_of
from asperity.runtime.display import brief
from asperity.runtime.parallel import on_root, on_root_bcast
from asperity.runtime.timing import Phases
from asperity.surface import Surface

if TYPE_CHECKING:
    from mpi4py import MPI

    from asperity.quasistatic.checkpoint import Checkpoint

ESTIMATE_STEPS = 40  # after which the approach at a given force is only guessed


@dataclass(frozen=True)
class ContactResult:
    """Result of a load path.

    Attributes:
        curve: accepted steps
        counts: totals of steps, cutbacks, iterations
        dofs, cells: size of the model, all ranks
        phases: seconds per phase, this rank
        memory: greatest resident memory, all ranks [bytes]
        snapshots: states of the top kept, this rank's part
        block: the mesh on rank 0, None elsewhere
        solver: with the solid in its last state
        first_contact: approach at which each node of the top was touched first, this rank's part
        complete: whether the path was followed to its end
        reason: why it ended

    Examples:
        >>> from asperity.surface import Flat
        >>> size = asp.MeshSize(h_contact=1.0, h_max=1.0)

        >>> result = asp.solve_contact(Flat(L=1.0), asp.Material(E=1.0, nu=0.3), delta_max=0.01, steps=2, size=size)

        >>> result.complete, len(result.curve), result.counts.cutbacks, bool(result.checks.violated)
        (True, 2, 0, False)
    """

    curve: Curve
    counts: Counts
    dofs: int
    cells: int
    phases: Phases
    memory: int
    snapshots: tuple[Snapshot, ...]
    block: BlockMesh | None
    solver: ContactSolver
    first_contact: FirstContact
    complete: bool
    reason: str

    def __repr__(self) -> str:
        return f"ContactResult({self.curve!r}, dofs={self.dofs}, cells={self.cells}, {brief(self.reason)})"

    @property
    def checks(self) -> Checks:
        """Worst figures of the balances that every step has to keep."""
        return self.solver.checks

    def displacement(self) -> Any:
        """Displacement of the last state, a function of dolfinx, second-order [L]; collective.

        Its mesh is the undeformed block, with coordinates in units of L.

        Examples:
            >>> wave = asp.Surface.from_spec("sinusoid", L=1e-6, amplitude=2e-8)
            >>> size = asp.MeshSize(h_contact=0.3e-6, h_max=0.6e-6)
            >>> result = asp.solve_contact(wave, asp.Material(E=200e9, nu=0.3), delta_max=2e-8, steps=2, size=size)
            >>> import ufl
            >>> from dolfinx import fem
            >>> u = result.displacement()
            >>> pushed_down = fem.assemble_scalar(fem.form(-u[2] * ufl.dx))
            >>> bool(0.0 < pushed_down < 0.02), result.stress().x.array.reshape(-1, 3, 3).shape[0] == result.cells
            (True, True)
        """
        u = self.solver.solid.u.copy()
        u.name = "displacement"
        return u

    def stress(self) -> Any:
        """Mean Cauchy stress of the cells in the last state, a tensor function of dolfinx [E]; collective.

        Its mesh is that of `displacement`.
        """
        from dolfinx import fem

        solid = self.solver.solid
        values, _ = mean_stress(self.solver, solid.u.x.array.reshape(-1, 3))
        V = fem.functionspace(solid.mesh, ("DG", 0, (3, 3)))
        stress = fem.Function(V, name="stress")
        cells = V.dofmap.list[: len(values), 0]
        stress.x.array.reshape(-1, 9)[cells] = values[:, (0, 3, 4, 3, 1, 5, 4, 5, 2)]  # of xx yy zz xy xz yz
        stress.x.scatter_forward()
        return stress

    def touched_at(self) -> tuple[Floats, Floats]:
        """Position of each node of the top and the approach that first touched it [L], see `FirstContact.gather`."""
        return self.first_contact.gather(self.solver)


class PartialResult(ConvergenceError):
    """The load path ended early; `result` holds what was reached.

    Examples:
        >>> from asperity.surface import Flat
        >>> size = asp.MeshSize(h_contact=1.0, h_max=1.0)

        >>> block = asp.Problem.of(Flat(L=1.0), asp.Material(E=1.0, nu=0.3), delta_max=0.01, steps=2, size=size)
        >>> try:
        ...     asp.solve_problem(block, hooks=Hooks(stop=lambda: "the first step"))
        ... except PartialResult as stopped:
        ...     print(len(stopped.result.curve), stopped.result.complete)
        0 False
    """

    def __init__(self, message: str, result: ContactResult) -> None:
        super().__init__(message)
        self.result = result


def make_block(
    comm: MPI.Comm, surface: Surface, height: float, delta_max: float, size: MeshSize, sides: str = "rollers"
) -> BlockMesh | None:
    """Mesh of the block on rank 0, None elsewhere; collective.

    Args:
        comm: communicator
        surface: the top
        height: mean height of the block [length]
        delta_max: approach the mesh is made for [length]
        size: element sizes
        sides: "periodic" makes opposite sides fit

    Raises:
        MeshError: the surface cannot be meshed

    Examples:
        >>> from mpi4py import MPI
        >>> from asperity.surface import Flat
        >>> block = make_block(MPI.COMM_SELF, Flat(L=2.0), 1.0, 0.01, asp.MeshSize(h_contact=2.0, h_max=2.0))
        >>> block.side, block.height
        (2.0, 1.0)
    """

    def build() -> BlockMesh:
        h = H_CONTACT * surface.L if size.h_contact is None else size.h_contact
        field = SizeField.of(
            surface, delta_max, h, growth=size.growth, h_max=size.h_max, first_contact=size.reach, grading=size.grading,
            periodic=sides == "periodic",
        )  # fmt: skip
        return build_block(surface, height, field.compiled().at, field.periodic)

    return on_root(comm, build)


def make_contact_solver(
    comm: MPI.Comm,
    surface: Surface,
    block: BlockMesh | None,
    material: Material,
    *,
    sides: str = "rollers",
    formulation: Formulation | None = None,
    kernels: str = "compiled",
    options: SolverOptions | None = None,
    phases: Phases | None = None,
) -> ContactSolver:
    """Distribute a block over the ranks and put it under the flat; collective.

    Args:
        comm: communicator
        surface: the top the block was built for
        block: mesh on rank 0, None elsewhere
        material: in physical units
        sides: "rollers", "free" or "periodic"
        formulation: contact formulation
        kernels: "compiled" or "ufl"
        options: of the nonlinear solver
        phases: collects where the time goes

    Raises:
        InputError: the kinematics of the material is not chosen yet
        MeshError: the block is another surface's, or an element is turned inside out

    Examples:
        >>> from mpi4py import MPI
        >>> from asperity.surface import Flat
        >>> flat, elastic = Flat(L=1.0), asp.Material(E=1.0, nu=0.3)
        >>> block = make_block(MPI.COMM_SELF, flat, 1.0, 0.01, asp.MeshSize(h_contact=1.0, h_max=1.0))
        >>> solver = make_contact_solver(MPI.COMM_SELF, flat, block, elastic)
        >>> solver.step(0.01).converged, round(solver.force / 0.01, 6), round(elastic.confined_modulus, 6)
        (True, 1.346154, 1.346154)
    """
    material.check_decided()
    L = surface.L

    def checked_height() -> float:
        assert block is not None
        block.check(surface)
        return block.height

    height = on_root_bcast(comm, checked_height)
    mesh, tags = distribute(comm, block, 1.0 / L, sides == "periodic")
    check_distortion(mesh, surface)
    solid = Solid(mesh, tags, material.scaled(material.E), sides, kernels, phases)
    top = ContactSurface(solid)
    contact = make_contact(formulation or Formulation(), solid, top)
    summit = (height + surface.maximum()[2] - surface.mean()) / L
    return ContactSolver(solid, top, contact, summit, options or SolverOptions())


@dataclass(frozen=True)
class Hooks:
    """Callbacks of a load path, and what to keep of it.

    Attributes:
        on_stage: called with the name of each stage
        on_step: called after each accepted step
        stop: polled after each step on all ranks; a non-empty string stops the run
        checkpoint: receives the state; one that holds a state is continued from
        snapshots: states of the top to keep per loading
        on_ready: called when mesh and solver are made, before anything is saved
        stiffness: whether to compute the columns k_n to k_n_interface
        conductance: whether to compute the column conductance

    Examples:
        >>> from asperity.surface import Flat
        >>> size = asp.MeshSize(h_contact=1.0, h_max=1.0)

        >>> block = asp.Problem.of(Flat(L=1.0), asp.Material(E=1.0, nu=0.3), delta_max=0.01, steps=2, size=size)
        >>> hooks = Hooks(on_step=lambda rows, fraction: print(rows[-1]["delta"], fraction))
        >>> result = asp.solve_problem(block, hooks=hooks)
        0.005 0.5
        0.01 1.0
    """

    on_stage: Callable[[str], None] | None = None
    on_step: Callback | None = None
    stop: Callable[[], str] | None = None
    checkpoint: Checkpoint | None = None
    snapshots: int = 0
    on_ready: Callable[[], None] | None = None
    stiffness: bool = False
    conductance: bool = False

    def probes(self, solid: Solid) -> tuple[Probe, ...]:
        """Measurements of each accepted step that are requested; collective."""
        found: tuple[Probe, ...] = (stiffness_of,) if self.stiffness else ()
        return (*found, Conductance(solid)) if self.conductance else found

    def stage(self, name: str) -> None:
        """Announce a stage."""
        if self.on_stage is not None:
            self.on_stage(name)


def solve_contact(
    surface: Surface,
    material: Material,
    *,
    block: BlockMesh | None = None,
    comm: MPI.Comm | None = None,
    snapshots: int = 0,
    on_stage: Callable[[str], None] | None = None,
    on_step: Callback | None = None,
    checkpoint: Checkpoint | None = None,
    stop: Callable[[], str] | None = None,
    stiffness: bool = False,
    conductance: bool = False,
    **problem: Any,
) -> ContactResult:
    """Press a rough block with a rigid frictionless flat; collective over `comm`.

    The call for scripts: `solve_problem` of `Problem.of(surface, material, **problem)`.

    Args:
        surface: the rough top
        material: elastic or elastic-plastic
        block: a mesh to use instead of making one (on rank 0)
        comm: communicator; default all ranks
        snapshots, on_stage, on_step, checkpoint, stop, stiffness, conductance: see `Hooks`
        problem: delta_max, force_max or pressure_max, steps, height, sides, size and other arguments of `Problem.of`

    Raises:
        InputError: not exactly one of delta_max, force_max and pressure_max
        MeshError: the surface cannot be meshed
        CheckpointError: the checkpoint cannot be continued from
        OutputError: the checkpoint cannot be written
        PartialResult: a step did not converge or the run was stopped; carries the curve up to there

    Examples:
        >>> from asperity.surface import Flat
        >>> size, elastic = asp.MeshSize(h_contact=1.0, h_max=1.0), asp.Material(E=1.0, nu=0.3)
        >>> result = asp.solve_contact(Flat(L=1.0), elastic, delta_max=0.01, steps=2, size=size)
        >>> print(result.curve.force.round(6), round(0.01 * elastic.confined_modulus, 6))
        [0.006731 0.013462] 0.013462
    """
    hooks = Hooks(on_stage, on_step, stop, checkpoint, snapshots, stiffness=stiffness, conductance=conductance)
    return solve_problem(Problem.of(surface, material, **problem), block=block, comm=comm, hooks=hooks)


def solve_problem(
    problem: Problem, *, block: BlockMesh | None = None, comm: MPI.Comm | None = None, hooks: Hooks | None = None
) -> ContactResult:
    """Press the block of a problem with a rigid frictionless flat; collective over `comm`.

    Args:
        problem: what to solve
        block: a mesh to use instead of making one (on rank 0)
        comm: communicator; default all ranks
        hooks: progress, checkpoint, snapshots

    Raises:
        InputError: the kinematics of the material is not chosen yet
        MeshError, CheckpointError, OutputError, PartialResult: see `solve_contact`

    Examples:
        >>> wave = asp.Surface.from_spec("sinusoid", L=1.0, amplitude=0.02)
        >>> size = asp.MeshSize(h_contact=0.3, h_max=0.6)
        >>> block = asp.Problem.of(wave, asp.Material(E=1.0, nu=0.3), delta_max=0.02, steps=2, size=size)
        >>> curve = asp.solve_problem(block).curve
        >>> bool(curve.force[1] > 2.0 * curve.force[0])  # the contact grows
        True
    """
    from mpi4py import MPI

    problem.material.check_decided()
    comm = MPI.COMM_WORLD if comm is None else comm
    hooks = hooks or Hooks()
    checkpoint, phases = hooks.checkpoint, Phases()
    saved = None if checkpoint is None else checkpoint.load()
    own_mesh = not comm.bcast(block is not None, root=0)  # made for the problem, now or before the run was stopped
    if saved is not None:
        block = saved.block
    given = comm.bcast(None if block is None else block.height, root=0)
    wanted, L = problem.block_height, problem.surface.L
    if given is not None and wanted is not None and abs(given - wanted) > 1e-9 * L:
        raise MeshError(f"mesh.file: the mesh has the height {given:g}, block.height is {wanted:g}: make them equal")
    if own_mesh:
        if given is None:
            hooks.stage("mesh")
        delta_max = _depth_of_mesh(problem, comm, phases)
        if given is None:
            with phases.phase("mesh"):
                block = make_block(comm, problem.surface, problem.height, delta_max, problem.size, problem.sides)
            on_root(comm, lambda: judge_smoothing(block, problem.surface, delta_max))
        h = problem.size.h_contact or H_CONTACT * L
        on_root(comm, partial(warn_of_missed_waves, problem.surface, h, delta_max))
    hooks.stage("set-up")
    with phases.phase("set-up"):
        solver = solver_of(problem, block, comm, phases)
        solver.probes = hooks.probes(solver.solid)
    record = Record(L, problem.material.E, problem.material.reduced_modulus)
    position = None if saved is None else saved.restore(solver, record)
    if hooks.on_ready is not None:
        hooks.on_ready()
    if checkpoint is not None:
        checkpoint.begin(block)
    hooks.stage(f"load path, {solver.solid.dofs} dofs")
    failure = None
    try:
        _follow(problem, solver, record, position, hooks)
    except ConvergenceError as e:
        failure = e
    result = ContactResult(
        record.curve(),
        solver.counts,
        solver.solid.dofs,
        comm.allreduce(len(solver.solid.cell_nodes)),
        phases,
        comm.allreduce(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024),
        tuple(record.snapshots),
        block,
        solver,
        record.first_contact,
        failure is None,
        "done" if failure is None else str(failure),
    )
    if failure is not None:
        raise PartialResult(result.reason, result) from failure
    return result


def _depth_of_mesh(problem: Problem, comm: MPI.Comm, phases: Phases) -> float:
    """Approach that the mesh of a problem is made for [length]; collective."""
    if problem.load_path.delta_max is not None:
        return problem.load_path.delta_max
    with phases.phase("deflection estimate"):
        return estimate_approach(problem, comm)


def _follow(problem: Problem, solver: ContactSolver, record: Record, position: Position | None, hooks: Hooks) -> None:
    """Follow the load path, saving the state and stopping as the hooks request; collective.

    Raises:
        ConvergenceError: a step does not converge, or the run was stopped
    """
    schedule, checkpoint = problem.schedule, hooks.checkpoint

    def on_position(at: Position) -> None:
        reason = "" if hooks.stop is None else hooks.stop()
        ended = at.leg == len(schedule.legs)
        if checkpoint is not None and (reason or ended or checkpoint.due(solver.counts.steps)):
            checkpoint.save(solver, record, at)
        if reason:
            raise Interrupted(
                f"stopped by {reason} after step {len(record.rows)} at delta/L = {solver.delta:.6g}"
                + ("; --resume continues" if checkpoint is not None and checkpoint.interval else "")
            )

    follow(solver, schedule, record, hooks.snapshots, hooks.on_step, position, on_position)


def solver_of(problem: Problem, block: BlockMesh | None, comm: MPI.Comm, phases: Phases | None = None) -> ContactSolver:
    """Contact solver of a problem on a mesh, see `make_contact_solver`; collective."""
    return make_contact_solver(
        comm,
        problem.surface,
        block,
        problem.material,
        sides=problem.sides,
        formulation=problem.formulation,
        kernels=problem.kernels,
        options=problem.options,
        phases=phases,
    )


def estimate_approach(problem: Problem, comm: MPI.Comm) -> float:
    """Approach at the greatest force, roughly, on a coarse mesh [length]: what the real mesh is made for; collective.

    A force that is not reached soon, or not at all, gives the approach so far: the run itself reports it.
    """
    surface, L = problem.surface, problem.surface.L
    depth = surface.maximum()[2] - surface.mean()
    block = make_block(comm, surface, problem.height, max(depth, 0.01 * L), MeshSize(0.1 * L), problem.sides)
    solver = solver_of(problem, block, comm)

    def give_up(at: Position) -> None:
        if solver.counts.steps >= ESTIMATE_STEPS:
            raise Interrupted  # enough for an estimate

    schedule = Schedule(force_max=problem.schedule.force_max, steps=5)
    with suppress(ConvergenceError):
        follow(solver, schedule, Record(L, problem.material.E, 1.0), on_position=give_up)
    return max(solver.delta, 1e-3) * L
