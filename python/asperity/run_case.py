"""The whole job of a case: curve, law, dynamics, and the files of the run in its folder."""

from __future__ import annotations

import logging
import warnings
from collections.abc import Callable, Mapping, Sequence
from contextlib import nullcontext
from dataclasses import dataclass, replace
from functools import cached_property, partial
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Any

from asperity.case import Case
from asperity.curve import Curve
from asperity.errors import (
    AssumptionWarning,
    CheckError,
    CheckpointError,
    ConvergenceError,
    InputError,
    Interrupted,
    OutputError,
    ResolutionWarning,
)
from asperity.model.problem import Problem
from asperity.model.settings import AccuracyTarget
from asperity.output.assumptions import departures
from asperity.output.run_files import RunFiles
from asperity.power_law import PowerLawFit
from asperity.runtime import run_folder
from asperity.runtime.files import files_into
from asperity.runtime.notices import Notices, noting
from asperity.runtime.parallel import agree, on_root_bcast
from asperity.runtime.progress import Progress, log_file
from asperity.runtime.run_folder import CASE, CHECKPOINT, DISTRIBUTIONS, FIELDS, LOG, VTKHDF

if TYPE_CHECKING:
    from mpi4py import MPI

    from asperity.adaptive.solve_to_tolerance import AccurateResult
    from asperity.quasistatic.checkpoint import Checkpoint
    from asperity.quasistatic.solve_contact import ContactResult, Hooks


@dataclass(frozen=True)
class RunResult:
    """Outcome of a case.

    Attributes:
        curve: accepted steps
        fit: power law of the loading branch; None when it has fewer than three points
        summary: what summary.json holds
        contact: the solved contact, with mesh and last state; None when a resumed run had nothing left to do
        dynamics: what `dynamics.run_dynamics` returned, None when not requested
    """

    curve: Curve
    fit: PowerLawFit | None
    summary: dict[str, Any]
    contact: ContactResult | None
    dynamics: Any = None


def run(
    case: Case | str | Path,
    folder: str | Path | None = None,
    *,
    progress: Progress | None = None,
    resume: bool = False,
    force: bool = False,
    comm: MPI.Comm | None = None,
) -> RunResult:
    """Run a case and write its results, as `asperity run` does; collective over `comm`.

    A folder with a run is left alone unless `resume` or `force` is given: a second call for the same folder has to say
    which. With `resume` a call may be repeated until the run is finished, whatever the state of the folder: it starts
    the run in an absent or empty folder, or where nothing was saved yet, continues one that was stopped, and returns
    the results of a finished one.

    What is legal but doubtful is reported by an `AsperityWarning`, by Python's `warnings` and in the summary, log and
    report of the run.

    Args:
        case: the input, or the path of a case file
        folder: receives the files; None writes nothing
        progress: receives stages and steps
        resume: continue the run of this case in `folder`
        force: replace the run in `folder`; files that no run has written stay
        comm: communicator; default all ranks

    Raises:
        InputError: the case is wrong, its load leaves no gap, or `folder` holds something that would be written over
        CheckpointError: the run in `folder` is of another case, or its checkpoint is damaged
        ConvergenceError: the path could not be followed, the files hold the part before; or the tolerance was not met,
            what was found is kept like a finished run
        Interrupted: SIGTERM or SIGINT requested the end; the files and the checkpoint hold the part before
        CheckError: the run is complete, but violates a balance
        OutputError: a file cannot be written
    """
    from mpi4py import MPI

    comm = MPI.COMM_WORLD if comm is None else comm
    out = None if folder is None else Path(folder)
    with noting(comm) as notices:
        whole, problem = agree(comm, partial(accepted, case, out, resume=resume, force=force))
        job = _Job(whole, problem, out, comm, progress or Progress(), notices)
        if out is not None:
            on_root_bcast(comm, partial(run_folder.check, out, resume=resume, force=force))
            if resume and (done := on_root_bcast(comm, job.writer.finished)) is not None:
                return RunResult(done[0], _fit(done[0]), done[1], None)
        resume = job.open(resume, force)
        with log_file(None if out is None or comm.rank > 0 else out / LOG, append=resume):
            notices.log()
            return job.run()


def accepted(
    case: Case | str | Path, folder: Path | None = None, *, resume: bool = False, force: bool = False
) -> tuple[Case, Problem]:
    """A case that may be run, and its problem; warns of what is doubtful.

    Raises:
        InputError: anything that can be found without solving
    """
    if resume and force:
        raise InputError("--resume continues the run in OUT and --force replaces it: give one of them")
    if resume and folder is None:
        raise InputError("give the folder of the run to resume")
    case = case if isinstance(case, Case) else Case.load(case)
    return case, case.problem()


