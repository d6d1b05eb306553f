"""The deformable block: displacement space, internal force, history; fields in the numbering of the mesh as built.

Inside the solver lengths are in units of the side L and stresses in units of E, so tolerances mean the same for
every case. Each residual writes a trial history; `commit` alone makes it the committed one.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from asperity.arrays import Array, Floats, Indices
from asperity.fem.forms import FormKernels
from asperity.fem.ghosts import Ghosts
from asperity.fem.kernels import ElementKernels
from asperity.fem.sparsity import SparsityPattern
from asperity.fem.tangent import Tangent
from asperity.mesh.distribute import BASE, SIDE_X, SIDE_Y
from asperity.mesh.element import DEGREE, NODES
from asperity.model.material import Material
from asperity.runtime import compat
from asperity.runtime.parallel import gather
from asperity.runtime.usage import Phases


class Solid:
    """Displacement on a distributed mesh, clamped base, and sides on rollers, free or periodic.

    Args:
        mesh, tags: returned by `mesh.distribute`
        material: with stresses in units of E
        sides: "rollers" (no normal displacement), "free", or "periodic" for a mesh with joined sides
        forms: whether the kernels are forms of UFL, as they are for a material with a law of its own
        phases: collects the time spent in each phase
        comm: communicator of PETSc's objects; None takes that of the mesh, which no other mesh has

    Attributes:
        u, force: displacement [L] and internal force [E L^2], functions of dolfinx
        owned, nodes: number of owned displacement nodes, and with ghosts
        dofs: degrees of freedom of all ranks
        points: coordinates of the nodes, on one of two joined sides (nodes, 3) [L]
        cell_nodes: displacement nodes of the owned cells (cells, 10)
        sides: as given
        fixed: owned dofs without displacement
        base: owned nodes on the clamped base
        kernels: internal force, tangent and history of the cells
        ghosts: ghost update of nodal values
        sparsity: of this rank's part of the tangent
        tangent: this rank's part
    """

    def __init__(
        self,
        mesh: Any,
        tags: Any,
        material: Material,
        sides: str = "rollers",
        forms: bool = False,
        phases: Phases | None = None,
        comm: Any = None,
    ) -> None:
        from dolfinx import fem

        self.phases = phases or Phases()
        self.mesh, self.tags, self.material, self.sides = mesh, tags, material, sides
        self.comm = mesh.comm if comm is None else comm
        self.V = fem.functionspace(mesh, ("Lagrange", DEGREE, (3,)))
        self.u = fem.Function(self.V, name="displacement")
        self.force = fem.Function(self.V, name="internal force")
        index_map = self.V.dofmap.index_map
        self.owned = index_map.size_local
        self.nodes = index_map.size_local + index_map.num_ghosts
        self.dofs = 3 * index_map.size_global
        self.points = np.ascontiguousarray(self.V.tabulate_dof_coordinates())
        cells = mesh.topology.index_map(3).size_local
        self.cell_nodes = np.ascontiguousarray(self.V.dofmap.list[:cells])
        self.sparsity = SparsityPattern(self.cell_nodes, self.nodes)
        self.base = self.nodes_on(BASE)
        fixed: list[npt.NDArray[np.int32]] = [(3 * self.base[:, None] + np.arange(3)).ravel()]
        if sides == "rollers":
            fixed += [3 * self.nodes_on(SIDE_X), 3 * self.nodes_on(SIDE_Y) + 1]
        self.fixed = np.unique(np.concatenate(fixed)).astype(np.int32)
        x_nodes = compat.geometry_dofmap(mesh)[:cells]
        if forms or material.law is not None:
            self.kernels: ElementKernels = FormKernels(self.V, self.cell_nodes, material, self.sparsity)
        else:
            self.kernels = ElementKernels(mesh.geometry.x, x_nodes, self.cell_nodes, material, self.sparsity)
        self.ghosts = Ghosts(index_map)
        self.tangent = Tangent(self.kernels, self.sparsity, self.u.x.array, self.phases)

    def positions(self, nodes: npt.NDArray[np.int32]) -> Floats:
        """Coordinates of the nodes (n, k) of cells or facets, across joined sides next to the first (n, k, 3) [L]."""
        x = self.points[nodes]
        if self.sides == "periodic":  # cells are narrower than half the side, which is one
            x[:, :, :2] -= np.round(x - x[:, :1])[:, :, :2]
        return x

    def nodes_on(self, tag: int) -> npt.NDArray[np.int32]:
        """Owned nodes on the facets with a tag."""
        from dolfinx import fem

        found = fem.locate_dofs_topological(self.V, 2, self.tags.find(tag))
        return found[found < self.owned]

    def set_displacement(self, x: Floats) -> None:
        """Set the displacement by owned dof values (3 owned,), ghosts included; collective."""
        self.u.x.array[: 3 * self.owned] = x
        self.u.x.scatter_forward()

    def vector(self) -> Any:
        """A PETSc vector of the owned dofs."""
        from petsc4py import PETSc

        return PETSc.Vec().createMPI((3 * self.owned, self.dofs), bsize=3, comm=self.comm)

    def scatter_forward(self, values: Floats) -> Floats:
        """Nodal array with ghosts (nodes, 3) of owned dof values (3 owned,); collective."""
        return self.ghosts.scatter_forward(values.reshape(-1, 3)).copy()

    def scatter_reverse(self, values: Floats) -> Floats:
        """Sum nodal values (nodes, k) over the ranks that hold a part; at the owned nodes (owned, k); collective."""
        return self.ghosts.scatter_reverse(values).copy()

    def internal_force(self) -> Floats:
        """Internal force of the current displacement on the owned nodes (owned, 3); collective."""
        from dolfinx import la

        b = self.force.x.array
        with self.phases.phase("residual"):
            b[:] = 0.0
            self.kernels.add_internal_force(self.u.x.array.reshape(-1, 3), b.reshape(-1, 3))
            self.force.x.scatter_reverse(la.InsertMode.add)
        return b.reshape(-1, 3)[: self.owned]


def node_numbers(solid: Solid) -> Indices:
    """Number in the built mesh of each local displacement node, of one of them where nodes are joined (nodes,)."""
    x_nodes = compat.geometry_dofmap(solid.mesh)
    out = np.full(solid.nodes, -1, dtype=np.int64)
    numbers = solid.mesh.geometry.input_global_indices
    out[solid.V.dofmap.list.ravel()] = np.asarray(numbers)[x_nodes.ravel()]
    return out


def built_nodes(solid: Solid) -> tuple[Indices, Indices]:
    """Numbers in the built mesh of all nodes of this rank's cells, and the displacement node of each (n,)."""
    numbers = np.asarray(solid.mesh.geometry.input_global_indices)
    node = np.empty(len(numbers), dtype=np.int64)
    node[compat.geometry_dofmap(solid.mesh).ravel()] = solid.V.dofmap.list.ravel()
    return numbers, node


