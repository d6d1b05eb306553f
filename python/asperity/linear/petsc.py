"""PETSc: the assembled tangent, the sum of the parts of all ranks, its rigid-body modes; defaults of options."""

from __future__ import annotations

import gc
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np

from asperity.arrays import Floats
from asperity.errors import ConvergenceError
from asperity.fem.sparsity import SparsityPattern
from asperity.runtime.usage import free_share

OUT_OF_MEMORY = 55  # PETSC_ERR_MEM
GAMG = {
    "pc_gamg_coarse_eq_limit": 1000,
    "pc_gamg_esteig_ksp_type": "cg",
    "pc_gamg_esteig_ksp_max_it": 10,
    "mg_levels_ksp_type": "chebyshev",
    "mg_levels_pc_type": "jacobi",
}
#: Memory beyond the estimate of MUMPS, in per cent: on several ranks the need depends on the speed of each.
WORKSPACE = 100
MOST_MEMORY = 23  # control parameter of MUMPS: what a rank may take [MB]
TOO_LITTLE = -19  # error of MUMPS: that is too little


class NodeMatrix:
    """PETSc matrix `A`, the sum of the parts of the ranks, which are local CSR matrices of one pattern."""

    def __init__(self, sparsity: SparsityPattern, index_map: Any, comm: Any) -> None:
        from petsc4py import PETSc

        self._sparsity, self._comm = sparsity, comm
        if comm.size > 1:
            self.A = empty_matrix(index_map, 3, comm)
            return
        self._values = np.zeros(sparsity.size)
        csr, size = (sparsity.rows, sparsity.columns, self._values), len(sparsity.rows) - 1
        self.A = PETSc.Mat().createAIJWithArrays((size, size), csr, bsize=3, comm=comm)
        self.A.setBlockSize(3)  # without which algebraic multigrid would aggregate dofs instead of nodes

    def assemble(self, values: Floats) -> None:
        """Assemble the matrix from the values of this rank's part, in the order of `sparsity.columns`; collective."""
        from petsc4py import PETSc

        if self._comm.size > 1:
            self.A.zeroEntries()
            self.A.setValuesLocalCSR(self._sparsity.rows, self._sparsity.columns, values, PETSc.InsertMode.ADD)
        else:
            np.copyto(self._values, values)
        self.A.assemble()


def empty_matrix(index_map: Any, width: int, comm: Any) -> Any:
    """PETSc matrix of the nodes of an index map with some dofs each, to be filled by local numbers; collective."""
    from petsc4py import PETSc

    sizes = width * index_map.size_local, width * index_map.size_global
    A = PETSc.Mat().create(comm)
    A.setSizes((sizes, sizes), bsize=width)
    A.setType("aij")
    A.setUp()
    nodes = np.arange(index_map.size_local + index_map.num_ghosts, dtype=np.int32)
    numbers = index_map.local_to_global(nodes).astype(PETSc.IntType)
    lgmap = PETSc.LGMap().create(numbers, bsize=width, comm=comm)
    A.setLGMap(lgmap, lgmap)
    return A


def set_rigid_modes(A: Any, points: Floats) -> None:
    """Set the near-null space that multigrid needs: the rigid-body modes of the nodes `points` (n, 3), ghosts last."""
    from petsc4py import PETSc

    places = A.createVecRight()
    places.array = points.ravel()[: places.getLocalSize()]
    A.setNearNullSpace(PETSc.NullSpace().createRigidBody(places))


def set_defaults(prefix: str, options: dict[str, Any]) -> None:
    """Put options in PETSc's database where the user has not set them.

    They stay there: PETSc reads those of multigrid levels only when the levels are built. Those of a solver that never
    comes to its levels, because its run has ended before, count as read, or PETSc would warn of a spelling mistake.
    """
    from petsc4py import PETSc

    database = PETSc.Options(prefix)
    for key, value in options.items():
        if not database.hasName(key):
            database[key] = value
            database.hasName(key)


def factorise(ksp: Any, symmetric: bool) -> None:
    """Let a KSP, which has its matrix, factorise it by MUMPS, unless options of the user say otherwise; collective.

    MUMPS takes no more than an equal share of the free memory for each rank: a system would end a job that takes more.
    """
    pc, comm = ksp.getPC(), ksp.getComm().tompi4py()
    ksp.setType("preonly")
    pc.setType("cholesky" if symmetric else "lu")
    pc.setFactorSolverType("mumps")
    set_defaults(ksp.getOptionsPrefix(), {"mat_mumps_icntl_14": WORKSPACE})
    ksp.setFromOptions()
    if pc.getType() in ("cholesky", "lu") and pc.getFactorSolverType() == "mumps":
        pc.setFactorSetUpSolverType()
        share = free_share(comm)
        if np.isfinite(share):
            pc.getFactorMatrix().setMumpsIcntl(MOST_MEMORY, max(min(int(share / 1e6), 2**31 - 1), 1))


def memory_lacking(ksp: Any) -> float:
    """Memory that a factorisation takes on all ranks where it failed for want of it, else 0 [bytes]."""
    from petsc4py import PETSc

    pc = ksp.getPC()
    if pc.getType() not in ("cholesky", "lu") or pc.getFactorSolverType() != "mumps":
        return 0.0
    factor, failed = pc.getFactorMatrix(), pc.getFailedReason()
    lacks = failed == PETSc.PC.FailedReason.FACTOR_OUTMEMORY or factor.getMumpsInfog(1) == TOO_LITTLE
    return 1e6 * float(factor.getMumpsInfog(17)) if failed and lacks else 0.0


def destroy_unused(comm: Any) -> None:
    """Destroy the PETSc objects of a communicator to which nothing refers any more; collective.

    On several ranks PETSc only puts them aside, since a garbage collector may release them in another order on each.
    An object that another one holds is released with that, so the second pass takes those of the first. On one rank
    each is destroyed with its last reference.
    """
    from petsc4py import PETSc

    if comm.size == 1:
        return
    for _ in range(2):
        gc.collect()
        PETSc.garbage_cleanup(comm)


class LinearFailure(ConvergenceError):
    """PETSc or a library below it gave up a linear system; its solver cannot be used again."""


@contextmanager
def own_errors() -> Iterator[None]:
    """Raise the errors of call-backs, MemoryError where PETSc lacks memory, else LinearFailure, for those of PETSc."""
    from petsc4py import PETSc

    try:
        yield
    except PETSc.Error as error:
        cause: BaseException = error
        while isinstance(cause, PETSc.Error) and cause.__cause__ is not None:  # of a solve within a call-back
            cause = cause.__cause__
        if not isinstance(cause, PETSc.Error):
            raise cause from None
        if cause.ierr == OUT_OF_MEMORY:
            raise MemoryError(str(cause)) from None
        said = " ".join(str(PETSc.Error(cause.ierr)).split())
        raise LinearFailure(f"the linear solver gave up, PETSc's {said}") from cause
