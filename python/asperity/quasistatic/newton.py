"""Newton's method for one position of the flat: PETSc SNES around a solid and a contact formulation."""

from __future__ import annotations

import weakref
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, Protocol

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
SLOPE_DROP, TRIALS = 0.3, 8  # the line search ends when the work rate has dropped to this part, or after these trials
SMALLEST_PART = 1e-3  # of a Newton step, to which it is halved where it turns a solid inside out
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


class Forces(Protocol):
    """Forces of a flat on a solid, as `contact.Contact` describes them."""

    symmetric: bool
    has_tangent: bool

    def residual(self, force: Floats) -> tuple[Floats, Integers, Floats]: ...

    def nodal_force(self, force: Floats) -> Floats: ...

    def add_tangent(self) -> None: ...


@dataclass(frozen=True)
class Equations:
    """The equations of equilibrium at a displacement; parts of this rank."""

    force: Floats  # internal force (owned, 3) [E L^2]
    residual: Floats  # forces out of balance, zero at prescribed dofs (3 owned,) [E L^2]
    rows: Integers  # owned dofs that the contact prescribes
    lacking: Floats  # displacement increment that each of them still lacks [L]
    inverted: bool  # whether the solid is turned inside out, on any rank


@dataclass
class Iteration:
    """State of a solve between two call-backs of SNES; a step of a resumed run begins alike, to the last bit."""

    scale: float  # length of the load step [L]
    rounding: float  # of the norm of the forces out of balance [E L^2]
    now: Equations  # at the displacement of this iteration
    ahead: Equations | None = None  # at the end of the Newton step, where the line search has found it
    rows: Integers = field(default_factory=NOT_YET.copy)  # that the contact prescribed in the iteration before
    changed: int = 0  # dofs that only one of both iterations prescribes, on all ranks
    active: int = 0  # prescribed dofs, on all ranks
    balance: float = 0.0  # forces out of balance over the contact forces
    chords: bool = False  # whether the step is that of the secant stiffness
    shift: float = 0.0  # elastic stiffness added to the tangent of this iteration
    last_shift: float = 0.0  # the last one that was added
    shortened: int = 0  # steps that the line search shortened


