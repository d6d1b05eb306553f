"""Paths of a flat that moves sideways on the solid under a constant normal load: micro-slip of two like bodies."""

from __future__ import annotations

import logging
from collections.abc import Callable
from dataclasses import replace
from math import cos, inf, nan, radians, sin

import numpy as np

from asperity.arrays import Floats
from asperity.contact.active_set import ActiveSet
from asperity.contact.friction import Coulomb, FrozenFriction, StickSlip
from asperity.errors import ConvergenceError, InputError
from asperity.model.problem import Problem
from asperity.quasistatic.contact_result import ContactResult, refuse_wrong
from asperity.quasistatic.contact_solver import ContactSolver
from asperity.quasistatic.force_loops import CLOSE as CLOSE_PRELOAD
from asperity.quasistatic.force_loops import TRIALS, Leg, as_before
from asperity.quasistatic.newton import NewtonSolver, StepStats
from asperity.quasistatic.stiffness import mirrored
from asperity.slip.law import DOWN, FIRST, UP, SlipPath
from asperity.slip.settings import SlipSettings, check_motion

CLOSE = 1e-3  # tolerance of the force at the end of a leg, over its amplitude
RTOL = 1e-6  # of the forces out of balance over the normal force; 1e-8 costs an iteration in six, and changes nothing
LIGHT = 0.01  # displacement that gives the stiffness at rest, over friction times the approach


def solve_slip(
    problem: Problem, result: ContactResult, settings: SlipSettings, stop: Callable[[], str] | None = None
) -> tuple[SlipPath, ...]:
    """Paths of a flat that moves sideways, from the state at the end of a load path, in physical units; collective.

    The flat goes from the present state to the preload. There the normal forces of the nodes of like bodies stay, and
    for each amplitude the flat moves from rest to the amplitude of the tangential force and around one loop. The
    plastic strain stays: the loop is the steady one of a solid that has shaken down, see `Sliding`.

    Args:
        problem: that was solved, of exact contact; with friction it is one body on a rigid flat
        result: of `solve_contact`; its state is as before afterwards
        settings: with the preload [force]
        stop: called after each step on all ranks; a text it returns, the same on all, ends the paths

    Raises:
        InputError: the contact is not exact, or the sides admit no motion in the direction
        ConvergenceError: a step does not converge
        Interrupted: `stop` has ended the paths

    Examples:
        >>> from asperity.quasistatic.slip_paths import solve_slip
        >>> from asperity.slip import SlipSettings
        >>> wave = asp.Surface.from_spec("sinusoid", L=1.0, amplitude=0.02)
        >>> size = asp.MeshSize(h_contact=0.3, h_max=0.6)
        >>> problem = asp.Problem.of(wave, asp.Material(E=1.0, nu=0.3), delta_max=0.02, steps=3, size=size)
        >>> result = asp.solve_contact(problem)
        >>> settings = SlipSettings(friction=0.3, amplitudes=(0.5,), preload=result.curve.force[-1], steps=1)
        >>> path = solve_slip(problem, result, settings)[0]
        >>> print(f"{path.force / (0.3 * settings.preload):.2f}", path.energy > 0.0)
        0.50 True
    """
    if settings.preload is None:
        raise InputError("slip.preload is missing: give the normal force on the patch")
    side, unit = problem.surface.L, problem.material.E * problem.surface.L**2
    paths = slip_paths(result.solver, replace(settings, preload=settings.preload / unit), stop)
    return tuple(path.scaled(unit, side) for path in paths)


def slip_paths(
    solver: ContactSolver, settings: SlipSettings, stop: Callable[[], str] | None = None
) -> tuple[SlipPath, ...]:
    """The same of a solver in an accepted state, in units of E and L; collective."""
    preload, steps = settings.preload, settings.steps
    assert preload is not None
    rigid = isinstance(solver.contact, Coulomb)
    if not isinstance(solver.contact, ActiveSet):
        raise InputError('slip.method = "solid" needs contact.method = "active-set"')
    check_motion(solver.solid.sides, settings.direction, rigid)
    found = []
    with as_before(solver):
        leg = Leg(solver, CLOSE_PRELOAD * preload, stop)
        leg.follow(preload, steps)
        refuse_wrong(solver.checks, None)
        solver.solid.kernels.restore(solver.history.copy())
        with solver.solid.kernels.holding():
            if rigid:
                sliding: Sliding = RigidSliding(solver, leg.slope, preload, settings.direction, stop)
            else:
                sliding = Sliding(solver, settings.friction, settings.direction, stop)
            try:
                for amplitude in settings.amplitudes:
                    sliding.reset()
                    found.append(sliding.path(amplitude, steps))
            finally:
                sliding.reset()
    return tuple(found)


