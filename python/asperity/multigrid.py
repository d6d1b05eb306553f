"""Two-level p-multigrid: second-order displacements are smoothed, first-order ones solved on the cell corners.

The coarse space is an eighth of the size, so it can be factorised where the second-order problem of the same mesh
is far too large for that, and is set up in a fraction of the time of an algebraic hierarchy on the fine level.

Smoothing costs what reading the matrix costs, and a preconditioner needs few digits: the fine level works on a copy
of its upper half in single precision (benchmarks/linear.py).
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt
from scipy.linalg import eigh_tridiagonal

from . import _solver
from .node_matrix import NodeGraph, NodeMatrix, set_rigid_modes
from .petsc_options import GAMG, set_defaults

if TYPE_CHECKING:
    from .solid import Solid

Singles = npt.NDArray[np.float32]

EDGES = (
    (2, 3),
    (1, 3),
    (1, 2),
    (0, 3),
    (0, 2),
    (0, 1),
)  # corners of edge k of a cell, in the order of basix
COARSE_DIRECT_LIMIT = 60_000  # coarse dofs up to which the coarse problem is factorised

PREFIX = "asperity_coarse_"

SWEEPS = 2  # of the smoother, before and after the coarse correction
LANCZOS, UPDATE = 20, 4  # steps of an estimate of the greatest eigenvalue: from anew, and for the next matrix
NOISE = 0.1  # in the start of an update, relative to the vector the last one led to
SMOOTHED = (0.1, 1.1)  # part of the spectrum that is damped, in units of the estimate


class PMultigrid:
    """Preconditioner for the eliminated tangent of a solid, as a python context of PETSc; collective.

    A V-cycle with Chebyshev's iteration on the Jacobi-scaled matrix as smoother (Adams et al., J. Comput. Phys. 188
    (2003) 593). Eliminated dofs are masked, on the fine level and in the interpolation, so that the cycle never moves
    them; eliminated corners get a unit row in the coarse matrix.

    Args:
        solid: whose matrix is preconditioned
        symmetric: whether the matrix is; of another one the smoother takes the upper half for the whole
    """

    def __init__(self, solid: Solid, symmetric: bool = True) -> None:
        from dolfinx import fem
        from petsc4py import PETSc

        self._solid = solid
        coarse = fem.functionspace(solid.mesh, ("Lagrange", 1, (3,))).dofmap
        index_map = coarse.index_map
        corners = index_map.size_local + index_map.num_ghosts
        self._corners = np.empty(corners, dtype=np.int32)  # node at each corner, ghosts included
        self._corners[coarse.list] = solid.V.dofmap.list[:, :4]
        # of each node: the corner it is, twice, or the ends of its edge
        self._parents = np.empty((solid.nodes, 2), dtype=np.int32)
        for k, ends in enumerate([(k, k) for k in range(4)] + list(EDGES)):
            self._parents[solid.V.dofmap.list[:, k]] = coarse.list[:, ends]
        self._coarse = NodeMatrix(NodeGraph(coarse.list, corners), index_map, solid.comm)
        set_rigid_modes(self._coarse.A, solid.points[self._corners])
        self._diagonal = self._coarse.graph.diagonal()
        self._P = self._interpolation(index_map)
        self._mask = self._P.createVecLeft(), self._P.createVecRight()
        self._fine, self._rhs, self._correction = self._P.createVecLeft(), *(self._P.createVecRight() for _ in "ab")
        self._ksp = PETSc.KSP().create(solid.comm)
        self._ksp.setOptionsPrefix(PREFIX)
        self._coarse.A.setOption(PETSc.Mat.Option.SPD, symmetric)
        self._ksp.setType("preonly")
        pc = self._ksp.getPC()
        if 3 * index_map.size_global <= COARSE_DIRECT_LIMIT:
            pc.setType("cholesky" if symmetric else "lu")
            # CHOLMOD is faster (benchmarks/linear.py), but works in one process
            alone = symmetric and solid.comm.size == 1 and PETSc.Sys.hasExternalPackage("cholmod")
            pc.setFactorSolverType("cholmod" if alone else "mumps")
        else:
            pc.setType("gamg")
            set_defaults(PREFIX, GAMG)
        self._ksp.setFromOptions()
        indptr, indices = solid.graph.indptr, solid.graph.indices
        upper = indices >= np.repeat(np.arange(solid.nodes), np.diff(indptr))
        before = np.concatenate([[0], np.cumsum(upper)])
        self._upper = before[indptr].astype(np.int32), indices[upper]
        self._blocks = np.empty((len(self._upper[1]), 9), dtype=np.float32)
        self._vector = np.zeros((solid.nodes, 3), dtype=np.float32)
        self._image = np.zeros_like(self._vector)
        noise = np.random.default_rng(solid.comm.rank).normal(size=3 * solid.owned)
        self._noise = (NOISE * noise / np.sqrt(solid.dofs)).astype(np.float32)
        self._extreme, self._greatest = self._noise, 0.0

    def _interpolation(self, index_map: Any) -> Any:
        """Matrix from corner dofs to all dofs: a corner keeps its value, an edge takes the mean of its ends."""
        from petsc4py import PETSc
        from scipy import sparse

        solid = self._solid
        columns = index_map.local_to_global(self._parents.ravel())
        rows = np.repeat(np.arange(solid.nodes), 2)
        shape = (solid.nodes, index_map.size_global)
        local = sparse.coo_array((np.full(len(rows), 0.5), (rows, columns)), shape).tocsr()[: solid.owned]
        P = sparse.kron(local, sparse.eye_array(3), format="csr")
        sizes = (
            (3 * solid.owned, solid.dofs),
            (3 * index_map.size_local, 3 * index_map.size_global),
        )
        csr = (P.indptr.astype(PETSc.IntType), P.indices.astype(PETSc.IntType), P.data)
        out = PETSc.Mat().createAIJ(sizes, csr=csr, comm=solid.comm)
        out.setBlockSizes(3, 3)
        return out

    def update(self, A: Any, eliminated: npt.NDArray[np.int32]) -> bool:
        """Adapt to new values of the matrix and a new set of eliminated owned dofs; collective.

        Returns:
            whether the matrix can be smoothed; not so one with a diagonal that is not positive
        """
        from mpi4py import MPI

        solid, diagonal = self._solid, A.getDiagonal().array_r
        least = -solid.comm.allreduce(float(np.max(-diagonal, initial=-np.inf)), op=MPI.MAX)
        if not least > 0.0:
            return False
        fine = self._mask[0]
        fine.set(1.0)
        fine.array[eliminated] = 0.0
        self._kept = solid.with_ghosts(fine.array_r)
        self._galerkin()
        self._ksp.setOperators(self._coarse.A)
        self._ksp.setUp()
        _solver.upper_half(solid.graph.indptr, solid.graph.indices, solid.values, self._blocks)
        self._inverse = (1.0 / diagonal).astype(np.float32)
        self._free = fine.array_r.astype(np.float32)
        self._scaling = self._free * self._inverse
        if self._greatest > 0.0:
            self._greatest = max(self._greatest, self._greatest_eigenvalue(UPDATE))
        else:
            self.estimate()
        return True

    def _galerkin(self) -> None:
        """Coarse matrix of the free dofs, with a unit row for each held corner; collective."""
        fine, coarse, held = self._solid.graph, self._coarse, self._mask[1]
        corners = np.ascontiguousarray(self._kept[self._corners])
        held.array = corners.ravel()[: held.getLocalSize()]
        _solver.galerkin(
            fine.indptr, fine.indices, self._solid.values, self._kept, self._parents,
            coarse.graph.indptr, coarse.graph.indices, corners, coarse.values,
        )  # fmt: skip
        coarse.values[self._diagonal[np.flatnonzero(held.array_r == 0.0)]] = 1.0
        coarse.assemble()

    def forget(self) -> None:
        """Let the next `update` estimate the greatest eigenvalue from anew."""
        self._greatest = 0.0

    def estimate(self) -> None:
        """Estimate the greatest eigenvalue from anew; collective.

        It grows when cells yield (from 3.6 to 4.5 has been seen). The smoother works with the greatest one so far,
        for one too great costs little and one too small by a fifth makes the cycle indefinite.
        """
        self._extreme = self._noise
        self._greatest = max(self._greatest, self._greatest_eigenvalue(LANCZOS))

    def apply(self, pc: Any, r: Any, z: Any) -> None:
        """One V-cycle from zero: z is about the solution for r."""
        b = r.array_r.astype(np.float32)
        x, left = self._smooth(np.zeros_like(b), self._free * b)
        coarse_mask = self._mask[1]
        self._fine.array = left
        self._P.multTranspose(self._fine, self._rhs)
        self._rhs.pointwiseMult(self._rhs, coarse_mask)
        self._ksp.solve(self._rhs, self._correction)
        self._correction.pointwiseMult(self._correction, coarse_mask)
        self._P.mult(self._correction, self._fine)
        correction = self._free * self._fine.array_r.astype(np.float32)
        x, _ = self._smooth(x + correction, left - self._product(correction), last=True)
        z.array = x + (1.0 - self._free) * self._inverse * b

    def _smooth(self, x: Singles, residual: Singles, last: bool = False) -> tuple[Singles, Singles]:
        """Chebyshev's iteration (Saad, Iterative Methods, 2003, algorithm 12.1); the last residual only if needed."""
        low, high = (self._greatest * part for part in SMOOTHED)
        middle, half = 0.5 * (high + low), 0.5 * (high - low)
        rho = half / middle
        step = self._scaling * residual * np.float32(1.0 / middle)
        for k in range(SWEEPS):
            x = x + step
            if last and k == SWEEPS - 1:
                break
            residual = residual - self._product(step)
            before, rho = rho, 1.0 / (2.0 * middle / half - rho)
            step = np.float32(rho * before) * step + np.float32(2.0 * rho / half) * self._scaling * residual
        return x, residual

    def _product(self, x: Singles) -> Singles:
        """Matrix times vector of owned dofs, in the rows of the free ones; collective."""
        solid = self._solid
        if solid.comm.size == 1:
            self._vector.reshape(-1)[:] = x
            _solver.symmetric_product(*self._upper, self._blocks, self._vector, self._image)
            return self._free * self._image.reshape(-1)
        self._vector[:] = solid.with_ghosts(x.astype(np.float64))
        _solver.symmetric_product(*self._upper, self._blocks, self._vector, self._image)
        return self._free * solid.sum_ghosts(self._image.astype(np.float64)).astype(np.float32).reshape(-1)

    def _greatest_eigenvalue(self, steps: int) -> float:
        """Of the Jacobi-scaled matrix, by Lanczos' method from the vector it led to last time; collective."""
        comm = self._solid.comm
        root = np.sqrt(self._scaling)

        def dot(a: Singles, b: Singles) -> float:
            return float(comm.allreduce(float(np.dot(a, b))))

        v = self._free * self._extreme
        v /= np.float32(np.sqrt(dot(v, v)))
        before, beta = np.zeros_like(v), 0.0
        basis, diagonal, beside = [], [], []
        for _ in range(steps):
            basis.append(v)
            w = root * self._product(root * v) - np.float32(beta) * before
            diagonal.append(dot(w, v))
            w -= np.float32(diagonal[-1]) * v
            beta = np.sqrt(dot(w, w))
            if beta <= 1e-5 * diagonal[0]:  # the space is exhausted
                break
            beside.append(beta)
            before, v = v, w / np.float32(beta)
        size = len(diagonal)
        values, vectors = eigh_tridiagonal(diagonal, beside[: size - 1])
        # the noise lets a mode grow that has become the greatest one somewhere else
        self._extreme = sum(np.float32(c) * v for c, v in zip(vectors[:, -1], basis, strict=True)) + self._noise
        return float(values[-1])
