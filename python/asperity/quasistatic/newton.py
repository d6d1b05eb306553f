"""Newton's method for one position of the flat: PETSc SNES around a solid and a contact formulation."""

from __future__ import annotations

import weakref
from dataclasses import dataclass
from typing import Any

import numpy as np
from mpi4py import MPI

from asperity.arrays import Floats, Integers
from asperity.fem.solid import Solid
from asperity.linear.petsc import own_errors, set_defaults
from asperity.linear.solver import PREFIX, SINGLE_RTOL, LinearSolver
from asperity.model.settings import SolverOptions
from asperity.runtime.parallel import summed

CURVATURE = 10.0  # error after a Newton iteration over the square of that before it, measured on a fractal surface
ROUNDING = 1e-13  # rounding error of the residual, relative to displacements (E = L = 1)
FEW = 0.01  # part of the active dofs; when fewer change, the set is practically found
NOT_YET = np.array([-1], dtype=np.int32)  # differs from any active set
SHORT = 0.5  # length of a Newton step below which the next one is that of the chords
SLOPE_DROP = 0.3  # the line search ends when the work rate has dropped to this part
SMALLEST_PART = 1e-3  # of a Newton step, to which it is halved where it turns a solid inside out
DAMPED, SUFFICIENT = (1.0, 0.5, 0.25, 0.125), 0.2  # lengths of a step with friction, and the fall of the square wanted
SHIFT, LARGEST_SHIFT, RAISED = 0.01, 100.0, 4.0  # of a tangent that is not positive definite, and its growth
PUSHED = 10.0  # growth of the work rate along a step from which on the flat moves the nodes


COUNTED = ("newton", "krylov", "shortened", "direct")  # of a solve


@dataclass(frozen=True)
class StepStats:
    """Outcome and iterations of a solve."""

    converged: bool  # whether the equations are solved
    reason: str  # name of the SNES reason, in lower case
    newton: int  # iterations
    krylov: int  # iterations
    shortened: int = 0  # Newton steps that the line search shortened
    direct: int = 0  # linear systems factorised because the iterative solver failed

    def __add__(self, later: StepStats) -> StepStats:
        """This solve and a later one of the same step, whose outcome counts."""
        return StepStats(later.converged, later.reason, *(getattr(self, k) + getattr(later, k) for k in COUNTED))


