"""The load path: steps of the flat, cutback and growth, ends at an approach or a force, and the record of all steps."""

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
from asperity.quasistatic import measures, midpoint
from asperity.quasistatic.contact_solver import ContactSolver
from asperity.quasistatic.measures import Snapshot
from asperity.quasistatic.newton import StepStats

DEEP, FAR = 0.1, 100.0  # beyond this approach [L], a force more than so many L ahead counts as unreachable
SMALLEST_CUT = 1.0 / 256  # smallest part of a planned step before a run stops
FIRST_MOVE = 1e-3  # first step of a loading from first touch to a given force [L]
STEEP = 4.0  # guess of the slope at which a contact unloads or reloads, over the force over the approach
FORCE_TOLERANCE = 1e-6  # relative, of the greatest force
GROWTH = 1.5  # a cut step grows again by this factor


@dataclass(frozen=True)
class Position:
    """Position on the load path between two accepted steps.

    Together with the state of the solver it determines all later steps. Approaches in L, forces in E L^2.
    """

    leg: int = 0  # number of finished loadings and unloadings
    start: tuple[float, float] | None = None  # approach and force at the beginning of this leg; None before
    target: int = 0  # number of the current planned step in this leg, from 1
    origin: tuple[float, float] = (0.0, 0.0)  # approach and force at the beginning of the way to the target
    goal: float = 0.0  # approach of the target
    step: float = 0.0  # length of the next step
    longest: float = 0.0  # that it may have on the way to an approach
    shortest: float = 0.0  # below it the run stops
    history: float | None = None  # approach of the committed history where the midpoint rule extrapolates it

    @staticmethod
    def from_dict(values: Mapping[str, Any]) -> Position:
        """Inverse of `dataclasses.asdict`, also for values read from JSON."""
        pairs = {k: values[k] and tuple(values[k]) for k in ("start", "origin")}
        return Position(**{**values, **pairs})


@dataclass
class Record:
    """Rows of the curve in physical units, and requested snapshots."""

    side: float  # L [length]
    E: float  # unit of stress [force/length^2]
    reduced_modulus: float  # E' [force/length^2]
    rows: list[dict[str, Any]] = field(default_factory=list)
    snapshots: list[Snapshot] = field(default_factory=list)

    def add(self, solver: ContactSolver, branch: str, stats: StepStats, seconds: float) -> None:
        """Append the state of `solver` as a row; collective."""
        state = measures.row(solver)
        force = solver.force * self.E * self.side**2
        units = {
            "": 1.0, "length": self.side, "length^2": self.side**2, "length^3": self.side**3, "force/length": self.E * self.side,
            "force/length^2": self.E,
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
        }
        self.rows.append(row)

    def curve(self) -> Curve:
        """The rows so far."""
        return Curve.from_rows(self.rows)


#: Called after each accepted step with all rows so far and the finished part of the load path, in [0, 1].
Callback = Callable[[Sequence[Mapping[str, Any]], float], None]
Outcome = tuple[StepStats, Position]


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
    legs = schedule.legs
    total = sum(n for _, n in legs)
    if on_position is not None and position is None:
        on_position(at)
    while at.leg < len(legs):
        branch, n = legs[at.leg]
        if at.start is None:
            at = _begin(solver, schedule, at, branch)
        start, before = perf_counter(), solver.force
        if ends_at_force(schedule, branch):
            move = _to_force
        else:
            move = _unload if branch == "unload" else _load
        try:
            stats, after = move(solver, schedule, at)
        except LinearFailure as error:  # beside the solve, as of a stiffness
            raise ConvergenceError(
                f"step {len(record.rows) + 1} at delta/L = {solver.delta:.6g}: {error}; the curve before is kept"
            ) from error
        record.add(solver, branch, stats, perf_counter() - start)
        if branch != "unload" and _is_kept(solver, schedule, snapshots, at, after, before):
            record.snapshots.append(measures.snapshot(solver, len(record.rows), branch))
        if on_step is not None:
            within = 1.0 if after.leg > at.leg else _part_done(solver, schedule, at, branch)
            on_step(record.rows, (sum(n for _, n in legs[: at.leg]) + n * within) / total)
        at = after
        if on_position is not None:
            on_position(at)