class NewtonSolver:
    """Newton's method for the equilibrium displacement of a solid in contact; collective.

    SNES calls `_function`, `_test`, `_jacobian` and `_shorten` in turn, which share the `Iteration`. Its KSP is that of
    `linear.LinearSolver`, which prescribes the increment of some dofs: fixed ones, and the active ones of exact
    contact. The line search of SNES takes the whole of a step that has been shortened before, see `_shorten`; with
    another of its types chosen by an option none is.

    Args:
        fixed: owned dofs without displacement increment; default those of the solid

    Attributes:
        now: equations at the last displacement
        x: the displacement of the last solve (3 owned,) [L]
    """

    now: Equations

    def __init__(self, solid: Solid, contact: Forces, options: SolverOptions, fixed: Integers | None = None) -> None:
        from petsc4py import PETSc

        self.solid, self.contact, self.options = solid, contact, options
        self._fixed = solid.fixed if fixed is None else fixed
        residual, self.x = solid.vector(), solid.vector()
        # few iterations do not find that a tangent of finite strain is indefinite; in nearly incompressible solids the
        # error is larger than the residual indicates
        usual = 1e-2 if solid.material.finite else 4e-2
        self._loosest = options.krylov_rtol or (usual if solid.material.nu <= 0.45 else 1e-3)
        symmetric = contact.symmetric and solid.material.symmetric
        self.linear = LinearSolver(solid, options.linear, symmetric, min(self._loosest, SINGLE_RTOL))
        # the garbage collector cannot see references that PETSc holds: a strong one would never be freed
        me = weakref.proxy(self)
        self._raise = (lambda: me._raise_shift()) if solid.material.finite and symmetric else None
        snes = PETSc.SNES().create(solid.comm)
        snes.setOptionsPrefix(PREFIX)
        snes.setType("newtonls")
        set_defaults(PREFIX, {"snes_linesearch_type": "basic"})
        snes.setFunction(lambda snes, x, r: me._function(x, r), residual)
        snes.setJacobian(lambda *_: me._jacobian(), self.linear.operator)
        snes.setConvergenceTest(lambda snes, it, norms: me._test(it))
        snes.setTolerances(stol=0.0, max_it=options.newton_max)  # a small step alone is no convergence
        snes.setMaxLinearSolveFailures(2**31 - 1)  # `_test` knows of rescues
        snes.setKSP(self.linear.ksp)
        snes.setFromOptions()
        database = PETSc.Options(PREFIX)
        if database.getString("snes_linesearch_type") == "basic":
            snes.setLineSearchPreCheck(lambda x, y: me._shorten(x, y))
        self._tells = database.hasName("snes_linesearch_monitor")
        self.snes = snes

    def evaluate(self, x: Floats) -> Equations:
        """Find the equations at owned dof values (3 owned,) [L], prescribed ones included; collective."""
        solid = self.solid
        solid.set_displacement(x)
        force = solid.internal_force().copy()
        inverted = solid.material.finite and solid.comm.allreduce(solid.kernels.inverted_points > 0, op=MPI.LOR)
        residual, rows, lacking = self.contact.residual(force)
        flat = residual.reshape(-1)
        flat[self._fixed] = 0.0
        self.now = Equations(force, flat, rows, lacking, bool(inverted))
        return self.now

    def solve(self, start: Floats, scale: float) -> StepStats:
        """Solve from the displacement `start` (owned, 3) [L] for a step of length `scale` [L]; collective."""
        largest = max(scale, self.solid.comm.allreduce(float(np.max(np.abs(start), initial=0.0)), op=MPI.MAX))
        self.x.array = start.reshape(-1)
        begun = self.evaluate(self.x.array_r)
        self._state = state = Iteration(max(scale, 1e-6), ROUNDING * largest, begun, ahead=begun)
        self.linear.rescue, krylov, rescued = False, self.linear.total, self.linear.rescued
        with own_errors():
            self.snes.solve(None, self.x)
        reason = self.snes.getConvergedReason()
        if reason <= 0:  # where it converged, the equations are those of `x`
            self.evaluate(self.x.array_r)
        names = {v: k.lower() for k, v in vars(self.snes.ConvergedReason).items() if isinstance(v, int)}
        return StepStats(
            reason > 0, names.get(reason, str(reason)), self.snes.getIterationNumber(), self.linear.total - krylov,
            state.shortened, self.linear.rescued - rescued,
        )  # fmt: skip

    def bound(self, contact: float) -> float:
        """Norm of the forces out of balance at convergence, by the norm of the contact forces [E L^2]."""
        return self.options.rtol * contact + self._state.rounding

    # -- SNES call-backs -------------------------------------------------------------------------------------

    def _function(self, x: Any, r: Any) -> None:
        state = self._state
        state.now, state.ahead = state.ahead or self.evaluate(x.array_r), None
        r.array = state.now.residual

    def _test(self, it: int) -> int | bool:
        """Test of convergence: forces balance and nothing penetrates the flat, each relative to its own scale."""
        state, now = self._state, self._state.now
        held = self.contact.nodal_force(now.force)
        *sums, state.changed, state.active = summed(
            self.solid.comm, np.sum(held**2), np.sum(now.residual**2), len(np.setxor1d(state.rows, now.rows)),
            len(now.rows),
        )  # fmt: skip
        state.rows = now.rows
        lack = self._greatest_lack()
        contact, unbalanced = np.sqrt(sums)
        state.balance = unbalanced / contact if contact > 0 else unbalanced
        reasons = self.snes.ConvergedReason
        if it > 0 and not self.linear.solved:
            return reasons.DIVERGED_LINEAR_SOLVE
        if now.inverted:
            return reasons.DIVERGED_FUNCTION_DOMAIN
        if not np.isfinite(unbalanced):
            return reasons.DIVERGED_FNORM_NAN
        if unbalanced <= self.bound(contact) and lack <= self._lack_at_end():
            return reasons.CONVERGED_FNORM_RELATIVE
        return reasons.DIVERGED_MAX_IT if it >= self.options.newton_max else reasons.ITERATING

    def _greatest_lack(self) -> float:
        """Greatest displacement increment that a prescribed dof still lacks [L]; collective."""
        lacking = self._state.now.lacking
        return float(self.solid.comm.allreduce(np.max(np.abs(lacking), initial=0.0), op=MPI.MAX))

    def _lack_at_end(self) -> float:
        """Displacement increment that a prescribed dof may lack at convergence [L]."""
        return self.options.rtol * self._state.scale + 1e-14

    def _jacobian(self) -> None:
        self._state.shift = 0.0
        self._assemble()
        now, rtol = self._state.now, self._krylov_rtol()
        self.linear.prescribe(np.concatenate([self._fixed, now.rows]), -now.lacking, rtol, shift=self._raise)

    def _assemble(self) -> None:
        add = self.contact.add_tangent if self.contact.has_tangent else None
        self.solid.tangent.assemble(add, self._state.shift, self._state.chords)

    def _raise_shift(self) -> bool:
        """Add more elastic stiffness to a tangent that is not positive definite; whether it did.

        In finite strain the stress of a flowing solid may exceed its stiffness. The shifted step descends, and the line
        search finds how far. GMRES needs no shift: it also solves systems that are not definite.
        """
        state = self._state
        if state.shift >= LARGEST_SHIFT:
            return False
        state.shift = RAISED * state.shift if state.shift else max(state.last_shift / RAISED, SHIFT)
        state.last_shift = state.shift
        self._assemble()
        return True

    def _krylov_rtol(self) -> float:
        """Tolerance of the linear solver: loose while the active set changes, then as tight as the iteration can use.

        In a plastic or finitely deformed solid the error after a Newton iteration is about CURVATURE times the square
        of that before it, and need not be smaller than the tolerance of the residual (Eisenstat & Walker, SIAM J. Sci.
        Comput. 17 (1996) 16). An elastic one has no such error: with the right active set an iteration is the last one
        if its linear system is solved to the end, and the set is often right before it has stayed the same.
        """
        state = self._state
        exact = self.solid.material.linear and not self.contact.has_tangent
        if state.changed > (FEW * state.active if exact else 0):
            return self._loosest
        useful = 0.3 * self.options.rtol / max(state.balance, 1e-15)
        if not exact:
            useful = max(useful, CURVATURE * state.balance)
        return float(min(max(useful, SINGLE_RTOL), self._loosest))

    def _shorten(self, x: Any, y: Any) -> bool:
        """Scale the step -y from the displacement x; whether it changed.

        Without hardening the tangent does not resist more flow, and far from the solution its step is much too long.
        The next one then takes the secant stiffness. The energy of a point in small strain is a concave function of the
        square of its strain, so that such a step need not be shortened, as in the method of Kachanov (Zeidler,
        Nonlinear Functional Analysis and its Applications II/B (1990), chapter 25). Where volumetric strain relaxes, in
        finite strain, and with the stiffness of a penalty or of Nitsche's method, that holds nearly or not at all; and
        near the solution such steps are slow. So the tangent always follows.
        """
        if not self.linear.solved or (self.solid.material.linear and not self.contact.has_tangent):
            return False
        if tilted := self.solid.tangent.tilted:
            y.array = self.solid.tangent.untilt(y.array_r)
        state, comm = self._state, self.solid.comm
        free = np.ones(len(y.array_r), dtype=bool)
        free[self._fixed] = False
        free[state.now.rows] = False
        start, step, direction = x.array_r.copy(), y.array_r, y.array_r[free]

        def rate(at: Equations) -> float:
            """Work rate of the free forces along the step; inf where the solid is turned inside out."""
            return np.inf if at.inverted else -float(summed(comm, direction @ at.residual[free])[0])

        def trial(length: float) -> float:
            state.ahead = self.evaluate(start - length * step)
            return rate(state.ahead)

        moved = self._greatest_lack() > self._lack_at_end()
        length = step_length(trial, rate(state.now), moved)
        state.shortened += int(length < 1.0)
        state.chords = length < SHORT and not state.chords
        if self._tells and comm.rank == 0:
            print(f"      Line search: length {length:g}")
        y.scale(length)
        return length < 1.0 or tilted


