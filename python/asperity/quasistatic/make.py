"""Mesh and contact solver of a problem, without a load path."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from asperity.contact import make_contact
from asperity.contact.contact_surface import ContactSurface, Tool
from asperity.fem.law_check import check_law
from asperity.fem.solid import Solid
from asperity.linear.petsc import destroy_unused
from asperity.mesh.block import BlockMesh
from asperity.mesh.distribute import check_distortion, distribute
from asperity.mesh.generate import build_block
from asperity.mesh.size_field import size_field
from asperity.model.problem import Problem
from asperity.quasistatic.contact_solver import ContactSolver
from asperity.runtime.parallel import on_root
from asperity.runtime.usage import Phases
from asperity.surface import Surface

if TYPE_CHECKING:
    from mpi4py import MPI


def make_block(comm: MPI.Comm, problem: Problem, delta_max: float) -> BlockMesh | None:
    """Mesh of a problem for an approach [length], on rank 0, None elsewhere; MeshError where there is none; collective.

    Elements are small where the composite surface meets the flat, and opposite sides that are periodic fit.
    """
    met = problem.composite

    def build() -> BlockMesh:
        field = size_field(met, delta_max, problem.size, problem.sides)
        return build_block(problem.surface, problem.height, field.at, field.periodic, met.maximum()[:2])

    return on_root(comm, build)


def distributed(comm: MPI.Comm, surface: Surface, block: BlockMesh | None, sides: str) -> tuple[Any, Any]:
    """Check a mesh on rank 0 and distribute it over the ranks, see `distribute`; collective.

    Raises:
        MeshError: the block is another surface's, its sides do not fit, or an element is turned inside out
    """

    def check() -> None:
        if block is not None:
            block.check(surface)

    on_root(comm, check)
    mesh, tags = distribute(comm, block, 1.0 / surface.L, sides == "periodic")
    check_distortion(mesh, surface)
    return mesh, tags


def make_contact_solver(
    comm: MPI.Comm, problem: Problem, block: BlockMesh | None, phases: Phases | None = None
) -> ContactSolver:
    """Distribute the mesh of a problem over the ranks and put it under the flat, or the tool; collective.

    Args:
        problem: whose surface the block was built for
        block: mesh on rank 0, None elsewhere

    Raises:
        InputError: the kinematics of the material is not chosen yet
        MeshError: the block is another surface's, or an element is turned inside out

    Examples:
        >>> from mpi4py import MPI
        >>> size, elastic = asp.MeshSize(h_contact=1.0, h_max=1.0), asp.Material(E=1.0, nu=0.3)
        >>> problem = asp.Problem.of(asp.Surface.from_spec("flat", L=1.0), elastic, delta_max=0.01, size=size)
        >>> solver = make_contact_solver(MPI.COMM_SELF, problem, make_block(MPI.COMM_SELF, problem, 0.01))
        >>> solver.step(0.01).converged, round(solver.force / 0.01, 6), round(elastic.confined_modulus, 6)
        (True, 1.346154, 1.346154)
    """
    surface, material, sides, L = problem.surface, problem.material, problem.sides, problem.surface.L
    material.check_decided()
    destroy_unused(comm)  # solvers of earlier runs
    if (law := material.law) is not None:
        on_root(comm, lambda: check_law(law))
    height = comm.bcast(None if block is None else block.height, root=0)
    mesh, tags = distributed(comm, surface, block, sides)
    solid = Solid(mesh, tags, material.scaled(material.E), sides, problem.options.forms, phases, comm)
    top = ContactSurface(solid, None if problem.flat else Tool(problem.rigid, sides == "periodic"))
    summit = (height + problem.composite.maximum()[2] - surface.mean()) / L
    return ContactSolver(solid, top, make_contact(problem.formulation, solid, top), summit, problem.options)