def gather_nodes(solid: Solid, values: Array) -> Array | None:
    """Nodal values in the order of the mesh as built, on rank 0; collective; see `built_nodes`."""
    numbers, at = built_nodes(solid)
    found = gather(solid.comm, numbers, values[at])
    return found and found[1]


def gather_cells(solid: Solid, values: Array) -> Array | None:
    """Values of the owned cells (cells, ...) in the order of the mesh as built, on rank 0; collective."""
    found = gather(solid.comm, cell_numbers(solid), values)
    return found and found[1]


def cell_numbers(solid: Solid) -> Indices:
    """Number in the built mesh of each owned cell (cells,)."""
    return np.asarray(solid.mesh.topology.original_cell_index)[: len(solid.cell_nodes)]


def gather_mesh(solid: Solid) -> tuple[Array, Array] | None:
    """Nodes (N, 3) [L] and elements (M, 10), in the order of gmsh, of the mesh as built; on rank 0; collective."""
    numbers = np.asarray(solid.mesh.geometry.input_global_indices)
    x_nodes = compat.geometry_dofmap(solid.mesh)[: len(solid.cell_nodes)]
    points = gather(solid.comm, numbers, solid.mesh.geometry.x)
    tets = np.empty(x_nodes.shape, dtype=np.int64)
    tets[:, compat.gmsh_to_dolfinx(NODES)] = numbers[x_nodes]
    cells = gather_cells(solid, tets)
    return None if points is None or cells is None else (points[1], cells)