def ends_at_force(schedule: Schedule, branch: str) -> bool:
    """Whether a leg ends at a force above zero: the others end at the greatest approach or where the flat lifts off."""
    return schedule.unload_to > 0.0 if branch == "unload" else schedule.delta_max is None


def _begin(solver: ContactSolver, schedule: Schedule, at: Position, branch: str) -> Position:
    """Plan the first step of a leg."""
    at = replace(at, start=(solver.delta, solver.force))
    if not ends_at_force(schedule, branch):
        return _next_unloading(solver, schedule, at) if branch == "unload" else _next_loading(schedule, at)
    step, force = FIRST_MOVE, solver.force
    if force > 0.0:
        step = abs(_goal(solver, schedule, at) - force) / _parts(schedule, branch) * solver.delta / (STEEP * force)
    return replace(at, step=step, shortest=SMALLEST_CUT * step)


def _part_done(solver: ContactSolver, schedule: Schedule, at: Position, branch: str) -> float:
    """Finished part of a leg, in [0, 1]; of a loading to an approach by its steps, the first of which are short."""
    assert at.start is not None
    delta, force = at.start
    if ends_at_force(schedule, branch):
        way = _goal(solver, schedule, at) - force
        return min((solver.force - force) / way, 1.0) if way else 1.0
    if branch == "unload":
        return 1.0 - solver.force / force if force > 0.0 else 1.0
    assert schedule.delta_max is not None
    stops = (0.0, *schedule.stops())
    part = (solver.delta - delta) / (schedule.delta_max - delta)
    return float(np.interp(part, stops, np.linspace(0.0, 1.0, len(stops))))


def _is_kept(
    solver: ContactSolver, schedule: Schedule, snapshots: int, at: Position, after: Position, before: float
) -> bool:
    """Whether a step of a loading ended at a requested snapshot; to a given force, the first at or beyond it."""
    if schedule.delta_max is None:
        goal = _goal(solver, schedule, at)
        done = snapshots if after.leg > at.leg else int(snapshots * solver.force / goal)
        return done > int(snapshots * before / goal)
    n = schedule.steps
    arrived = after.leg > at.leg or after.target > at.target
    part = schedule.stops()[at.target - 1]
    return arrived and any(abs(part - round(n * (k + 1) / snapshots) / n) < 1e-9 for k in range(snapshots))


def _approach(
    solver: ContactSolver, at: Position, following: Callable[[float, float], float | None] | None = None
) -> tuple[StepStats, Position, bool]:
    """Make one accepted step towards the goal, cut where it does not converge and longer where the last one did.

    For the midpoint rule `following` gives the approach of the solve after one at an approach, for steps of a length.
    Returns the iterations, the new position, and whether the goal is reached.
    """
    step = at.step
    while True:
        left = at.goal - solver.delta
        # a remainder slightly longer than a whole step is one step
        move = left if abs(left) <= 1.001 * step else np.copysign(step, left)
        target = at.goal if move == left else solver.delta + move
        after = min(at.longest, step * GROWTH)
        extrapolation, history = 0.0, None
        if following is not None:
            extrapolation, history = midpoint.extrapolation(at.history, target, following(target, after))
        stats = solver.step(target, extrapolation)
        if stats.converged:
            at = replace(at, step=after, history=history)
            return stats, at, abs(at.goal - solver.delta) <= 1e-12
        solver.counts.cutbacks += 1
        step = 0.5 * abs(move)
        if step < at.shortest:
            raise ConvergenceError(
                f"no convergence at delta/L = {solver.delta + move:.6g} ({stats.reason} after {stats.newton} Newton "
                f"iterations) although the step was cut to {abs(move):.2g} L; the curve up to delta/L = "
                f"{solver.delta:.6g} is kept: {_advice(solver)}"
            )
        logging.getLogger(__name__).info("delta/L = %.6g: step cut to %.3g L", solver.delta, step)


