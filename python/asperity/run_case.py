# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

"""The whole job of a case: curve, law, dynamics, and the files of the run in its folder."""

from __future__ import annotations

import logging
import warnings
from collections.abc import Callable, Mapping, Sequence
from contextlib import nullcontext
from dataclasses import dataclass
from functools import cached_property, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from asperity.case import Case
from asperity.curve import Curve
from asperity.errors import (
    AssumptionWarning,
    CaseWarning,
    CheckError,
    ConvergenceError,
    InputError,
    Interrupted,
    OutputError,
    ResolutionWarning,
)
from asperity.model.problem import Problem
from asperity.model.settings import wrong_friction
from asperity.output.assumption import DOUBTFUL, Assumption
from asperity.output.assumptions import ledger
from asperity.output.friction_bounds import FRICTION_BOUNDS
from asperity.output.run_files import RunFiles
from asperity.power_law import PowerLawFit, with_misfit
from asperity.run_outputs import write_outputs
from asperity.runtime import run_folder
from asperity.runtime.display import brief, html_table
from asperity.runtime.notices import Notices, noting
from asperity.runtime.parallel import agree, on_root_bcast
from asperity.runtime.progress import Progress, log_file
from asperity.runtime.run_folder import CHECKPOINT, LOG, STATE

if TYPE_CHECKING:
    from mpi4py import MPI

    from asperity.mesh.block import BlockMesh
    from asperity.quasistatic.checkpoint import Checkpoint
    from asperity.quasistatic.contact_result import ContactResult
    from asperity.quasistatic.hooks import Hooks
    from asperity.solve_case import SolvedCase


@dataclass(frozen=True)
class RunResult:
    """Outcome of a case.

    Attributes:
        curve: accepted steps
        fit: power law of the loading branch; None when it has fewer than three points
        summary: what summary.json holds
        contact: the solved contact, with mesh and last state; None when a resumed run had nothing left to do
        dynamics: what `dynamics.run_dynamics` returned, None when not requested

    Examples:
        >>> case = asp.Case.from_dict({
        ...     "units": "other", "surface": {"kind": "flat", "L": 1.0}, "material": {"E": 1.0, "nu": 0.3},
        ...     "mesh": {"h_contact": 1.0, "h_max": 1.0}, "loading": {"delta_max": 0.01, "steps": 3},
        ...     "output": {"figures": False, "report": False},
        ... })

        >>> result = asp.run(case)
        >>> len(result.curve), result.summary["exit_reason"], result.dynamics
        (3, 'done', None)
    """

    curve: Curve
    fit: PowerLawFit | None
    summary: dict[str, Any]
    contact: ContactResult | None
    dynamics: Any = None

    def __repr__(self) -> str:
        law = "no fit" if self.fit is None else "k = {}, n = {}".format(*with_misfit(self.fit.to_dict()))
        return f"RunResult({self.curve!r}, {law}, {brief(self.summary.get('exit_reason'))})"

    def _repr_html_(self) -> str:
        """Table of the main numbers in a notebook."""
        names = ("dofs", "cells", "steps", "newton", "krylov", "ranks", "exit_reason")
        rows = [(name, self.summary[name]) for name in names if name in self.summary]
        law = [] if self.fit is None else [("k", self.fit.k), ("n", self.fit.n), ("r2", self.fit.r2)]
        return html_table(repr(self), ("", "value"), [*law, *rows])


