"""Coarse problem of the p-multigrid: factorised by substructures, or by algebraic multigrid.

Substructures serve while the corners that ranks share are few: a solution takes one sum over the ranks, where algebraic
multigrid consists of many small steps, each with a message (benchmarks/linear.py coarse). The corners that are shared
are a dense matrix, which each rank has and factorises.
"""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np

from asperity.arrays import Floats, Singles
from asperity.errors import AsperityWarning, warn
from asperity.fem.ghosts import Ghosts
from asperity.fem.sparsity import SparsityPattern
from asperity.linear.petsc import GAMG, NodeMatrix, factorise, set_defaults, set_rigid_modes
from asperity.linear.substructures import Substructures, interface_of
from asperity.runtime.compiled import solver as _solver

DIRECT_LIMIT = 450_000  # coarse dofs up to which they are factorised
GENERAL_LIMIT = 60_000  # the same where the matrix is not symmetric
DENSE = 300.0  # square of the interface over the coarse dofs of a rank, up to which it costs less than multigrid
SWEEPS = 4  # of algebraic multigrid: a tenth fewer iterations on the fine level than with two
PREFIX = "asperity_coarse_"
WITHOUT = (
    "there is no CHOLMOD 5.1 or newer (SuiteSparse 7.4), here or where asperity was built: MUMPS factorises the "
    "coarse problem, in more time and memory; the results are the same"
)


def make_coarse(dofmap: Any, points: Floats, comm: Any, symmetric: bool) -> Distributed | Substructures:
    """Coarse problem on the corners of the cells; a solver of PETSc where the user has set its type; collective.

    Args:
        dofmap: of first-order displacements
        points: coordinates of the corners, ghosts last (corners, 3)
    """
    from petsc4py import PETSc

    dofs = 3 * dofmap.index_map.size_global
    if not symmetric or dofs > DIRECT_LIMIT or PETSc.Options(PREFIX).hasName("pc_type"):
        return Distributed(dofmap, points, comm, symmetric, factorised=not symmetric and dofs <= GENERAL_LIMIT)
    if not hasattr(_solver, "Cholesky"):
        if comm.rank == 0:
            warn(WITHOUT, AsperityWarning)
        return Distributed(dofmap, points, comm, symmetric, factorised=True)
    interface = interface_of(dofmap.index_map, comm)
    if interface.dofs**2 <= DENSE * dofs / comm.size:
        return Substructures(dofmap, comm, interface)
    return Distributed(dofmap, points, comm, symmetric, factorised=False)


class Distributed:
    """The ranks share the matrix; algebraic multigrid, or a factorisation. `Substructures` has the same methods.

    Attributes:
        sparsity: of this rank's part of the matrix, on its corners, ghosts included
        values: of this rank's part; the matrix is the sum of the parts
        factorisation: makes the same problem factorised by MUMPS; None where it is, or where the user has chosen
    """

    def __init__(self, dofmap: Any, points: Floats, comm: Any, symmetric: bool, factorised: bool) -> None:
        from petsc4py import PETSc

        index_map = dofmap.index_map
        self.factorisation = None
        if not (factorised or PETSc.Options(PREFIX).hasName("pc_type")):
            self.factorisation = partial(Distributed, dofmap, points, comm, symmetric, factorised=True)
        self._matrix = NodeMatrix(SparsityPattern(dofmap.list, len(points)), index_map, comm)
        self.sparsity = self._matrix.sparsity
        self.values: Floats = self._matrix.values
        set_rigid_modes(self._matrix.A, points)
        self._matrix.A.setOption(PETSc.Mat.Option.SPD, symmetric)
        self._ghosts = Ghosts(index_map)
        self._x, self._b = self._matrix.A.createVecs()
        self._ksp = PETSc.KSP().create(comm)
        self._ksp.setOptionsPrefix(PREFIX)
        self._ksp.setOperators(self._matrix.A)
        if factorised:
            factorise(self._ksp, symmetric)
            return
        self._ksp.setType("preonly")
        self._ksp.getPC().setType("gamg")
        set_defaults(PREFIX, GAMG | {"mg_levels_ksp_max_it": SWEEPS})
        self._ksp.setFromOptions()

    def update(self) -> bool:
        """Take up the current `values`; whether it can be solved, the same on all ranks; collective."""
        self._matrix.assemble()
        self._ksp.setOperators(self._matrix.A)
        self._ksp.setUp()
        return not self._ksp.getPC().getFailedReason()

    def solve(self, right: Singles) -> Singles:
        """Solution at the corners of this rank (3 corners,), ghosts included; `right` is its part; collective."""
        self._b.array = self._ghosts.scatter_reverse(right.reshape(-1, 3)).ravel()
        self._ksp.solve(self._b, self._x)
        return self._ghosts.scatter_forward(self._x.array_r.astype(np.float32).reshape(-1, 3)).ravel()
