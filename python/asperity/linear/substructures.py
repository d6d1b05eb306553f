"""Coarse problem factorised by substructures: each rank eliminates its interior, and the interface is left.

The interface, the corners that several ranks hold, is a small dense system, which every rank factorises. On one rank
there is none, and the factors are those of the whole matrix (Przemieniecki, AIAA J. 1 (1963) 138).

A rank's factors L L^T are those of its whole part, the interface last. L y = b leaves there what, times the last block
of L, is the right side of the interface; L^T x = y goes on from its solution times the transpose of that block.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from asperity.arrays import Floats, Indices, Singles
from asperity.fem.ghosts import Ghosts
from asperity.fem.sparsity import SparsityPattern
from asperity.runtime import compat
from asperity.runtime.compiled import solver as _solver


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
    """See `coarse.Distributed`: symmetric and positive definite, in single precision."""

    def __init__(self, dofmap: Any, comm: Any, interface: Interface) -> None:
        index_map, self._comm = dofmap.index_map, comm
        corners = index_map.size_local + index_map.num_ghosts
        self.sparsity = SparsityPattern(dofmap.list, corners)
        self.values: Floats = np.zeros(self.sparsity.size)
        self._ghosts, self._owned = Ghosts(index_map), index_map.size_local
        self._nodes, self._at, dofs = interface
        self._factors = _solver.Cholesky(self.sparsity.indptr, self.sparsity.indices, self._nodes.astype(np.int32))
        self._schur = np.zeros((dofs, dofs), dtype=np.float32)
        self._left = np.zeros(dofs, dtype=np.float32)
        self._work = np.empty(3 * corners, dtype=np.float32)

    def update(self) -> bool:
        """See `Distributed`; so for `solve`."""
        from mpi4py import MPI
        from scipy.linalg.lapack import spotrf

        shift = self._diagonal()
        done = self._factors.factorise(self.values, shift)
        if self._comm.size == 1:
            return bool(done)
        if not self._comm.allreduce(bool(done), MPI.LAND):
            return False
        lower = np.zeros((len(self._at), len(self._at)), dtype=np.float32)
        self._factors.interface_factors(lower)
        self._upper = lower.T  # as LAPACK stores it, by columns
        part = lower @ lower.T
        part[np.diag_indices_from(part)] -= shift
        whole = np.zeros_like(self._schur)
        whole[np.ix_(self._at, self._at)] = part
        self._comm.Allreduce(MPI.IN_PLACE, whole)
        self._schur, failed = spotrf(whole.T, lower=True, overwrite_a=True)
        return failed == 0

    def _diagonal(self) -> Singles:
        """Diagonal of the whole matrix at this rank's part of the interface; collective."""
        if self._comm.size == 1:
            return np.empty(0, dtype=np.float32)
        parts = self.values[self.sparsity.diagonal].reshape(-1, 3)
        whole = self._ghosts.scatter_forward(self._ghosts.scatter_reverse(parts).copy())
        return whole[self._nodes].ravel().astype(np.float32)

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
