"""The end of CG by the energy of the error, and the least energy of a solid with prescribed displacements."""

from __future__ import annotations

from math import nan, sqrt
from typing import Any

import numpy as np

from asperity.arrays import Floats, Integers
from asperity.linear.matrix_free import TangentOperator
from asperity.linear.multigrid import ITERATIONS, PMultigrid
from asperity.linear.petsc import combine_sums
from asperity.runtime.parallel import summed

# Estimate of the relative error of the energy at which the iteration ends; the estimate is subtracted. With the penalty
# method it is too small after few iterations: 1e-3 left 2.5e-3 in k_n_elastic of a scene of the tests, this 1e-5.
LEFT = 1e-4
LEAST = 2  # iterations for an energy: one alone would let slow errors add up over the steps
NEAR = 0.8  # least energy over that of its start, the solution of the step before, roughly
PASSES = 5  # of the solver at most
TIGHTEST = 1e-8  # relative tolerance where an absolute one counts
PREFIX = "asperity_stiffness_"
UNKNOWN = 1.0  # contraction before one was observed


class EnergyTest:
    """Test of convergence of CG with p-multigrid, by the energy norm of the error.

    The energy of the residual after an iteration would cost a V-cycle at the end of each solution. It is predicted
    instead: the energy falls from one iteration to the next as the square of the residual does.

    Args:
        ksp: CG; gets the test
        multigrid: its preconditioner
        least: number of iterations

    Attributes:
        left: energy of the error of the last iterate
        contraction: by which it fell in the second iteration, in the last solve with two
    """

    def __init__(self, ksp: Any, multigrid: PMultigrid, least: int = 1) -> None:
        from petsc4py import PETSc

        self._multigrid, self._least, multigrid.measures = multigrid, least, True
        self._norm = self._first = self.left = 0.0
        self.contraction = UNKNOWN
        ksp.setNormType(PETSc.KSP.NormType.UNPRECONDITIONED)
        ksp.setConvergenceTest(self)

    def __call__(self, ksp: Any, iteration: int, norm: float) -> int:
        """Whether the energy of the error is small enough; called by PETSc."""
        reasons = ksp.ConvergedReason
        before, self._norm = self._norm, norm
        if not np.isfinite(norm):
            return int(reasons.DIVERGED_BREAKDOWN)
        if norm == 0.0:
            self.left = 0.0
            return int(reasons.CONVERGED_ATOL)
        if iteration == 0:
            self.left = np.inf
            return int(reasons.ITERATING)
        energy = self._multigrid.energy()
        if not energy > 0.0:
            return int(reasons.DIVERGED_INDEFINITE_PC)
        if iteration == 1:
            self._first = energy
        fall = (norm / before) ** 2
        self.left = energy * fall
        if iteration == 2:
            self.contraction = fall
        if iteration >= self._least:
            if self.left <= ksp.atol**2:
                return int(reasons.CONVERGED_ATOL)
            if self.left <= ksp.rtol**2 * self._first:
                return int(reasons.CONVERGED_RTOL)
        return int(reasons.ITERATING if iteration < ksp.max_it else reasons.DIVERGED_MAX_IT)


class EnergySolver:
    """Least energy w.K w with some dofs of w prescribed, by CG with p-multigrid; collective.

    The coarse matrix may be that of other prescribed dofs: the cycle masks those of today. The contraction shows when
    it is stale.

    Attributes:
        contraction: see `EnergyTest`
    """

    def __init__(self, tangent: TangentOperator) -> None:
        from petsc4py import PETSc

        solid = tangent.solid
        self._solid, self._tangent, self._multigrid = solid, tangent, PMultigrid(tangent)
        self._b, self._y = solid.vector(), solid.vector()
        self._ksp = PETSc.KSP().create(solid.comm)
        self._ksp.setOptionsPrefix(PREFIX)
        self._ksp.setType("cg")
        pc = self._ksp.getPC()
        pc.setType("python")
        pc.setPythonContext(self._multigrid)
        self._ksp.setOperators(tangent.matrix())
        combine_sums(PREFIX, solid.comm)
        self._ksp.setFromOptions()
        self._test = EnergyTest(self._ksp, self._multigrid, LEAST)

    @property
    def contraction(self) -> float:
        return self._test.contraction

    @contraction.setter
    def contraction(self, value: float) -> None:
        self._test.contraction = value

    def renew(self, rows: Integers) -> bool:
        """Make the coarse matrix with these owned dofs prescribed; whether the matrix can be smoothed; collective."""
        with self._solid.phases.phase("preconditioner"):
            self._tangent.hold(rows)
            return self._multigrid.update(renew=True)

    def minimise(self, w: Floats, rigid: Floats, rows: Integers) -> tuple[float, Floats]:
        """Least energy [E L], NaN where the solver fails, and its displacement (owned, 3); collective.

        Args:
            w: start (owned, 3); the dofs `rows` stay
            rigid: translation (3,), which strains nothing, near that of most of the solid
            rows: prescribed owned dofs
        """
        solid, tangent, ksp = self._solid, self._tangent, self._ksp
        with solid.phases.phase("preconditioner"):
            tangent.hold(rows)
            if not self._multigrid.update(renew=False):
                return nan, w
        with solid.phases.phase("linear solve"):
            guess = 0.0
            for _ in range(PASSES):
                # without the translation most of the solid is at rest, and single precision will do
                image = tangent.product((w - rigid).ravel())
                energy = float(summed(solid.comm, float(np.vdot(w, image)))[0])
                self._b.array = -tangent.free * image
                ksp.setTolerances(rtol=TIGHTEST, atol=sqrt(LEFT * (guess or NEAR * energy)), max_it=ITERATIONS)
                ksp.solve(self._b, self._y)
                if ksp.getConvergedReason() < 0:
                    break
                w = w + self._y.array_r.reshape(-1, 3)
                guess = energy - self._b.dot(self._y) - self._test.left
                if self._test.left <= LEFT * guess:
                    self.contraction = float(np.float32(self.contraction))  # as a checkpoint keeps it
                    return guess, w
        return nan, w
