"""Mesh and contact solver of a problem, without a load path."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from asperity.contact import make_contact
from asperity.contact.contact_surface import ContactSurface
from asperity.contact.tool import Tool
from asperity.fem.law_check import check_law
from asperity.fem.solid import Solid
from asperity.linear.petsc import destroy_unused
from asperity.mesh.block import BlockMesh
from asperity.mesh.distribute import check_distortion, distribute
from asperity.mesh.generate import build_block
from asperity.mesh.size_field import size_field
from asperity.model.material import Material
from asperity.model.problem import Problem
from asperity.model.settings import Formulation, MeshSize, SolverOptions
from asperity.quasistatic.contact_solver import ContactSolver
from asperity.runtime.parallel import on_root
from asperity.runtime.usage import Phases
from asperity.surface import Flat, Surface, composite

if TYPE_CHECKING:
    from mpi4py import MPI


def make_block(
    comm: MPI.Comm, surface: Surface, height: float, delta_max: float, size: MeshSize, sides: str = "rollers",
    composite: Surface | None = None,
) -> BlockMesh | None:  # fmt: skip
    """Mesh on rank 0 of a block of mean height for an approach, both [length]; None elsewhere; collective.

    Opposite `sides` that are "periodic" fit. The `composite` surface, by default that of the block, says where elements
    are small. A MeshError says why a surface cannot be meshed.
    """
    met = surface if composite is None else composite

    def build() -> BlockMesh:
        field = size_field(met, delta_max, size, sides)
        return build_block(surface, height, field.at, field.periodic, met.maximum()[:2])

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
    comm: MPI.Comm,
    surface: Surface,
    block: BlockMesh | None,
    material: Material,
    *,
    sides: str = "rollers",
    formulation: Formulation | None = None,
    options: SolverOptions | None = None,
    phases: Phases | None = None,
    tool: Surface | None = None,
    highest: float | None = None,
) -> ContactSolver:
    """Distribute a block over the ranks and put it under the flat, or a tool; collective.

    Args:
        surface: the top the block was built for
        block: mesh on rank 0, None elsewhere
        material: in physical units
        tool: rigid body above the block, see `Problem`
        highest: greatest height of the composite surface, which is searched without it [length]

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
    if comm.size > 1:
        destroy_unused(comm)  # solvers of earlier runs
    L = surface.L
    if (law := material.law) is not None:
        on_root(comm, lambda: check_law(law))
    height = comm.bcast(None if block is None else block.height, root=0)
    mesh, tags = distributed(comm, surface, block, sides)
    options = options or SolverOptions()
    solid = Solid(mesh, tags, material.scaled(material.E), sides, options.forms, phases, comm)
    rigid = Flat(L=L) if tool is None else tool
    top = ContactSurface(solid, None if isinstance(rigid, Flat) else Tool(rigid, sides == "periodic"))
    contact = make_contact(formulation or Formulation(), solid, top)
    summit = (height + (composite(surface, rigid).maximum()[2] if highest is None else highest) - surface.mean()) / L
    return ContactSolver(solid, top, contact, summit, options)


def solver_of(problem: Problem, block: BlockMesh | None, comm: MPI.Comm, phases: Phases | None = None) -> ContactSolver:
    """Contact solver of a problem on a mesh, see `make_contact_solver`; collective."""
    return make_contact_solver(
        comm,
        problem.surface,
        block,
        problem.material,
        sides=problem.sides,
        formulation=problem.formulation,
        options=problem.options,
        phases=phases,
        tool=problem.tool,
        highest=problem.composite.maximum()[2],
    )
