"""The linear system of a Newton iteration: prescribed dofs eliminated, then a direct or a multigrid solver."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from .errors import InputError
from .multigrid import PMultigrid
from .petsc_options import GAMG, set_defaults

if TYPE_CHECKING:
    from .solid import Floats, Solid

LU_LIMIT = 6_000  # dofs below which a factorisation beats CG with multigrid (benchmarks/linear.py)
DIRECT_LIMIT = 200_000  # dofs up to which a factorisation may stand in for an iterative solver that fails
KINDS = ("auto", "lu", "cg", "gamg")
PREFIX = "asperity_linear_"


class LinearSolver:
    """Solves A y = r with some dofs of y prescribed; collective.

    The prescribed dofs are eliminated symmetrically in place, so the matrix keeps its structure and near-null
    space. Where an iterative solver fails, because the matrix is nearly singular or indefinite, the system is
    factorised, and so are those that follow in the same step.

    Args:
        solid: whose matrix is solved with
        kind: "lu" (MUMPS), "cg" (p-multigrid), "gamg" (algebraic multigrid), or "auto", which takes "lu" for small
            problems and "cg" for others
        rtol: relative tolerance of the iterative solvers, in the energy norm
        symmetric: whether the matrix is symmetric and positive definite: Cholesky and CG, else LU and GMRES

    Attributes:
        rescue: whether systems are factorised because the iterative solver failed in this step
        rescued: systems that were factorised for that

    Raises:
        InputError: unknown kind
    """

    def __init__(self, solid: Solid, kind: str, rtol: float, symmetric: bool = True) -> None:
        from petsc4py import PETSc

        if kind not in KINDS:
            raise InputError(f'solver.linear = "{kind}" is not one of {", ".join(KINDS)}')
        if kind == "auto":
            kind = "lu" if solid.dofs < LU_LIMIT else "cg"
        self.rescue, self.rescued = False, 0
        self._direct: Any = None
        self._may_rescue = kind != "lu" and solid.dofs <= DIRECT_LIMIT
        self._solid = solid
        self._ksp = PETSc.KSP().create(solid.comm)
        self._ksp.setOptionsPrefix(PREFIX)
        self._multigrid: PMultigrid | None = None
        pc = self._ksp.getPC()
        if kind == "lu":
            self._ksp.setType("preonly")
            pc.setType("cholesky" if symmetric else "lu")
            pc.setFactorSolverType("mumps")
        else:
            self._ksp.setType("cg" if symmetric else "gmres")
            self._ksp.setTolerances(rtol=rtol, max_it=1000)
            if symmetric:
                self._ksp.setNormType(PETSc.KSP.NormType.NATURAL)
            if kind == "cg":
                self._multigrid = PMultigrid(solid, symmetric)
                pc.setType("python")
                pc.setPythonContext(self._multigrid)
            else:
                pc.setType("gamg")
                set_defaults(PREFIX, GAMG)
        solid.A.setOption(PETSc.Mat.Option.SYMMETRIC, symmetric)
        solid.A.setOption(PETSc.Mat.Option.SPD, symmetric)
        self._ksp.setOperators(solid.A)
        self._ksp.setFromOptions()
        self._b, self._y = solid.A.createVecRight(), solid.A.createVecRight()

    def forget(self) -> None:
        """Let the next solve depend on its system alone, not on those before, as after a restart."""
        if self._multigrid is not None:
            self._multigrid.forget()

    def solve(self, r: Any, rows: npt.NDArray[np.int32], values: Floats, y: Any) -> tuple[int, bool]:
        """Solve with the current values of the matrix, which are changed by the elimination.

        Args:
            r: right-hand side, unchanged
            rows: owned dofs to be zero besides the prescribed ones, which come last
            values: of the prescribed dofs, for the last rows
            y: receives the solution

        Returns:
            iterations, and whether the solver converged
        """
        A, phase = self._solid.A, self._solid.phases.phase
        with phase("elimination"):
            r.copy(self._b)
            self._y.set(0.0)
            self._y.array[rows[len(rows) - len(values) :]] = values
            diagonal = A.getDiagonal().sum() / self._solid.dofs
            A.zeroRowsColumns(rows + A.getOwnershipRange()[0], diag=diagonal, x=self._y, b=self._b)
        iterations, solved = 0, False
        if not self.rescue:
            with phase("preconditioner"):
                self._ksp.setOperators(A)
                ready = self._multigrid is None or self._multigrid.update(A, rows)
                self._ksp.setUp()
            if ready:
                with phase("linear solve"):
                    iterations, solved = self._iterate(y)
        if not solved and self._may_rescue:
            with phase("direct rescue"):
                solved = self._solve_directly(y)
        y.array[rows] = self._y.array_r[rows]  # an iterative solver only meets them to its tolerance
        return iterations, solved

    def _iterate(self, y: Any) -> tuple[int, bool]:
        self._ksp.solve(self._b, y)
        if self._multigrid is not None and self._ksp.getConvergedReason() < 0:
            self._multigrid.estimate()
            self._ksp.solve(self._b, y)
        return self._ksp.getIterationNumber(), self._ksp.getConvergedReason() > 0

    def _solve_directly(self, y: Any) -> bool:
        from petsc4py import PETSc

        if self._direct is None:
            self._direct = PETSc.KSP().create(self._solid.comm)
            self._direct.setType("preonly")
            self._direct.getPC().setType("lu")  # Cholesky would fail where the matrix is indefinite
            self._direct.getPC().setFactorSolverType("mumps")
        self._direct.setOperators(self._solid.A)
        self._direct.solve(self._b, y)
        self.rescue = True
        self.rescued += 1
        return bool(self._direct.getConvergedReason() > 0)
