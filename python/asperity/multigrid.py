"""Two-level p-multigrid: second-order displacements are smoothed, first-order ones solved on the cell corners.

The coarse space is an eighth of the size, so it can be factorised where the second-order problem of the same mesh
is far too large for that, and is set up in a fraction of the time of an algebraic hierarchy on the fine level.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

if TYPE_CHECKING:
    from .solid import Solid

EDGES = (
    (2, 3),
    (1, 3),
    (1, 2),
    (0, 3),
    (0, 2),
    (0, 1),
)  # corners of edge k of a cell, in the order of basix
COARSE_LU_LIMIT = 60_000  # coarse dofs up to which the coarse problem is factorised

LEVELS = {
    "mg_levels_ksp_type": "chebyshev",
    "mg_levels_ksp_max_it": 2,
    "mg_levels_pc_type": "jacobi",
    "mg_levels_esteig_ksp_type": "cg",
    "mg_levels_esteig_ksp_max_it": 10,
}
COARSE_LU = {
    "mg_coarse_ksp_type": "preonly",
    "mg_coarse_pc_type": "cholesky",
    "mg_coarse_pc_factor_mat_solver_type": "mumps",
}
COARSE_GAMG = {
    "mg_coarse_ksp_type": "preonly",
    "mg_coarse_pc_type": "gamg",
    "mg_coarse_pc_gamg_coarse_eq_limit": 1000,
    "mg_coarse_pc_gamg_esteig_ksp_type": "cg",
    "mg_coarse_pc_gamg_esteig_ksp_max_it": 10,
    "mg_coarse_mg_levels_ksp_type": "chebyshev",
    "mg_coarse_mg_levels_pc_type": "jacobi",
}


class PMultigrid:
    """Preconditioner for the eliminated tangent of a solid; collective.

    Eliminated dofs (unit rows of the matrix) are taken out of the interpolation, so a coarse correction never moves
    them, and eliminated corners get a unit row of their own.

    Args:
        solid: whose matrix is preconditioned
        pc: PETSc preconditioner that becomes the multigrid one

    Attributes:
        options: PETSc options the levels need
    """

    def __init__(self, solid: Solid, pc: Any) -> None:
        from dolfinx import fem

        self._solid, self._pc = solid, pc
        coarse = fem.functionspace(solid.mesh, ("Lagrange", 1, (3,))).dofmap
        self._corners = self._corner_nodes(coarse)
        self._P = self._interpolation(coarse)
        self._masked = self._P.copy()
        self._keep = self._P.createVecLeft(), self._P.createVecRight()
        self._coarse: Any = None
        pc.setType("mg")
        pc.setMGLevels(2)
        pc.setMGInterpolation(1, self._masked)
        direct = 3 * coarse.index_map.size_global <= COARSE_LU_LIMIT
        self.options = LEVELS | (COARSE_LU if direct else COARSE_GAMG)

    def _corner_nodes(self, coarse: Any) -> npt.NDArray[np.int32]:
        """Local second-order node at each local first-order node, ghosts included."""
        out = np.empty(coarse.index_map.size_local + coarse.index_map.num_ghosts, dtype=np.int32)
        out[coarse.list] = self._solid.V.dofmap.list[:, :4]
        return out

    def _interpolation(self, coarse: Any) -> Any:
        """Matrix from corner dofs to all dofs: a corner keeps its value, an edge takes the mean of its ends."""
        from petsc4py import PETSc
        from scipy import sparse

        solid, index_map = self._solid, coarse.index_map
        nodes, corners = (
            solid.V.dofmap.list,
            index_map.local_to_global(coarse.list.ravel()).reshape(-1, 4),
        )
        rows = [nodes[:, :4]] + [nodes[:, 4:]] * 2
        columns = [corners] + [corners[:, [ends[i] for ends in EDGES]] for i in (0, 1)]
        row = np.concatenate([r.ravel() for r in rows])
        column = np.concatenate([c.ravel() for c in columns])
        shape = (solid.nodes, index_map.size_global)
        local = sparse.coo_array((np.ones(len(row)), (row, column)), shape).tocsr()[: solid.owned]
        ends = np.diff(local.indptr)  # one or two, however many cells share the node
        local.data = np.repeat(1.0 / ends, ends)
        P = sparse.kron(local, sparse.eye_array(3), format="csr")
        sizes = (
            (3 * solid.owned, solid.dofs),
            (3 * index_map.size_local, 3 * index_map.size_global),
        )
        csr = (P.indptr.astype(PETSc.IntType), P.indices.astype(PETSc.IntType), P.data)
        out = PETSc.Mat().createAIJ(sizes, csr=csr, comm=solid.comm)
        out.setBlockSizes(3, 3)
        return out

    def update(self, A: Any, eliminated: npt.NDArray[np.int32]) -> None:
        """Adapt to new values of the matrix and a new set of eliminated owned dofs; collective."""
        fine, coarse = self._keep
        fine.set(1.0)
        fine.array[eliminated] = 0.0
        kept = self._solid.with_ghosts(fine.array_r)
        coarse.array = kept[self._corners].ravel()[: coarse.getLocalSize()]
        self._P.copy(self._masked)
        self._masked.diagonalScale(fine, coarse)
        # with the constant P the product can be reused; what the unit rows add to it only stiffens corners next
        # to eliminated edges
        self._coarse = A.ptap(self._P, result=self._coarse)
        rows = np.flatnonzero(coarse.array_r == 0.0).astype(np.int32)
        self._coarse.zeroRowsColumns(rows + coarse.getOwnershipRange()[0])
        self._pc.getMGCoarseSolve().setOperators(self._coarse)
