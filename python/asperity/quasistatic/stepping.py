"""The load path: legs to an approach or a force, their steps, cut where they fail, and the record of all steps."""

from __future__ import annotations

import logging
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from time import perf_counter
from typing import Any

import numpy as np

from asperity.curve import DIMENSIONS, Curve
from asperity.errors import ConvergenceError
from asperity.linear.petsc import LinearFailure
from asperity.model.load_path import MIDPOINT, Schedule
from asperity.quasistatic import measures
from asperity.quasistatic.contact_solver import ContactSolver
from asperity.quasistatic.measures import Snapshot
from asperity.quasistatic.newton import StepStats, illinois

DEEP, FAR = 0.1, 100.0  # beyond this approach [L], a force more than so many L ahead counts as unreachable
SMALLEST_CUT = 1.0 / 256  # smallest part of a planned step before a run stops
GROWTH = 2.0  # a step is at most so many times as long as the one before in the same leg
FIRST_MOVE = 1e-3  # first step of a loading from first touch to a given force [L]
STEEP = 4.0  # guess of the slope at which a contact unloads or reloads, over the force over the approach
FORCE_TOLERANCE, TRIALS = 1e-6, 40  # relative, of the greatest force; and solves in which it is found
AHEAD = 2.0  # planned steps of the force in one step, from which on a first step is shortened
GREATEST_LEAD = 2.0  # of the midpoint rule, where a step is twice as long as the one before


@dataclass(frozen=True)
class Position:
    """Position on the load path between two accepted steps.

    Together with the state of the solver it determines all later steps. Approaches in L, forces in E L^2.
    """

    leg: int = 0  # number of finished loadings and unloadings
    start: Sequence[float] | None = None  # approach and force at the beginning of this leg; None before
    target: int = 0  # number of planned steps of this leg that are reached
    done: float = 0.0  # part of this leg that is done, of a leg in parts
    step: float = 0.0  # length of the next step, of a leg in parts the part of the leg; 0 lifts the flat off
    shortest: float = 0.0  # below it the run stops
    history: float | None = None  # approach of the committed history where the midpoint rule extrapolates it


@dataclass
class Record:
    """Rows of the curve in physical units, and requested snapshots."""

    side: float  # L [length]
    E: float  # unit of stress [force/length^2]
    reduced_modulus: float  # E' [force/length^2]
    rows: list[dict[str, Any]] = field(default_factory=list)
    snapshots: list[Snapshot] = field(default_factory=list)

    def add(
        self, solver: ContactSolver, branch: str, stats: StepStats, seconds: float, time: float | None = None
    ) -> None:
        """Append the state of `solver` as a row, at a time of the path where it takes any [s]; collective."""
        state = measures.row(solver)
        force = solver.force * self.E * self.side**2
        units = {
            "": 1.0, "length": self.side, "length^2": self.side**2, "length^3": self.side**3,
            "force/length": self.E * self.side, "force/length^2": self.E,
        }  # fmt: skip
        row = {
            "step": len(self.rows) + 1,
            "branch": branch,
            "delta": solver.delta * self.side,
            "delta_star": solver.delta,
            "force": force,
            "P_star": force / (self.side**2 * self.reduced_modulus),
            **{name: value * units[DIMENSIONS[name]] for name, value in state.items()},
            "newton": stats.newton,
            "krylov": stats.krylov,
            "seconds": seconds,
            **({} if time is None else {"time": time}),
        }
        self.rows.append(row)

    def curve(self) -> Curve:
        """The rows so far."""
        return Curve.from_rows(self.rows)


#: Called after each accepted step with all rows so far and the finished part of the load path, in [0, 1].
Callback = Callable[[Sequence[Mapping[str, Any]], float], None]


@dataclass(frozen=True)
class Trial:
    """A solve of a step."""

    delta: float  # approach [L]
    stats: StepStats
    step: float  # length that was tried
    length: float  # and that was made, shorter at the end of a leg
    done: float = 0.0  # see `Position`


def follow(
    solver: ContactSolver,
    schedule: Schedule,
    record: Record,
    snapshots: int = 0,
    on_step: Callback | None = None,
    position: Position | None = None,
    on_position: Callable[[Position], None] | None = None,
) -> None:
    """Follow a load path step by step; collective.

    Args:
        solver: in its initial state, or in that of `position`
        record: receives a row per accepted step, also when the run stops early
        snapshots: number of states to keep of each loading, evenly spread, the last one included
        on_step: called after each accepted step
        position: where to continue
        on_position: called with the position at the beginning of the path and after each accepted step

    Raises:
        ConvergenceError: a step does not converge, however small
    """
    at = position or Position()
    numbers = [n for _, n in schedule.legs]
    if on_position is not None and position is None:
        on_position(at)
    while at.leg < len(numbers):
        leg, begun, before = leg_of(solver, schedule, at), perf_counter(), solver.force
        if at.start is None:
            at = leg.first(at)
        try:
            stats, after = _advance(solver, leg, at)
        except LinearFailure as error:  # beside the solve, as of a stiffness
            raise ConvergenceError(
                f"step {len(record.rows) + 1} at delta/L = {solver.delta:.6g}: {error}; the curve before is kept"
            ) from error
        part = 1.0 if after.leg > at.leg else after.done
        now = leg.begins + part * leg.duration if schedule.duration else None
        record.add(solver, leg.branch, stats, perf_counter() - begun, now)
        if leg.up > 0.0 and leg.keeps(snapshots, at, after, before, solver.force):
            record.snapshots.append(measures.snapshot(solver, len(record.rows), leg.branch))
        if on_step is not None:
            within = 1.0 if after.leg > at.leg else leg.part(after, solver.force)
            on_step(record.rows, (sum(numbers[: at.leg]) + numbers[at.leg] * within) / sum(numbers))
        at = after
        if on_position is not None:
            on_position(at)


