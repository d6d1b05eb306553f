"""The whole job of a case: curve, law, dynamics, and the files of the run in its folder."""

from __future__ import annotations

from contextlib import nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from asperity.case import Case
from asperity.curve import Curve
from asperity.curve.power_law import PowerLawFit, with_misfit
from asperity.errors import InputError, OutputError
from asperity.model.problem import Problem
from asperity.output.run_files import RunFiles
from asperity.runtime.display import brief
from asperity.runtime.parallel import StopRequest, agree
from asperity.runtime.progress import Progress, logged
from asperity.runtime.run_folder import LOG

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from mpi4py import MPI

    from asperity.quasistatic.contact_result import ContactResult


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

    comm = MPI.COMM_WORLD if comm is None else comm
    out = None if folder is None else Path(folder)
    if resume and force:
        raise InputError("--resume continues the run in OUT and --force replaces it: give one of them")
    if resume and out is None:
        raise InputError("give the folder of the run to resume")

    def prepare() -> tuple[Case, Problem]:
        whole = case if isinstance(case, Case) else Case.load(case)
        return whole, whole.problem(allow_code=allow_code)

    with logged(comm, None if out is None else out / LOG) as log:
        whole, problem = agree(comm, prepare)
        files = RunFiles(whole, out, comm, log.begin)
        with files.opened(resume, force) as done:
            if done is not None:
                return RunResult(done[0], done[0].fit_or_none(), done[1], None)
            with nullcontext() if out is None else StopRequest(comm) as request:
                from asperity.job.solve import solve_case
                from asperity.job.stages import Job

                progress, stop = progress or Progress(), None if request is None else request.agreed
                try:
                    solved = solve_case(whole, problem, files, progress, stop, comm)
                except InputError:
                    files.withdraw()
                    raise
                except OutputError as e:
                    more = "; --resume continues from the last step saved" if files.saved() else ""
                    raise OutputError(f"{e}{more}") from None
                files.curve(solved.contact.curve, whole=solved.accurate is not None)
                job = Job(whole, solved, files, log, progress, comm)
                job.follow()
                if job.failure is not None:
                    raise job.failure
                curve = solved.contact.curve
                return RunResult(curve, curve.fit_or_none(), job.summary, solved.contact, job.dynamics)
