"""Least energy of a solid with prescribed displacements, where the matrix stays and the prescribed dofs change."""

from __future__ import annotations

import weakref
from math import nan
from typing import Any

import numpy as np

from asperity.arrays import Floats, Integers
from asperity.linear.matrix_free import TangentOperator
from asperity.linear.multigrid import ITERATIONS, PMultigrid

LEFT = 1e-3  # estimate of the relative error of the energy at which the iteration ends; the estimate is subtracted
UNKNOWN = 1.0  # contraction before one was observed
LATER = 2.0  # contraction of the third iteration over that of the second, 1.5 to 2 where the coarse matrix is new
SLOWEST = 0.9  # contraction from which on an iteration tells nothing of what is left


class EnergySolver:
    """Least energy w.K w with some dofs of w prescribed, by CG with p-multigrid; collective.

    An iteration lowers the energy by an amount that follows from the right-hand side and the solution, because the
    residual is orthogonal to the solution. The amounts fall about geometrically, so those of two iterations give what
    is left (Strakos & Tichy, Electron. Trans. Numer. Anal. 13 (2002) 56). The end of the iteration costs no V-cycle,
    which the norm of the residual would.

    The coarse matrix may be that of other prescribed dofs: the cycle masks those of today. The contraction shows when
    it is stale.

    Attributes:
        contraction: second amount by which the energy fell over the first, in the last call with two
    """

    def __init__(self, tangent: TangentOperator) -> None:
        from petsc4py import PETSc

        solid = tangent.solid
        self._solid, self._tangent, self._multigrid = solid, tangent, PMultigrid(tangent)
        self._b, self._y = solid.vector(), solid.vector()
        self._energy = self._fall = self._gain = self._left = self._seen = 0.0
        self.contraction = UNKNOWN
        self._ksp = PETSc.KSP().create(solid.comm)
        self._ksp.setType("cg")
        self._ksp.setNormType(PETSc.KSP.NormType.UNPRECONDITIONED)
        # the garbage collector cannot see references that PETSc holds: a strong one would never be freed
        me = weakref.proxy(self)
        self._ksp.setConvergenceTest(lambda *args: me._test(*args))
        pc = self._ksp.getPC()
        pc.setType("python")
        pc.setPythonContext(self._multigrid)
        self._ksp.setOperators(tangent.matrix())

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
        solid, tangent = self._solid, self._tangent
        with solid.phases.phase("preconditioner"):
            tangent.hold(rows)
            if not self._multigrid.update(renew=False):
                return nan, w
        with solid.phases.phase("linear solve"):
            # without the translation most of the solid is at rest, and single precision will do
            image = tangent.product((w - rigid).ravel())
            self._energy = float(solid.comm.allreduce(float(np.vdot(w, image))))
            self._b.array = -tangent.free * image
            self._fall = self._gain = self._left = 0.0
            self._seen = self.contraction
            self._ksp.solve(self._b, self._y)
        self.contraction = float(np.float32(self._seen))  # as a checkpoint keeps it
        if self._ksp.getConvergedReason() < 0:
            return nan, w
        return self._energy - self._fall - self._left, w + self._y.array_r.reshape(-1, 3)

    def _test(self, ksp: Any, iteration: int, norm: float) -> int:
        """Whether enough of the energy has fallen; called by PETSc."""
        reasons = ksp.ConvergedReason
        if not np.isfinite(norm):
            return int(reasons.DIVERGED_NANORINF)
        if iteration == 0:
            return int(reasons.ITERATING)
        before, fall = self._gain, self._b.dot(self._y)
        self._gain, self._fall = max(fall - self._fall, 0.0), fall
        contraction = self.contraction
        if iteration > 1:
            seen = self._gain / before if before > 0.0 else 0.0
            if iteration == 2:
                self._seen = seen
                seen *= LATER
            contraction = seen if contraction == UNKNOWN else max(seen, contraction)
        contraction = min(contraction, SLOWEST)
        self._left = self._gain * contraction / (1.0 - contraction)
        # one iteration alone would let slow errors add up over the steps
        if iteration > 1 and self._left <= LEFT * (self._energy - fall):
            return int(reasons.CONVERGED_ATOL)
        return int(reasons.ITERATING if iteration < ITERATIONS else reasons.DIVERGED_MAX_IT)
