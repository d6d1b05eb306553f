"""The linear system of a Newton iteration: some dofs prescribed, then a Krylov method or a factorisation."""

from __future__ import annotations

import weakref
from contextlib import suppress
from typing import TYPE_CHECKING, Any

import numpy as np

from asperity.arrays import Floats, Integers
from asperity.errors import AsperityWarning, warn
from asperity.linear.matrix_free import TangentOperator, tangent_product
from asperity.linear.multigrid import ITERATIONS, PMultigrid
from asperity.linear.petsc import GAMG, NodeMatrix, set_defaults, set_rigid_modes

if TYPE_CHECKING:
    from asperity.fem.solid import Solid


SINGLE_RTOL = 1e-5  # smallest tolerance for which a product in single precision is exact enough
LU_LIMIT = 1_000  # dofs below which a factorisation beats CG with multigrid (benchmarks/linear.py)
GENERAL_LU_LIMIT = 6_000  # the same of a tangent that is not symmetric
DIRECT_LIMIT = 200_000  # dofs up to which a factorisation may replace an iterative solver that fails
RESCUES = 10  # systems rescued by a factorisation before a word of it
RESCUED = (
    f"solver.linear failed for {RESCUES} systems so far, and LU solved them, each several times slower; the results "
    "are the same. run.log names the steps: smaller ones may help (steps)"
)
PREFIX, RESCUE_PREFIX = "asperity_linear_", "asperity_rescue_"
#: Memory beyond the estimate of MUMPS, in per cent: on several ranks the need depends on the speed of each.
WORKSPACE = 100


class LinearSolver:
    """Solves A y = r with some dofs of y prescribed, A the tangent of a solid; collective.

    Where CG, GMRES or Cholesky's method fails, because the matrix is nearly singular or indefinite, LU factorises the
    system and those that follow in the same step.

    Args:
        solid: owner of the tangent
        kind: "lu" (MUMPS), "cg" (p-multigrid), "gamg" (algebraic multigrid), or "auto", which takes "lu" for small
            problems and "cg" for others
        symmetric: whether the matrix is symmetric and positive definite: Cholesky and CG, else LU and GMRES
        rtol: smallest tolerance that will be requested

    Attributes:
        operator: the tangent as a matrix of PETSc
        rescue: whether systems are factorised because the solver failed in this step
        rescued: number of systems factorised for that reason
        left: energy of the error of the last solution, the square of the energy norm of the residual, as CG predicts
            it; 0 after a factorisation
    """

    def __init__(self, solid: Solid, kind: str, symmetric: bool = True, rtol: float = SINGLE_RTOL) -> None:
        if kind == "auto":
            kind = "lu" if solid.dofs < (LU_LIMIT if symmetric else GENERAL_LU_LIMIT) else "cg"
        self.rescue, self.rescued, self.left = False, 0, 0.0
        self._solid = solid
        self._may_rescue = (symmetric or kind != "lu") and solid.dofs <= DIRECT_LIMIT
        self._direct: Assembled | None = None
        self._method: Krylov | Assembled
        single = rtol >= SINGLE_RTOL
        solid.halved = kind == "cg" and symmetric and single
        if kind == "cg":
            self._method = Krylov(TangentOperator(solid, symmetric, single), symmetric)
        else:
            self._method = Assembled(solid, kind, symmetric, PREFIX)
        self.operator = self._method.operator

    def forget(self) -> None:
        """Make the next solve independent of those before, as after a restart."""
        self._method.forget()

    def product(self, x: Floats) -> Floats:
        """Current tangent times owned dof values (3 owned,), in the precision of the solver; collective."""
        return self._method.product(x)

    def solve(self, r: Any, rows: Integers, values: Floats, y: Any, rtol: float, atol: float = 0.0) -> tuple[int, bool]:
        """Solve with the current values of the solid's tangent.

        Args:
            r: right-hand side, unchanged
            rows: owned dofs to be zero in addition to the prescribed ones, which come last
            values: of the prescribed dofs, for the last rows
            y: receives the solution
            rtol: relative tolerance of the iterative solvers: CG takes the energy norm as it predicts it
            atol: absolute one, sufficient as well

        Returns:
            iterations, and whether the solver converged

        Raises:
            MemoryError: there is not enough for a factorisation
        """
        iterations, solved = 0, False
        if not self.rescue:
            iterations, solved = self._method.solve(r, rows, values, y, rtol, atol)
            self.left = self._method.left
        if not solved and self._may_rescue:
            if self._direct is None:
                self._direct = Assembled(self._solid, "lu", False, RESCUE_PREFIX)
            with self._solid.phases.phase("direct rescue"), suppress(MemoryError):
                _, solved = self._direct.solve(r, rows, values, y, rtol)
            self.left = 0.0
            self.rescue = True
            self.rescued += 1
            if self.rescued == RESCUES and self._solid.comm.rank == 0:
                warn(RESCUED, AsperityWarning)
        # an iterative solver meets prescribed values only to its tolerance
        y.array[rows] = 0.0
        y.array[rows[len(rows) - len(values) :]] = values
        return iterations, solved


