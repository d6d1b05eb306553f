"""Paths of a flat that moves sideways on the solid under a constant normal load: micro-slip of two like bodies."""

from __future__ import annotations

import logging
from collections.abc import Callable
from dataclasses import dataclass, replace
from math import cos, inf, isfinite, nan, radians, sin

import numpy as np

from asperity.arrays import Floats
from asperity.contact.active_set import ActiveSet
from asperity.contact.coulomb import Coulomb
from asperity.contact.friction import FrozenFriction, StickSlip
from asperity.errors import ConvergenceError, InputError
from asperity.model.kinds import refuse
from asperity.model.problem import Problem
from asperity.quasistatic.contact_result import ContactResult
from asperity.quasistatic.contact_solver import ContactSolver
from asperity.quasistatic.force_loops import CLOSE as CLOSE_PRELOAD
from asperity.quasistatic.force_loops import Leg, aims, as_before, end_if_stopped
from asperity.quasistatic.newton import NewtonSolver
from asperity.quasistatic.stiffness import mirrored
from asperity.slip.path import DOWN, FIRST, UP, SlipPath
from asperity.slip.settings import SlipSettings, wrong_motion

CLOSE = 1e-3  # tolerance of the force at the end of a leg, over its amplitude
TRIALS = 25  # solves that look for a force
RTOL = 1e-6  # of the forces out of balance over the normal force; 1e-8 costs an iteration in six, and changes nothing
LIGHT = 0.01  # displacement that gives the stiffness at rest, over friction times the approach


def solve_slip(
    problem: Problem, result: ContactResult, settings: SlipSettings, stop: Callable[[], str] | None = None
) -> tuple[SlipPath, ...]:
    """Paths of a flat that moves sideways, from the state at the end of a load path, in physical units; collective.

    Args:
        problem: that was solved
        result: of `solve_problem`; its state is as before afterwards
        settings: with the preload [force]
        stop: see `slip_paths`, whose errors are raised

    Examples:
        >>> from asperity.quasistatic.slip_paths import solve_slip
        >>> from asperity.slip import SlipSettings
        >>> wave = asp.Surface.from_spec("sinusoid", L=1.0, amplitude=0.02)
        >>> size = asp.MeshSize(h_contact=0.3, h_max=0.6)
        >>> problem = asp.Problem.of(wave, asp.Material(E=1.0, nu=0.3), delta_max=0.02, steps=3, size=size)
        >>> result = asp.solve_problem(problem)
        >>> settings = SlipSettings(friction=0.3, amplitudes=(0.5,), preload=result.curve.force[-1], steps=1)
        >>> path = solve_slip(problem, result, settings)[0]
        >>> print(f"{path.force / (0.3 * settings.preload):.2f}", path.energy > 0.0)
        0.50 True
    """
    if settings.preload is None:
        raise InputError("slip.preload is missing: give the normal force on the patch")
    side, E = problem.surface.L, problem.material.E
    paths = slip_paths(result.solver, replace(settings, preload=settings.preload / (E * side**2)), stop)
    return tuple(path.scaled(E * side**2, side) for path in paths)


def slip_paths(
    solver: ContactSolver, settings: SlipSettings, stop: Callable[[], str] | None = None
) -> tuple[SlipPath, ...]:
    """Paths of a flat that moves sideways; the state of the solver is as before afterwards; collective.

    The flat goes from the present state to the preload. There the normal forces of the nodes of like bodies stay, and
    for each amplitude the flat moves from rest to the amplitude of the tangential force and around one loop. The
    plastic strain stays: the loop is the steady one of a solid that has shaken down, see `Sliding`.

    Args:
        solver: in an accepted state, of exact contact; with friction it is one body on a rigid flat
        settings: with the preload [E L^2]
        stop: called after each step on all ranks; a text it returns, the same on all, ends the paths

    Raises:
        InputError: the contact is not exact, or the sides admit no motion in the direction
        ConvergenceError: a step does not converge
        Interrupted: `stop` has ended the paths
    """
    preload, steps = settings.preload, settings.steps
    assert preload is not None
    rigid = isinstance(solver.contact, Coulomb)
    if not isinstance(solver.contact, ActiveSet):
        raise InputError('slip.method = "solid" needs contact.method = "active-set"')
    refuse(wrong_motion(solver.solid.sides, settings.direction, rigid))
    found = []
    with as_before(solver):
        leg = Leg(solver, CLOSE_PRELOAD * preload, stop)
        leg.follow(preload, steps)
        solver.solid.kernels.restore(solver.history.copy())
        with solver.solid.kernels.holding():
            if rigid:
                sliding: Sliding = RigidSliding(solver, leg, preload, settings.direction, stop)
            else:
                sliding = Sliding(solver, settings.friction, settings.direction, stop)
            try:
                for amplitude in settings.amplitudes:
                    sliding.reset()
                    found.append(sliding.path(amplitude, steps))
            finally:
                sliding.reset()
    return tuple(found)