@dataclass(frozen=True)
class _Job:
    """A case on its way to results.

    Attributes:
        case: the input
        problem: of the case; its surface keeps what was found about it, such as its summit
        folder: receives the files, None for none
        comm, progress: as in `run`
        notices: warnings so far
    """

    case: Case
    problem: Problem
    folder: Path | None
    comm: MPI.Comm
    progress: Progress
    notices: Notices

    @cached_property
    def writer(self) -> RunFiles:
        """Of this rank."""
        return RunFiles(self.case, self.folder if self.comm.rank == 0 else None)

    @cached_property
    def checkpoint(self) -> Checkpoint | None:
        """Of the run, where it has a folder."""
        from asperity.quasistatic.checkpoint import Checkpoint
        from asperity.quasistatic.checkpoint_identity import identity

        if self.folder is None:
            return None
        return Checkpoint(self.folder / CHECKPOINT, identity(self.case), self.comm, self.case.output.checkpoint)

    def open(self, resume: bool, force: bool) -> bool:
        """Make the folder ready; return whether there is a state to continue from; collective.

        Raises:
            CheckpointError: of a run that cannot be continued, which is left as it is
        """
        if self.folder is None or self.checkpoint is None:
            return False
        goes_on = resume and self.checkpoint.found()
        if not goes_on:
            if resume:
                on_root_bcast(self.comm, partial(_refuse_run_of_another, self.case, self.folder))
            self.checkpoint.clear()
            if force:
                on_root_bcast(self.comm, partial(run_folder.clear, self.folder))
        on_root_bcast(self.comm, self.writer.begin)
        return goes_on

    def run(self) -> RunResult:
        """Solve, judge, write; collective."""
        from asperity.output.summary import summarise
        from asperity.quasistatic.solve_contact import PartialResult
        from asperity.runtime.interrupt import StopRequest

        case, comm, writer = self.case, self.comm, self.writer
        failure: ConvergenceError | None = None
        accurate = None
        with nullcontext() if self.folder is None else StopRequest(comm) as request:
            hooks = _hooks(self, None if request is None else request.agreed)
            try:
                if case.accuracy.tolerance is None:
                    contact = _solve(self, hooks)
                else:
                    accurate = _solve_to_tolerance(self, hooks)
                    contact = replace(accurate.contact, curve=accurate.curve, reason=accurate.reason)
                    failure = None if accurate.met else ConvergenceError(accurate.reason)
            except PartialResult as e:
                stopped = isinstance(e.__cause__, Interrupted)
                failure = Interrupted(str(e)) if stopped else ConvergenceError(str(e))
                contact = e.result
            except OutputError as e:
                hint = "; --resume continues from the last step saved" if case.output.checkpoint else ""
                raise OutputError(f"{e}{hint}") from None
        fit = _fit(contact.curve)
        summary = summarise(case, contact, fit, comm.size)
        if accurate is not None:
            summary |= accurate.to_dict()
        doubts = "; ".join(contact.checks.violated.values())
        if doubts and not isinstance(failure, Interrupted):
            failure = CheckError(f"the result is wrong, do not use it: {doubts}")
            summary["exit_reason"] = str(failure)
        for text in departures(contact.curve, self.problem.material, self.problem.surface, self.problem.sides):
            warnings.warn(text, AssumptionWarning, stacklevel=3)
        if summary["unresolved"] and accurate is None and not isinstance(failure, Interrupted):
            warnings.warn(f"{summary['unresolved']}; make mesh.h_contact smaller", ResolutionWarning, stacklevel=3)
        self.notices.share()
        summary["warnings"] = self.notices.texts  # those of what follows join them

        def write() -> None:
            (writer.steps if accurate is None else writer.curve)(contact.curve)
            writer.summary(summary)

        on_root_bcast(comm, write)
        complete = accurate is not None and not doubts  # though perhaps not as accurate as requested
        if failure is not None and not complete:
            raise failure
        result = self._after(RunResult(contact.curve, fit, summary, contact), finished=failure is None)
        if failure is not None:
            raise failure
        return result

    def _after(self, result: RunResult, finished: bool) -> RunResult:
        """What follows a complete curve: fields, dynamics, figures, report; on rank 0 except for the gathering."""
        from asperity.output.distributions import write_distributions
        from asperity.output.fields import gather_states, write_figure_data, write_vtkhdf

        case, comm, folder, progress, writer = self.case, self.comm, self.folder, self.progress, self.writer
        seconds, contact = result.summary["seconds"], result.contact
        assert contact is not None
        if contact.snapshots and folder is not None:
            progress.stage("fields")
            start = perf_counter()
            states = gather_states(contact, case.surface.L, case.material.E)
            block = contact.block
            if comm.rank == 0 and block is not None:
                with files_into(folder / FIELDS) as aside:
                    write_figure_data(aside, block, states)
                    if case.output.fields:
                        write_vtkhdf(aside / VTKHDF, block, states)
                    if case.output.distributions:
                        write_distributions(aside / DISTRIBUTIONS, block, states)
            seconds["fields"] = perf_counter() - start

        def serial() -> Any:
            dynamics = None
            if case.dynamics is not None:
                progress.stage("dynamics")
                start = perf_counter()
                dynamics = _dynamics(case, result.curve, folder)
                seconds["dynamics"] = perf_counter() - start
            writer.summary(result.summary)
            if folder is not None and (case.output.figures or case.output.report):
                progress.stage("figures")
                start = perf_counter()
                from asperity.plot import plot_run

                plot_run(folder, self.problem.surface)
                seconds["figures"] = perf_counter() - start
                writer.summary(result.summary)
            if folder is not None and case.output.report:
                from asperity.plot.report import write_report

                write_report(folder, finished)
            result.summary["finished"] = finished  # not before all is there: a finished run is not continued
            writer.summary(result.summary)
            return dynamics

        # the others wait, for a process that ends with an error would end all
        return replace(result, dynamics=on_root_bcast(comm, serial))