class Krylov:
    """CG, or GMRES, with p-multigrid on the free dofs.

    The energy norm of the residual would cost CG a V-cycle at the end of each solution. It is predicted instead: the
    energy falls from one iteration to the next as the square of the residual does.
    """

    def __init__(self, tangent: TangentOperator, symmetric: bool) -> None:
        from petsc4py import PETSc

        solid = tangent.solid
        self._solid, self._tangent = solid, tangent
        self.operator = tangent.matrix()
        self._multigrid = PMultigrid(tangent, symmetric)
        self._ksp = PETSc.KSP().create(solid.comm)
        self._ksp.setOptionsPrefix(PREFIX)
        self._ksp.setType("cg" if symmetric else "gmres")
        self._ksp.setTolerances(max_it=ITERATIONS)
        if symmetric:  # of the methods that a user may set instead
            self._ksp.setNormType(PETSc.KSP.NormType.NATURAL)
        pc = self._ksp.getPC()
        pc.setType("python")
        pc.setPythonContext(self._multigrid)
        self._ksp.setOperators(self.operator)
        self._ksp.setFromOptions()
        self._predicts = self._ksp.getType() == "cg"
        if self._predicts:
            self._ksp.setNormType(PETSc.KSP.NormType.UNPRECONDITIONED)
            # the garbage collector cannot see references that PETSc holds: a strong one would never be freed
            me = weakref.proxy(self)
            self._ksp.setConvergenceTest(lambda *args: me._test(*args))
        self._b = solid.vector()
        self._norm = self._first = self.left = 0.0

    def forget(self) -> None:
        """See `LinearSolver`; so for `product` and `solve`."""
        self._multigrid.forget()

    def product(self, x: Floats) -> Floats:
        self._tangent.update()
        return self._tangent.product(x)

    def solve(self, r: Any, rows: Integers, values: Floats, y: Any, rtol: float, atol: float = 0.0) -> tuple[int, bool]:
        from mpi4py import MPI

        solid, tangent = self._solid, self._tangent
        with solid.phases.phase("preconditioner"):
            tangent.hold(rows)
            tangent.update()
            if not self._multigrid.update():
                return 0, False
        with solid.phases.phase("linear solve"):
            lifted = np.zeros(3 * solid.owned)
            lifted[rows[len(rows) - len(values) :]] = values
            b = tangent.free * r.array_r
            if solid.comm.allreduce(bool(lifted.any()), op=MPI.LOR):
                b -= tangent.free * tangent.product(lifted)
            self._b.array = b
            self._ksp.setTolerances(rtol=rtol, atol=atol)
            self._ksp.solve(self._b, y)
            if self._ksp.getConvergedReason() < 0 and self._multigrid.renew():
                self._ksp.solve(self._b, y)
            if not self._predicts:
                self.left = self._ksp.getResidualNorm() ** 2
            iterations, solved = self._ksp.getIterationNumber(), self._ksp.getConvergedReason() > 0
            self._multigrid.judge(iterations, rtol, solved)
        return iterations, solved

    def _test(self, ksp: Any, iteration: int, norm: float) -> int:
        """Whether the energy of the error is small enough, as predicted; called by PETSc."""
        reasons = ksp.ConvergedReason
        before, self._norm = self._norm, norm
        if not np.isfinite(norm):
            return int(reasons.DIVERGED_NANORINF)
        if norm == 0.0:
            self.left = 0.0
            return int(reasons.CONVERGED_ATOL)
        if iteration == 0:
            self.left = np.inf
            return int(reasons.ITERATING)
        energy = self._solid.comm.allreduce(self._multigrid.energy)
        if not energy > 0.0:
            return int(reasons.DIVERGED_INDEFINITE_PC)
        if iteration == 1:
            self._first = energy
        self.left = energy * (norm / before) ** 2
        if self.left <= max(ksp.rtol**2 * self._first, ksp.atol**2):
            return int(reasons.CONVERGED_RTOL)
        return int(reasons.ITERATING if iteration < ksp.max_it else reasons.DIVERGED_MAX_IT)