def run(
    case: Case | str | Path,
    folder: str | Path | None = None,
    *,
    progress: Progress | None = None,
    resume: bool = False,
    force: bool = False,
    block: BlockMesh | None = None,
    bounds: bool = False,
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
        block: mesh that was made before for this surface, block, element sizes and approach (on rank 0); None makes it
        bounds: solve the case with the other `contact.friction` too, on the same mesh: the section friction_bounds of
            the summary has what both differ by
        comm: communicator; default all ranks

    Raises:
        InputError: the case is wrong, its load leaves no gap, its contact has no bounds of friction, or `folder` holds
            something that would be written over
        CheckpointError: the run in `folder` is of another case, or its checkpoint is damaged
        ConvergenceError: the path could not be followed, the files hold the part before; or the tolerance was not met,
            what was found is kept like a finished run
        Interrupted: SIGTERM, SIGINT or SIGUSR1 requested the end; the files and the checkpoint hold the part before
        CheckError: the run is complete, but violates a balance
        OutputError: a file cannot be written

    Examples:
        >>> case = asp.Case.from_dict({
        ...     "units": "other", "surface": {"kind": "flat", "L": 1.0}, "material": {"E": 1.0, "nu": 0.3},
        ...     "mesh": {"h_contact": 1.0, "h_max": 1.0}, "loading": {"delta_max": 0.01, "steps": 3},
        ...     "output": {"figures": False, "report": False},
        ... })

        >>> print(f"n = {asp.run(case, 'out').fit.n:.6f}")
        n = 1.000000
        >>> sorted(path.name for path in Path("out").iterdir())
        ['case.toml', 'checkpoint', 'curve.csv', 'run.log', 'summary.json']
    """
    from mpi4py import MPI

    from asperity.runtime.interrupt import StopRequest

    comm = MPI.COMM_WORLD if comm is None else comm
    out = None if folder is None else Path(folder)
    with noting(comm) as notices:
        whole, problem = agree(
            comm, partial(prepare, case, out, resume=resume, force=force, block=block, bounds=bounds)
        )
        job = _Job(whole, problem, block, out, comm, progress or Progress(), notices, bounds)
        if out is not None:
            on_root_bcast(comm, partial(run_folder.check, out, resume=resume, force=force))
            done = on_root_bcast(comm, job.writer.finished) if resume else None
            if done is not None and (not bounds or FRICTION_BOUNDS in done[1]):
                return RunResult(done[0], done[0].fit_or_none(), done[1], None)
        continues = job.continues(resume)
        with (
            log_file(None if out is None or comm.rank > 0 else out / LOG, append=continues) as open_log,
            nullcontext() if out is None else StopRequest(comm) as request,
        ):
            notices.log()
            stop = None if request is None else request.agreed
            return job.run(continues, partial(job.begin, continues, force, open_log), stop)


def prepare(
    case: Case | str | Path,
    folder: Path | None = None,
    *,
    resume: bool = False,
    force: bool = False,
    block: BlockMesh | None = None,
    bounds: bool = False,
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
    if block is not None and not (case.mesh.file is None and case.accuracy.tolerance is None):
        raise InputError("block is the mesh of the run: leave out mesh.file and accuracy.tolerance, which name another")
    if bounds and (wrong := wrong_friction(case.contact.method, "stick")):
        raise InputError(wrong)
    return case, case.problem()


@dataclass(frozen=True)
class _Job:
    """A case on its way to results.

    Attributes:
        case: the input
        problem: of the case; its surface keeps what was found about it, such as its summit
        block: mesh made before, on rank 0
        folder: receives the files, None for none
        comm, progress: as in `run`
        notices: warnings so far
        bounds: whether the case is solved with the other friction too
    """

    case: Case
    problem: Problem
    block: BlockMesh | None
    folder: Path | None
    comm: MPI.Comm
    progress: Progress
    notices: Notices
    bounds: bool = False

    @cached_property
    def writer(self) -> RunFiles:
        """Writer of the files; of rank 0 only."""
        return RunFiles(self.case, self.folder if self.comm.rank == 0 else None)

    @cached_property
    def checkpoint(self) -> Checkpoint | None:
        """Checkpoint of the run, if it has a folder."""
        from asperity.quasistatic.checkpoint import Checkpoint
        from asperity.quasistatic.checkpoint_identity import identity

        if self.folder is None:
            return None
        return Checkpoint(self.folder / CHECKPOINT, identity(self.case), self.comm, self.case.output.checkpoint)

    def continues(self, resume: bool) -> bool:
        """Whether there is a state to continue from; writes nothing; collective.

        Raises:
            CheckpointError: of a run that cannot be continued
            OutputError: the folder cannot be written
        """
        from asperity.quasistatic.checkpoint_identity import refuse_run_of_another

        if self.folder is None or self.checkpoint is None:
            return False
        on_root_bcast(self.comm, partial(run_folder.check_writable, self.folder))
        if resume and self.checkpoint.found():
            return True
        if resume:
            on_root_bcast(self.comm, partial(refuse_run_of_another, self.case, self.folder))
        self.checkpoint.ignore()
        return False

    def begin(self, continues: bool, force: bool, open_log: Callable[[], None]) -> None:
        """Make the folder ready and write the input; collective.

        Args:
            continues: whether the run in the folder continues; otherwise its checkpoint is removed
            force: whether the other files of a run in the folder are removed too
            open_log: starts the log file
        """
        if self.folder is None or self.checkpoint is None:
            return
        if not continues:
            self.checkpoint.clear()
            if force:
                on_root_bcast(self.comm, partial(run_folder.clear, self.folder))
        on_root_bcast(self.comm, self.writer.begin)
        open_log()

    def _withdraw(self, continues: bool) -> None:
        """Remove what a run wrote that is refused after it began, for example when its next mesh cannot be made."""
        if self.checkpoint is not None and not continues and on_root_bcast(self.comm, lambda: self.writer.begun):
            self.checkpoint.clear()
            on_root_bcast(self.comm, self.writer.withdraw)

    def run(self, continues: bool, begin: Callable[[], None], stop: Callable[[], str] | None) -> RunResult:
        """Solve, judge, write; collective.

        Args:
            continues: whether the run in the folder continues
            begin: called once there is a mesh, before the first file is written: a case whose surface cannot be meshed
                leaves the folder as it is
            stop: gives the reason to stop, empty for none; collective; None never stops
        """
        case, comm, writer = self.case, self.comm, self.writer
        try:
            solved = self._solve(begin, stop)
        except InputError:
            self._withdraw(continues)
            raise
        contact, failure = solved.contact, solved.failure
        fit = contact.curve.fit_or_none()
        summary = solved.summary(case, fit, comm.size)
        violated = contact.checks.violated
        doubts = "; ".join(violated.values())
        # a mesh of a run with a tolerance that is not touched is one that is too coarse, as the reason says
        too_coarse = solved.accurate is not None and failure is not None and violated.keys() == {"touch"}
        if doubts and not too_coarse and not isinstance(failure, Interrupted):
            failure = CheckError(f"the result is wrong, do not use it: {doubts}")
        if failure is not None:
            summary["exit_reason"] = str(failure)
        lines = on_root_bcast(comm, partial(ledger, solved.evidence(case, summary.get(FRICTION_BOUNDS))))
        summary["assumptions"] = [line.to_dict() for line in lines]
        self._warn(lines, solved, summary["unresolved"])
        self.notices.share()
        summary["warnings"] = self.notices.texts  # those of what follows join them

        def write() -> None:
            (writer.steps if solved.accurate is None else writer.curve)(contact.curve)
            writer.summary(summary)

        on_root_bcast(comm, write)
        # though perhaps not as accurate as requested, or without the bounds of friction
        complete = contact.complete and not doubts and not isinstance(failure, Interrupted)
        if failure is not None and not complete:
            raise failure
        try:
            dynamics = write_outputs(
                case, self.problem, contact, summary, self.folder, writer, self.progress, failure is None, stop=stop
            )
        except (Interrupted, InputError) as e:
            kept = e if isinstance(e, Interrupted) else ConvergenceError(f"{e}; the curve is kept")
            summary["exit_reason"] = str(kept)
            on_root_bcast(comm, partial(writer.summary, summary))
            raise kept from None
        if failure is not None:
            raise failure
        return RunResult(contact.curve, fit, summary, contact, dynamics)

    def _solve(self, begin: Callable[[], None], stop: Callable[[], str] | None) -> SolvedCase:
        """The static part; collective.

        Raises:
            OutputError: a file cannot be written
        """
        from asperity.solve_case import solve_case

        hooks = _hooks(self, begin, stop)
        try:
            return solve_case(
                self.case,
                self.problem,
                hooks,
                self.comm,
                block=self.block,
                bounds=self.bounds,
                note=self.writer.note,
                on_curve=lambda curve: on_root_bcast(self.comm, lambda: self.writer.curve(curve)),
                on_step_of_other=lambda rows, fraction: self.progress.step(rows[-1], fraction),
            )
        except OutputError as e:
            saved = self.checkpoint is not None and any(self.checkpoint.folder.glob(f"**/{STATE}"))
            hint = "; --resume continues from the last step saved" if saved else ""
            raise OutputError(f"{e}{hint}") from None

    def _warn(self, lines: Sequence[Assumption], solved: SolvedCase, unresolved: str) -> None:
        """Warn of what is doubtful in the result, and put the rest into the log."""
        for line in lines:
            if line.verdict == DOUBTFUL and line.warning:
                warnings.warn(line.warning, AssumptionWarning, stacklevel=4)
            elif line.verdict == DOUBTFUL:
                logging.getLogger(__name__).info("doubtful: %s", line.describe())
        contact = solved.contact
        if self.case.output.fields and self.folder is not None and contact.complete and not contact.snapshots:
            warnings.warn(_no_fields(self.case), CaseWarning, stacklevel=4)
        if unresolved and solved.accurate is None and not isinstance(solved.failure, Interrupted):
            warnings.warn(f"{unresolved}; make mesh.h_contact smaller", ResolutionWarning, stacklevel=4)


def _no_fields(case: Case) -> str:
    """Why a run has no snapshots to write as fields."""
    why = "the steps were computed without snapshots before the run was resumed; replace the run with --force"
    return f"output.fields = true writes nothing: {'output.snapshots = 0' if case.output.snapshots == 0 else why}"


def _hooks(job: _Job, begin: Callable[[], None], stop: Callable[[], str] | None) -> Hooks:
    """Progress, checkpoint and snapshots of a run, whose curve is written step by step."""
    from asperity.quasistatic.hooks import Hooks

    begun = False

    def on_ready() -> None:
        nonlocal begun
        if not begun:  # with a tolerance there are several meshes
            begin()
        begun = True

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
        on_stage,
        on_step,
        stop,
        job.checkpoint,
        snapshots,
        on_ready,
        stiffness=output.stiffness,
        conductance=output.conductance,
        on_part=job.progress.part,
    )