def _refuse_run_of_another(case: Case, folder: Path) -> None:
    """Refuse a folder whose run, of which no state is saved, is not of this case.

    Raises:
        CheckpointError: it is of another, or does not tell
    """
    from asperity.quasistatic.checkpoint_identity import identity, refuse_another

    if run_folder.is_empty(folder):
        return
    path = folder / CASE
    try:
        there = Case.load(path)
    except InputError as error:
        raise CheckpointError(
            f"{folder} holds no state to resume from, and no case to start again: {error}; start again with --force"
        ) from None
    refuse_another(path, identity(there), identity(case))


def _hooks(job: _Job, stop: Callable[[], str] | None) -> Hooks:
    """Progress, checkpoint and snapshots of a run, whose curve is written step by step."""
    from asperity.quasistatic.solve_contact import Hooks

    def on_stage(name: str) -> None:
        reason = "" if stop is None else stop()
        if reason:
            raise Interrupted(f"stopped by {reason} before the load path (next: {name})")
        job.progress.stage(name)
        logging.getLogger(__name__).info("%s", name)

    def on_step(rows: Sequence[Mapping[str, Any]], fraction: float) -> None:
        on_root_bcast(job.comm, lambda: job.writer.steps(Curve.from_rows(rows)))
        job.progress.step(rows[-1], fraction)

    output = job.case.output
    snapshots = output.snapshots if output.figures or output.fields or output.distributions else 0
    return Hooks(
        on_stage, on_step, stop, job.checkpoint, snapshots, stiffness=output.stiffness, conductance=output.conductance
    )


def _solve(job: _Job, hooks: Hooks) -> ContactResult:
    """The static part of a case on one mesh; collective."""
    from asperity.mesh.block import BlockMesh
    from asperity.quasistatic.solve_contact import solve_problem

    file = job.case.mesh.file
    block = BlockMesh.read(file) if file is not None else None
    return solve_problem(job.problem, block=block, comm=job.comm, hooks=hooks)


def _solve_to_tolerance(job: _Job, hooks: Hooks) -> AccurateResult:
    """The static part of a case on meshes that its tolerance chooses; collective."""
    from asperity.adaptive.solve_to_tolerance import refine

    wanted = job.case.accuracy
    assert wanted.tolerance is not None
    target = AccuracyTarget(wanted.tolerance, wanted.max_dofs, wanted.max_seconds)
    return refine(
        job.problem, target, job.comm, hooks, lambda curve: on_root_bcast(job.comm, lambda: job.writer.curve(curve))
    )


def _fit(curve: Curve) -> PowerLawFit | None:
    try:
        return curve.fit()
    except InputError:
        return None


def _dynamics(case: Case, curve: Curve, folder: str | Path | None) -> Any:
    from asperity.dynamics import run_dynamics

    d = case.dynamics
    assert d is not None
    return run_dynamics(
        curve,
        law=d.law,
        load=d.preload,
        zeta=d.zeta,
        damping=d.damping,
        forcing=d.forcing,
        models=d.model,
        omega=d.omega,
        out_dir=folder,
        gravity=d.gravity,
        units=case.units,
    )
