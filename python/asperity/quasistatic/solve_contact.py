"""From a surface and a material to the force-deflection curve: mesh, solid, contact, load path in one call."""

from __future__ import annotations

import resource
import warnings
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, Any

from asperity.contact import ActiveSet, Contact, PressureContact
from asperity.contact.contact_surface import ContactSurface
from asperity.curve import Curve
from asperity.errors import ConvergenceError, InputError, Interrupted, MeshError, ResolutionWarning
from asperity.fem.solid import Solid
from asperity.mesh.block import H_CONTACT, H_MAX, BlockMesh
from asperity.mesh.distribute import check_distortion, distribute, is_distorted
from asperity.mesh.generate import build_block
from asperity.mesh.resolution import doubt_of_waves
from asperity.mesh.size_field import FirstContactMap, SizeField
from asperity.model.load_path import BACKWARD_EULER, MIDPOINT, Schedule
from asperity.model.material import Material
from asperity.quasistatic.balance import Checks
from asperity.quasistatic.contact_solver import ContactSolver, Counts
from asperity.quasistatic.measures import FirstContact, Snapshot
from asperity.quasistatic.newton import SolverOptions
from asperity.quasistatic.stepping import Callback, Position, Record, follow
from asperity.runtime.parallel import on_root, on_root_bcast
from asperity.runtime.timing import Phases

if TYPE_CHECKING:
    from mpi4py import MPI

    from asperity.quasistatic.checkpoint import Checkpoint
    from asperity.surface import Surface

SMALLEST_H_MAX = 0.05  # to which the largest elements are made smaller for the slopes [L]
ESTIMATE_STEPS = 40  # after which the deflection at a given force is only guessed


@dataclass(frozen=True)
class Formulation:
    """Contact formulation and its parameters, see docs/theory.md.

    Attributes:
        method: "active-set", "penalty" or "nitsche"
        penalty: factor of E p^2/h of the penalty method
        gamma: factor of (lambda + 2 mu) p^2/h of Nitsche's method; None takes 1, or 10 for theta = 1 and -1
        theta: 0, or 1 (symmetric) or -1 (skew) for an elastic solid
    """

    method: str = "active-set"
    penalty: float = 10.0
    gamma: float | None = None
    theta: int = 0

    def build(self, solid: Solid, top: ContactSurface) -> Contact:
        """The formulation for a solid.

        Raises:
            InputError: unknown method, theta = +-1 for a material that yields, or gamma too small for theta
        """
        if self.method == "active-set":
            return ActiveSet(solid, top)
        if self.method == "penalty":
            return PressureContact(solid, top, self.penalty, traction=False)
        if self.method == "nitsche":
            gamma = (10.0 if self.theta else 1.0) if self.gamma is None else self.gamma
            return PressureContact(solid, top, gamma, traction=True, theta=self.theta)
        raise InputError(f'contact.method = "{self.method}" is not one of active-set, penalty, nitsche')


@dataclass(frozen=True)
class MeshSize:
    """Element sizes of the block [length], see `mesh.SizeField`; None takes the default for the side L."""

    h_contact: float | None = None
    growth: float = 0.25
    h_max: float | None = None
    reach: FirstContactMap | None = None
    grading: tuple[float, float] | None = None


