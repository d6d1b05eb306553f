# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

"""The problem of a result with the other friction, on the same mesh: which bounds what friction does."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from asperity.adaptive.mesh_plan import planned_steps
from asperity.adaptive.solve_to_tolerance import AccurateResult
from asperity.curve import Curve
from asperity.errors import ConvergenceError, Interrupted
from asperity.model.problem import Problem
from asperity.quasistatic.contact_result import ContactResult, PartialResult
from asperity.quasistatic.hooks import Hooks
from asperity.quasistatic.solve_problem import solve_problem

if TYPE_CHECKING:
    from mpi4py import MPI

PARTS_OF_STICK = 2  # of a load step of an elastic solid


def solve_other_friction(
    problem: Problem, contact: ContactResult, accurate: AccurateResult | None, comm: MPI.Comm, hooks: Hooks
) -> tuple[Curve | None, ConvergenceError | None]:
    """Curve of the first loading with stick instead of no friction, or the reverse, or what stopped it; collective.

    Without plastic flow the load steps matter to stick alone, which has them in parts.

    Args:
        problem: that was solved
        contact: its result, whose mesh is used
        accurate: the same of a run with a tolerance
        comm: communicator
        hooks: progress and checkpoints; a checkpoint of its own is made of theirs
    """
    path = problem.load_path
    if accurate is not None:
        path = replace(path, steps=planned_steps(path.steps), substeps=accurate.levels[-1].substeps)
    friction = "none" if problem.formulation.sticks else "stick"
    if friction == "stick" and not problem.material.plastic:
        path = replace(path, substeps=max(path.substeps, PARTS_OF_STICK))
    path = replace(path, unload_steps=0, cycles=1)
    other = replace(problem, load_path=path, formulation=replace(problem.formulation, friction=friction))
    name = f"friction {friction}"
    again = replace(
        hooks,
        on_stage=lambda stage: hooks.stage(f"{name}: {stage}"),
        checkpoint=None if hooks.checkpoint is None else hooks.checkpoint.part(f"friction-{friction}"),
        on_ready=None,
        snapshots=0,
        stiffness=False,
        conductance=False,
    )
    try:
        return solve_problem(other, block=contact.block, comm=comm, hooks=again).curve, None
    except (PartialResult, Interrupted) as e:
        kind = Interrupted if isinstance(e.__cause__ or e, Interrupted) else ConvergenceError
        return None, kind(f"{name}: {e}")
