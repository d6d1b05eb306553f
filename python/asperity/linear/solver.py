"""The linear system of a Newton iteration: a KSP of PETSc with some dofs prescribed."""

from __future__ import annotations

import weakref
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager
from typing import TYPE_CHECKING, Any

import numpy as np

from asperity.arrays import Floats, Integers
from asperity.errors import AsperityWarning, ConvergenceError, warn
from asperity.linear.matrix_free import TangentOperator, tangent_product
from asperity.linear.multigrid import ITERATIONS, EnergyTest, PMultigrid
from asperity.linear.petsc import NodeMatrix, factorise, memory_lacking, own_errors
from asperity.runtime.parallel import summed

if TYPE_CHECKING:
    from asperity.fem.solid import Solid


SINGLE_RTOL = 1e-5  # smallest tolerance for which a product in single precision is exact enough
LU_LIMIT = 1_000  # dofs below which a factorisation beats CG with multigrid (benchmarks/speed.py)
GENERAL_LU_LIMIT = 6_000  # the same of a tangent that is not symmetric
RESCUES = 10  # systems rescued by a factorisation before a word of it
RESCUED = (
    f"solver.linear failed for {RESCUES} systems so far, and LU solved them, each several times slower; the results "
    "are the same. run.log names the steps: smaller ones may help (steps)"
)
FAILED = "the iterative solver failed, and the step is cut; "
LACKS = (
    "MUMPS would factorise the system of {} dofs, but takes about {:.2g} GiB on all ranks, more than is free: take "
    "more memory, ranks on more machines, or a larger mesh.h_contact"
)
PREFIX, RESCUE_PREFIX = "asperity_", "asperity_rescue_"


