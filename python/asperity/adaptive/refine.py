"""Accuracy as an input: meshes and load steps refined until the force has the requested error bar.

A half-space shows which spots of the surface carry the force, and the meshes resolve them (`guide`). The first mesh
measures the error of the load steps (`load_step_error`), which depends little on the mesh: the finer ones need no more
steps than it found and all forces are corrected for them. The error of the mesh follows from two of them
(`mesh_error`).
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

from asperity.adaptive.guide import Guide
from asperity.adaptive.load_step_error import LoadStepError, choose_substeps
from asperity.adaptive.mesh_error import AccurateResult, MeshErrorEstimate
from asperity.adaptive.mesh_levels import LevelSolver
from asperity.adaptive.mesh_plan import RATIO, first_scale, planned_steps, step_rule
from asperity.errors import InputError, Interrupted, MeshError
from asperity.model.problem import Problem
from asperity.model.settings import AccuracyTarget, MeshSize
from asperity.quasistatic.callbacks import Callbacks
from asperity.quasistatic.contact_result import PartialResult
from asperity.quasistatic.solve_problem import estimate_approach
from asperity.runtime.parallel import on_root

if TYPE_CHECKING:
    from mpi4py import MPI


def check_free(problem: Problem, meshed: bool) -> None:
    """Refuse a problem that is meshed already, or whose element sizes or substeps are given (InputError)."""
    if meshed or problem.size != MeshSize() or problem.load_path.substeps != 1:
        raise InputError(
            "a tolerance chooses mesh and substeps: leave out block, size (mesh.h_contact, mesh.file) and substeps"
        )


def refine(
    problem: Problem,
    target: AccuracyTarget,
    comm: MPI.Comm | None = None,
    hooks: Callbacks | None = None,
) -> AccurateResult:
    """Refine mesh and load steps until the force along the first loading has the requested error bar; collective.

    Args:
        problem: what to solve; the element sizes and the substeps are chosen here, the steps are a multiple of its own
        target: tolerance and limits
        comm: communicator; default all ranks
        hooks: progress, checkpoints, snapshots

    Raises:
        InputError: target.max_dofs does not even allow the guide; the contact is a penalty too soft for an error bar;
            or the kinematics of the material is not chosen yet
        PartialResult: a load step does not converge before there is an error bar, the run was stopped, or
            target.max_dofs allows no mesh except the guide

    Examples:
        >>> from asperity.surface import Flat
        >>> block = asp.Problem.of(Flat(L=1.0), asp.Material(E=1.0, nu=0.3), delta_max=0.01, steps=2)
        >>> result = refine(block, asp.AccuracyTarget(0.01))
        >>> result.reason, len(result.levels), len(result.curve), bool(result.budget.total.max() < 1e-6)
        ('done', 2, 6, True)
    """
    from mpi4py import MPI

    problem.material.check_decided()
    problem.formulation.check_bar()
    steps = planned_steps(problem.load_path.steps)
    planned = replace(problem, load_path=replace(problem.load_path, steps=steps))
    comm = MPI.COMM_WORLD if comm is None else comm
    hooks = hooks or Callbacks()
    depth = planned.load_path.delta_max
    if depth is None:
        hooks.stage("deflection estimate")
        depth = estimate_approach(planned, comm)
    hooks.stage("half-space with all waves")
    guide = on_root(comm, partial(Guide, planned, depth, steps, hooks.on_part))
    scale = first_scale(target.tolerance)
    run = LevelSolver(planned, depth, guide, RATIO * scale, target.max_dofs, comm, hooks)
    if problem.path_dependent:
        result, path = choose_substeps(run, steps, step_rule(problem), target)
    else:
        result, path = run(1.0), LoadStepError.none()
    estimate = MeshErrorEstimate(run, target, steps, path)
    estimate.add(result)
    result.solver.drop_matrices()
    result = run(max(run.scales[-1] / scale, RATIO), path.substeps)
    while True:
        with suppress(Interrupted):  # this mesh is judged first; the next one is not begun
            hooks.stage("half-space with the top of the mesh")
        accurate, finer = estimate.judge(result)
        if hooks.on_curve is not None:
            hooks.on_curve(accurate.curve)
        if finer is None:
            return accurate
        result.solver.drop_matrices()  # room for the next mesh; its state stays, in case that mesh fails
        try:
            result = run(finer, path.substeps)
        except (PartialResult, Interrupted, MeshError) as e:
            if isinstance(stop := e.__cause__ or e, Interrupted):
                raise PartialResult(str(e), replace(result, curve=accurate.curve)) from stop
            failed = str(e)
            if isinstance(e, PartialResult):
                failed = (
                    f"on the next mesh, of {e.result.dofs} dofs, no step converges beyond delta/L = "
                    f"{e.result.solver.delta:.6g}, use more loading.steps"
                )
            return replace(accurate, reason=f"{accurate.reason}: {failed}")
