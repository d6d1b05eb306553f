"""Loops of the force about a preload, each amplitude from the same state: the loss of plastic flow."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from math import isfinite
from typing import Any

from asperity.curve.loops import SETTLED, SHAKEN_DOWN, Loop, LoopTable
from asperity.errors import CheckError, ConvergenceError, InputError, Interrupted
from asperity.model.problem import Problem
from asperity.quasistatic.contact_result import ContactResult
from asperity.quasistatic.contact_solver import ContactSolver

CLOSE = 1e-4  # tolerance of the force at the ends of a leg, over the amplitude
ROUGHLY = 0.3  # the same of a step on the way, over the step
TRIALS = 25  # solves that look for a force
FIRST_SLOPE = 4.0  # of the first step, over the force over the approach
LARGEST_AMPLITUDE = 0.99  # of the force over the preload: the flat stays on


def solve_loops(
    problem: Problem,
    result: ContactResult,
    preload: float,
    amplitudes: Sequence[float],
    *,
    cycles: int = 4,
    steps: int = 4,
    stop: Callable[[], str] | None = None,
) -> LoopTable:
    """Loops of the force about a preload, from the state at the end of a load path, in physical units; collective.

    The flat goes from the present state to the preload, and from there for each amplitude up, down below it and
    back, until two loops are alike: the mean force is that of a dead preload, and the flat sinks as far as
    the loops make it. The path is integrated by backward Euler. A greater force before the preload is one that the
    contact has met.

    Args:
        problem: that was solved
        result: of `solve_contact`; its state is as before afterwards
        preload: mean force [force]
        amplitudes: of the force over the preload, in (0, 0.99]
        cycles: greatest number of loops of an amplitude
        steps: of a quarter of a loop, and of the way to the preload
        stop: called after each step on all ranks; a text it returns, the same on all, ends the loops

    Raises:
        InputError: an argument is outside its range
        ConvergenceError: a step does not converge
        Interrupted: `stop` has ended the loops
        CheckError: a step violates a balance

    Examples:
        >>> from asperity.quasistatic.force_loops import solve_loops
        >>> wave = asp.Surface.from_spec("sinusoid", L=1.0, amplitude=0.02)
        >>> solid = asp.Material(E=1.0, nu=0.3, yield_strength=0.005, tangent_modulus=0.05)
        >>> size = asp.MeshSize(h_contact=0.3, h_max=0.6)
        >>> problem = asp.Problem.of(wave, solid, delta_max=0.02, steps=3, size=size)
        >>> result = asp.solve_contact(problem)
        >>> loops = solve_loops(problem, result, preload=result.curve.force[-1], amplitudes=[0.2], steps=2)
        >>> loops.loops[0].eta > 100.0 * loops.loops[-1].eta  # isotropic hardening shakes down
        True
    """
    side, unit = problem.surface.L, problem.material.E * problem.surface.L**2
    loops = force_loops(result.solver, float(preload) / unit, amplitudes, cycles=cycles, steps=steps, stop=stop)
    return LoopTable.scaled(loops, unit, side)


def force_loops(
    solver: ContactSolver,
    preload: float,
    amplitudes: Sequence[float],
    *,
    cycles: int = 4,
    steps: int = 4,
    stop: Callable[[], str] | None = None,
) -> tuple[Loop, ...]:
    """The same of a solver in an accepted state, in units of E and L; collective."""
    if not (isfinite(preload) and preload > 0.0):
        raise InputError(f"preload = {preload:g} of the loops is not legal: it must be positive")
    for amplitude in amplitudes:
        if not 0.0 < amplitude <= LARGEST_AMPLITUDE:
            raise InputError(
                f"loops.amplitudes = {amplitude:g} must lie in (0, {LARGEST_AMPLITUDE:g}]: it is the force over the "
                "preload, and the flat must stay on"
            )
    if min(cycles, steps) < 1:
        raise InputError(f"loops.cycles = {cycles!r} and loops.steps = {steps!r} must be at least 1")
    found: list[Loop] = []
    with as_before(solver):
        Leg(solver, CLOSE * preload, stop).follow(preload, steps)
        for amplitude in amplitudes:
            with as_before(solver):
                leg = Leg(solver, CLOSE * amplitude * preload, stop)
                found += _loops_of(leg, preload, amplitude, cycles, steps)
        if solver.checks.violated:
            raise CheckError(f"the loops are wrong, do not use them: {'; '.join(solver.checks.violated.values())}")
    return tuple(found)


def _loops_of(leg: Leg, preload: float, amplitude: float, cycles: int, steps: int) -> Iterator[Loop]:
    """Loops of an amplitude until two are alike."""
    solver, before = leg.solver, None
    checks = solver.checks
    for number in range(1, cycles + 1):
        work, dissipated, stored = checks.work, checks.dissipated, checks.stored
        leg.follow(preload * (1.0 + amplitude), steps)
        high = solver.delta
        leg.follow(preload * (1.0 - amplitude), 2 * steps)
        low = solver.delta
        leg.follow(preload, steps)
        loop = Loop(
            amplitude, number, preload, low, high, checks.work - work, checks.dissipated - dissipated,
            checks.stored - stored,
        )  # fmt: skip
        logging.getLogger(__name__).info("loop %d, force %g of the preload: eta = %.4g", number, amplitude, loop.eta)
        yield loop
        if before is not None and abs(loop.eta - before) <= max(SETTLED * before, 0.1 * SHAKEN_DOWN):
            return
        before = loop.eta


@contextmanager
def as_before(solver: ContactSolver) -> Iterator[None]:
    """Run a block without probes and restore the state after it."""
    state, history = solver.state(), solver.solid.kernels.history().copy()
    probes, solver.probes = solver.probes, ()
    held = solver.contact.held
    try:
        yield
    finally:
        solver.probes, solver.contact.held = probes, held
        violated = solver.checks.violated
        solver.solid.kernels.restore(history)
        solver.restore(state)
        solver.checks.violated |= violated


class Leg:
    """Ways to given forces, in about equal steps of the force.

    Args:
        solver: a flat that moves in steps, a `ContactSolver` along z or a `Sliding` along x, by its attributes `delta`
            [L] and `force` [E L^2] and its methods `solve`, `solved_force` and `commit`
        close: tolerance of the force at the end of a way [E L^2]
        stop: gives the reason to stop, empty for none; collective
        slope: of the force at the beginning [E L], by default a guess for the approach of a flat
        section: of the case, for messages

    Attributes:
        slope: of the force, between the last two positions [E L]
    """

    def __init__(
        self, solver: Any, close: float, stop: Callable[[], str] | None, slope: float = 0.0, section: str = "loops"
    ) -> None:
        self.solver, self._close, self._stop, self.slope, self._section = solver, close, stop, slope, section

    def follow(self, goal: float, steps: int) -> None:
        """Move the flat to a force and commit each step; collective."""
        solver, start = self.solver, self.solver.force
        if self.slope == 0.0:
            self.slope = FIRST_SLOPE * max(start, goal) / max(solver.delta, 1e-3)
        for k in range(1, steps + 1):
            wanted = start + (goal - start) * k / steps
            if k < steps and (wanted - solver.force) * (goal - start) <= 0.0:
                continue  # the step before went as far
            tolerance = self._close if k == steps else max(ROUGHLY * abs(goal - start) / steps, self._close)
            if abs(wanted - solver.force) > tolerance:
                solver.commit(self.find(wanted, tolerance))
                reason = "" if self._stop is None else self._stop()
                if reason:
                    raise Interrupted(f"stopped by {reason} in the {self._section}; --resume computes them again")

    def find(self, wanted: float, tolerance: float) -> float:
        """Position of a force, the last solve being there; collective.

        Commits nothing, except where a step fails, from which the first one that converges is a step of its own.

        Args:
            wanted, tolerance: [E L^2]

        Raises:
            ConvergenceError: it is not found
        """
        solver, failed = self.solver, False
        before, force = solver.delta, solver.force
        target = before + (wanted - force) / self.slope
        for _ in range(TRIALS):
            stats = solver.solve(target)
            if not stats.converged:
                if target == solver.delta:
                    break
                target, failed = 0.5 * (target + solver.delta), True
                continue
            found = solver.solved_force()
            if found != force and target != before:
                self.slope = max((found - force) / (target - before), 0.1 * self.slope)
            if abs(found - wanted) <= tolerance:
                return target
            if failed and (wanted - found) * (found - solver.force) > 0.0:  # on the way
                solver.commit(target)
                failed = False
            before, force = target, found
            target += (wanted - found) / self.slope
        raise ConvergenceError(
            f"the {self._section} did not reach the force {wanted:.6g} E L^2 from the position {solver.delta:.6g} L "
            f"({stats.reason}): use more {self._section}.steps"
        )