@dataclass(frozen=True)
class ToApproach:
    """Leg to an approach in planned parts of the way; a step that was cut grows again to the next stop."""

    branch: str  # as in the curve
    start: Sequence[float]  # approach [L] and force [E L^2] at its beginning
    goal: float  # approach at its end [L]
    steps: int  # planned ones, without their parts
    stops: tuple[float, ...]  # ends of all parts of the way, in (0, 1]
    midpoint: bool  # whether the history is extrapolated
    begins: float = 0.0  # time at its beginning [s]
    duration: float = 0.0  # [s]
    where = ""

    @property
    def up(self) -> float:
        """1, 0 or -1."""
        return {"unload": -1.0, "hold": 0.0}.get(self.branch, 1.0)

    def lifts(self, at: Position) -> bool:
        """Whether the next step lifts the flat off."""
        return False

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
        """Approach after a part of the way."""
        return self.start[0] + (self.goal - self.start[0]) * part

    def solve(self, solver: ContactSolver, at: Position, step: float) -> Trial:
        """Try a step; commits nothing."""
        end = self._end(at, step)
        solver.solid.kernels.dt = self.duration * (end - at.done)
        delta = self._at(end)
        return Trial(delta, solver.solve(delta), step, end - at.done, end)

    def after(self, at: Position, solver: ContactSolver, trial: Trial) -> tuple[Position, float | None]:
        """Position after a solve, and the approach of the one that follows in the leg."""
        if self.stops[at.target] - trial.done > 1e-12:
            after = replace(at, done=trial.done, step=min(self._whole(at.target), GROWTH * trial.step))
        elif at.target + 1 < len(self.stops):
            after = self._next(replace(at, done=trial.done), at.target + 1)
        else:
            return Position(at.leg + 1), None
        return after, self._at(self._end(after, after.step))

    def part(self, at: Position, force: float) -> float:
        """Finished part, by the steps, the first of which are short."""
        stops = (0.0, *self.stops)
        return float(np.interp(at.done, stops, np.linspace(0.0, 1.0, len(stops))))

    def keeps(self, snapshots: int, at: Position, after: Position, before: float, force: float) -> bool:
        """Whether a step ended at one of the requested snapshots."""
        arrived, n, part = after.leg > at.leg or after.target > at.target, self.steps, self.stops[at.target]
        return arrived and any(abs(part - round(n * (k + 1) / snapshots) / n) < 1e-9 for k in range(snapshots))


@dataclass(frozen=True)
class ToForceInTime(ToApproach):
    """Leg to a force [E L^2], which changes at a constant rate or is held: each step is searched for its force."""

    @property
    def where(self) -> str:  # type: ignore[override]
        """Words for a message."""
        return f" in the {self.branch} to a force in time"

    def lifts(self, at: Position) -> bool:
        """Whether the next step lifts the flat off."""
        return self.goal == 0.0 and self.up < 0.0 and at.target == len(self.stops) - 1

    def solve(self, solver: ContactSolver, at: Position, step: float) -> Trial:
        """Try a step; commits nothing."""
        end = self._end(at, step)
        solver.solid.kernels.dt = self.duration * (end - at.done)
        wanted = self.start[1] + (self.goal - self.start[1]) * end
        close = FORCE_TOLERANCE * max(self.goal, self.start[1])
        return Trial(*at_force(solver, wanted, close), step, end - at.done, end)


def at_force(solver: ContactSolver, wanted: float, close: float) -> tuple[float, StepStats]:
    """Find the approach [L] of a force [E L^2] after a step whose length in time is known; commits nothing.

    Within that time the force at the approach of before may fall, so the first solve is there, and secants follow.
    """
    stats, start = StepStats(False, "the force is not found", 0, 0), None

    def excess(delta: float) -> float:
        nonlocal stats, start
        stats = solver.solve(delta, start)
        start = solver.solid.u.x.array.reshape(-1, 3)[: solver.solid.owned].copy() if stats.converged else None
        return solver.solved_force() - wanted if stats.converged else np.nan

    delta, force = solver.delta, solver.force
    found, slope = excess(delta), STEEP * force / delta if force > 0.0 and delta > 0.0 else wanted / FIRST_MOVE
    for _ in range(TRIALS):
        if not abs(found) > close:
            return delta, stats
        here, before, delta = delta, found, delta - found / slope
        found = excess(delta)
        if found * before < 0.0:
            delta = illinois(excess, (here, before), (delta, found), close, TRIALS)
            return delta, stats
        # at most four times as far, and on where the flat touches nothing yet
        slope = max((found - before) / (delta - here), 0.25 * abs(found) / abs(delta - here))
    return delta, replace(stats, converged=False, reason="the force is not found")