def _advice(solver: ContactSolver) -> str:
    """What may help where no step converges."""
    more = "use more loading.steps, a larger solver.newton_max, or a finer mesh.h_contact"
    return solver.doubt or solver.newton.linear.lacks or more


def _load(solver: ContactSolver, schedule: Schedule, at: Position) -> Outcome:
    """Make a step of a loading to delta_max, in the planned steps from first touch."""
    last = at.target == len(schedule.stops())

    def following(target: float, step: float) -> float | None:
        if target < at.goal:
            return min(target + step, at.goal)
        return None if last else _next_loading(schedule, at).goal

    midpoint = schedule.integrator == MIDPOINT
    stats, at, arrived = _approach(solver, at, following if midpoint else None)
    if not arrived:
        return stats, at
    return stats, Position(at.leg + 1) if last else _next_loading(schedule, at)


def _next_loading(schedule: Schedule, at: Position) -> Position:
    assert at.start is not None and schedule.delta_max is not None
    first, k, stops = at.start[0], at.target + 1, schedule.stops()
    way = schedule.delta_max - first
    step = way * (stops[k - 1] - (stops[k - 2] if k > 1 else 0.0))
    return _towards(at, k, first + way * stops[k - 1], step)


def _towards(at: Position, target: int, goal: float, step: float) -> Position:
    """Plan the way to an approach in one step, which may be cut."""
    return replace(at, target=target, goal=goal, step=step, longest=step, shortest=SMALLEST_CUT * step)


def _goal(solver: ContactSolver, schedule: Schedule, at: Position) -> float:
    """Force at the end of a leg that ends at one [E L^2]."""
    if schedule.legs[at.leg][0] == "unload":
        assert at.start is not None
        return schedule.unload_to * at.start[1]
    assert schedule.force_max is not None
    return schedule.force_max * solver.solid.material.reduced_modulus


def _parts(schedule: Schedule, branch: str) -> int:
    """Planned steps of a leg that ends at a force."""
    return schedule.unload_steps if branch == "unload" else schedule.steps * schedule.substeps


def _to_force(solver: ContactSolver, schedule: Schedule, at: Position) -> Outcome:
    """Make a step of a leg to a force, up or down, in about equal steps of force; the last one ends there.

    A step moves the flat by the planned force over the slope of the step before and accepts the resulting force. Only
    the last position is searched.
    """
    assert at.start is not None
    branch, _ = schedule.legs[at.leg]
    goal, begin, step, parts = _goal(solver, schedule, at), at.start[1], at.step, _parts(schedule, branch)
    up, way, close = 1.0 if branch != "unload" else -1.0, abs(goal - begin), FORCE_TOLERANCE * max(goal, begin)
    if not way > close:  # it is there, or nothing was touched
        return solver.step(solver.delta), Position(at.leg + 1)
    unknown = solver.force == 0.0 or solver.delta == at.start[0]  # the stiffness, so far
    while True:
        target = solver.delta + up * step
        stats = solver.solve(target)
        if stats.converged and unknown and (ahead := up * (solver.solved_force() - solver.force) * parts / way) > 2.0:
            # the force of a first contact grows as the power 3/2
            step *= ahead ** (-2.0 / 3.0 if solver.force == 0.0 else -1.0)
            continue
        if stats.converged and up * (solver.solved_force() - goal) > 0.0:
            target, stats = _find_force(solver, goal, target, stats, close)
        if stats.converged:
            break
        solver.counts.cutbacks += 1
        step *= 0.5
        logging.getLogger(__name__).info("delta/L = %.6g: step cut to %.3g L", solver.delta, step)
        if step < at.shortest:
            raise ConvergenceError(
                f"no convergence at delta/L = {target:.6g} on the way to the "
                f"{'greatest force' if up > 0.0 else 'end of the unloading'} ({stats.reason}); the curve up to "
                f"delta/L = {solver.delta:.6g} is kept: {_advice(solver)}"
            )
    force = solver.solved_force()
    if up * (force - goal) >= -close:
        solver.commit(target)
        return stats, Position(at.leg + 1)
    slope = up * (force - solver.force) / step
    if up > 0.0 and target > DEEP and goal - force > FAR * slope:
        raise ConvergenceError(
            f"the greatest force cannot be reached: at delta/L = {target:.3g} the force is {force / goal:.2g} of it "
            f"and hardly rises: lower loading.force_max or pressure_max, or give delta_max"
        )
    wanted = way / parts / slope if slope > 0.0 else 2.0 * step
    step = min(max(wanted, 0.1 * step), 2.0 * step)
    extrapolation, history = 0.0, None
    if up > 0.0 and schedule.integrator == MIDPOINT:  # the next solve may find the end before a whole step
        left = (goal - force) / slope if slope > 0.0 else step
        extrapolation, history = midpoint.extrapolation(at.history, target, target + min(step, left))
    solver.commit(target, extrapolation)
    return stats, replace(at, step=step, shortest=min(at.shortest, SMALLEST_CUT * step), history=history)


