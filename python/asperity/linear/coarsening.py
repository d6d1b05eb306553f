# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

"""From the second-order displacements of a solid to the first-order ones of the same mesh."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from asperity.fem.sparsity import SparsityPattern
from asperity.linear.petsc_matrix import NodeMatrix, set_rigid_modes
from asperity.mesh.element import node_ends

if TYPE_CHECKING:
    from asperity.fem.solid import Solid


class Coarsening:
    """Coarse nodes of a solid, the corners of its cells, and the interpolation from them; collective.

    Args:
        solid: of the fine nodes

    Attributes:
        corners: node at each corner, ghosts included
        parents: of each node the corner it is, twice, or the ends of its edge (nodes, 2)
        P: matrix from corner dofs to all dofs
        dofs: corner dofs of all ranks
    """

    def __init__(self, solid: Solid) -> None:
        from dolfinx import fem

        coarse = fem.functionspace(solid.mesh, ("Lagrange", 1, (3,))).dofmap
        self._solid, self._map, self._cells = solid, coarse.index_map, coarse.list
        self.dofs = 3 * self._map.size_global
        self.corners = np.empty(self._map.size_local + self._map.num_ghosts, dtype=np.int32)
        self.corners[coarse.list] = solid.V.dofmap.list[:, :4]
        self.parents = np.empty((solid.nodes, 2), dtype=np.int32)
        for k, ends in enumerate(node_ends()):
            self.parents[solid.V.dofmap.list[:, k]] = coarse.list[:, ends]
        self.P = self._interpolation()

    def matrix(self) -> NodeMatrix:
        """A new matrix on the corners, with its rigid-body modes; collective."""
        solid = self._solid
        matrix = NodeMatrix(SparsityPattern(self._cells, len(self.corners)), self._map, solid.comm)
        set_rigid_modes(matrix.A, solid.points[self.corners])
        return matrix

    def _interpolation(self) -> Any:
        """Matrix from corner dofs to all dofs: a corner keeps its value, an edge takes the mean of its ends."""
        from petsc4py import PETSc
        from scipy import sparse

        solid, index_map = self._solid, self._map
        columns = index_map.local_to_global(self.parents.ravel())
        rows = np.repeat(np.arange(solid.nodes), 2)
        shape = (solid.nodes, index_map.size_global)
        local = sparse.coo_array((np.full(len(rows), 0.5), (rows, columns)), shape).tocsr()[: solid.owned]
        P = sparse.kron(local, sparse.eye_array(3), format="csr")
        sizes = (
            (3 * solid.owned, solid.dofs),
            (3 * index_map.size_local, 3 * index_map.size_global),
        )
        csr = (P.indptr.astype(PETSc.IntType), P.indices.astype(PETSc.IntType), P.data)
        out = PETSc.Mat().createAIJ(sizes, csr=csr, comm=solid.comm)
        out.setBlockSizes(3, 3)
        return out