@dataclass(frozen=True)
class ContactResult:
    """What a load path gave.

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

    @property
    def checks(self) -> Checks:
        """Worst figures of the balances that every step has to keep."""
        return self.solver.checks


class PartialResult(ConvergenceError):
    """The load path ended early; `result` holds what was reached."""

    def __init__(self, message: str, result: ContactResult) -> None:
        super().__init__(message)
        self.result = result


def make_block(comm: MPI.Comm, surface: Surface, height: float, delta_max: float, size: MeshSize) -> BlockMesh | None:
    """Mesh of the block on rank 0, None elsewhere; collective.

    Args:
        comm: communicator
        surface: the top
        height: mean height of the block [length]
        delta_max: deflection the mesh is made for [length]
        size: element sizes; without h_max, the largest elements are as small as slopes need, see `make_undistorted`

    Raises:
        MeshError: the surface cannot be meshed
    """
    if size.h_max is None:
        return make_undistorted(comm, surface, height, delta_max, size)[0]

    def build() -> BlockMesh:
        h = H_CONTACT * surface.L if size.h_contact is None else size.h_contact
        field = SizeField.of(
            surface, delta_max, h, growth=size.growth, h_max=size.h_max, first_contact=size.reach, grading=size.grading
        )
        return build_block(surface, height, field.at)

    return on_root(comm, build)


def make_undistorted(
    comm: MPI.Comm, surface: Surface, height: float, delta_max: float, size: MeshSize
) -> tuple[BlockMesh | None, float]:
    """Mesh whose largest elements are, if possible, too small to be turned inside out by slopes, and their size;
    collective.

    Args:
        comm, surface, height, delta_max: as in `make_block`
        size: element sizes; h_max is made smaller as far as needed, but not much below SMALLEST_H_MAX
    """
    h_max = H_MAX * surface.L if size.h_max is None else size.h_max
    while True:
        block = make_block(comm, surface, height, delta_max, replace(size, h_max=h_max))
        if not is_distorted(comm, block) or h_max <= SMALLEST_H_MAX * surface.L:
            return block, h_max
        h_max *= 0.7


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
        sides: "rollers" or "free"
        formulation: contact formulation
        kernels: "compiled" or "ufl"
        options: of the nonlinear solver
        phases: collects where the time goes

    Raises:
        MeshError: the block is another surface's, or an element is turned inside out
    """
    L = surface.L

    def checked_height() -> float:
        assert block is not None
        block.check(surface)
        return block.height

    height = on_root_bcast(comm, checked_height)
    mesh, tags = distribute(comm, block, 1.0 / L)
    check_distortion(mesh, surface)
    solid = Solid(mesh, tags, material.scaled(material.E), sides, kernels, phases)
    top = ContactSurface(solid)
    contact = (formulation or Formulation()).build(solid, top)
    summit = (height + surface.maximum()[2] - surface.mean()) / L
    return ContactSolver(solid, top, contact, summit, options or SolverOptions())


