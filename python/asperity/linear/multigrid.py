# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

"""Two-level p-multigrid: displacements are smoothed, and the first-order ones among them solved on the cell corners.

The coarse space is an eighth of the size, so it can be factorised where the second-order problem of the same mesh
is far too large for that, and is set up in a fraction of the time of an algebraic hierarchy on the fine level.

The fine level works in single precision, see `matrix_free.TangentOperator`.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.linalg import eigh_tridiagonal

from asperity import _solver
from asperity.arrays import Singles
from asperity.linear.coarsening import Coarsening
from asperity.linear.matrix_free import TangentOperator
from asperity.linear.petsc_options import GAMG, set_defaults

COARSE_DIRECT_LIMIT = 60_000  # coarse dofs up to which the coarse problem is factorised on one rank
COARSE_SWEEPS = 4  # of its smoother above the limit: a tenth fewer iterations on the fine level than with two

PREFIX = "asperity_coarse_"

SWEEPS = 2  # of the smoother, before and after the coarse correction
LANCZOS, UPDATE = 20, 4  # steps of an estimate of the greatest eigenvalue: from the start, and for the next matrix
RENEWAL = 1.5  # increase of the iterations at which the coarse matrix is renewed
NOISE = 0.1  # in the start vector of an update, relative to the result of the one before
SMOOTHED = (0.1, 1.1)  # part of the spectrum that is damped, in units of the estimate


class PMultigrid:
    """Preconditioner for the tangent of a solid on its free dofs, as a python context of PETSc; collective.

    A V-cycle with Chebyshev's iteration on the Jacobi-scaled matrix as smoother (Adams et al., J. Comput. Phys. 188
    (2003) 593). The other dofs are masked, on the fine level and in the interpolation, so that the cycle never moves
    them; corners that are not free get a unit row in the coarse matrix.

    Args:
        tangent: operator to precondition
        symmetric: whether it is symmetric; the smoother treats any operator as if it were
        coarsening: of the solid, made by default
    """

    def __init__(self, tangent: TangentOperator, symmetric: bool = True, coarsening: Coarsening | None = None) -> None:
        from petsc4py import PETSc

        self._tangent, self._solid = tangent, tangent.solid
        solid = self._solid
        self._coarsening = coarsening or Coarsening(solid)
        self._coarse, self._P = self._coarsening.matrix(), self._coarsening.P
        self._fine = self._P.createVecLeft()
        self._coarse_mask, self._rhs, self._correction = (self._P.createVecRight() for _ in range(3))
        self._ksp = PETSc.KSP().create(solid.comm)
        self._ksp.setOptionsPrefix(PREFIX)
        self._coarse.A.setOption(PETSc.Mat.Option.SPD, symmetric)
        self._ksp.setType("preonly")
        pc = self._ksp.getPC()
        small = self._coarsening.dofs <= COARSE_DIRECT_LIMIT
        # a parallel factorisation is slower than multigrid at any size (benchmarks/linear.py coarse)
        if small and (solid.comm.size == 1 or not symmetric):
            pc.setType("cholesky" if symmetric else "lu")
            # faster than MUMPS (benchmarks/linear.py pieces)
            pc.setFactorSolverType("cholmod" if symmetric and PETSc.Sys.hasExternalPackage("cholmod") else "mumps")
        else:
            pc.setType("gamg")
            set_defaults(PREFIX, GAMG | {"mg_levels_ksp_max_it": COARSE_SWEEPS})
        self._ksp.setFromOptions()
        self._version = 0
        self._reusable, self._of, self._usual = False, tangent.kept, 0  # free dofs and iterations of the coarse matrix
        noise = np.random.default_rng(solid.comm.rank).normal(size=3 * solid.owned)
        self._noise = (NOISE * noise / np.sqrt(solid.dofs)).astype(np.float32)
        self._supported = np.ones(3 * solid.owned, dtype=np.float32)
        self._supported[solid.fixed] = 0.0
        self._extreme, self._greatest = self._noise, 0.0

    def update(self, renew: bool | None = None) -> bool:
        """Adapt to the current values and free dofs of the tangent; collective.

        Args:
            renew: whether to renew the coarse matrix, the same on all ranks; None where other dofs are free than
                when it was made, or where `judge` finds it too old

        Returns:
            whether the matrix can be smoothed: its diagonal must be positive
        """
        from mpi4py import MPI

        solid, tangent = self._solid, self._tangent
        self._free = tangent.free.astype(np.float32)
        new = self._version != tangent.version
        if new:
            diagonal = solid.ghosts.scatter_reverse(solid.values[solid.sparsity.diagonal].reshape(-1, 3)).ravel()
            least = -solid.comm.allreduce(float(np.max(-diagonal[self._free > 0.0], initial=-np.inf)), op=MPI.MAX)
            if not least > 0.0:
                return False
            self._inverse = (1.0 / np.where(diagonal > 0.0, diagonal, 1.0)).astype(np.float32)
            self._version = tangent.version
        self._scaling = self._free * self._inverse
        if renew is None:
            same = self._reusable and bool(np.array_equal(self._of, tangent.kept))
            renew = not solid.comm.allreduce(same, op=MPI.LAND)
        self._coarse_mask.array = tangent.kept[self._coarsening.corners].ravel()[: self._coarse_mask.getLocalSize()]
        if renew:
            self._galerkin()
            self._ksp.setOperators(self._coarse.A)
            self._ksp.setUp()
            self._of, self._usual = tangent.kept, 0
        if self._greatest == 0.0:
            self.estimate()
        elif new:
            self._greatest = max(self._greatest, self._greatest_eigenvalue(UPDATE, self._free))
        return True

    def _galerkin(self) -> None:
        """Coarse matrix of the free dofs, with a unit row for each dof of a corner that is not free; collective."""
        fine, coarse, mask, kept = self._solid.sparsity, self._coarse, self._coarse_mask, self._tangent.kept
        corners = np.ascontiguousarray(kept[self._coarsening.corners])
        _solver.galerkin(
            fine.indptr, fine.indices, self._solid.values, kept, self._coarsening.parents,
            coarse.sparsity.indptr, coarse.sparsity.indices, corners, coarse.values,
        )  # fmt: skip
        coarse.values[coarse.sparsity.diagonal[np.flatnonzero(mask.array_r == 0.0)]] = 1.0
        coarse.assemble()

    def forget(self) -> None:
        """Let the next `update` set everything up again, unless the tangent never changed."""
        if self._solid.version > 1:
            self._greatest, self._reusable = 0.0, False

    def judge(self, iterations: int) -> None:
        """Decide by the iterations of a solve whether the next one may use the same coarse matrix.

        It may while the free dofs stay the same and the iterations do not increase, even if some more cells yield.
        """
        self._usual = self._usual or iterations
        self._reusable = iterations <= RENEWAL * self._usual + 2

    def estimate(self) -> None:
        """Estimate the greatest eigenvalue from a new start vector; collective.

        It grows when cells yield (measured: from 3.6 to 4.5). The smoother uses the greatest estimate so far, because
        an estimate too large costs little, and one too small by a fifth makes the cycle indefinite. The estimate is for
        the solid without contact, a bound for any contact: prescribed dofs only lower the eigenvalue.
        """
        self._extreme = self._noise
        self._greatest = max(self._greatest, self._greatest_eigenvalue(LANCZOS, self._supported))

    def apply(self, pc: Any, r: Any, z: Any) -> None:
        """One V-cycle from zero: z approximates the solution for r; called by PETSc."""
        x, left = np.zeros_like(self._free), self._free * r.array_r.astype(np.float32)
        left -= self._free * self._smooth(x, left)
        self._fine.array = left
        self._P.multTranspose(self._fine, self._rhs)
        self._rhs.pointwiseMult(self._rhs, self._coarse_mask)
        self._ksp.solve(self._rhs, self._correction)
        self._correction.pointwiseMult(self._correction, self._coarse_mask)
        self._P.mult(self._correction, self._fine)
        correction = self._free * self._fine.array_r.astype(np.float32)
        x += correction
        left -= self._free * self._tangent.single_product(correction)
        self._smooth(x, left, last=True)
        z.array = x

    def _smooth(self, x: Singles, residual: Singles, last: bool = False) -> Singles:
        """Chebyshev's iteration (Saad, Iterative Methods, 2003, algorithm 12.1) on x and its residual, in place.

        Returns:
            product with the last step, not yet subtracted from the residual; not up to date after the last smoothing
        """
        low, high = (self._greatest * part for part in SMOOTHED)
        middle, half = 0.5 * (high + low), 0.5 * (high - low)
        rho = half / middle
        step, image = np.zeros_like(x), np.zeros_like(x)
        keep, add = 0.0, 1.0 / middle
        for sweep in range(SWEEPS):
            _solver.relax(image, self._free, self._scaling, keep, add, residual, step, x)
            if not last or sweep < SWEEPS - 1:
                image = self._tangent.single_product(step)
            before, rho = rho, 1.0 / (2.0 * middle / half - rho)
            keep, add = rho * before, 2.0 * rho / half
        return image

    def _greatest_eigenvalue(self, steps: int, free: Singles) -> float:
        """Of the Jacobi-scaled matrix with those dofs free, by Lanczos' method from the last vector; collective."""
        comm = self._solid.comm
        root = np.sqrt(free * self._inverse)

        def dot(a: Singles, b: Singles) -> float:
            return float(comm.allreduce(float(np.dot(a, b))))

        v = free * self._extreme
        v /= np.float32(np.sqrt(dot(v, v)))
        before, beta = np.zeros_like(v), 0.0
        basis, diagonal, off_diagonal = [], [], []
        for _ in range(steps):
            basis.append(v)
            w = root * self._tangent.single_product(root * v) - np.float32(beta) * before
            diagonal.append(dot(w, v))
            w -= np.float32(diagonal[-1]) * v
            beta = np.sqrt(dot(w, w))
            if beta <= 1e-5 * diagonal[0]:  # the space is exhausted
                break
            off_diagonal.append(beta)
            before, v = v, w / np.float32(beta)
        size = len(diagonal)
        values, vectors = eigh_tridiagonal(diagonal, off_diagonal[: size - 1])
        # noise, so that a mode that has become the greatest elsewhere can grow
        self._extreme = np.stack(basis, axis=1) @ vectors[:, -1].astype(np.float32) + self._noise
        return float(values[-1])