@dataclass(frozen=True)
class _State:
    """State between two steps: displacement (owned, 3), flat, force, loss by friction, share that slips."""

    displacement: Floats
    at: float
    force: float
    dissipated: float
    slipping: float


class Sliding:
    """A flat that moves sideways on a solid, from its state at a preload.

    A plastic solid flows on in each step (backward Euler) unless its plastic strain is held. Its loops tend to the one
    with the plastic strain held, docs/slip.md.

    Args:
        solver: at the preload, its committed history that of its displacement
        friction: Coulomb's coefficient
        direction: of the motion [degrees]
        stop: gives the reason to stop, empty for none; collective

    Attributes:
        k_rest: stiffness before any slip [E L]
        limit: force at which all nodes slip [E L^2]
    """

    _flat: StickSlip  # the nodes on the flat
    limit: float

    def __init__(
        self, solver: ContactSolver, friction: float, direction: float = 0.0, stop: Callable[[], str] | None = None
    ) -> None:
        self._solver, self._solid, self._stop, self._friction = solver, solver.solid, stop, friction
        angle = radians(direction)
        self._axis = np.array([cos(angle), sin(angle)])
        solver.roll_back()
        self._begin()
        self._origin, self._history = self._flat.origin, self._solid.kernels.history().copy()
        self._rest = _State(solver.state().displacement, 0.0, self._force(), 0.0, 0.0)
        self.reset()
        self.k_rest = self._stiffness_at_rest(LIGHT * friction * solver.delta)

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
        self._accepted = self._rest
        self._guide: tuple[float, Floats] | None = None  # a move from the accepted state, or to it, and what it changes
        self._solid.kernels.restore(self._history.copy())
        self._flat.shift, self._flat.origin = 0.0 * self._axis, self._origin

    def _stiffness_at_rest(self, move: float) -> float:
        """Tangential stiffness with all nodes in contact stuck to the flat [E L]; collective."""
        self._flat.bounds = np.full(self._contact.normal.shape, inf)
        force = self.solve(move)
        self._flat.bounds = self._friction * self._contact.normal
        return force / move

    def _force(self) -> float:
        """Tangential force on the solid at the last solve [E L^2]; collective."""
        return float(self._solid.comm.allreduce(float((self._flat.traction @ self._axis).sum())))

    def path(self, amplitude: float, steps: int) -> SlipPath:
        """Move from the present state to an amplitude and around a loop; collective."""
        rows = [(FIRST, state) for state in (self._accepted, *self._follow(amplitude * self.limit, steps))]
        nodes = np.concatenate(self._solid.comm.allgather(self._flat.slips(self._origin)))
        for leg, sign in ((DOWN, -1.0), (UP, 1.0)):
            rows += [(leg, state) for state in self._follow(sign * amplitude * self.limit, 2 * steps)]
        columns = np.array([(leg, s.at, s.force, s.slipping, s.dissipated) for leg, s in rows]).T
        u, T, share, loss = columns[1:]
        path = SlipPath(amplitude, columns[0].astype(int), u, T, share, loss, nodes)
        logging.getLogger(__name__).info(
            "slip at %g mu P: k = %.5g E L, eta = %.4g; %d steps", amplitude, path.k_secant, path.eta, path.u.size - 1
        )
        return path

    def _follow(self, goal: float, steps: int) -> list[_State]:
        """Move to a force in about equal steps of it; collective."""
        states, slope = [], self.k_rest
        for wanted, tolerance in aims(lambda: self._accepted.force, goal, steps, CLOSE * abs(goal)):
            slope = self._step_to(wanted, tolerance, slope)
            states.append(self._accepted)
            end_if_stopped(self._stop, "paths of slip")
        return states

    def _step_to(self, wanted: float, tolerance: float, slope: float) -> float:
        """Find and accept the position of a force; returns the slope from the accepted state to it; collective."""
        here = self._accepted
        low, high = here.at, nan  # positions below and above the wanted force, on the way
        force_low, force_high = here.force, nan
        sign = 1.0 if wanted > here.force else -1.0
        target, failed = here.at + (wanted - here.force) / slope, False
        for _ in range(TRIALS):
            try:
                force = self.solve(target)
            except ConvergenceError as error:
                reason, target, failed = str(error), 0.5 * (low + target), True
                continue
            reason = "after many trials"
            if abs(force - wanted) <= tolerance:
                self._accept(target, force)
                return (force - here.force) / (target - here.at)
            secant = (force - here.force) / (target - here.at)
            if sign * (wanted - force) > 0.0:
                low, force_low = target, force
                if failed:  # go on from here
                    self._accept(target, force)
                    here, failed = self._accepted, False
            else:
                high, force_high = target, force
            if isfinite(high):  # between both, where the force is concave the chord falls short
                target = low + (high - low) * (wanted - force_low) / (force_high - force_low)
            else:
                target = low + 1.5 * (wanted - force_low) / secant
        raise ConvergenceError(
            f"the slip did not reach the tangential force {wanted:.6g} E L^2 from the displacement {here.at:.6g} L "
            f"({reason}): use more slip.steps"
        )

    def solve(self, target: float) -> float:
        """Tangential force with the flat at a position, from the accepted state [E L^2]; collective.

        Raises:
            ConvergenceError: it is not found
        """
        here, solid = self._accepted, self._solid
        move, start = target - here.at, here.displacement
        guide = self._guide if self._guide is not None and self._guide[0] * move > 0.0 else None
        if guide is not None:
            start = start + guide[1] * (move / guide[0])
        self._flat.shift = target * self._axis
        self._flat.begin(self._flat.stuck | (guide is None), abs(move))  # where the flat goes on, nodes slip on
        self._newton.linear.forget()
        stats = self._newton.solve(start, abs(move))
        if not stats.converged:
            raise ConvergenceError(f"stick and slip were not found: {stats.reason}")
        self._guide = move, solid.u.x.array.reshape(-1, 3)[: solid.owned] - here.displacement
        return self._force()

    def _accept(self, target: float, force: float) -> None:
        """Commit the last solve; collective."""
        loss, slipping, touching = self._solid.comm.allreduce(self._flat.step()).tolist()
        self._commit()
        displacement = self._solid.u.x.array.reshape(-1, 3)[: self._solid.owned].copy()
        share = slipping / touching if touching > 0.0 else nan
        self._accepted = _State(displacement, target, force, self._accepted.dissipated + loss, share)

    def _commit(self) -> None:
        self._solid.kernels.commit()
        self._flat.origin = self._flat.position()


