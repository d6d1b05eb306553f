"""Electric or thermal conductance of the contact at a converged state: Laplace's equation on the mesh of the solid."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from asperity.fem.solid import Solid
from asperity.fem.weak_form import nodal_matrix
from asperity.linear.petsc import GAMG, empty_matrix, set_defaults
from asperity.mesh.element import QUADRATURE_DEGREE
from asperity.quasistatic.stiffness import without_block

if TYPE_CHECKING:
    from asperity.quasistatic.contact_solver import ContactSolver

PREFIX = "asperity_conductance_"
RTOL = 1e-5  # of the potential in the energy norm; its square is the error of the conductance


class Conductance:
    """Constriction conductance over the conductivity [L]: a probe of accepted steps; collective.

    The potential is 1 at the nodes in contact and 0 on the base; nothing flows through the sides and the rest of the
    top. The resistance h_b/A of the block is subtracted. The undeformed mesh conducts.
    """

    def __init__(self, solid: Solid) -> None:
        import ufl
        from petsc4py import PETSc

        degree = QUADRATURE_DEGREE
        local = nodal_matrix(solid.V, solid.sparsity, lambda u, v: ufl.inner(ufl.grad(u), ufl.grad(v)), degree)
        self._A = A = empty_matrix(solid.V.dofmap.index_map, 1, solid.comm)
        indptr, indices = (part.astype(PETSc.IntType) for part in (local.indptr, local.indices))
        A.setValuesLocalCSR(indptr, indices, local.data, PETSc.InsertMode.ADD)
        A.assemble()
        self._ksp = PETSc.KSP().create(solid.comm)
        self._ksp.setOptionsPrefix(PREFIX)
        self._ksp.setType("cg")
        self._ksp.setNormType(PETSc.KSP.NormType.NATURAL)
        self._ksp.setTolerances(rtol=RTOL, max_it=1000)
        self._ksp.getPC().setType("gamg")
        set_defaults(PREFIX, GAMG)
        self._ksp.setFromOptions()

    def __call__(self, solver: ContactSolver) -> dict[str, float]:
        """Conductance at the last solve; left out where the resistance of the block is all there is."""
        solid, A = solver.solid, self._A
        nodes = solver.contact.nodes()
        if not solid.comm.allreduce(len(nodes)):
            return {"conductance": 0.0}
        potential, right = A.createVecs()
        at_contact = np.zeros(solid.owned)
        at_contact[nodes] = 1.0
        potential.array = at_contact
        A.mult(potential, right)
        right.scale(-1.0)
        matrix, y = A.duplicate(copy=True), potential.duplicate()
        rows = np.union1d(solid.base, nodes) + A.getOwnershipRange()[0]
        right.array[rows - A.getOwnershipRange()[0]] = 0.0
        matrix.zeroRowsColumns(rows.astype(np.int32), diag=1.0)
        self._ksp.setOperators(matrix)
        self._ksp.solve(right, y)
        if self._ksp.getConvergedReason() < 0:
            return {}
        potential.axpy(1.0, y)
        A.mult(potential, right)
        whole = float(potential.dot(right))
        constriction = without_block(whole, 1.0 / solver.contact_surface.mean(solid.points[:, 2]))
        return {"conductance": constriction} if constriction == constriction else {}

    def drop_matrices(self) -> None:
        """Nothing is freed: a matrix with one unknown a node is small compared with that of the displacements."""
