# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

"""Coarse problem of the p-multigrid: factorised by every rank for itself, or shared by algebraic multigrid.

A factorisation that the ranks share costs more in messages than it saves in work while the coarse problem is small, and
algebraic multigrid consists of many small steps, each with a message. So up to `REPLICATED_LIMIT` each rank holds the
whole coarse matrix and its factors: a solution takes one sum over the ranks (benchmarks/linear.py coarse).
"""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np

from asperity.arrays import Floats, Integers, Singles
from asperity.fem.ghosts import Ghosts
from asperity.fem.sparsity import SparsityPattern
from asperity.linear.petsc_matrix import NodeMatrix, local_matrix, set_rigid_modes
from asperity.linear.petsc_options import GAMG, set_defaults

DIRECT_LIMIT = 60_000  # coarse dofs up to which one rank factorises
REPLICATED_LIMIT = 15_000  # the same where each of several ranks does
SWEEPS = 4  # of algebraic multigrid: a tenth fewer iterations on the fine level than with two
PREFIX = "asperity_coarse_"


class Coarse(Protocol):
    """Coarse problem, a part on each rank.

    Attributes:
        sparsity: of this rank's part of the matrix, on its corners, ghosts included
        values: of this rank's part; the matrix is the sum of the parts
        A: the matrix of PETSc, whole or distributed
    """

    sparsity: SparsityPattern
    values: Floats
    A: Any

    def update(self) -> None:
        """Take up the current `values`; collective."""

    def solve(self, right: Singles) -> Singles:
        """Solution at the corners of this rank (3 corners,), ghosts included; collective.

        Args:
            right: this rank's part of the right-hand side, which is the sum of the parts (3 corners,)
        """


def make_coarse(dofmap: Any, points: Floats, comm: Any, symmetric: bool) -> Coarse:
    """Coarse problem on the corners of the cells; collective.

    Args:
        dofmap: of first-order displacements
        points: coordinates of the corners, ghosts last (corners, 3)
        comm: of the ranks
        symmetric: whether the matrix is symmetric and positive definite
    """
    dofs = 3 * dofmap.index_map.size_global
    if dofs <= (DIRECT_LIMIT if comm.size == 1 else REPLICATED_LIMIT):
        return Replicated(dofmap, comm, symmetric)
    return Distributed(dofmap, points, comm, symmetric, factorised=not symmetric and dofs <= DIRECT_LIMIT)


class Replicated:
    """Each rank sums the parts of the matrix of all ranks and factorises it.

    Args:
        dofmap, comm, symmetric: see `make_coarse`
    """

    def __init__(self, dofmap: Any, comm: Any, symmetric: bool) -> None:
        from petsc4py import PETSc

        index_map, self._comm = dofmap.index_map, comm
        corners = index_map.size_local + index_map.num_ghosts
        self.sparsity = SparsityPattern(dofmap.list, corners)
        self.values: Floats = np.zeros(self.sparsity.size)
        self._whole, self._all = self.sparsity, self.values
        if comm.size > 1:
            numbers = index_map.local_to_global(np.arange(corners, dtype=np.int32)).astype(np.int32)
            cells = np.concatenate(comm.allgather(numbers[dofmap.list]))
            self._whole = SparsityPattern(cells, index_map.size_global)
            self._all = np.zeros(self._whole.size)
            self._dofs = (3 * numbers[:, None] + np.arange(3, dtype=np.int32)).ravel()
            self._place = self._places()
        self._sum = np.zeros(3 * index_map.size_global, dtype=np.float32)
        self.A = local_matrix(self._whole, self._all, PETSc.COMM_SELF)
        self.A.setOption(PETSc.Mat.Option.SPD, symmetric)
        self._x, self._b = self.A.createVecs()
        self._ksp = _direct(self.A, symmetric)

    def _places(self) -> Integers:
        """Place of each value of this rank among those of the whole matrix."""
        rows = np.repeat(self._dofs, np.diff(self.sparsity.rows)).astype(np.int64)
        size, whole = len(self._whole.rows) - 1, self._whole
        row_of = np.repeat(np.arange(size, dtype=np.int64), np.diff(whole.rows))
        keys = size * row_of + whole.columns
        return np.searchsorted(keys, size * rows + self._dofs[self.sparsity.columns]).astype(np.int64)

    def update(self) -> None:
        """See `Coarse`; so for `solve`."""
        from mpi4py import MPI

        if self._comm.size > 1:
            self._all[:] = 0.0
            self._all[self._place] = self.values
            self._comm.Allreduce(MPI.IN_PLACE, self._all)
        self.A.assemble()
        self._ksp.setOperators(self.A)
        self._ksp.setUp()

    def solve(self, right: Singles) -> Singles:
        from mpi4py import MPI

        if self._comm.size == 1:
            self._b.array = right
        else:
            self._sum[:] = 0.0
            self._sum[self._dofs] = right
            self._comm.Allreduce(MPI.IN_PLACE, self._sum)
            self._b.array = self._sum
        self._ksp.solve(self._b, self._x)
        found = self._x.array_r.astype(np.float32)
        return found if self._comm.size == 1 else found[self._dofs]