class LinearSolver:
    """Solves A y = r with some dofs of y prescribed, A the tangent of a solid; collective.

    A KSP of PETSc for the free dofs: before it begins, the part of the prescribed dofs is moved to the right side, and
    their rows are those of the unit matrix; when it has ended, they get their values. SNES may call it.

    Where CG, GMRES or Cholesky's method fails, because the matrix is nearly singular or indefinite, LU factorises the
    system and those that follow in the same step.

    Args:
        solid: owner of the tangent
        kind: "lu" (MUMPS), "cg" (p-multigrid), or "auto", which takes "lu" for small problems and "cg" for others
        symmetric: whether the matrix is symmetric and positive definite: Cholesky and CG, else LU and GMRES
        rtol: smallest tolerance that will be requested

    Attributes:
        ksp: the solver of PETSc
        operator: its matrix
        multigrid: its preconditioner; None where it factorises
        rescue: whether systems are factorised because the solver failed in this step
        rescued: number of systems factorised for that reason
        iterations, total: of the last solution, and of all
        solved: whether it was found
        lacks: what to do where a rescue wanted for memory, else empty
        left: energy of its error, the square of the energy norm of the residual, as CG predicts it; 0 after a
            factorisation
    """

    def __init__(self, solid: Solid, kind: str, symmetric: bool = True, rtol: float = SINGLE_RTOL) -> None:
        from petsc4py import PETSc

        if kind == "auto":
            kind = "lu" if solid.dofs < (LU_LIMIT if symmetric else GENERAL_LU_LIMIT) else "cg"
        self.rescue, self.rescued, self.left, self.iterations, self.total, self.solved = False, 0, 0.0, 0, 0, False
        self._solid = solid
        self.lacks = ""
        self._may_rescue = symmetric or kind != "lu"
        self._direct: tuple[Any, Assembled] | None = None
        single = rtol >= SINGLE_RTOL
        solid.tangent.halved = kind == "cg" and symmetric and single
        self.ksp = PETSc.KSP().create(solid.comm)
        self.ksp.setOptionsPrefix(PREFIX)
        self.multigrid: PMultigrid | None = None
        self._test: EnergyTest | None = None
        if kind == "cg":
            self._tangent = TangentOperator(solid, symmetric, single)
            self.multigrid = PMultigrid(self._tangent, symmetric)
            self.operator = self.multigrid.precondition(self.ksp)
            self._test = EnergyTest(self.ksp, self.multigrid) if self.ksp.getType() == "cg" else None
        else:
            self._assembled = Assembled(self.ksp, solid, symmetric)
            self.operator = self._assembled.operator
        # the garbage collector cannot see references that PETSc holds: a strong one would never be freed
        me = weakref.proxy(self)
        self.ksp.setPreSolve(lambda ksp, b, x: me._begin(b))
        self.ksp.setPostSolve(lambda ksp, b, x: me._end(b, x))
        self._again = False
        self._shift: Callable[[], bool] | None = None
        self._phase: AbstractContextManager[None] = solid.phases.phase("linear solve")

    def forget(self) -> None:
        """Make the next solve independent of those before, as after a restart."""
        if self.multigrid is not None:
            self.multigrid.forget()

    def product(self, x: Floats) -> Floats:
        """Current tangent times owned dof values (3 owned,), in the precision of the solver; collective."""
        if self.multigrid is None:
            return tangent_product(self._solid, x)
        self._tangent.update()
        return self._tangent.product(x)

    def prescribe(
        self,
        rows: Integers,
        values: Floats,
        rtol: float,
        shift: Callable[[], bool] | None = None,
    ) -> None:
        """Prepare a solve with the current values of the solid's tangent.

        Args:
            rows: owned dofs to be zero in addition to the prescribed ones, which come last
            values: of the prescribed dofs, for the last rows
            rtol: relative tolerance of the iterative solvers: CG takes the energy norm as it predicts it
            shift: after a solve that failed, writes a tangent that is closer to a positive definite one; whether it
                did, collective
        """
        self._rows, self._values, self._rtol, self._shift = rows, values, rtol, shift
        self.ksp.setTolerances(rtol=rtol, atol=0.0, max_it=0 if self.rescue else ITERATIONS)
        if not self.rescue:
            with self._solid.phases.phase("preconditioner"):
                self._prepare()

    def _prepare(self) -> None:
        """Take up the current tangent."""
        from petsc4py import PETSc

        if self.multigrid is None:
            self._assembled.prepare(self._rows)
            return
        self._tangent.hold(self._rows)
        self._tangent.update()
        self.multigrid.update()
        self.ksp.getPC().setFailedReason(PETSc.PC.FailedReason.NOERROR)

    def solve(self, r: Any, rows: Integers, values: Floats, y: Any, rtol: float) -> tuple[int, bool]:
        """Solve for y with the right side r, which stays, see `prescribe`; iterations, and whether it converged.

        Raises:
            ConvergenceError: there is not enough memory for the factorisation that was chosen
        """
        self.prescribe(rows, values, rtol)
        with own_errors():
            self.ksp.solve(r, y)
        return self.iterations, self.solved

    def _begin(self, b: Any) -> None:
        """Move the part of the prescribed dofs to the right side; called by PETSc."""
        if self._again:
            return
        self._phase = self._solid.phases.phase("linear solve")
        self._phase.__enter__()
        self._given = b.array_r.copy()
        lifted = np.zeros(3 * self._solid.owned)
        lifted[self._rows[len(self._rows) - len(self._values) :]] = self._values
        right = self._given.copy()
        if not self.rescue and summed(self._solid.comm, float(lifted.any()))[0]:
            right -= self.product(lifted)
        right[self._rows] = 0.0
        b.array = right

    def _end(self, b: Any, x: Any) -> None:
        """Solve again, by one remedy after the other, where the solver failed, and prescribe; called by PETSc."""
        if self._again:
            return
        self.iterations, self.solved = (0, False) if self.rescue else self._outcome()
        if not self.rescue:
            for _ in () if self.solved else self._remedies():
                self._solve_again(b, x)
                if self.solved:
                    break
            if self.multigrid is not None:
                self.multigrid.judge(self.iterations, self._rtol, self.solved)
            self.left = self._energy_left()
        self.total += self.iterations
        self._phase.__exit__(None, None, None)
        if not self.solved and (needed := memory_lacking(self.ksp)):
            raise ConvergenceError(LACKS.format(self._solid.dofs, needed / 2**30) + ', or solver.linear = "cg"')
        if not self.solved and self._may_rescue:
            self._factorise(b, x)
        b.array = self._given
        if not self.solved:
            x.set(0.0)
        # an iterative solver meets prescribed values only to its tolerance
        x.array[self._rows] = 0.0
        x.array[self._rows[len(self._rows) - len(self._values) :]] = self._values

    def _remedies(self) -> Iterator[str]:
        """Apply what may help a solver that failed, the cheapest first; yields its name where the system changed."""
        multigrid = self.multigrid
        if multigrid is not None and multigrid.ready and multigrid.renew():
            yield "a new coarse matrix"
        while self._shift is not None and self._shift():
            self.forget()
            self._prepare()
            yield "a tangent closer to a positive definite one"
        if multigrid is not None and multigrid.factorise_coarse():
            yield "a coarse matrix that is factorised"

    def _solve_again(self, b: Any, x: Any) -> None:
        from petsc4py import PETSc

        self.ksp.getPC().setFailedReason(PETSc.PC.FailedReason.NOERROR)
        self._again = True
        self.ksp.solve(b, x)
        self._again = False
        self.iterations, self.solved = self._outcome()

    def _energy_left(self) -> float:
        """Energy of the error of the last solution."""
        if self.ksp.getType() == "preonly":
            return 0.0
        return float(self.ksp.getResidualNorm() ** 2) if self._test is None else self._test.left

    def _outcome(self) -> tuple[int, bool]:
        return self.ksp.getIterationNumber(), self.ksp.getConvergedReason() > 0

    def _factorise(self, b: Any, x: Any) -> None:
        """Solve the system by LU, as those that follow in the same step."""
        from petsc4py import PETSc

        solid = self._solid
        if self._direct is None:
            ksp = PETSc.KSP().create(solid.comm)
            ksp.setOptionsPrefix(RESCUE_PREFIX)
            self._direct = ksp, Assembled(ksp, solid, symmetric=False)
        ksp, assembled = self._direct
        with solid.phases.phase("direct rescue"):
            assembled.prepare(self._rows)
            ksp.solve(b, x)
        self.solved, self.left, self.rescue = ksp.getConvergedReason() > 0, 0.0, True
        self.rescued += 1
        needed = memory_lacking(ksp)
        self.lacks = LACKS.format(solid.dofs, needed / 2**30) if needed else ""
        if solid.comm.rank == 0 and needed:
            warn(FAILED + self.lacks, AsperityWarning)
        if solid.comm.rank == 0 and self.rescued == RESCUES:
            warn(RESCUED, AsperityWarning)


class Assembled:
    """A matrix of PETSc for LU or Cholesky's method, prescribed dofs eliminated in place: its structure stays."""

    def __init__(self, ksp: Any, solid: Solid, symmetric: bool) -> None:
        from petsc4py import PETSc

        self._solid, self._ksp = solid, ksp
        self._matrix = NodeMatrix(solid.sparsity, solid.V.dofmap.index_map, solid.comm)
        self.operator: Any = self._matrix.A
        self.operator.setOption(PETSc.Mat.Option.SYMMETRIC, symmetric)
        self.operator.setOption(PETSc.Mat.Option.SPD, symmetric)
        ksp.setOperators(self.operator)
        factorise(ksp, symmetric)

    def prepare(self, rows: Integers) -> None:
        """Take up the current tangent with these owned dofs prescribed; collective."""
        A, solid = self.operator, self._solid
        self._matrix.assemble(solid.tangent.values())
        diagonal = A.getDiagonal().sum() / solid.dofs
        A.zeroRowsColumns(rows + A.getOwnershipRange()[0], diag=diagonal)
        self._ksp.setOperators(A)