class Sliding:
    """A flat that moves sideways on a solid, from its state at a preload.

    A plastic solid flows on in each step (backward Euler) unless its plastic strain is held. Its loops tend to the one
    with the plastic strain held, docs/slip.md. The committed history of the solver is that of its displacement; the
    direction of the motion is in degrees; `stop` gives the reason to stop, empty for none, and is collective.

    Attributes:
        delta, force: displacement of the flat [L] and tangential force [E L^2] after the last accepted step
        k_rest: stiffness before any slip [E L]
        limit: force at which all nodes slip [E L^2]
    """

    _flat: StickSlip  # the nodes on the flat
    limit: float

    def __init__(
        self, solver: ContactSolver, friction: float, direction: float = 0.0, stop: Callable[[], str] | None = None
    ) -> None:
        self._solver, self._solid, self._stop, self._friction = solver, solver.solid, stop, friction
        self._axis = np.array([cos(radians(direction)), sin(radians(direction))])
        solver.roll_back()
        self._begin()
        self._origin, self._history = self._flat.origin, self._solid.kernels.history().copy()
        self._at_rest = solver.state().displacement, self.solved_force()
        self.reset()
        move = LIGHT * friction * solver.delta
        try:
            stats = self._solve_at_rest(move)
            if not stats.converged:
                raise ConvergenceError(f"the tangential stiffness at rest was not found ({stats.reason})")
            self.k_rest = (self.solved_force() - self.force) / move
        finally:
            self.reset()

    def _begin(self) -> None:
        """Freeze the normal forces; collective."""
        solver, solid = self._solver, self._solid
        fixed = mirrored(solid, int(abs(self._axis[1]) > abs(self._axis[0])))
        self._contact = FrozenFriction(solid, solver.contact_surface, solver.nodal_force.copy(), fixed)
        self._flat = self._contact.sliding
        self.limit = self._friction * float(solid.comm.allreduce(float(self._contact.normal.sum())))
        options = replace(solver.newton.options, rtol=max(RTOL, solver.newton.options.rtol))
        solver.drop_matrices()
        self._newton = NewtonSolver(solid, self._contact, options, fixed)

    def reset(self) -> None:
        """To rest."""
        self.delta = 0.0
        self._u, self.force = self._at_rest
        self._guide: tuple[float, Floats | float] = 0.0, 0.0  # the last move, and how it changed the displacement
        self._solid.kernels.restore(self._history.copy())
        self._flat.shift, self._flat.origin = 0.0 * self._axis, self._origin

    def _solve_at_rest(self, move: float) -> StepStats:
        """Solve with all nodes in contact stuck to the flat; collective."""
        self._flat.bounds = np.full(self._contact.normal.shape, inf)
        stats = self.solve(move)
        self._flat.bounds = self._friction * self._contact.normal
        return stats

    def path(self, amplitude: float, steps: int) -> SlipPath:
        """Move from the present state to an amplitude and around a loop; collective."""
        self._rows, goal = [(FIRST, self.delta, self.force, 0.0, 0.0)], amplitude * self.limit
        for self._leg, sign, count in ((FIRST, 1.0, steps), (DOWN, -1.0, 2 * steps), (UP, 1.0, 2 * steps)):
            Leg(self, CLOSE * goal, self._stop, self.k_rest, "slip").follow(sign * goal, count)
            if self._leg == FIRST:
                nodes = np.concatenate(self._solid.comm.allgather(self._flat.slips(self._origin)))
        leg, u, T, share, loss = np.array(self._rows).T
        path = SlipPath(amplitude, leg.astype(int), u, T, share, loss, nodes)
        logging.getLogger(__name__).info(
            "slip at %g mu P: k = %.5g E L, eta = %.4g; %d steps", amplitude, path.k_secant, path.eta, path.u.size - 1
        )
        return path

    def solve(self, delta: float) -> StepStats:
        """Solve with the flat at a displacement, from the accepted state, without committing; collective."""
        move, (before, change) = delta - self.delta, self._guide
        part = move / before if before * move > 0.0 else 0.0
        self._flat.shift = delta * self._axis
        stats = self._solve(self._u + part * change, abs(move), part)
        self._guide = (move, self._displacement() - self._u) if stats.converged else (0.0, 0.0)
        return stats

    def _solve(self, start: Floats, move: float, part: float) -> StepStats:
        """Solve from a displacement (owned, 3) [L] after a move [L], a part of the one before it in the same direction.

        Where the flat goes on, nodes slip on.
        """
        self._flat.begin(self._flat.stuck | (part == 0.0), move)
        self._newton.linear.forget()
        return self._newton.solve(start, move)

    def _displacement(self) -> Floats:
        return self._solid.u.x.array.reshape(-1, 3)[: self._solid.owned].copy()

    def solved_force(self) -> float:
        """Tangential force on the solid at the last solve [E L^2]; collective."""
        return float(self._solid.comm.allreduce(float((self._flat.traction @ self._axis).sum())))

    def commit(self, delta: float) -> None:
        """Commit the last solve, made with the flat at `delta`; collective."""
        self.delta, self.force = delta, self.solved_force()
        loss, slipping, touching = self._solid.comm.allreduce(self._flat.step()).tolist()
        self._keep()
        self._u = self._displacement()
        share = slipping / touching if touching > 0.0 else nan
        self._rows.append((self._leg, delta, self.force, share, self._rows[-1][-1] + loss))

    def _keep(self) -> None:
        self._solid.kernels.commit()
        self._flat.origin = self._flat.position()


