"""The load path: steps of the flat, cutback and growth, unloading, and the record of every accepted step."""

from __future__ import annotations

import logging
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from time import perf_counter
from typing import Any

import numpy as np

from asperity.curve import Curve
from asperity.errors import ConvergenceError
from asperity.model.load_path import MIDPOINT, Schedule
from asperity.quasistatic.contact_solver import Press, Snapshot
from asperity.quasistatic.newton import StepStats

DEEP, FAR = 0.1, 100.0  # deflection [L] from which a force that lies more than so many L ahead is given up
SMALLEST_CUT = 1.0 / 256  # part of a planned step below which a run gives up
FIRST_MOVE = 1e-3  # first step of a force-driven loading [L]
FORCE_TOLERANCE = 1e-6  # relative, of force_max
GROWTH = 1.5  # a cut step grows again by this factor
GREATEST_LEAD = 2.0  # of the midpoint rule, where a step is twice as long as the one before


@dataclass(frozen=True)
class Position:
    """Where on a schedule a run stands between two accepted steps.

    With the state of the press it determines all that follows, so a run goes on from it as if never stopped.

    Attributes:
        leg: loadings and unloadings behind
        start: deflection [L] and force [E L^2] where this leg began; None when it has not begun
        target: number of the planned step under way in this leg, from 1
        origin: deflection and force where the way to the target began
        goal: deflection of the target [L]
        planned: greatest step on this way; of a loading by force, the smallest step planned so far [L]
        step: length of the next step [L]
        history: deflection that the committed history stands for, where the midpoint rule has carried it on [L]
    """

    leg: int = 0
    start: tuple[float, float] | None = None
    target: int = 0
    origin: tuple[float, float] = (0.0, 0.0)
    goal: float = 0.0
    planned: float = 0.0
    step: float = 0.0
    history: float | None = None

    @staticmethod
    def from_dict(values: Mapping[str, Any]) -> Position:
        """Read what `dataclasses.asdict` gave, also after a detour through JSON."""
        pairs = {k: values[k] and tuple(values[k]) for k in ("start", "origin")}
        return Position(**{**values, **pairs})


@dataclass
class Record:
    """Rows of the curve in physical units, and the snapshots asked for."""

    side: float  # L [length]
    E: float  # unit of stress [force/length^2]
    reduced_modulus: float  # E' [force/length^2]
    rows: list[dict[str, Any]] = field(default_factory=list)
    snapshots: list[Snapshot] = field(default_factory=list)

    def add(self, press: Press, branch: str, stats: StepStats, seconds: float) -> None:
        """Append the state of `press` as a row; collective."""
        state = press.row()
        force = press.force * self.E * self.side**2
        row = {
            "step": len(self.rows) + 1,
            "branch": branch,
            "delta": press.delta * self.side,
            "delta_star": press.delta,
            "force": force,
            "P_star": force / (self.side**2 * self.reduced_modulus),
            **state,
            "max_pressure": state["max_pressure"] * self.E,
            "newton": stats.newton,
            "krylov": stats.krylov,
            "seconds": seconds,
        }
        self.rows.append(row)

    def curve(self) -> Curve:
        """The rows so far."""
        return Curve.from_rows(self.rows)


#: Told of the rows so far, the last one new, and of the part of the schedule done.
Callback = Callable[[Sequence[Mapping[str, Any]], float], None]
Outcome = tuple[StepStats, Position]


def follow(
    press: Press,
    schedule: Schedule,
    record: Record,
    snapshots: int = 0,
    on_step: Callback | None = None,
    position: Position | None = None,
    on_position: Callable[[Position], None] | None = None,
) -> None:
    """Drive `press` along `schedule`, filling `record`; collective.

    Args:
        press: at its initial state, or at `position`
        schedule: what the flat does
        record: receives a row per accepted step, also when the run stops early
        snapshots: states kept of each loading, evenly spread, the last one included
        on_step: called after each accepted step
        position: where to go on
        on_position: called with where the run stands at the beginning of the path and after each accepted step

    Raises:
        ConvergenceError: a step does not converge however small
    """
    at = position or Position()
    legs = schedule.legs
    total = sum(n for _, n in legs)
    if on_position is not None and position is None:
        on_position(at)
    while at.leg < len(legs):
        branch, n = legs[at.leg]
        if at.start is None:
            at = _begin(press, schedule, at, branch)
        start = perf_counter()
        if branch == "unload":
            stats, after = _unload(press, schedule, at)
        elif schedule.delta_max is None:
            stats, after = _load_to_force(press, schedule, at)
        else:
            stats, after = _load(press, schedule, at)
        record.add(press, branch, stats, perf_counter() - start)
        if branch != "unload" and _is_kept(schedule, snapshots, at, after):
            record.snapshots.append(press.snapshot(len(record.rows), branch))
        if on_step is not None:
            within = 1.0 if after.leg > at.leg else _part_done(press, schedule, at, branch)
            on_step(record.rows, (sum(n for _, n in legs[: at.leg]) + n * within) / total)
        at = after
        if on_position is not None:
            on_position(at)


