"""Paths of a flat that moves sideways on the solid under a constant normal load: micro-slip of two like bodies.

Each node keeps its normal force, and the plastic strain stays while the flat moves: the loop is the steady one of a
solid that has shaken down. It is the reference of the slip by the curve, see slip.py.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from math import inf
from typing import Any, NamedTuple

import numpy as np

from asperity.arrays import Floats, Integers
from asperity.contact.active_set import ActiveSet
from asperity.contact.contact_surface import ContactSurface
from asperity.contact.friction import StickSlip
from asperity.errors import ConvergenceError
from asperity.fem.solid import Solid
from asperity.model.problem import Problem
from asperity.quasistatic.contact_result import ContactResult
from asperity.quasistatic.contact_solver import ContactSolver
from asperity.quasistatic.newton import NewtonSolver, StepStats
from asperity.quasistatic.stiffness import mirrored
from asperity.slip import SlipSettings

CLOSE = 1e-3  # tolerance of the force at the end of a leg, over its amplitude
CLOSE_PRELOAD = 1e-4  # the same of the normal force
RTOL = 1e-6  # of the forces out of balance over the normal force; 1e-8 costs an iteration in six, and changes nothing
LIGHT = 0.01  # displacement that gives the stiffness at rest, over friction times the approach
TRIALS = 25  # solves that look for a force
LEGS = (1.0, 1), (-1.0, 2), (1.0, 2)  # side, and steps: first loading, to the opposite amplitude, and back


class Loop(NamedTuple):
    """Steady loop of the solid between opposite tangential forces, after a first loading from rest."""

    displacement: float  # amplitude, half of its range (length)
    force: float  # amplitude, half of its range (force)
    energy: float  # dissipated by friction (force length)


def solve_slip(problem: Problem, result: ContactResult, settings: SlipSettings) -> tuple[Loop, ...]:
    """Loops along x from the state at the end of a load path of exact contact without friction, in physical units.

    The flat goes from the present state to the preload [force] of the settings, and from rest to each amplitude of the
    tangential force and around one loop. The state of the result is as before afterwards.
    """
    solver, side, unit = result.solver, problem.surface.L, problem.material.E * problem.surface.L**2
    assert settings.preload is not None and isinstance(solver.contact, ActiveSet)
    kernels, found = solver.solid.kernels, []
    with at_preload(solver, settings.preload / unit):
        flowing, kernels._law = kernels._law, kernels._held
        sliding = Sliding(solver, settings.friction)
        for amplitude in settings.amplitudes:
            sliding.reset()
            u, force, energy = sliding.loop(amplitude)
            found.append(Loop(u * side, force * unit, energy * unit * side))
        kernels._law = flowing
    return tuple(found)


@contextmanager
def at_preload(solver: ContactSolver, preload: float) -> Iterator[None]:
    """Run a block at a force [E L^2] and restore the state after it."""
    state, history = solver.state(), solver.solid.kernels.history().copy()
    probes, solver.probes = solver.probes, ()
    slope = 4.0 * max(solver.force, preload) / max(solver.delta, 1e-3)
    follow(solver, preload, 1, CLOSE_PRELOAD * preload, slope)
    solver.solid.kernels.restore(solver.history.copy())
    yield
    solver.probes = probes
    solver.solid.kernels.restore(history)
    solver.restore(state)


def follow(flat: Any, goal: float, steps: int, close: float, slope: float) -> None:
    """Move a flat to a force in equal steps of the force, by the secant method, and commit each step.

    Args:
        flat: a `ContactSolver` along z or a `Sliding` along x
        close: tolerance of the force [E L^2]
        slope: of the force, at the beginning [E L]
    """
    begun = flat.force
    for wanted in np.linspace(begun, goal, steps + 1)[1:]:
        before, force, target = flat.delta, flat.force, flat.delta + (wanted - flat.force) / slope
        if abs(wanted - force) <= close:
            continue
        for _ in range(TRIALS):
            if not flat.solve(target).converged:
                target = 0.5 * (target + flat.delta)
                continue
            found = flat.solved_force()
            if found != force and target != before:
                slope = max((found - force) / (target - before), 0.1 * slope)
            if abs(found - wanted) <= close:
                break
            before, force = target, found
            target += (wanted - found) / slope
        else:
            raise ConvergenceError(f"the force {wanted:.6g} E L^2 was not reached")
        flat.commit(target)


class FrozenFriction:
    """Nodes under constant normal forces on a flat that moves sideways, free along z.

    The tangential tractions of like bodies do not change their pressures (Dundurs' constant is zero). A step minimises
    the convex energy + sum of mu N_i |s_i|, s_i the slip of a node on the flat, see `StickSlip`.

    Args:
        solid: at rest under the normal forces
        surface: of the solid
        normal: normal force of the owned nodes (owned,) [E L^2]
        fixed: owned dofs without displacement

    Attributes:
        sliding: the nodes in contact, at rest on the flat; their bounds are given from outside
        normal: their normal forces (n,) [E L^2]
    """

    symmetric = True
    has_tangent = True

    def __init__(self, solid: Solid, surface: ContactSurface, normal: Floats, fixed: Integers) -> None:
        self._normal = normal
        self._resting = solid.internal_force().copy()  # stays as an external force
        nodes = surface.owned_nodes[normal[surface.owned_nodes] > 0.0]
        self.normal = normal[nodes]
        self.sliding = StickSlip(solid, nodes, fixed)
        self.sliding.origin = self.sliding.position()

    def residual(self, force: Floats) -> tuple[Floats, Integers, Floats]:
        r = force - self._resting
        return r, *self.sliding.residual(r)

    def add_tangent(self) -> None:
        self.sliding.add_tangent()

    def nodal_force(self, force: Floats) -> Floats:
        return self._normal

    def work(self) -> float:
        """Work of friction in the step, the part of this rank [E L^3]."""
        flat, loose = self.sliding, ~self.sliding.stuck
        return float(flat.bounds[loose] @ np.linalg.norm(flat.slip()[loose], axis=1))


class Sliding:
    """A flat that moves along x on a solid, from its state at a preload.

    A plastic solid flows on in each step (backward Euler) unless its plastic strain is held. Its loops tend to the one
    with the plastic strain held.

    Attributes:
        delta, force: displacement of the flat [L] and tangential force [E L^2] after the last accepted step
        k_rest: stiffness before any slip [E L]
        limit: force at which all nodes slip [E L^2]
    """

    def __init__(self, solver: ContactSolver, friction: float) -> None:
        self._solid = solid = solver.solid
        solver.roll_back()
        fixed = mirrored(solid, 0)
        self._contact = FrozenFriction(solid, solver.contact_surface, solver.nodal_force.copy(), fixed)
        self._flat, bounds = self._contact.sliding, friction * self._contact.normal
        self.limit = float(solid.comm.allreduce(float(bounds.sum())))
        solver.drop_matrices()
        options = replace(solver.newton.options, rtol=max(RTOL, solver.newton.options.rtol))
        self._newton = NewtonSolver(solid, self._contact, options, fixed)
        self._origin, self._history = self._flat.origin, solid.kernels.history().copy()
        self._at_rest = solver.state().displacement, self.solved_force()
        self.reset()
        move = LIGHT * friction * solver.delta
        self._flat.bounds = np.full(bounds.shape, inf)
        stats = self.solve(move)
        self._flat.bounds = bounds
        if not stats.converged:
            raise ConvergenceError(f"the tangential stiffness at rest was not found ({stats.reason})")
        self.k_rest = (self.solved_force() - self.force) / move
        self.reset()

    def reset(self) -> None:
        """To rest."""
        self.delta = self._loss = 0.0
        self._u, self.force = self._at_rest
        self._guide: tuple[float, Floats | float] = 0.0, 0.0  # the last move, and how it changed the displacement
        self._solid.kernels.restore(self._history.copy())
        self._flat.shift, self._flat.origin = np.zeros(2), self._origin

    def loop(self, amplitude: float) -> Loop:
        """Move from the present state to an amplitude over the limit and around a loop [L, E L^2, E L^3]."""
        goal, ends = amplitude * self.limit, []
        for sign, steps in LEGS:
            follow(self, sign * goal, steps, CLOSE * goal, self.k_rest)
            ends.append((self.delta, self.force, self._loss))
        (_, _, begun), (low, down, _), (high, up, lost) = ends
        return Loop((high - low) / 2.0, (up - down) / 2.0, lost - begun)

    def solve(self, delta: float) -> StepStats:
        """Solve with the flat at a displacement, from the accepted state, without committing.

        Where the flat goes on, nodes slip on.
        """
        move, (before, change) = delta - self.delta, self._guide
        part = move / before if before * move > 0.0 else 0.0
        self._flat.shift = np.array([delta, 0.0])
        self._flat.begin(self._flat.stuck | (part == 0.0), abs(move))
        self._newton.linear.forget()
        stats = self._newton.solve(self._u + part * change, abs(move))
        self._guide = (move, self._displacement() - self._u) if stats.converged else (0.0, 0.0)
        return stats

    def _displacement(self) -> Floats:
        return self._solid.u.x.array.reshape(-1, 3)[: self._solid.owned].copy()

    def solved_force(self) -> float:
        """Tangential force on the solid at the last solve [E L^2]."""
        return float(self._solid.comm.allreduce(float(self._flat.traction[:, 0].sum())))

    def commit(self, delta: float) -> None:
        """Commit the last solve, made with the flat at `delta`."""
        self.delta, self.force = delta, self.solved_force()
        self._loss += self._solid.comm.allreduce(self._contact.work())
        self._solid.kernels.commit()
        self._flat.origin, self._u = self._flat.position(), self._displacement()
