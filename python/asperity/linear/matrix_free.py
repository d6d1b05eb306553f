"""Tangent operator of a solid: products without assembling the matrix; each rank has its part."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, cast

import numpy as np
import numpy.typing as npt

from asperity.arrays import Floats, Integers, Singles
from asperity.fem.ghosts import SharedSums
from asperity.runtime.compiled import solver as _solver

if TYPE_CHECKING:
    from asperity.fem.solid import Solid
    from asperity.fem.sparsity import SparsityPattern


def tangent_product(solid: Solid, x: Floats) -> Floats:
    """Tangent of a solid times owned dof values (3 owned,), in double precision; collective."""
    sparsity, image = solid.sparsity, np.empty((solid.nodes, 3))
    _solver.product(sparsity.indptr, sparsity.indices, solid.tangent.values(), solid.scatter_forward(x), image)
    return solid.scatter_reverse(image).ravel()


class TangentOperator:
    """Products with the tangent of a solid; a python context of PETSc for the matrix of the free dofs.

    A product takes as long as reading the matrix, and neither a preconditioner nor a Newton step needs many digits. So
    the operator takes the upper half in single precision (benchmarks/speed.py).

    Args:
        solid: owner of the tangent
        symmetric: whether the tangent is symmetric; the half treats any tangent as if it were
        single: whether PETSc uses the half of a symmetric tangent, sufficient for tolerances above 1e-5

    Attributes:
        kept: 1 at the free dofs, 0 at the others, ghosts included (nodes, 3)
        free: the same at the owned dofs (3 owned,)
        version: of the solid's matrix that the operator has taken
    """

    def __init__(self, solid: Solid, symmetric: bool, single: bool) -> None:
        from dolfinx import la

        self.solid, self._symmetric, self._single = solid, symmetric, symmetric and single
        self._starts, self._columns = solid.sparsity.upper
        self._blocks: Singles = np.empty(0, dtype=np.float32)
        self._sums = la.vector(solid.V.dofmap.index_map, 4, np.float32)
        if solid.comm.size > 1:
            self._shared = SharedSums(solid.V.dofmap.index_map, solid.comm, 4)
        self.version = 0
        self.hold(np.empty(0, dtype=np.int32))

    def matrix(self) -> Any:
        """The tangent on the free dofs, the unit matrix on the others, as a matrix of PETSc."""
        from petsc4py import PETSc

        sizes = 3 * self.solid.owned, self.solid.dofs
        return PETSc.Mat().createPython((sizes, sizes), self, comm=self.solid.comm)

    def hold(self, rows: npt.NDArray[np.int32]) -> None:
        """Make all dofs free except for these owned ones; collective."""
        self.free = np.ones(3 * self.solid.owned)
        self.free[rows] = 0.0
        self.kept = self.solid.scatter_forward(self.free)

    def update(self) -> None:
        """Take the current matrix of the solid, unless it has been taken."""
        if self.version != self.solid.tangent.version:
            self._blocks = self.solid.tangent.half()
            self.version = self.solid.tangent.version

    def diagonal(self) -> Floats:
        """Diagonal at the owned dofs (3 owned,); collective."""
        first = 9 * self._starts[:-1].astype(np.int64)
        parts = self._blocks[first[:, None] + np.array([0, 4, 8])].astype(float)
        return self.solid.scatter_reverse(parts).ravel()

    def project(self, parents: Integers, coarse: SparsityPattern, corners: Floats, values: Floats) -> None:
        """Write the `values` of Galerkin's coarse matrix of the free dofs, of this rank's part.

        Each node is the mean of its `parents` (nodes, 2), a corner the same twice; `corners` is 1 at the free dofs of
        the coarse matrix (corners, 3).
        """
        graph, matrix = (self._starts, self._columns), cast("Floats | Singles", self._blocks)
        if not self._symmetric:
            fine, matrix = self.solid.sparsity, self.solid.tangent.values()
            graph = fine.indptr, fine.indices
        _solver.galerkin(*graph, matrix, self.kept, parents, coarse.indptr, coarse.indices, corners, values)

    def single_product(self, x: Singles, ghosts: bool = True) -> Singles:
        """The tangent by its upper half times dof values, both `padded`; collective.

        The next call overwrites the result, which is that of the owned nodes alone without `ghosts`.
        """
        from dolfinx import la

        image: Singles = self._sums.array
        _solver.symmetric_product(self._starts, self._columns, self._blocks, x.reshape(-1, 4), image.reshape(-1, 4))
        if self.solid.comm.size > 1:
            if ghosts:
                self._shared.add(image.reshape(-1, 4))
            else:
                self._sums.scatter_reverse(la.InsertMode.add)
        return image

    def padded(self, owned: Floats) -> Singles:
        """Values of all local dofs in single precision from those of the owned ones (3 owned,); collective.

        A node has three and a zero (4 nodes,), a vector of the processor.
        """
        out = np.zeros((self.solid.nodes, 4), dtype=np.float32)
        out[:, :3] = self.solid.ghosts.scatter_forward(owned.astype(np.float32).reshape(-1, 3))
        return out.reshape(-1)

    def unpadded(self, values: Singles) -> Floats:
        """Values of the owned dofs (3 owned,) in double precision from padded ones."""
        return values.reshape(-1, 4)[: self.solid.owned, :3].astype(np.float64).reshape(-1)

    def product(self, x: Floats) -> Floats:
        """Tangent times owned dof values (3 owned,), in the precision that PETSc uses; collective."""
        if self._single:
            return self.unpadded(self.single_product(self.padded(x), ghosts=False))
        return tangent_product(self.solid, x)

    def mult(self, A: Any, x: Any, y: Any) -> None:
        """y = A x; called by PETSc."""
        free, x = self.free > 0.0, x.array_r
        y.array = np.where(free, self.product(np.where(free, x, 0.0)), x)  # x is infinite where it was not found