def _begin(press: Press, schedule: Schedule, at: Position, branch: str) -> Position:
    """Plan the first step of a leg."""
    at = replace(at, start=(press.delta, press.force))
    if branch == "unload":
        return _next_unloading(press, schedule, at)
    if schedule.delta_max is None:
        return replace(at, planned=FIRST_MOVE, step=FIRST_MOVE)
    return _next_loading(schedule, at)


def _part_done(press: Press, schedule: Schedule, at: Position, branch: str) -> float:
    """Part of a leg that is behind."""
    assert at.start is not None
    delta, force = at.start
    if branch == "unload":
        return 1.0 - press.force / force if force > 0.0 else 1.0
    if schedule.delta_max is None:
        return press.force / _goal(press, schedule)
    return (press.delta - delta) / (schedule.delta_max - delta)


def _is_kept(schedule: Schedule, snapshots: int, at: Position, after: Position) -> bool:
    """Whether a step of a loading ended where a snapshot is wanted."""
    if schedule.delta_max is None:
        return snapshots > 0 and after.leg > at.leg
    n = schedule.steps
    arrived = after.leg > at.leg or after.target > at.target
    part = schedule.stops()[at.target - 1]
    return arrived and any(abs(part - round(n * (k + 1) / snapshots) / n) < 1e-9 for k in range(snapshots))


def _lead(at: Position, here: float, after: float | None) -> tuple[float, float | None]:
    """By which part of a step's plastic flow to carry the history on, and the deflection it then stands for.

    The midpoint rule carries it half-way to the next solve, so that steps of any lengths add up to the trapezoidal
    rule. Where no solve follows, where none went before, or where a cut step fell behind the history, it stays with the
    displacement.

    Args:
        at: position before the step
        here: deflection of the step
        after: deflection of the next one, None after the last
    """
    if after is None:
        return 0.0, None
    if at.history is None:
        return 0.0, here
    done = here - at.history
    lead = min(0.5 * (after - here) / done, GREATEST_LEAD) if done > 0.0 else 0.0
    return lead, here + lead * max(done, 0.0)


def _approach(
    press: Press, at: Position, following: Callable[[float, float], float | None] | None = None
) -> tuple[StepStats, Position, bool]:
    """One accepted step towards the goal, cutting and growing as convergence allows, and whether it is reached.

    Args:
        press: at `at`
        at: position
        following: with the midpoint rule, the deflection of the solve after one at a given deflection, when steps
            have a given length
    """
    step = at.step
    while True:
        left = at.goal - press.delta
        # a remainder just above a whole step is taken with it
        move = left if abs(left) <= 1.001 * step else np.copysign(step, left)
        target = at.goal if move == left else press.delta + move
        after = min(at.planned, step * GROWTH)
        lead, history = 0.0, None
        if following is not None:
            lead, history = _lead(at, target, following(target, after))
        stats = press.attempt(target, lead)
        if stats.converged:
            at = replace(at, step=after, history=history)
            return stats, at, abs(at.goal - press.delta) <= 1e-12
        press.counts.cutbacks += 1
        step = 0.5 * abs(move)
        if step < SMALLEST_CUT * at.planned:
            raise ConvergenceError(
                f"no convergence at delta/L = {press.delta + move:.6g} ({stats.reason} after {stats.newton} Newton "
                f"iterations) although the step was cut to {abs(move):.2g} L; the curve up to delta/L = "
                f"{press.delta:.6g} is kept: use more loading.steps or a finer mesh.h_contact"
            )
        logging.getLogger(__name__).info("delta/L = %.6g: step cut to %.3g L", press.delta, step)


def _load(press: Press, schedule: Schedule, at: Position) -> Outcome:
    """A step to delta_max, in equal ones from where the flat touched."""
    last = at.target == len(schedule.stops())

    def following(target: float, step: float) -> float | None:
        if target < at.goal:
            return min(target + step, at.goal)
        return None if last else _next_loading(schedule, at).goal

    midpoint = schedule.integrator == MIDPOINT
    stats, at, arrived = _approach(press, at, following if midpoint else None)
    if not arrived:
        return stats, at
    return stats, Position(at.leg + 1) if last else _next_loading(schedule, at)


def _next_loading(schedule: Schedule, at: Position) -> Position:
    assert at.start is not None and schedule.delta_max is not None
    first, k, stops = at.start[0], at.target + 1, schedule.stops()
    way = schedule.delta_max - first
    planned = way * (stops[k - 1] - (stops[k - 2] if k > 1 else 0.0))
    return replace(at, target=k, goal=first + way * stops[k - 1], planned=planned, step=planned)


