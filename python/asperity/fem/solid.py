"""The deformable block: displacement space, internal force, tangent, history.

Inside the solver lengths are in units of the side L and stresses in units of E, so tolerances mean the same for
every case. Each residual writes a trial history; `commit` alone makes it the committed one.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

from asperity.arrays import Floats, Singles
from asperity.fem.forms import FormKernels
from asperity.fem.ghosts import Ghosts
from asperity.fem.kernels import ElementKernels
from asperity.fem.node_order import displacement_space
from asperity.fem.sparsity import SparsityPattern
from asperity.mesh.distribute import BASE, SIDE_X, SIDE_Y
from asperity.model.material import Material
from asperity.runtime import compat
from asperity.runtime.compiled import solver as _solver
from asperity.runtime.timing import Phases

#: Writes a matrix at a nodal displacement, see `ElementKernels.tangent`.
Write = Callable[[Floats, Floats | Singles], None]


class BodyForce(Protocol):
    """A force on the whole block, such as that of inertia."""

    def add_force(self, u: Floats, b: Floats) -> None:
        """Add the force at the displacement u (nodes, 3) to the internal one b (nodes, 3) [E L^2]; this rank's part."""

    def add_stiffness(self, values: Floats) -> None:
        """Add its derivative to the values of the local matrix."""


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
        body_force: counts as a part of the internal force; None in statics
        ghosts: ghost update of nodal values
        sparsity: of this rank's part of the tangent
        values: of that part; the tangent is the sum of the parts of all ranks
        half: upper half of that part in single precision
        halved: whether a matrix without a stiffness of the contact is written as its half alone, a quarter of the
            memory; `values` are then made on demand, at the state of that moment
        version: number of matrices written
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
        self.V = displacement_space(mesh)
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
        self.fixed = self._fixed_rows(sides)
        self.base = self.nodes_on(BASE)
        x_nodes = compat.geometry_dofmap(mesh)[:cells]
        self.kernels: ElementKernels | FormKernels
        if forms or material.law is not None:
            self.kernels = FormKernels(self.V, self.cell_nodes, material, self.sparsity)
        else:
            self.kernels = ElementKernels(mesh.geometry.x, x_nodes, self.cell_nodes, material, self.sparsity)
        self.body_force: BodyForce | None = None
        self.ghosts = Ghosts(index_map)
        self._values: Floats | None = None
        self._half: Singles | None = None
        self._missing: Write | None = None  # writes the values of a matrix of which there is only the half
        self._halved_version = 0  # of the matrix in `_half`
        self.halved = False
        self.version = 0
        self._written = False
        self._with_contact = False  # whether a stiffness of the contact is in `values`

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

    def _fixed_rows(self, sides: str) -> npt.NDArray[np.int32]:
        """Owned dofs without displacement."""
        fixed: list[npt.NDArray[np.int32]] = [(3 * self.nodes_on(BASE)[:, None] + np.arange(3)).ravel()]
        if sides == "rollers":
            fixed += [3 * self.nodes_on(SIDE_X), 3 * self.nodes_on(SIDE_Y) + 1]
        return np.unique(np.concatenate(fixed)).astype(np.int32)

    # -- vectors and matrix ----------------------------------------------------------------------------------

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
            if self.body_force is not None:
                self.body_force.add_force(self.u.x.array.reshape(-1, 3), b.reshape(-1, 3))
            self.force.x.scatter_reverse(la.InsertMode.add)
        return b.reshape(-1, 3)[: self.owned]

    @property
    def values(self) -> Floats:
        """Values of the local tangent, in the order of `sparsity`."""
        if self._values is None:
            self._values = np.zeros(self.sparsity.size)
        if self._missing is not None:
            with self.phases.phase("tangent"):
                self._missing(self.u.x.array.reshape(-1, 3), self._values)
            self._missing = None
        return self._values

    @property
    def half(self) -> Singles:
        """Upper half of the local tangent by the columns of its blocks (9 blocks + 1,), see `SparsityPattern.upper`.

        The lower half counts for nothing. The next matrix overwrites it.
        """
        half = self._half_to_write()
        if self._halved_version != self.version:
            _solver.upper_half(self.sparsity.indptr, self.sparsity.indices, self.values, half)
            self._halved_version = self.version
        return half

    def _half_to_write(self) -> Singles:
        if self._half is None:
            blocks = len(self.sparsity.upper[1])
            self._half = np.zeros(9 * blocks + 1, dtype=np.float32)  # one more is read with the last
        return self._half

    def drop_matrices(self) -> None:
        """Free the matrices, most of the memory of a solid; the next tangent makes them again."""
        self._values = self._half = self._missing = None
        self._written, self._halved_version = False, 0
        self.kernels.drop_matrices()

    @property
    def constant(self) -> bool:
        """Whether the tangent of the solid, without that of the contact, never changes."""
        return self.kernels.linear and self.body_force is None

    def assemble_tangent(self, add: Callable[[], None] | None = None, shift: float = 0.0) -> None:
        """Write the tangent at the state of the last internal force; `add` adds that of the contact to `values`.

        With a `shift`, see `ElementKernels.tangent`.
        """
        self._assemble(partial(self.kernels.tangent, shift=shift) if shift else self.kernels.tangent, add)

    def assemble_elastic(self, add: Callable[[], None] | None = None) -> None:
        """Write the stiffness without plastic flow; `add` adds that of the contact to `values`."""
        self._assemble(self.kernels.elastic_tangent, add)

    def _assemble(self, write: Write, add: Callable[[], None] | None) -> None:
        if self._written and self.constant and add is None and not self._with_contact:
            return
        half = self.halved and add is None and self.body_force is None
        with self.phases.phase("tangent"):
            self._missing = None
            write(self.u.x.array.reshape(-1, 3), self._half_to_write() if half else self.values)
            if add is not None:
                add()
            if self.body_force is not None:
                self.body_force.add_stiffness(self.values)
        self._with_contact, self._written = add is not None, True
        self.version += 1
        if half:
            self._missing, self._halved_version = write, self.version
