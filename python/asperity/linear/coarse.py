"""Coarse problem of the p-multigrid: factorised by substructures, or by algebraic multigrid.

Substructures serve while the corners that ranks share, the interface, are few: each rank eliminates its interior, and a
small dense system is left, which each rank has and factorises. A solution takes one sum over the ranks, where algebraic
multigrid consists of many small steps, each with a message. On one rank there is no interface, and the factors are
those of the whole matrix (Przemieniecki, AIAA J. 1 (1963) 138). Beside algebraic multigrid they save 10 to 35 % of the
CPU time of a run on one and two ranks, beside CHOLMOD through PETSc 5 to 25 % on one (benchmarks/speed.py coarse).

A rank's factors L L^T are those of its whole part, the interface last. L y = b leaves there what, times the last block
of L, is the right side of the interface; L^T x = y goes on from its solution times the transpose of that block.
"""

from __future__ import annotations

from copy import copy
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
        factorisation: makes the same problem factorised by MUMPS; None where it is, or where the user has chosen
    """

    def __init__(self, dofmap: Any, points: Floats, comm: Any, symmetric: bool, factorised: bool) -> None:
        from petsc4py import PETSc

        index_map = dofmap.index_map
        self.factorisation = None
        if not (factorised or PETSc.Options(PREFIX).hasName("pc_type")):
            self.factorisation = partial(Distributed, dofmap, points, comm, symmetric, factorised=True)
        self.sparsity = SparsityPattern(dofmap.list, len(points))
        self._matrix = NodeMatrix(self.sparsity, index_map, comm)
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

    def update(self, values: Floats) -> bool:
        """Take up the values of this rank's part; whether the sum can be solved, the same on all ranks; collective."""
        self._matrix.assemble(values)
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


class Factors:
    """Factors L L^T of one rank's part of a symmetric matrix in single precision, the nodes of `last` eliminated last.

    `forward` and `backward` solve L y = b and L^T x = y; y is in the order of elimination.
    """

    def __init__(self, sparsity: SparsityPattern, last: Indices) -> None:
        from scipy import sparse

        indptr, indices = sparsity.indptr, sparsity.indices
        inner = np.setdiff1d(np.arange(len(indptr) - 1), last)
        graph = sparse.csr_array((np.ones(len(indices), dtype=np.int8), indices, indptr))[inner][:, inner]
        graph = sparse.tril(graph, format="csr")  # the rows of a lower half are the columns of the upper one
        order = np.empty(len(inner), dtype=np.int32)
        if len(inner):
            _solver.Cholesky.best_order(graph.indptr, graph.indices, order)
        nodes = np.concatenate([inner[order], last])
        self._order = (3 * nodes[:, None] + np.arange(3)).ravel().astype(np.int32)
        whole = copy(sparsity)  # with three dofs a node, which is not kept
        below = whole.columns <= np.repeat(np.arange(len(self._order)), np.diff(whole.rows))
        self._source = np.flatnonzero(below)
        starts = np.concatenate([[0], np.cumsum(below)])[whole.rows].astype(np.int32)
        self._shifted = starts[self._order[3 * len(inner) :] + 1] - 1  # the diagonal is the last of its column
        self._factors = _solver.Cholesky(starts, whole.columns[below], self._order)

    def factorise(self, values: Floats, shift: Singles) -> bool:
        """Of the sum of these values and a `shift` of the diagonal at the last nodes; whether it is definite."""
        with np.errstate(over="ignore"):
            upper = values[self._source].astype(np.float32)
        upper[self._shifted] += shift
        return bool(np.isfinite(upper).all()) and self._factors.factorise(upper)

    def last_block(self) -> Singles:
        """L at the last nodes: the factor of what is left of the matrix there, the shift included."""
        out = np.zeros((len(self._shifted), len(self._shifted)), dtype=np.float32)
        self._factors.last_block(out)
        return out

    def forward(self, right: Singles) -> Singles:
        y = right[self._order]
        self._factors.solve(y, transposed=False)
        return y

    def backward(self, y: Singles) -> Singles:
        """Overwrites y."""
        self._factors.solve(y, transposed=True)
        x = np.empty_like(y)
        x[self._order] = y
        return x


class Substructures:
    """Symmetric and positive definite, in single precision; the methods are those of `Distributed`."""

    factorisation = None

    def __init__(self, dofmap: Any, comm: Any, interface: Interface) -> None:
        index_map, self._comm = dofmap.index_map, comm
        corners = index_map.size_local + index_map.num_ghosts
        self.sparsity = SparsityPattern(dofmap.list, corners)
        self._ghosts = Ghosts(index_map)
        self._nodes, self._at, dofs = interface
        self._factors = Factors(self.sparsity, self._nodes)
        self._schur = np.zeros((dofs, dofs), dtype=np.float32)
        self._left = np.zeros(dofs, dtype=np.float32)

    def update(self, values: Floats) -> bool:
        from mpi4py import MPI
        from scipy.linalg.lapack import spotrf

        if self._comm.size == 1:
            return self._factors.factorise(values, np.empty(0, dtype=np.float32))
        # the diagonal of the whole matrix, without which the part of one rank may be singular at the interface
        parts = values[self.sparsity.diagonal].reshape(-1, 3)
        whole = self._ghosts.scatter_forward(self._ghosts.scatter_reverse(parts).copy())
        shift = whole[self._nodes].ravel().astype(np.float32)
        done = self._factors.factorise(values, shift)
        if not self._comm.allreduce(done, MPI.LAND):
            return False
        lower = self._factors.last_block()
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

        work = self._factors.forward(right)
        if not len(self._left):
            return self._factors.backward(work)
        from scipy.linalg.blas import strmv
        from scipy.linalg.lapack import spotrs

        tail = work[len(work) - len(self._at) :]
        self._left[:] = 0.0
        if len(tail):  # what is left of the right side there
            self._left[self._at] = strmv(self._upper, tail, trans=1)
        self._comm.Allreduce(MPI.IN_PLACE, self._left)
        shared = spotrs(self._schur, self._left, lower=True)[0][self._at]
        if len(tail):
            tail[:] = strmv(self._upper, shared)
        x = self._factors.backward(work)
        x.reshape(-1, 3)[self._nodes] = shared.reshape(-1, 3)  # the same bits on each rank
        return x
