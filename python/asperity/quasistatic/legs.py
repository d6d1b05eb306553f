"""Legs of a load path: how each plans its steps, to an approach or to a force, and finds a force."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from asperity.errors import ConvergenceError
from asperity.model.load_path import MIDPOINT, Schedule
from asperity.quasistatic.contact_solver import ContactSolver
from asperity.quasistatic.newton import StepStats, illinois

DEEP, FAR = 0.1, 100.0  # beyond this approach [L], a force more than so many L ahead counts as unreachable
SMALLEST_CUT = 1.0 / 256  # smallest part of a planned step before a run stops
GROWTH = 2.0  # a step is at most so many times as long as the one before in the same leg
FIRST_MOVE = 1e-3  # first step of a loading from first touch to a given force [L]
STEEP = 4.0  # guess of the slope at which a contact unloads or reloads, over the force over the approach
FORCE_TOLERANCE, TRIALS = 1e-6, 40  # relative, of the greatest force; and solves in which it is found
AHEAD = 2.0  # planned steps of the force in one step, from which on a first step is shortened

Point = tuple[float, float]  # of a function: argument and value


@dataclass(frozen=True)
class Position:
    """Position on the load path between two accepted steps.

    Together with the state of the solver it determines all later steps. Approaches in L, forces in E L^2.
    """

    leg: int = 0  # number of finished loadings and unloadings
    start: Sequence[float] | None = None  # approach and force at the beginning of this leg; None before
    target: int = 0  # number of planned steps of this leg that are reached
    done: float = 0.0  # part of this leg that is done
    step: float = 0.0  # length of the next step, of a planned leg the part of the leg; 0 lifts the flat off
    shortest: float = 0.0  # below it the run stops
    history: float | None = None  # approach of the committed history where the midpoint rule extrapolates it


@dataclass(frozen=True)
class Trial:
    """A solve of a step."""

    delta: float  # approach [L]
    stats: StepStats
    step: float  # length that was tried
    length: float  # and that was made, shorter at the end of a leg
    done: float = 0.0  # see `Position`, of a planned leg


@dataclass(frozen=True)
class Planned:
    """Leg in planned parts of the way, to an approach or in time to a force; a cut step grows again to the next stop.

    A force in time changes at a constant rate or is held: each step is searched for its force.
    """

    branch: str  # as in the curve
    start: Sequence[float]  # approach [L] and force [E L^2] at its beginning
    goal: float  # approach at its end [L], or force [E L^2]
    by_force: bool
    stops: tuple[float, ...]  # ends of all parts of the way, in (0, 1]
    midpoint: bool  # whether the history is extrapolated
    begins: float = 0.0  # time at its beginning [s]
    duration: float = 0.0  # [s]

    @property
    def up(self) -> float:
        """1, 0 or -1."""
        return {"unload": -1.0, "hold": 0.0}.get(self.branch, 1.0)

    @property
    def where(self) -> str:
        """Words for a message."""
        return f" in the {self.branch} to a force in time" if self.by_force else ""

    def lifts(self, at: Position) -> bool:
        """Whether the next step lifts the flat off."""
        return self.by_force and self.goal == 0.0 and self.up < 0.0 and at.target == len(self.stops) - 1

    def first(self, at: Position) -> Position:
        """Plan the first step."""
        return self._next(replace(at, start=self.start), 0)

    def _next(self, at: Position, target: int) -> Position:
        """Plan the step to a stop, by its number."""
        return replace(at, target=target, step=self._whole(target), shortest=SMALLEST_CUT * self._whole(target))

    def _whole(self, target: int) -> float:
        """Length of the planned step to a stop."""
        return self.stops[target] - (self.stops[target - 1] if target else 0.0)

    def _end(self, at: Position, step: float) -> float:
        """End of a step; a remainder slightly longer than the step is a part of it."""
        stop = self.stops[at.target]
        return stop if stop - at.done <= 1.001 * step else at.done + step

    def _at(self, part: float) -> float:
        """Approach or force after a part of the way."""
        start = self.start[self.by_force]
        return start + (self.goal - start) * part

    def solve(self, solver: ContactSolver, at: Position, step: float) -> Trial:
        """Try a step; commits nothing."""
        end = self._end(at, step)
        solver.solid.kernels.dt = self.duration * (end - at.done)
        delta = wanted = self._at(end)
        if self.by_force:
            delta, stats = at_force(solver, wanted, FORCE_TOLERANCE * max(self.goal, self.start[1]))
        else:
            stats = solver.solve(delta)
        return Trial(delta, stats, step, end - at.done, end)

    def after(self, at: Position, solver: ContactSolver, trial: Trial) -> tuple[Position, float | None]:
        """Position after a solve, and the approach of the one that follows in the leg, None where it is unknown."""
        if self.stops[at.target] - trial.done > 1e-12:
            after = replace(at, done=trial.done, step=min(self._whole(at.target), GROWTH * trial.step))
        elif at.target + 1 < len(self.stops):
            after = self._next(replace(at, done=trial.done), at.target + 1)
        else:
            return Position(at.leg + 1), None
        return after, None if self.by_force else self._at(self._end(after, after.step))


def at_force(
    solver: ContactSolver, wanted: float, close: float, ends: tuple[Point, Point] | None = None
) -> tuple[float, StepStats]:
    """Find the approach [L] of a force [E L^2]; commits nothing.

    Args:
        close: tolerance of the force [E L^2]
        ends: two approaches and the excess of their forces, of unlike signs. Without them the first solve is at the
            approach of before, where the force of a step in time may fall, and secants follow
    """
    stats, start = StepStats(False, "the force is not found", 0, 0), None

    def excess(delta: float) -> float:
        nonlocal stats, start
        stats = solver.solve(delta, start)
        start = solver.solid.u.x.array.reshape(-1, 3)[: solver.solid.owned].copy() if stats.converged else None
        return solver.solved_force() - wanted if stats.converged else np.nan

    if ends is None:
        delta, force = solver.delta, solver.force
        found, slope = excess(delta), STEEP * force / delta if force > 0.0 and delta > 0.0 else wanted / FIRST_MOVE
        for _ in range(TRIALS):
            if not abs(found) > close:
                return delta, stats
            here, before, delta = delta, found, delta - found / slope
            found = excess(delta)
            if found * before < 0.0:
                ends = (here, before), (delta, found)
                break
            # at most four times as far, and on where the flat touches nothing yet
            slope = max((found - before) / (delta - here), 0.25 * abs(found) / abs(delta - here))
        else:
            return delta, replace(stats, converged=False, reason="the force is not found")
    return illinois(excess, *ends, close, TRIALS), stats


@dataclass(frozen=True)
class ToForce:
    """Leg to a force, up or down, in about equal steps of force.

    A step moves the flat by the planned force over the slope of the step before and accepts the resulting force. The
    last one ends at the force, which is searched, or lifts the flat off: that gives the residual indentation exactly.
    A slope falls along an unloading, whose steps therefore aim at the planned forces. For the rest see `Planned`.
    """

    branch: str
    start: Sequence[float]
    goal: float  # force at its end [E L^2]
    steps: int
    midpoint: bool
    begins = duration = 0.0

    @property
    def up(self) -> float:
        """1 or -1."""
        return -1.0 if self.branch == "unload" else 1.0

    @property
    def where(self) -> str:
        """Words for a message."""
        return f" on the way to the {'greatest force' if self.up > 0.0 else 'end of the unloading'}"

    @property
    def close(self) -> float:
        """Tolerance of the force at the end [E L^2]."""
        return FORCE_TOLERANCE * max(self.goal, self.start[1])

    @property
    def _planned(self) -> float:
        """Force of a step [E L^2]."""
        return abs(self.goal - self.start[1]) / self.steps

    def first(self, at: Position) -> Position:
        """Plan the first step, with the guess of a slope; that of a first contact is unknown."""
        delta, force = self.start
        step = self._planned * delta / (STEEP * force) if force > 0.0 else FIRST_MOVE
        if self.goal == 0.0 and (self.steps == 1 or force <= 0.0):
            step = 0.0
        return replace(at, start=self.start, target=1, step=step, shortest=SMALLEST_CUT * step)

    def lifts(self, at: Position) -> bool:
        """Whether the next step lifts the flat off."""
        return self.goal == 0.0 and at.step == 0.0

    def solve(self, solver: ContactSolver, at: Position, step: float) -> Trial:
        """Try a step; commits nothing."""
        while True:
            delta = solver.delta + self.up * step
            stats = solver.solve(delta)
            if not stats.converged or (shorter := self._shorter(solver, step)) == step:
                break
            step = shorter
        if stats.converged:
            delta, stats = self._found(solver, delta, stats)
        return Trial(delta, stats, step, abs(delta - solver.delta))

    def _shorter(self, solver: ContactSolver, step: float) -> float:
        """Length of a first step whose solve gave far more than the planned force; else `step`."""
        if solver.force > 0.0 and solver.delta != self.start[0]:
            return step
        ahead = self.up * (solver.solved_force() - solver.force) / max(self._planned, self.close)
        if ahead <= AHEAD:
            return step
        # the force of a first contact grows as the power 3/2
        return float(step * ahead ** (-2.0 / 3.0 if solver.force == 0.0 else -1.0))

    def _found(self, solver: ContactSolver, target: float, stats: StepStats) -> tuple[float, StepStats]:
        """The solve at `target`, or where it is beyond the end of the leg, one at the end; commits nothing."""
        beyond = solver.solved_force() - self.goal
        if self.goal == 0.0 or self.up * beyond <= self.close:
            return target, stats

        return at_force(solver, self.goal, self.close, ((solver.delta, solver.force - self.goal), (target, beyond)))

    def after(self, at: Position, solver: ContactSolver, trial: Trial) -> tuple[Position, float | None]:
        """Position after a solve, and the approach of the one that follows in the leg.

        Raises:
            ConvergenceError: the force cannot be reached
        """
        force, target, step = solver.solved_force(), trial.delta, trial.step
        left = self.up * (self.goal - force)
        if self.goal > 0.0 and left <= self.close:
            return Position(at.leg + 1), None
        slope = self.up * (force - solver.force) / step
        if self.up > 0.0 and target > DEEP and left > FAR * slope:
            raise ConvergenceError(
                f"the greatest force cannot be reached: at delta/L = {target:.3g} the force is {force / self.goal:.2g} "
                f"of it and hardly rises: lower loading.force_max or pressure_max, or give delta_max"
            )
        number, wanted = self._following(at.target + int(step == at.step), force)
        longest = GROWTH * step if self.up > 0.0 or step < at.step else np.inf
        whole = 0.0
        if wanted > 0.0:
            whole = wanted / slope if slope > 0.0 else GROWTH * step
        shortest = min(at.shortest, SMALLEST_CUT * whole)
        done = (force - self.start[1]) / (self.goal - self.start[1])
        after = replace(at, target=number, done=done, step=min(whole, longest), shortest=shortest)
        # the next solve may find the end before a whole step
        return after, target + self.up * (min(after.step, left / slope) if slope > 0.0 else after.step)

    def _following(self, number: int, force: float) -> tuple[int, float]:
        """Number of the planned force to aim at, from `number` on, and how far away it is; 0 lifts the flat off."""
        planned = self._planned
        if self.up > 0.0:
            return number, planned
        for k in range(number, self.steps):
            left = force - self.start[1] + k * planned
            if left >= 0.5 * planned and (self.goal > 0.0 or force >= 0.25 * planned):
                return k, left
        return self.steps, planned if self.goal > 0.0 else 0.0


Leg = Planned | ToForce


def leg_of(solver: ContactSolver, schedule: Schedule, at: Position) -> Leg:
    """The leg of a position."""
    branch, n = schedule.legs[at.leg]
    start, midpoint = at.start or (solver.delta, solver.force), schedule.integrator == MIDPOINT
    by_force = branch == "unload" or schedule.delta_max is None
    goal = schedule.delta_max or 0.0
    if branch == "hold":
        goal = start[by_force]
    elif branch == "unload":
        goal = schedule.unload_to * start[1]
    elif schedule.force_max is not None:
        goal = schedule.force_max * solver.solid.material.reduced_modulus
    if by_force and schedule.duration is None:
        unloads = branch == "unload"
        return ToForce(branch, start, goal, n if unloads else n * schedule.substeps, midpoint and not unloads)
    begins = sum(schedule.seconds(name) for name, _ in schedule.legs[: at.leg])
    stops = tuple(schedule.stops(branch))
    return Planned(branch, start, goal, by_force, stops, midpoint, begins, schedule.seconds(branch))