def step_length(rate: Callable[[float], float], at_start: float, moved: bool) -> float:
    """Length in (0, 1] of a step: where the work rate of the free forces along it nearly vanishes.

    It is the slope of the incremental energy, convex in small strain, that associative J2 plasticity, the penalty
    method and friction with given bounds minimise. A full step that overshoots the minimum is shortened. A step that
    starts uphill moves prescribed dofs and is not shortened. Nor is one whose rate at the beginning is negligible
    beside that which moving them causes: its sign is a matter of rounding. A step that turns a solid inside out is
    halved until it does not.

    Args:
        rate: work rate at a length, inf where the solid is turned inside out; called last with the result
        at_start: work rate at the beginning
        moved: whether the step moves prescribed dofs
    """
    length, at_end = 1.0, rate(1.0)
    while at_end == np.inf and length > SMALLEST_PART:
        length *= 0.5
        at_end = rate(length)
    pushed = moved and at_end > -PUSHED * at_start
    if at_start >= 0.0 or pushed or not -SLOPE_DROP * at_start < at_end < np.inf:
        return length
    return illinois(rate, (0.0, at_start), (length, at_end), -SLOPE_DROP * at_start, TRIALS)


def illinois(
    f: Callable[[float], float], low: tuple[float, float], high: tuple[float, float], close: float, most: int
) -> float:
    """Root of a function between two points (x, f(x)) of unlike signs, by regula falsi (Illinois): the last x tried.

    Args:
        f: the function; inf lies beyond the root as `high`, NaN ends the search
        close: value at which the search ends
        most: number of trials
    """
    (a, f_a), (b, f_b), x, before = low, high, high[0], 0.0
    for _ in range(most):
        x = (a * f_b - b * f_a) / (f_b - f_a) if f_b < np.inf else 0.5 * (a + b)
        found = f(x)
        if not abs(found) > close:
            break
        weight = 0.5 if found * before > 0.0 else 1.0  # an end that stays twice weighs half
        if found * f_b > 0.0:
            b, f_b, f_a = x, found, weight * f_a
        else:
            a, f_a, f_b = x, found, weight * f_b
        before = found
    return x