class RigidSliding(Sliding):
    """A rigid flat with friction that moves sideways under a constant normal force: the pressures change.

    Args:
        solver: at the preload, of Coulomb friction, its committed history that of its displacement
        leg: that led there
        preload: normal force [E L^2]
        direction, stop: see `Sliding`
    """

    def __init__(
        self, solver: ContactSolver, leg: Leg, preload: float, direction: float, stop: Callable[[], str] | None
    ) -> None:
        assert isinstance(solver.contact, Coulomb)
        self._leg, self._preload, self._coulomb = leg, preload, solver.contact
        super().__init__(solver, solver.contact.friction, direction, stop)

    def _begin(self) -> None:
        self._flat, self.limit = self._coulomb.sliding, self._friction * self._preload
        self._before = self._solver.state()
        self._coulomb.residual(self._solid.internal_force())
        self._flat.origin = self._coulomb.held[:, :2]

    def reset(self) -> None:
        super().reset()
        self._solver.restore(self._before)
        self._coulomb.commit()

    def _stiffness_at_rest(self, move: float) -> float:
        return (self.solve(move) - self._rest.force) / move

    def solve(self, target: float) -> float:
        self._flat.shift = target * self._axis
        self._solver.forget()
        self._found = self._leg.find(self._preload, CLOSE * self._preload, self._solver.delta)
        return self._force()

    def _commit(self) -> None:
        self._solver.commit(self._found)