class Assembled:
    """A matrix of PETSc, prescribed dofs eliminated in place: structure and near-null space stay as they are."""

    def __init__(self, solid: Solid, kind: str, symmetric: bool, prefix: str = "") -> None:
        from petsc4py import PETSc

        self._solid = solid
        self._matrix = NodeMatrix(solid.sparsity, solid.V.dofmap.index_map, solid.comm)
        self.operator = A = self._matrix.A
        A.setOption(PETSc.Mat.Option.SYMMETRIC, symmetric)
        A.setOption(PETSc.Mat.Option.SPD, symmetric)
        self._ksp = PETSc.KSP().create(solid.comm)
        self._ksp.setOptionsPrefix(prefix)
        pc = self._ksp.getPC()
        if kind == "lu":
            self._ksp.setType("preonly")
            pc.setType("cholesky" if symmetric else "lu")
            pc.setFactorSolverType("mumps")
            set_defaults(prefix, {"mat_mumps_icntl_14": WORKSPACE})
        else:
            self._ksp.setType("cg" if symmetric else "gmres")
            self._ksp.setTolerances(max_it=ITERATIONS)
            if symmetric:
                self._ksp.setNormType(PETSc.KSP.NormType.NATURAL)
            pc.setType("gamg")
            set_defaults(prefix, GAMG)
            set_rigid_modes(A, solid.points)
        self._ksp.setOperators(A)
        self._ksp.setFromOptions()
        self._b, self._y = solid.vector(), solid.vector()
        self.left = 0.0

    def forget(self) -> None:
        """See `LinearSolver`; so for `product` and `solve`."""

    def product(self, x: Floats) -> Floats:
        return tangent_product(self._solid, x)

    def solve(self, r: Any, rows: Integers, values: Floats, y: Any, rtol: float, atol: float = 0.0) -> tuple[int, bool]:
        from petsc4py import PETSc

        A, solid = self.operator, self._solid
        with solid.phases.phase("preconditioner"):
            np.copyto(self._matrix.values, solid.values)
            self._matrix.assemble()
            r.copy(self._b)
            self._y.set(0.0)
            self._y.array[rows[len(rows) - len(values) :]] = values
            diagonal = A.getDiagonal().sum() / solid.dofs
            A.zeroRowsColumns(rows + A.getOwnershipRange()[0], diag=diagonal, x=self._y, b=self._b)
            self._ksp.setOperators(A)
            self._ksp.setUp()
        with solid.phases.phase("linear solve"):
            self._ksp.setTolerances(rtol=rtol, atol=atol)
            self._ksp.solve(self._b, y)
            if self._ksp.getType() != "preonly":
                self.left = self._ksp.getResidualNorm() ** 2
        if self._ksp.getPC().getFailedReason() == PETSc.PC.FailedReason.FACTOR_OUTMEMORY:
            raise MemoryError
        return self._ksp.getIterationNumber(), self._ksp.getConvergedReason() > 0
