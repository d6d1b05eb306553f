"""The call for scripts: from a surface and a material to the force-approach curve, on one mesh or to a tolerance."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Unpack, overload

from asperity.adaptive.mesh_error import AccurateResult
from asperity.adaptive.solve_to_tolerance import check_free, refine
from asperity.mesh.block import BlockMesh
from asperity.model.load_path import MIDPOINT
from asperity.model.material import Material
from asperity.model.problem import Problem, ProblemArguments
from asperity.model.settings import AccuracyTarget, Formulation, MeshSize, SolverOptions
from asperity.quasistatic.callbacks import Callbacks
from asperity.quasistatic.contact_result import ContactResult
from asperity.quasistatic.solve_problem import solve_problem
from asperity.quasistatic.stepping import Callback
from asperity.surface import Surface

if TYPE_CHECKING:
    from mpi4py import MPI

    from asperity.quasistatic.checkpoint import Checkpoint


@overload
def solve_contact(
    surface: Surface,
    material: Material,
    *,
    tolerance: None = None,
    block: BlockMesh | None = None,
    comm: MPI.Comm | None = None,
    snapshots: int = 0,
    on_stage: Callable[[str], None] | None = None,
    on_step: Callback | None = None,
    checkpoint: Checkpoint | None = None,
    stop: Callable[[], str] | None = None,
    stiffness: bool = False,
    conductance: bool = False,
    **problem: Unpack[ProblemArguments],
) -> ContactResult: ...


@overload
def solve_contact(
    surface: Surface,
    material: Material,
    *,
    tolerance: float | AccuracyTarget,
    comm: MPI.Comm | None = None,
    snapshots: int = 0,
    on_stage: Callable[[str], None] | None = None,
    on_step: Callback | None = None,
    checkpoint: Checkpoint | None = None,
    stop: Callable[[], str] | None = None,
    stiffness: bool = False,
    conductance: bool = False,
    **problem: Unpack[ProblemArguments],
) -> AccurateResult: ...


def solve_contact(
    surface: Surface,
    material: Material,
    *,
    delta_max: float | None = None,
    force_max: float | None = None,
    pressure_max: float | None = None,
    steps: int = 10,
    unload_steps: int = 0,
    cycles: int = 1,
    tolerance: float | AccuracyTarget | None = None,
    size: MeshSize | None = None,
    height: float | None = None,
    sides: str = "rollers",
    formulation: Formulation | None = None,
    integrator: str = MIDPOINT,
    substeps: int = 1,
    options: SolverOptions | None = None,
    block: BlockMesh | None = None,
    comm: MPI.Comm | None = None,
    snapshots: int = 0,
    on_stage: Callable[[str], None] | None = None,
    on_step: Callback | None = None,
    checkpoint: Checkpoint | None = None,
    stop: Callable[[], str] | None = None,
    stiffness: bool = False,
    conductance: bool = False,
) -> ContactResult | AccurateResult:
    """Press a rough block with a rigid frictionless flat; collective over `comm`.

    The call for scripts: `solve_problem`, or with a tolerance `refine`, of `Problem.of` these arguments.

    Args:
        surface: the rough top
        material: elastic or elastic-plastic
        delta_max: greatest approach from first touch [length]
        force_max: greatest force instead [force]
        pressure_max: greatest nominal pressure instead, the force over L^2 [force/length^2]
        steps: planned steps of a loading
        unload_steps: planned steps of an unloading, 0 for none
        cycles: loadings, each followed by an unloading
        tolerance: greatest error bar of the force, relative to the force: mesh and load steps are refined until it is
            reached, and the result is an `AccurateResult`; None takes one mesh
        size: element sizes, without a tolerance
        height: mean height of the block [length]; None takes L
        sides: "rollers", "free" or "periodic"
        formulation: of the contact
        integrator, substeps: of plasticity, see `load_path.Schedule`
        options: of the solver
        block: a mesh to use instead of making one (on rank 0), without a tolerance
        comm: communicator; default all ranks
        snapshots, on_stage, on_step, checkpoint, stop, stiffness, conductance: see `Callbacks`

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
        >>> asp.solve_contact(Flat(L=1.0), elastic, delta_max=0.01, steps=2, tolerance=0.01).met
        True
    """
    problem = Problem.of(
        surface, material, height=height, sides=sides, delta_max=delta_max, force_max=force_max,
        pressure_max=pressure_max, steps=steps, unload_steps=unload_steps, cycles=cycles, integrator=integrator,
        substeps=substeps, size=size, formulation=formulation, options=options,
    )  # fmt: skip
    hooks = Callbacks(on_stage, on_step, stop, checkpoint, snapshots, stiffness=stiffness, conductance=conductance)
    if tolerance is None:
        return solve_problem(problem, block=block, comm=comm, hooks=hooks)
    check_free(problem, block is not None)
    target = tolerance if isinstance(tolerance, AccuracyTarget) else AccuracyTarget(tolerance)
    return refine(problem, target, comm, hooks).checked()
