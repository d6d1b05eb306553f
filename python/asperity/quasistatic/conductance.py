"""Constriction conductance of the contact over the conductivity: Laplace's equation in the block."""

from __future__ import annotations

from math import nan
from typing import Any

import numpy as np

from asperity.arrays import Integers
from asperity.fem.kernels import ElementKernels
from asperity.fem.solid import Solid
from asperity.linear.petsc import GAMG, empty_matrix, own_errors, set_defaults
from asperity.model.material import Material
from asperity.runtime import compat

PREFIX = "asperity_conductance_"
RTOL = 1e-5  # of the potential in the energy norm; its square is the error of the conductance


class Conductance:
    """Conductance of the block from given nodes to the base; collective.

    The potential is 1 at these nodes and 0 on the base; nothing flows through the sides and the rest of the top. The
    undeformed mesh conducts.
    """

    def __init__(self, solid: Solid) -> None:
        from petsc4py import PETSc

        sparsity, cells = solid.sparsity, solid.cell_nodes
        x_nodes = compat.geometry_dofmap(solid.mesh)[: len(cells)]
        # the trace of each 3 x 3 block of an elastic solid is lambda + 4 mu times the Laplacian: 2 with E = 1, nu = 0
        elastic = ElementKernels(solid.mesh.geometry.x, x_nodes, cells, Material(1.0, 0.0), sparsity)
        values = np.zeros(sparsity.size)
        elastic.elastic_tangent(np.zeros((solid.nodes, 3)), values)
        laplacian = 0.5 * values[sparsity.diagonals(np.arange(len(sparsity.indices)))].sum(axis=1)
        self._A = A = empty_matrix(solid.V.dofmap.index_map, 1, solid.comm)
        A.setValuesLocalCSR(sparsity.indptr, sparsity.indices, laplacian, PETSc.InsertMode.ADD)
        A.assemble()
        self._base, self._ksp = solid.base, PETSc.KSP().create(solid.comm)
        self._ksp.setOptionsPrefix(PREFIX)
        self._ksp.setType("cg")
        self._ksp.setNormType(PETSc.KSP.NormType.NATURAL)
        self._ksp.setTolerances(rtol=RTOL, max_it=1000)
        self._ksp.getPC().setType("gamg")
        set_defaults(PREFIX, GAMG)
        self._ksp.setFromOptions()

    def between(self, nodes: Integers) -> float:
        """Conductance of the owned `nodes` on all ranks to the base [L]; NaN where the solver fails."""
        A: Any = self._A
        potential, right = A.createVecs()
        potential.array[nodes] = 1.0
        A.mult(potential, right)
        right.scale(-1.0)
        matrix, y, rows = A.duplicate(copy=True), potential.duplicate(), np.union1d(self._base, nodes)
        right.array[rows] = 0.0
        matrix.zeroRowsColumns((rows + A.getOwnershipRange()[0]).astype(np.int32), diag=1.0)
        self._ksp.setOperators(matrix)
        with own_errors():
            self._ksp.solve(right, y)
        if self._ksp.getConvergedReason() < 0:
            return nan
        potential.axpy(1.0, y)
        A.mult(potential, right)
        return float(potential.dot(right))
