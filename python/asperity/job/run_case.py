"""The whole job of a case: curve, law, dynamics, and the files of the run in its folder."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass
from functools import cache, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from asperity.case import Case
from asperity.curve import Curve
from asperity.curve.power_law import PowerLawFit, with_misfit
from asperity.errors import (
    AssumptionWarning,
    CaseWarning,
    InputError,
    Interrupted,
    OutputError,
    ResolutionWarning,
    warn,
)
from asperity.model.problem import Problem
from asperity.output.assumption import DOUBTFUL, Assumption, describe
from asperity.output.assumptions import ledger
from asperity.output.run_files import RunFiles
from asperity.output.summary import of_ranks
from asperity.runtime.display import brief
from asperity.runtime.parallel import agree, on_root, on_root_bcast, spread
from asperity.runtime.progress import Progress, log_file
from asperity.runtime.run_folder import LOG
from asperity.runtime.timing import Clock, Phases, clocked
from asperity.runtime.warnings_log import Notices, log, noting

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from mpi4py import MPI

    from asperity.job.parts import SolvedCase
    from asperity.quasistatic.contact_result import ContactResult
    from asperity.surface import Surface


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

    def plot(self, name: str = "curve") -> Figure:
        """Draw a figure of the curve, "curve", "area" or "stiffness", or refuse (InputError) where it has no data."""
        from asperity.output.results import Results
        from asperity.plot import figures_of

        results = Results(Path(), self.curve, summary=self.summary)
        drawn = figures_of(results)
        if name not in drawn:
            raise InputError(f"there is no figure {name!r} of this result: choose {', '.join(drawn) or 'none'}")
        return drawn[name](results)

    def _repr_html_(self) -> str:
        """Picture and sentences for a notebook."""
        from html import escape

        from asperity.output.results import Results
        from asperity.output.verdict import verdict

        sentences = verdict(Results(Path(), self.curve, summary=self.summary))
        return self.curve._repr_html_() + "".join(f"<p>{escape(text)}</p>" for text in sentences)

    def __repr__(self) -> str:
        law = "no fit" if self.fit is None else "k = {}, n = {}".format(*with_misfit(self.fit.to_dict()))
        return f"RunResult({self.curve!r}, {law}, {brief(self.summary.get('exit_reason'))})"


def run(
    case: Case | str | Path,
    folder: str | Path | None = None,
    *,
    progress: Progress | None = None,
    resume: bool = False,
    force: bool = False,
    allow_code: bool = False,
    comm: MPI.Comm | None = None,
) -> RunResult:
    """Run a case and write its results, as `asperity run` does; collective over `comm`.

    A folder with a run is left alone unless `resume` or `force` is given. With `resume` a call may be repeated until
    the run is finished: it starts the run where nothing was saved yet, continues one that was stopped, and returns the
    results of a finished one. What is legal but doubtful is reported by an `AsperityWarning`, and in the summary, log
    and report of the run.

    Args:
        case: the input, or the path of a case file
        folder: receives the files; None writes nothing
        progress: receives stages and steps
        resume: continue the run of this case in `folder`
        force: replace the run in `folder`; files that no run has written stay
        allow_code: run the file that material.law may name, with all rights of the user
        comm: communicator; default all ranks

    Raises:
        InputError: the case is wrong, `folder` holds something that would be written over, or
            another process works in it
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
        ['.lock', 'case.toml', 'checkpoint', 'curve.csv', 'run.log', 'summary.json']
    """
    from mpi4py import MPI

    from asperity.runtime.interrupt import StopRequest

    comm = MPI.COMM_WORLD if comm is None else comm
    out = None if folder is None else Path(folder)
    if resume and force:
        raise InputError("--resume continues the run in OUT and --force replaces it: give one of them")
    if resume and out is None:
        raise InputError("give the folder of the run to resume")

    def prepare() -> tuple[Case, Problem]:
        whole = case if isinstance(case, Case) else Case.load(case)
        return whole, whole.problem(allow_code=allow_code)

    with noting(comm) as notices:
        whole, problem = agree(comm, prepare)
        files = RunFiles(whole, out, comm)
        with files.locked(resume, force):
            done = files.finished() if resume else None
            if done is not None:
                return RunResult(done[0], done[0].fit_or_none(), done[1], None)
            continues = files.open(resume, force)
            with (
                log_file(None if out is None or comm.rank > 0 else out / LOG, append=continues) as files.open_log,
                nullcontext() if out is None else StopRequest(comm) as request,
                clocked() as clock,
            ):
                for text in notices.texts:
                    log(text)
                stop = None if request is None else request.agreed
                return _run(whole, problem, files, notices, progress or Progress(), stop, comm, clock)


def _run(
    case: Case, problem: Problem, files: RunFiles, notices: Notices, progress: Progress,
    stop: Callable[[], str] | None, comm: MPI.Comm, clock: Clock,
) -> RunResult:  # fmt: skip
    """Solve, vibrate, judge, write; collective."""
    from asperity.job.parts import VibratedCase, solve_case, vibrate_case

    try:
        solved = solve_case(case, problem, files, progress, stop, comm)
    except InputError:
        files.withdraw()
        raise
    except OutputError as e:
        raise OutputError(f"{e}{'; --resume continues from the last step saved' if files.saved() else ''}") from None
    contact, failure, folder = solved.contact, solved.failure, files.folder
    summary = solved.summary(case, comm.size)
    summary["warnings"] = notices.texts  # those of what follows join them
    files.curve(contact.curve, whole=solved.accurate is not None)

    def write() -> None:
        summary["parallel"] = of_ranks(comm, summary["seconds"], clock)
        files.summary(summary, failure)

    write()
    phases, found = Phases(summary["seconds"]), VibratedCase()

    @contextmanager
    def stage(name: str) -> Iterator[None]:
        progress.stage(name)
        with phases.phase(name):
            yield

    if solved.complete:
        if contact.snapshots and folder is not None:
            with stage("fields"):
                files.fields(contact)
        found = vibrate_case(case, contact, folder, stage)
        summary |= found.sections
        failure = found.failure or failure

    evidence = solved.evidence(case, found.numbers)
    lines = on_root_bcast(comm, partial(ledger, evidence))
    summary["assumptions"] = [line.to_dict() for line in lines]
    if evidence.patches is not None:
        summary["patches"] = evidence.patches.to_dict()
    _warn(case, folder, solved, lines)
    notices.share()
    write()

    if solved.complete and not found.ends:
        if folder is not None and (case.output.figures or case.output.report):
            with stage("figures"):
                _draw(comm, folder, problem.surface)
            write()  # with the time of the figures
        if folder is not None and case.output.report:
            from asperity.plot.report import write_report

            on_root(comm, partial(write_report, folder))
        summary["finished"] = failure is None  # not before all is there: a finished run is not continued
        write()
    if failure is not None:
        raise failure
    return RunResult(contact.curve, contact.curve.fit_or_none(), summary, contact, found.dynamics)


def _warn(case: Case, folder: Path | None, solved: SolvedCase, lines: Sequence[Assumption]) -> None:
    """Warn of what is doubtful in the result, and put the rest into the log."""
    for line in lines:
        text = describe(line.to_dict())
        if line.verdict == DOUBTFUL and line.warns:
            warn(text, AssumptionWarning)
        elif line.verdict == DOUBTFUL:
            logging.getLogger(__name__).info("doubtful: %s", text)
    contact, unresolved = solved.contact, solved.contact.curve.unresolved()
    if case.output.fields and folder is not None and contact.complete and not contact.snapshots:
        why = "output.snapshots = 0"
        if case.output.snapshots:
            why = "the steps were computed without snapshots before the run was resumed; replace the run with --force"
        warn(f"output.fields = true writes nothing: {why}", CaseWarning)
    if unresolved and solved.accurate is None and not isinstance(solved.failure, Interrupted):
        warn(f"{unresolved}; make mesh.h_contact smaller", ResolutionWarning)


def _draw(comm: MPI.Comm, folder: Path, surface: Surface) -> None:
    """Draw the figures, each on one rank; collective."""
    from asperity.output.results import Results
    from asperity.plot import draw, figures_of

    read = cache(partial(Results.read, folder, surface))
    names = on_root_bcast(comm, lambda: list(figures_of(read())))

    def task(name: str) -> None:
        draw(read(), name)

    spread(comm, [partial(task, name) for name in names], near=True)