def _find_force(
    solver: ContactSolver, goal: float, beyond: float, stats: StepStats, close: float
) -> tuple[float, StepStats]:
    """Search the approach of the force `goal` from the accepted one to `beyond` by regula falsi (Illinois).

    Commits nothing; the tolerance of the force is `close` [E L^2].
    """
    before, f_before, f_beyond = solver.delta, solver.force - goal, solver.solved_force() - goal
    target, f, side = beyond, 0.0, np.sign(f_beyond)
    for _ in range(40):
        target = (before * f_beyond - beyond * f_before) / (f_beyond - f_before)
        stats = solver.solve(target)
        if not stats.converged:
            break
        last, f = f, solver.solved_force() - goal
        if abs(f) <= close:
            break
        twice = 0.5 if f * last > 0.0 else 1.0  # an end that stays twice weighs half
        if side * f > 0.0:
            beyond, f_beyond, f_before = target, f, twice * f_before
        else:
            before, f_before, f_beyond = target, f, twice * f_beyond
    return target, stats


def _unload(solver: ContactSolver, schedule: Schedule, at: Position) -> Outcome:
    """Make a step of an unloading to zero, in about equal steps of force; the last one lifts the flat off.

    Each aims at an equal drop of the force by the slope of the one before, the first by half of that of a rigid
    release, and accepts the resulting force. The last gives the residual indentation exactly.
    """
    if at.target < schedule.unload_steps:
        stats, at, arrived = _approach(solver, at)
        return stats, _next_unloading(solver, schedule, at) if arrived else at
    stats = solver.release()
    if not stats.converged:
        raise ConvergenceError(
            f"the flat could not be lifted off at delta/L = {solver.delta:.6g} ({stats.reason}): use more "
            "loading.unload_steps"
        )
    return stats, Position(at.leg + 1)


def _next_unloading(solver: ContactSolver, schedule: Schedule, at: Position) -> Position:
    """Plan the way to the next force of an unloading that is clearly below the current one; the last is the release."""
    assert at.start is not None
    n, top = schedule.unload_steps, at.start[1]
    if top <= 0.0:
        return replace(at, target=n)
    drop = top / n
    if at.target == 0:
        slope = 4.0 * top / solver.delta
    else:
        slope = (at.origin[1] - solver.force) / (at.origin[0] - solver.delta)
        if solver.force < 0.25 * drop:
            return replace(at, target=n)
    for k in range(at.target + 1, n):
        remaining = solver.force - (top - k * drop)
        if remaining >= 0.5 * drop:
            way = remaining / slope
            return _towards(replace(at, origin=(solver.delta, solver.force)), k, solver.delta - way, way)
    return replace(at, target=n)