class RigidSliding(Sliding):
    """A rigid flat with friction that moves sideways under a constant normal force: the pressures change.

    Of a solver with Coulomb friction, the normal force `preload` [E L^2], and its `slope` over the approach [E L].
    """

    def __init__(
        self, solver: ContactSolver, slope: float, preload: float, direction: float, stop: Callable[[], str] | None
    ) -> None:
        assert isinstance(solver.contact, Coulomb)
        self._slope, self._preload, self._coulomb = slope, preload, solver.contact
        self._sunk = 0.0  # by how much the last move changed the approach
        super().__init__(solver, solver.contact.friction, direction, stop)

    def _begin(self) -> None:
        self._flat, self.limit = self._coulomb.sliding, self._friction * self._preload
        self._before = self._solver.state()
        self._coulomb.residual(self._solid.internal_force())
        self._flat.origin = self._coulomb.held[:, :2]

    def reset(self) -> None:
        super().reset()
        self._coulomb.goes_on = False
        self._solver.restore(self._before)
        self._coulomb.commit()

    def _solve_at_rest(self, move: float) -> StepStats:
        return self.solve(move)

    def _solve(self, start: Floats, move: float, part: float) -> StepStats:
        """Solve at the approach of the preload, each trial from the one before."""
        solver = self._solver
        approach, self._coulomb.goes_on = solver.delta + part * self._sunk, part > 0.0
        before: tuple[float, float] | None = None
        for _ in range(TRIALS):
            stats, normal = solver.solve(approach, start), solver.solved_force()
            if not stats.converged:
                return stats
            lacking = self._preload - normal
            if abs(lacking) <= CLOSE * self._preload:
                self._sunk = approach - solver.delta
                return stats
            if before is not None:
                self._slope = max((normal - before[1]) / (approach - before[0]), 0.1 * self._slope)
            before, start, self._coulomb.goes_on = (approach, normal), self._displacement(), True
            approach += lacking / self._slope
        return replace(stats, converged=False, reason="the preload was not met")

    def _keep(self) -> None:
        self._solver.commit(self._solver.delta + self._sunk)
