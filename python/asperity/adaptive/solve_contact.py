"""The call for scripts: from a surface and a material to the force-approach curve, on one mesh or to a tolerance."""

from __future__ import annotations

from dataclasses import fields, replace
from typing import TYPE_CHECKING, Unpack, overload

from asperity.errors import InputError
from asperity.mesh.block import BlockMesh
from asperity.model.material import Material
from asperity.model.problem import Problem, ProblemArguments
from asperity.model.settings import AccuracyTarget, MeshSize
from asperity.quasistatic.contact_result import ContactResult
from asperity.quasistatic.solve_problem import CallbackArguments, Callbacks, solve_problem
from asperity.surface import Surface

if TYPE_CHECKING:
    from mpi4py import MPI

    from asperity.adaptive.refine import AccurateResult


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
    from asperity.adaptive.refine import refine

    # replace refuses a target without a tolerance
    target = replace(tolerance) if isinstance(tolerance, AccuracyTarget) else AccuracyTarget(tolerance)
    return refine(problem, target, comm, hooks).checked()
