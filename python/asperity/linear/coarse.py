"""Coarse problem of the p-multigrid: factorised by substructures, or by algebraic multigrid.

Substructures serve while the corners that ranks share, the interface, are few: each rank eliminates its interior, and a
small dense system is left, which each rank has and factorises. A solution takes one sum over the ranks, where algebraic
multigrid consists of many small steps, each with a message. On one rank there is no interface, and the factors are
those of the whole matrix (Przemieniecki, AIAA J. 1 (1963) 138). Beside algebraic multigrid they save 10 to 35 % of the
CPU time of a run on one and two ranks, beside CHOLMOD through PETSc 5 to 25 % on one (benchmarks/linear.py coarse).

A rank's factors L L^T are those of its whole part, the interface last. L y = b leaves there what, times the last block
of L, is the right side of the interface; L^T x = y goes on from its solution times the transpose of that block.
"""

from __future__ import annotations

from functools import partial
from typing import Any, NamedTuple

import numpy as np

from asperity.arrays import Floats, Indices, Singles
from asperity.fem.ghosts import Ghosts
from asperity.fem.sparsity import SparsityPattern
from asperity.linear.petsc import GAMG, NodeMatrix, factorise, set_defaults, set_rigid_modes
from asperity.runtime import compat
from asperity.runtime.compiled import solver as _solver

DIRECT_LIMIT = 450_000  # coarse dofs up to which they are factorised
GENERAL_LIMIT = 60_000  # the same where the matrix is not symmetric
DENSE = 300.0  # square of the interface over the coarse dofs of a rank, up to which it costs less than multigrid
PREFIX = "asperity_coarse_"


def make_coarse(dofmap: Any, points: Floats, comm: Any, symmetric: bool) -> Distributed | Substructures:
    """Coarse problem on the corners of the cells; a solver of PETSc where the user has set its type; collective.

    Args:
        dofmap: of first-order displacements
        points: coordinates of the corners, ghosts last (corners, 3)
    """
    from petsc4py import PETSc

    dofs = 3 * dofmap.index_map.size_global
    chosen = PETSc.Options(PREFIX).hasName("pc_type")
    # a build without single precision in CHOLMOD has no such factors
    if symmetric and dofs <= DIRECT_LIMIT and not chosen and hasattr(_solver, "Cholesky"):
        interface = interface_of(dofmap.index_map, comm)
        if interface.dofs**2 <= DENSE * dofs / comm.size:
            return Substructures(dofmap, comm, interface)
    return Distributed(dofmap, points, comm, symmetric, factorised=not symmetric and dofs <= GENERAL_LIMIT)


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
        # four sweeps save a tenth of the iterations on the fine level
        set_defaults(PREFIX, GAMG | {"mg_levels_ksp_max_it": 4})
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


class Interface(NamedTuple):
    """Corners that several ranks hold."""

    nodes: Indices  # those of this rank (n,)
    at: Indices  # place of each dof of theirs among those of all ranks (3n,)
    dofs: int  # number of these


def interface_of(index_map: Any, comm: Any) -> Interface:
    """Interface between the ranks that share the corners of an index map; collective."""
    if comm.size == 1:
        return Interface(np.empty(0, dtype=np.int64), np.empty(0, dtype=np.int64), 0)
    owned, links = index_map.size_local, compat.ghost_holders(index_map)
    shared = np.flatnonzero(np.diff(links.offsets[: owned + 1])), owned + np.arange(index_map.num_ghosts)
    nodes: Indices = np.concatenate(shared)
    numbers = index_map.local_to_global(nodes.astype(np.int32))
    nodes, numbers = nodes[np.argsort(numbers)], np.sort(numbers)
    everywhere = np.unique(np.concatenate(comm.allgather(numbers)))
    at = (3 * np.searchsorted(everywhere, numbers)[:, None] + np.arange(3)).ravel()
    return Interface(nodes, at, 3 * len(everywhere))


class Substructures:
    """Symmetric and positive definite, in single precision; the methods are those of `Distributed`."""

    factorisation = None

    def __init__(self, dofmap: Any, comm: Any, interface: Interface) -> None:
        index_map, self._comm = dofmap.index_map, comm
        corners = index_map.size_local + index_map.num_ghosts
        self.sparsity = SparsityPattern(dofmap.list, corners)
        self.values: Floats = np.zeros(self.sparsity.size)
        self._ghosts = Ghosts(index_map)
        self._nodes, self._at, dofs = interface
        self._factors = _solver.Cholesky(self.sparsity.indptr, self.sparsity.indices, self._nodes.astype(np.int32))
        self._schur = np.zeros((dofs, dofs), dtype=np.float32)
        self._left = np.zeros(dofs, dtype=np.float32)
        self._work = np.empty(3 * corners, dtype=np.float32)

    def update(self) -> bool:
        from mpi4py import MPI
        from scipy.linalg.lapack import spotrf

        if self._comm.size == 1:
            return bool(self._factors.factorise(self.values, np.empty(0, dtype=np.float32)))
        # the diagonal of the whole matrix, without which the part of one rank may be singular at the interface
        parts = self.values[self.sparsity.diagonal].reshape(-1, 3)
        whole = self._ghosts.scatter_forward(self._ghosts.scatter_reverse(parts).copy())
        shift = whole[self._nodes].ravel().astype(np.float32)
        done = self._factors.factorise(self.values, shift)
        if not self._comm.allreduce(bool(done), MPI.LAND):
            return False
        lower = np.zeros((len(self._at), len(self._at)), dtype=np.float32)
        self._factors.interface_factors(lower)
        self._upper = lower.T  # as LAPACK stores it, by columns
        part = lower @ lower.T
        part[np.diag_indices_from(part)] -= shift
        schur = np.zeros_like(self._schur)
        schur[np.ix_(self._at, self._at)] = part
        self._comm.Allreduce(MPI.IN_PLACE, schur)
        self._schur, failed = spotrf(schur.T, lower=True, overwrite_a=True)
        return failed == 0

    def solve(self, right: Singles) -> Singles:
        from mpi4py import MPI

        self._factors.forward(right, self._work)
        x = np.empty_like(self._work)
        if not len(self._left):
            self._factors.backward(self._work, x)
            return x
        from scipy.linalg.blas import strmv
        from scipy.linalg.lapack import spotrs

        tail = self._work[len(self._work) - len(self._at) :]
        self._left[:] = 0.0
        if len(tail):  # what is left of the right side there
            self._left[self._at] = strmv(self._upper, tail, trans=1)
        self._comm.Allreduce(MPI.IN_PLACE, self._left)
        shared = spotrs(self._schur, self._left, lower=True)[0][self._at]
        if len(tail):
            tail[:] = strmv(self._upper, shared)
        self._factors.backward(self._work, x)
        x.reshape(-1, 3)[self._nodes] = shared.reshape(-1, 3)  # the same bits on each rank
        return x