@dataclass(frozen=True)
class ToForce:
    """Leg to a force, up or down, in about equal steps of force.

    A step moves the flat by the planned force over the slope of the step before and accepts the resulting force. The
    last one ends at the force, which is searched, or lifts the flat off: that gives the residual indentation exactly.
    A slope falls along an unloading, whose steps therefore aim at the planned forces. For the rest see `ToApproach`.
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

        def missing(delta: float) -> float:
            nonlocal stats
            stats = solver.solve(delta)
            return solver.solved_force() - self.goal if stats.converged else np.nan

        ends = (solver.delta, solver.force - self.goal), (target, beyond)
        return illinois(missing, *ends, self.close, TRIALS), stats

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
        after = replace(at, target=number, step=min(whole, longest), shortest=shortest)
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

    def part(self, at: Position, force: float) -> float:
        """Finished part, by the force."""
        way = self.goal - self.start[1]
        return min((force - self.start[1]) / way, 1.0) if way else 1.0

    def keeps(self, snapshots: int, at: Position, after: Position, before: float, force: float) -> bool:
        """Whether a step ended at one of the requested snapshots: the first at or beyond it."""
        done = snapshots if after.leg > at.leg else int(snapshots * force / self.goal)
        return done > int(snapshots * before / self.goal)


Leg = ToApproach | ToForceInTime | ToForce


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
    kind, stops = ToForceInTime if by_force else ToApproach, tuple(schedule.stops(branch))
    return kind(branch, start, goal, n, stops, midpoint, begins, schedule.seconds(branch))


def _advance(solver: ContactSolver, leg: Leg, at: Position) -> tuple[StepStats, Position]:
    """Make one accepted step of a leg, cut where it does not converge; collective."""
    if leg.lifts(at):
        solver.solid.kernels.dt = leg.duration * (1.0 - at.done)
        return _lift_off(solver), Position(at.leg + 1)
    step = at.step
    while not (trial := leg.solve(solver, at, step)).stats.converged:
        stats = trial.stats
        solver.counts.cutbacks += 1
        if solver.retract():
            at = replace(at, history=solver.delta)
        step = 0.5 * trial.length
        if step < at.shortest:
            made = f"{abs(trial.delta - solver.delta):.2g} L"
            made = f"{trial.length * leg.duration:.2g} s" if leg.duration else made
            raise ConvergenceError(
                f"no convergence at delta/L = {trial.delta:.6g}{leg.where} ({stats.reason} after {stats.newton} Newton "
                f"iterations) although the step was cut to {made}; the curve up to delta/L = {solver.delta:.6g} "
                f"is kept: {_advice(solver)}"
            )
        log = logging.getLogger(__name__)
        log.info("delta/L = %.6g: step cut to %.3g %s", solver.delta, step, "L" if leg.where else "of the leg")
    after, ahead = leg.after(at, solver, trial)
    extrapolation, history = midpoint_lead(at.history, trial.delta, ahead if leg.midpoint else None)
    solver.commit(trial.delta, extrapolation)
    return trial.stats, replace(after, history=history)


def _advice(solver: ContactSolver) -> str:
    """What may help where no step converges."""
    more = "use more loading.steps, a larger solver.newton_max, or a finer mesh.h_contact"
    return solver.doubt or solver.newton.linear.lacks or more


def _lift_off(solver: ContactSolver) -> StepStats:
    stats = solver.release()
    if not stats.converged:
        raise ConvergenceError(
            f"the flat could not be lifted off at delta/L = {solver.delta:.6g} ({stats.reason}): use more "
            "loading.unload_steps"
        )
    return stats


def midpoint_lead(history: float | None, here: float, after: float | None) -> tuple[float, float | None]:
    """Part of a step's plastic flow by which to extrapolate the history, and the approach of the new history [L].

    The midpoint rule makes the integration of plasticity one of second order. The history is extrapolated half-way to
    the next solve, so that steps of any lengths add up to the trapezoidal rule; not in the first and the last step of a
    loading, nor where a cut step is behind it. The approaches are those of the committed history, None at the beginning
    of a loading, of the step and of the next one, None after the last.
    """
    if after is None:
        return 0.0, None
    if history is None:
        return 0.0, here
    done = here - history
    part = min(0.5 * (after - here) / done, GREATEST_LEAD) if done > 0.0 else 0.0
    return part, here + part * max(done, 0.0)