class NewtonSolver:
    """Newton's method for the equilibrium displacement of a solid in contact; collective.

    The KSP of SNES is that of `linear.LinearSolver`, which prescribes the increment of some dofs: fixed ones, and the
    active ones of exact contact. The line search of SNES takes the whole of a step that has been shortened before, see
    `_shorten`; with another of its types chosen by an option none is.

    Args:
        contact: a `Contact`, or what has its attributes `symmetric` and `has_tangent` and its methods `residual`,
            `nodal_force` and `add_tangent`. Where nodes stick or slip, so that a full step may not bring the solution
            nearer, its method `imbalance` gives the forces out of balance for an internal force, both (owned, 3)
        fixed: owned dofs without displacement increment; default those of the solid
    """

    def __init__(self, solid: Solid, contact: Any, options: SolverOptions, fixed: Integers | None = None) -> None:
        from petsc4py import PETSc

        self.solid, self.contact, self.options = solid, contact, options
        self._fixed = solid.fixed if fixed is None else fixed
        self._residual_vec, self.x = solid.vector(), solid.vector()
        self._shortened, self._at_trial, self._secant = 0, False, False
        self._shift = self._last_shift = 0.0
        self.rows: Integers = NOT_YET
        # few iterations do not find that a tangent of finite strain is indefinite; in nearly incompressible solids the
        # error is larger than the residual indicates
        usual = 1e-2 if solid.material.finite else 4e-2
        self._loosest = options.krylov_rtol or (usual if solid.material.nu <= 0.45 else 1e-3)
        self._symmetric = contact.symmetric and solid.material.symmetric
        self.linear = LinearSolver(solid, options.linear, self._symmetric, min(self._loosest, SINGLE_RTOL))
        # the garbage collector cannot see references that PETSc holds: a strong one would never be freed
        me = weakref.proxy(self)
        self._shifts = (lambda: me._raise_shift()) if solid.material.finite and self._symmetric else None
        snes = PETSc.SNES().create(solid.comm)
        snes.setOptionsPrefix(PREFIX)
        snes.setType("newtonls")
        set_defaults(PREFIX, {"snes_linesearch_type": "basic"})
        snes.setFunction(lambda *args: me._function(*args), self._residual_vec)
        snes.setJacobian(lambda *args: me._jacobian(*args), self.linear.operator)
        snes.setConvergenceTest(lambda *args: me._test(*args))
        snes.setTolerances(stol=0.0, max_it=options.newton_max)  # a small step alone is no convergence
        snes.setMaxLinearSolveFailures(2**31 - 1)  # `_test` knows of rescues
        snes.setKSP(self.linear.ksp)
        snes.setFromOptions()
        database = PETSc.Options(PREFIX)
        if database.getString("snes_linesearch_type") == "basic":
            snes.setLineSearchPreCheck(lambda x, y: me._shorten(y))
        self._tells = database.hasName("snes_linesearch_monitor")
        self.snes = snes

    @property
    def residual(self) -> Floats:
        """Forces out of balance after the last solve, at the owned dofs, zero at prescribed ones [E L^2]."""
        return np.asarray(self._residual_vec.array_r)

    # -- SNES call-backs -------------------------------------------------------------------------------------

    def _function(self, snes: Any, x: Any, r: Any) -> None:
        if not self._at_trial:  # the last one of the line search
            self._evaluate(x.array_r)
        self._at_trial = False
        residual, rows, self._lacking = self._found
        before, self.rows = self.rows, rows
        self._changed_here = len(np.setxor1d(before, self.rows))
        flat = residual.reshape(-1)
        flat[self._fixed] = 0.0
        r.array = flat

    def _evaluate(self, x: Floats) -> Floats:
        """Forces out of balance (3 owned,) at owned dof values, prescribed dofs included; collective."""
        self._found = self.contact.residual(self._internal_force(x))
        return self._found[0].reshape(-1)

    def _internal_force(self, x: Floats) -> Floats:
        """Internal force (owned, 3) at owned dof values, and whether the solid is turned inside out; collective."""
        solid = self.solid
        solid.set_displacement(x)
        self.force = solid.internal_force().copy()
        self._inverted = solid.material.finite and bool(
            solid.comm.allreduce(solid.kernels.inverted_points > 0, op=MPI.LOR)
        )
        return self.force

    def _jacobian(self, snes: Any, x: Any, A: Any, P: Any) -> None:
        self._shift = 0.0
        self._assemble()
        self.linear.prescribe(
            np.concatenate([self._fixed, self.rows]), -self._lacking, self._krylov_rtol(), shift=self._shifts
        )

    def _assemble(self) -> None:
        self.solid.tangent.assemble(
            self.contact.add_tangent if self.contact.has_tangent else None, self._shift, self._secant
        )

    def _raise_shift(self) -> bool:
        """Add more elastic stiffness to a tangent that is not positive definite; whether it did.

        In finite strain the stress of a flowing solid may exceed its stiffness. The shifted step descends, and the line
        search finds how far. GMRES needs no shift: it also solves systems that are not definite.
        """
        if self._shift >= LARGEST_SHIFT:
            return False
        self._shift = RAISED * self._shift if self._shift else max(self._last_shift / RAISED, SHIFT)
        self._last_shift = self._shift
        self._assemble()
        return True

    def _test(self, snes: Any, it: int, norms: Any) -> int | bool:
        """Test of convergence: forces balance and nothing penetrates the flat, each relative to its own scale."""
        comm = self.solid.comm
        held = self.contact.nodal_force(self.force)
        out = self._residual_vec.array_r
        *sums, self._changed, self._active = summed(
            comm, np.sum(held**2), np.sum(out**2), self._changed_here, len(self.rows)
        )
        gap = self._greatest_lack()
        contact, unbalanced = np.sqrt(sums)
        reasons = snes.ConvergedReason
        if it > 0 and not self.linear.solved:
            return reasons.DIVERGED_LINEAR_SOLVE
        if self._inverted:
            return reasons.DIVERGED_FUNCTION_DOMAIN
        if not np.isfinite(unbalanced):
            return reasons.DIVERGED_FNORM_NAN
        self.balance = unbalanced / contact if contact > 0 else unbalanced
        if unbalanced <= self.bound(contact) and gap <= self._gap_tolerance():
            return reasons.CONVERGED_FNORM_RELATIVE
        return reasons.DIVERGED_MAX_IT if it >= self.options.newton_max else reasons.ITERATING

    def bound(self, contact: float) -> float:
        """Norm of the forces out of balance at convergence, by the norm of the contact forces [E L^2]."""
        return self.options.rtol * contact + self._rounding

    def _greatest_lack(self) -> float:
        """Greatest displacement increment that a prescribed dof still lacks [L]; collective."""
        return float(self.solid.comm.allreduce(np.max(np.abs(self._lacking), initial=0.0), op=MPI.MAX))

    def _gap_tolerance(self) -> float:
        """Displacement increment that a prescribed dof may lack at convergence [L]."""
        return self.options.rtol * self._scale + 1e-14

    # -- the step --------------------------------------------------------------------------------------------

    def _krylov_rtol(self) -> float:
        """Tolerance of the linear solver: loose while the active set changes, then as tight as the iteration can use.

        In a plastic or finitely deformed solid the error after a Newton iteration is about CURVATURE times the square
        of that before it, and need not be smaller than the tolerance of the residual (Eisenstat & Walker, SIAM J. Sci.
        Comput. 17 (1996) 16). An elastic one has no such error: with the right active set an iteration is the last one
        if its linear system is solved to the end, and the set is often right before it has stayed the same.
        """
        changed, active = self._changed, self._active
        exact = self.solid.material.linear and not self.contact.has_tangent
        if changed > (FEW * active if exact else 0):
            return self._loosest
        useful = 0.3 * self.options.rtol / max(self.balance, 1e-15)
        if not exact:
            useful = max(useful, CURVATURE * self.balance)
        return float(min(max(useful, SINGLE_RTOL), self._loosest))

    def _shorten(self, y: Any) -> bool:
        """Scale the step -y from the present displacement; whether it changed; called by PETSc.

        Without hardening the tangent does not resist more flow, and far from the solution its step is much too long.
        The next one then takes the secant stiffness. The energy of a point in small strain is a concave function of the
        square of its strain, so that such a step need not be shortened, as in the method of Kachanov (Zeidler,
        Nonlinear Functional Analysis and its Applications II/B (1990), chapter 25). Where volumetric strain relaxes, in
        finite strain, and with the stiffness of a penalty or of Nitsche's method, that holds nearly or not at all; and
        near the solution such steps are slow. So the tangent always follows.
        """
        if not self.linear.solved:
            return False
        tilted = hasattr(self.contact, "untilt")
        if tilted:
            step = y.array.copy()
            self.contact.untilt(step)
            y.array = step
        start = self.solid.u.x.array[: len(y.array_r)].copy()
        if hasattr(self.contact, "imbalance"):
            length = self._damped_length(start, y.array_r)
        elif self.contact.has_tangent or not self.solid.material.linear:
            length = self._step_length(start, y.array_r)
            self._shortened += int(length < 1.0)
        else:
            return False
        self._secant = length < SHORT and not self._secant
        if self._tells and self.solid.comm.rank == 0:
            print(f"      Line search: length {length:g}")
        y.scale(length)
        return length < 1.0 or tilted

    def _damped_length(self, start: Floats, y: Floats) -> float:
        """Length of the step -y with which the forces out of balance fall, those of stick and slip included.

        With full steps a node on the verge of slip may stick and slip in turn. Where none suffices, the best is taken.
        """

        def merit(force: Floats) -> float:
            flat = self.contact.imbalance(force).reshape(-1)
            flat[self._fixed] = 0.0
            return float(summed(self.solid.comm, float(flat @ flat))[0])

        before, found = merit(self.force), []
        for length in DAMPED:
            found.append(merit(self._internal_force(start - length * y)))
            if found[-1] <= (1.0 - SUFFICIENT * length) * before:
                self._found, self._at_trial = self.contact.residual(self.force), True
                return length
        return DAMPED[int(np.nanargmin([np.inf, *found])) - 1]

    def _step_length(self, start: Floats, y: Floats) -> float:
        """Length in (0, 1] of the step -y: where the work rate of the free forces along it nearly vanishes.

        It is the slope of the incremental energy, convex in small strain, that associative J2 plasticity and the
        penalty method minimise. Regula falsi (Illinois) shortens a full step that overshoots the minimum; a trial needs
        one residual, and the last one is that of the next iteration. A step that starts uphill moves prescribed dofs
        and is not shortened. Nor is one whose slope at the beginning is negligible beside that which moving them
        causes: its sign is a matter of rounding. A step that turns a solid inside out is halved until it does not.
        """
        free = np.ones(len(y), dtype=bool)
        free[self._fixed] = False
        free[self.rows] = False
        direction, greatest_lack = y[free], self._greatest_lack()

        def slope(length: float) -> float:
            residual = self._evaluate(start - length * y)
            self._at_trial = True
            return np.inf if self._inverted else -float(summed(self.solid.comm, direction @ residual[free])[0])

        s0 = -float(summed(self.solid.comm, direction @ self._found[0].reshape(-1)[free])[0])
        low, s_low, high, s_high = 0.0, s0, 1.0, slope(1.0)
        while s_high == np.inf and high > SMALLEST_PART:
            high *= 0.5
            s_high = slope(high)
        length = high
        pushed = s_high > -PUSHED * s0 and greatest_lack > self._gap_tolerance()
        if s0 < 0.0 and np.inf > s_high > -SLOPE_DROP * s0 and not pushed:
            for _ in range(8):
                if s_high < np.inf:
                    length = (low * s_high - high * s_low) / (s_high - s_low)
                else:
                    length = 0.5 * (low + high)
                s = slope(length)
                if abs(s) <= -SLOPE_DROP * s0:
                    break
                if s > 0.0:
                    high, s_high, s_low = length, s, 0.5 * s_low
                else:
                    low, s_low, s_high = length, s, 0.5 * s_high
        return length

    def solve(self, start: Floats, scale: float) -> StepStats:
        """Solve from the displacement `start` (owned, 3) [L] for a step of length `scale` [L]; collective."""
        largest = max(scale, self.solid.comm.allreduce(float(np.max(np.abs(start), initial=0.0)), op=MPI.MAX))
        self._scale, self._rounding = max(scale, 1e-6), ROUNDING * largest
        self.rows = NOT_YET  # a step of a resumed run is the same to the last bit
        self._shortened, self._at_trial, self._secant = 0, False, False
        self._last_shift = 0.0  # a step of a resumed run is the same to the last bit
        self.linear.rescue, krylov, rescued = False, self.linear.total, self.linear.rescued
        self.x.array = start.reshape(-1)
        with own_errors():
            self.snes.solve(None, self.x)
        reason = self.snes.getConvergedReason()
        if reason <= 0:  # where it converged, the residual is that of `x`
            self._at_trial = False
            self._function(self.snes, self.x, self._residual_vec)
        names = {v: k.lower() for k, v in vars(self.snes.ConvergedReason).items() if isinstance(v, int)}
        return StepStats(
            reason > 0, names.get(reason, str(reason)), self.snes.getIterationNumber(), self.linear.total - krylov,
            self._shortened, self.linear.rescued - rescued,
        )  # fmt: skip
