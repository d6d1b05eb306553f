"""The load path followed step by step, its steps cut where they fail."""

from __future__ import annotations

import logging
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from time import perf_counter
from typing import Any

from asperity.errors import ConvergenceError
from asperity.linear.petsc import LinearFailure
from asperity.model.load_path import Schedule
from asperity.quasistatic import measures
from asperity.quasistatic.contact_solver import ContactSolver
from asperity.quasistatic.legs import Leg, Position, leg_of
from asperity.quasistatic.measures import Record
from asperity.quasistatic.newton import StepStats

GREATEST_LEAD = 2.0  # of the midpoint rule, where a step is twice as long as the one before

#: Called after each accepted step with all rows so far and the finished part of the load path, in [0, 1].
Callback = Callable[[Sequence[Mapping[str, Any]], float], None]


def follow(
    solver: ContactSolver,
    schedule: Schedule,
    record: Record,
    snapshots: int = 0,
    on_step: Callback | None = None,
    position: Position | None = None,
    on_position: Callable[[Position], None] | None = None,
    legs: int | None = None,
) -> Position:
    """Follow a load path step by step, or its first legs; collective.

    Args:
        solver: in its initial state, or in that of `position`
        record: receives a row per accepted step, also when the run stops early
        snapshots: number of states to keep of each loading, evenly spread, the end included
        on_step: called after each accepted step
        position: where to continue
        on_position: called with the position at the beginning of the path and after each accepted step
        legs: so many of the path; default all

    Returns:
        the position reached

    Raises:
        ConvergenceError: a step does not converge, however small
    """
    at = position or Position()
    numbers = [n for _, n in schedule.legs[:legs]]
    if on_position is not None and at == Position():
        on_position(at)
    while at.leg < len(numbers):
        leg, begun = leg_of(solver, schedule, at), perf_counter()
        if at.start is None:
            at = leg.first(at)
        try:
            stats, after = _advance(solver, leg, at)
        except LinearFailure as error:  # beside the solve, as of a stiffness
            raise ConvergenceError(
                f"step {len(record.rows) + 1} at delta/L = {solver.delta:.6g}: {error}; the curve before is kept"
            ) from error
        done = 1.0 if after.leg > at.leg else after.done
        now = leg.begins + done * leg.duration if schedule.duration else None
        record.add(solver, leg.branch, stats, perf_counter() - begun, now)
        if leg.up > 0.0 and int(snapshots * done + 1e-9) > int(snapshots * at.done + 1e-9):
            record.snapshots.append(measures.snapshot(solver, len(record.rows), leg.branch))
        if on_step is not None:
            on_step(record.rows, (sum(numbers[: at.leg]) + numbers[at.leg] * done) / sum(numbers))
        at = after
        if on_position is not None:
            on_position(at)
    return at


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