def _goal(press: Press, schedule: Schedule) -> float:
    """The force a loading ends at [E L^2]."""
    assert schedule.force_max is not None
    return schedule.force_max * press.solid.material.reduced_modulus


def _load_to_force(press: Press, schedule: Schedule, at: Position) -> Outcome:
    """A step to force_max, in about equal steps of force; the last one hits it.

    A step moves the flat by the planned force over the slope of the step before and takes the force it gets; only
    the last position is searched, by regula falsi (Illinois) over trial solves that commit nothing.
    """
    goal, step, parts = _goal(press, schedule), at.step, schedule.steps * schedule.substeps
    while True:
        target = press.delta + step
        stats = press.trial(target)
        if stats.converged and press.force == 0.0 and (ahead := press.trial_force() * parts / goal) > 2.0:
            # nothing was known of the stiffness yet; the force of a first contact grows as the power 3/2
            step *= ahead ** (-2.0 / 3.0)
            continue
        if stats.converged and press.trial_force() > goal:
            target, stats = _find_force(press, goal, target, stats)
        if stats.converged:
            break
        press.counts.cutbacks += 1
        step *= 0.5
        logging.getLogger(__name__).info("delta/L = %.6g: step cut to %.3g L", press.delta, step)
        if step < SMALLEST_CUT * at.planned:
            raise ConvergenceError(
                f"no convergence at delta/L = {target:.6g} on the way to loading.force_max ({stats.reason}); the "
                f"curve up to delta/L = {press.delta:.6g} is kept: use more loading.steps"
            )
    force = press.trial_force()
    if force >= goal * (1.0 - FORCE_TOLERANCE):
        press.accept(target)
        return stats, Position(at.leg + 1)
    slope = (force - press.force) / step
    if target > DEEP and goal - force > FAR * slope:
        raise ConvergenceError(
            f"loading.force_max cannot be reached: at delta/L = {target:.3g} the force is {force / goal:.2g} of it and "
            f"hardly rises: lower force_max or give delta_max"
        )
    wanted = goal / parts / slope if slope > 0.0 else 2.0 * step
    step = min(max(wanted, 0.1 * step), 2.0 * step)
    lead, history = 0.0, None
    if schedule.integrator == MIDPOINT:  # the next solve may find the end before a whole step
        left = (goal - force) / slope if slope > 0.0 else step
        lead, history = _lead(at, target, target + min(step, left))
    press.accept(target, lead)
    return stats, replace(at, planned=min(at.planned, step), step=step, history=history)


def _find_force(press: Press, goal: float, high: float, stats: StepStats) -> tuple[float, StepStats]:
    """Position at which a trial solve gives the force `goal`, between the current one and `high`."""
    low, f_low, f_high = press.delta, press.force - goal, press.trial_force() - goal
    for _ in range(40):
        target = (low * f_high - high * f_low) / (f_high - f_low)
        stats = press.trial(target)
        if not stats.converged:
            break
        f = press.trial_force() - goal
        if abs(f) <= FORCE_TOLERANCE * goal:
            break
        if f > 0.0:
            high, f_high, f_low = target, f, 0.5 * f_low
        else:
            low, f_low, f_high = target, f, 0.5 * f_high
    return target, stats


def _unload(press: Press, schedule: Schedule, at: Position) -> Outcome:
    """A step of an unloading in about equal steps of force, at whose end the flat is lifted off.

    Each step aims at an equal drop of the force by the slope of the one before and takes what it gets, so no
    position has to be searched; the first one aims by half of the slope of a rigid release. The last step removes
    the flat, which gives the residual deflection exactly.
    """
    if at.target < schedule.unload_steps:
        stats, at, arrived = _approach(press, at)
        return stats, _next_unloading(press, schedule, at) if arrived else at
    stats = press.release()
    if not stats.converged:
        raise ConvergenceError(
            f"the flat could not be lifted off at delta/L = {press.delta:.6g} ({stats.reason}): use more "
            "loading.unload_steps"
        )
    return stats, Position(at.leg + 1)


def _next_unloading(press: Press, schedule: Schedule, at: Position) -> Position:
    """Plan the way to the next force of an unloading that is not nearly reached; the last target is the release."""
    assert at.start is not None
    n, top = schedule.unload_steps, at.start[1]
    if top <= 0.0:
        return replace(at, target=n)
    drop = top / n
    if at.target == 0:
        slope = 4.0 * top / press.delta
    else:
        slope = (at.origin[1] - press.force) / (at.origin[0] - press.delta)
        if press.force < 0.25 * drop:
            return replace(at, target=n)
    for k in range(at.target + 1, n):
        remaining = press.force - (top - k * drop)
        if remaining >= 0.5 * drop:
            way = remaining / slope
            here = press.delta, press.force
            return replace(at, target=k, origin=here, goal=press.delta - way, planned=way, step=way)
    return replace(at, target=n)