def solve_contact(
    surface: Surface,
    material: Material,
    *,
    height: float | None = None,
    sides: str = "rollers",
    delta_max: float | None = None,
    force_max: float | None = None,
    steps: int = 10,
    unload_steps: int = 0,
    cycles: int = 1,
    integrator: str = MIDPOINT,
    substeps: int = 1,
    size: MeshSize | None = None,
    formulation: Formulation | None = None,
    kernels: str = "compiled",
    options: SolverOptions | None = None,
    snapshots: int = 0,
    block: BlockMesh | None = None,
    comm: MPI.Comm | None = None,
    on_stage: Callable[[str], None] | None = None,
    on_step: Callback | None = None,
    checkpoint: Checkpoint | None = None,
    stop: Callable[[], str] | None = None,
) -> ContactResult:
    """ContactSolver a rough block with a rigid frictionless flat; collective over `comm`.

    Args:
        surface: the rough top
        material: elastic or elastic-plastic
        height: mean height of the block [length]; default L
        sides: "rollers" or "free"
        delta_max: greatest deflection from first touch [length]
        force_max: greatest force instead [force]
        steps, unload_steps, cycles, integrator, substeps: see `schedule.Schedule`
        size: element sizes
        formulation: contact formulation
        kernels: "compiled" or "ufl"
        options: of the nonlinear solver
        snapshots: states of the top to keep per loading
        block: a mesh to use instead of making one (on rank 0)
        comm: communicator; default all ranks
        on_stage, on_step: progress call-backs
        checkpoint: receives the state; one that holds a state is continued from
        stop: asked after each step on all ranks; ends the run when it names a reason

    Raises:
        InputError: not exactly one of delta_max and force_max
        MeshError: the surface cannot be meshed
        CheckpointError: the checkpoint cannot be continued from
        OutputError: the checkpoint cannot be written
        PartialResult: a step did not converge or the run was stopped; carries the curve up to there

    Warns (ResolutionWarning) on the first rank when waves of the surface are too short for the mesh it makes.
    """
    from mpi4py import MPI

    if (delta_max is None) == (force_max is None):
        raise InputError("give exactly one of delta_max and force_max")
    comm = MPI.COMM_WORLD if comm is None else comm
    stage = on_stage or (lambda name: None)
    phases = Phases()
    L = surface.L
    saved = None if checkpoint is None else checkpoint.load()
    if saved is not None:
        block = saved.block
    given = comm.bcast(None if block is None else block.height, root=0)
    if given is not None and height is not None and abs(given - height) > 1e-9 * L:
        raise MeshError(f"mesh.file: the mesh has the height {given:g}, block.height is {height:g}: make them equal")
    height = L if height is None else height
    schedule = Schedule(
        None if delta_max is None else delta_max / L,
        None if force_max is None else force_max / (L**2 * material.reduced_modulus),
        steps,
        unload_steps,
        cycles,
        integrator if material.plastic else BACKWARD_EULER,
        substeps,
    )
    settings: dict[str, Any] = dict(sides=sides, formulation=formulation, kernels=kernels, options=options)
    if given is None:
        stage("mesh")
        if delta_max is None:
            assert force_max is not None
            with phases.phase("deflection estimate"):
                delta_max = estimate_deflection(comm, surface, material, height, force_max, settings)
        with phases.phase("mesh"):
            size = size or MeshSize()
            block = make_block(comm, surface, height, delta_max, size)
            if doubt := on_root(comm, partial(doubt_of_waves, surface, size.h_contact or H_CONTACT * L, delta_max)):
                warnings.warn(doubt, ResolutionWarning, stacklevel=2)
    stage("set-up")
    with phases.phase("set-up"):
        solver = make_contact_solver(comm, surface, block, material, phases=phases, **settings)
    record = Record(L, material.E, material.reduced_modulus)
    position = None if saved is None else saved.restore(solver, record)
    if checkpoint is not None:
        checkpoint.begin(block)

    def on_position(at: Position) -> None:
        reason = stop() if stop is not None else ""
        ended = at.leg == len(schedule.legs)
        if checkpoint is not None and (reason or ended or checkpoint.due(solver.counts.steps)):
            checkpoint.save(solver, record, at)
        if reason:
            raise Interrupted(
                f"stopped by {reason} after step {len(record.rows)} at delta/L = {solver.delta:.6g}"
                + ("; --resume continues" if checkpoint is not None and checkpoint.interval else "")
            )

    stage(f"load path, {solver.solid.dofs} dofs")
    failure = None
    try:
        follow(solver, schedule, record, snapshots, on_step, position, on_position)
    except ConvergenceError as e:
        failure = e
    reason = "done" if failure is None else str(failure)
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
        reason,
    )
    if failure is not None:
        raise PartialResult(reason, result) from failure
    return result


def estimate_deflection(
    comm: MPI.Comm,
    surface: Surface,
    material: Material,
    height: float,
    force_max: float,
    settings: dict[str, Any],
) -> float:
    """About the deflection at a force on a coarse mesh [length], for the size of the real one; collective.

    A force that is not reached soon, or not at all, gives the deflection so far: the run itself has to say so.
    """
    L = surface.L
    depth = surface.maximum()[2] - surface.mean()
    block = make_block(comm, surface, height, max(depth, 0.01 * L), MeshSize(0.1 * L))
    solver = make_contact_solver(comm, surface, block, material, **settings)

    def give_up(at: Position) -> None:
        if solver.counts.steps >= ESTIMATE_STEPS:
            raise Interrupted  # enough for an estimate

    schedule = Schedule(force_max=force_max / (L**2 * material.reduced_modulus), steps=5)
    with suppress(ConvergenceError):
        follow(solver, schedule, Record(L, material.E, 1.0), on_position=give_up)
    return max(solver.delta, 1e-3) * L
