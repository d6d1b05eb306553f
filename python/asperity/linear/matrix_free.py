# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

"""Tangent operator of a solid: products without assembling the matrix; each rank has its part."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from asperity import _solver
from asperity.arrays import Floats, Singles
from asperity.fem.shared_nodes import SharedNodes

if TYPE_CHECKING:
    from asperity.fem.solid import Solid


def tangent_product(solid: Solid, x: Floats) -> Floats:
    """Tangent of a solid times owned dof values (3 owned,), in double precision; collective."""
    sparsity, image = solid.sparsity, np.empty((solid.nodes, 3))
    _solver.product(sparsity.indptr, sparsity.indices, solid.values, solid.scatter_forward(x), image)
    return solid.scatter_reverse(image).ravel()


class TangentOperator:
    """Products with the tangent of a solid; a python context of PETSc for the matrix of the free dofs.

    A product takes as long as reading the matrix, and neither a preconditioner nor a Newton step needs many digits. So
    the operator keeps a copy of the upper half in single precision (benchmarks/linear.py).

    Args:
        solid: owner of the tangent
        symmetric: whether the tangent is symmetric; the copy treats any tangent as if it were
        single: whether PETSc uses the copy of a symmetric tangent, sufficient for tolerances above 1e-5

    Attributes:
        kept: 1 at the free dofs, 0 at the others, ghosts included (nodes, 3)
        free: the same at the owned dofs (3 owned,)
        version: that of the solid's values in the copy
    """

    def __init__(self, solid: Solid, symmetric: bool, single: bool) -> None:
        self.solid, self._single = solid, symmetric and single
        indptr, indices = solid.sparsity.indptr, solid.sparsity.indices
        upper = indices >= np.repeat(np.arange(solid.nodes), np.diff(indptr))
        self._starts = np.concatenate([[0], np.cumsum(upper)])[indptr].astype(np.int32)
        self._columns = indices[upper]
        self._blocks = np.zeros(9 * len(self._columns) + 1, dtype=np.float32)  # one more is read with the last
        self._work = np.empty((2, solid.nodes, 4), dtype=np.float32)
        self._shared = SharedNodes(solid.V.dofmap.index_map)
        self._image = np.empty((solid.nodes, 3))
        self._single_image = np.empty((solid.nodes, 3), dtype=np.float32)
        self.version = 0
        self.hold(np.empty(0, dtype=np.int32))

    def matrix(self) -> Any:
        """The tangent on the free dofs, zero elsewhere, as a matrix of PETSc."""
        from petsc4py import PETSc

        sizes = 3 * self.solid.owned, self.solid.dofs
        return PETSc.Mat().createPython((sizes, sizes), self, comm=self.solid.comm)

    def hold(self, rows: npt.NDArray[np.int32]) -> None:
        """Make all dofs free except for these owned ones; collective."""
        self.free = np.ones(3 * self.solid.owned)
        self.free[rows] = 0.0
        self.kept = self.solid.scatter_forward(self.free)

    def update(self) -> None:
        """Copy the current values of the solid's tangent, unless they are those of the copy."""
        if self.version != self.solid.version:
            sparsity = self.solid.sparsity
            _solver.upper_half(sparsity.indptr, sparsity.indices, self.solid.values, self._blocks)
            self.version = self.solid.version

    def single_product(self, x: Singles) -> Singles:
        """Copy of the tangent times dof values of all local nodes, ghosts included (3 nodes,); collective.

        The next call overwrites the result.
        """
        values = x.reshape(-1, 3)
        _solver.symmetric_product(self._starts, self._columns, self._blocks, values, self._work, self._single_image)
        return self._shared.sum(self._single_image).reshape(-1)

    def product(self, x: Floats) -> Floats:
        """Tangent times owned dof values (3 owned,), in the precision that PETSc uses; collective."""
        if self._single:
            values = self.solid.ghosts.scatter_forward(x.astype(np.float32).reshape(-1, 3))
            return self.single_product(values)[: len(x)].astype(np.float64)
        sparsity, ghosts = self.solid.sparsity, self.solid.ghosts
        _solver.product(
            sparsity.indptr, sparsity.indices, self.solid.values, ghosts.scatter_forward(x.reshape(-1, 3)), self._image
        )
        return ghosts.scatter_reverse(self._image).reshape(-1)

    def mult(self, A: Any, x: Any, y: Any) -> None:
        """y = A x; called by PETSc."""
        y.array = self.free * self.product(self.free * x.array_r)