def _direct(A: Any, symmetric: bool) -> Any:
    """Factorisation of a matrix on one rank."""
    from petsc4py import PETSc

    ksp = PETSc.KSP().create(PETSc.COMM_SELF)
    ksp.setOptionsPrefix(PREFIX)
    ksp.setType("preonly")
    pc = ksp.getPC()
    pc.setType("cholesky" if symmetric else "lu")
    # faster than MUMPS (benchmarks/linear.py pieces)
    pc.setFactorSolverType("cholmod" if symmetric and PETSc.Sys.hasExternalPackage("cholmod") else "mumps")
    # tries nested dissection too, not only minimum degree: a third less time for the factors at 12,000 dofs
    set_defaults(PREFIX, {"mat_cholmod_nmethods": 3})
    ksp.setOperators(A)
    ksp.setFromOptions()
    return ksp


class Distributed:
    """The ranks share the matrix; algebraic multigrid, or a factorisation.

    Args:
        dofmap, points, comm, symmetric: see `make_coarse`
        factorised: whether to factorise
    """

    def __init__(self, dofmap: Any, points: Floats, comm: Any, symmetric: bool, factorised: bool) -> None:
        from petsc4py import PETSc

        index_map = dofmap.index_map
        self._matrix = NodeMatrix(SparsityPattern(dofmap.list, len(points)), index_map, comm)
        self.sparsity, self.A = self._matrix.sparsity, self._matrix.A
        self.values: Floats = self._matrix.values
        set_rigid_modes(self.A, points)
        self.A.setOption(PETSc.Mat.Option.SPD, symmetric)
        self._ghosts = Ghosts(index_map)
        self._x, self._b = self.A.createVecs()
        self._ksp = PETSc.KSP().create(comm)
        self._ksp.setOptionsPrefix(PREFIX)
        self._ksp.setType("preonly")
        pc = self._ksp.getPC()
        if factorised:
            pc.setType("lu")
            pc.setFactorSolverType("mumps")
        else:
            pc.setType("gamg")
            set_defaults(PREFIX, GAMG | {"mg_levels_ksp_max_it": SWEEPS})
        self._ksp.setFromOptions()

    def update(self) -> None:
        """See `Coarse`; so for `solve`."""
        self._matrix.assemble()
        self._ksp.setOperators(self.A)
        self._ksp.setUp()

    def solve(self, right: Singles) -> Singles:
        self._b.array = self._ghosts.scatter_reverse(right.reshape(-1, 3)).ravel()
        self._ksp.solve(self._b, self._x)
        return self._ghosts.scatter_forward(self._x.array_r.astype(np.float32).reshape(-1, 3)).ravel()
