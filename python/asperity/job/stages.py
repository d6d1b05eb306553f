"""What follows the curve of a case: a list of stages, each with the condition under which it runs."""

from __future__ import annotations

import logging
import math
from collections.abc import Callable
from dataclasses import asdict, dataclass, field, replace
from functools import cache, cached_property, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from asperity.case import Case
from asperity.errors import (
    AssumptionWarning,
    CaseWarning,
    ConvergenceError,
    InputError,
    Interrupted,
    ResolutionWarning,
    warn,
)
from asperity.job.solve import SolvedCase
from asperity.output.assumptions import DOUBTFUL, Evidence, assumptions_of, describe
from asperity.output.indentation import indentation_of
from asperity.output.patches import Spread, spread_of_patches
from asperity.output.run_files import RunFiles, of_ranks
from asperity.runtime.parallel import on_root, on_root_bcast, spread
from asperity.runtime.progress import Progress, RunLog
from asperity.runtime.usage import Phases
from asperity.slip.joint_slip import JointSlip, slip_of_case
from asperity.vibration import Dynamics, DynamicsSettings, run_dynamics
from asperity.vibration.oscillator import Numbers
from asperity.vibration.run import small_vibration

if TYPE_CHECKING:
    from mpi4py import MPI


@dataclass
class Job:
    """A case whose curve is known, and what its stages have found so far.

    Attributes:
        case: the input
        solved: the static part
        files: of the run
        log: its warnings
        progress: receives stages
        comm: of the run
        summary: contents of summary.json
        failure: why a part is missing, the first one
        dynamics: the vibration, when requested
        numbers: stiffness, frequency and damping of small vibration; None where there is none, or no mass
    """

    case: Case
    solved: SolvedCase
    files: RunFiles
    log: RunLog
    progress: Progress
    comm: MPI.Comm
    summary: dict[str, Any] = field(default_factory=dict)
    failure: ConvergenceError | None = None
    dynamics: Dynamics | None = None
    numbers: Numbers | None = None

    @cached_property
    def settings(self) -> DynamicsSettings:
        """Settings of the vibration of the case."""
        return DynamicsSettings.of_case(self.case.to_dict())

    def write(self) -> None:
        """Write summary.json; collective."""
        self.summary["parallel"] = of_ranks(self.comm, self.summary["seconds"])
        self.files.summary(self.summary, self.failure)

    def follow(self) -> None:
        """Do the stages that the case requests; what does not need a part that fails follows all the same."""
        self.summary |= self.solved.summary(self.case, self.comm.size) | {"warnings": self.log.texts}
        self.failure = self.solved.failure
        phases = Phases(self.summary["seconds"])
        self.write()
        for name, wanted, run in STAGES:
            if wanted(self):
                self.progress.stage(name)
                try:
                    with phases.phase(name):
                        run(self)
                except (ConvergenceError, InputError) as e:  # on all ranks
                    kept = e if isinstance(e, ConvergenceError) else ConvergenceError(f"{e}; the curve is kept")
                    self.failure = self.failure or kept
                self.write()
        if self.solved.complete:
            self.summary["finished"] = self.failure is None  # not before all is there: a finished run is not continued
            self.write()


def _fields(job: Job) -> None:
    job.files.fields(job.solved.contact)


def _joint(job: Job) -> None:
    """Small vibration of a joint whose case requests no other."""
    try:
        numbers, load = on_root_bcast(job.comm, partial(small_vibration, job.solved.contact.curve, job.settings))
    except InputError as e:  # the case asks for no vibration: its curve is all that it needs
        warn(f"no stiffness of the joint: {e}")
        return
    job.summary["joint"] = {"numbers": numbers.to_dict(), "load": load}
    job.numbers = numbers if math.isfinite(numbers.frequency) else None


def _dynamics(job: Job) -> None:
    def vibrate() -> Dynamics:
        result = run_dynamics(job.solved.contact.curve, job.settings, out_dir=job.files.folder)
        if result.choice is not None and result.choice.note:
            warn(result.choice.note)
        return result

    # the other ranks wait, for a process that ends with an error would end all
    job.dynamics = on_root_bcast(job.comm, vibrate)
    section, numbers = job.dynamics.to_dict(), job.dynamics.numbers
    job.summary["dynamics"] = {name: section[name] for name in ("law", "load", "numbers", "laws", "notes")}
    if job.case.joint is not None:
        job.summary["joint"] = {name: section[name] for name in ("numbers", "load")}
    job.numbers = numbers if math.isfinite(numbers.frequency) else None


def _slip(job: Job) -> None:
    """Section "slip" of summary.json, and its files; the mass of the normal vibration is on the joint."""
    assert job.case.slip is not None

    def by_curve() -> JointSlip:
        found = slip_of_case(job.case.to_dict(), job.solved.contact.curve, job.settings.patch_load)
        if job.files.folder is not None:
            found.write(job.files.folder)
        return found

    slip = on_root_bcast(job.comm, by_curve)
    for text in slip.notes:
        warn(text)
    mass = None if job.numbers is None or not math.isfinite(job.numbers.mass) else job.numbers.mass
    job.summary["slip"] = replace(slip, mass=mass, factor=job.settings.factor, units=job.case.units).to_dict()


def _indentation(job: Job) -> None:
    """Section "indentation" of summary.json."""
    found = on_root_bcast(job.comm, lambda: indentation_of(job.solved.problem, job.solved.contact.curve))
    if found is not None:
        job.summary["indentation"] = asdict(found)


def _assumptions(job: Job) -> None:
    """Judge the assumptions, and warn of what is doubtful in the result; the rest of the doubts is in the log."""
    patches = on_root_bcast(job.comm, partial(_patches, job))
    lines = on_root_bcast(job.comm, lambda: assumptions_of(_evidence(job, patches)))
    job.summary["assumptions"] = [line.to_dict() for line in lines]
    if patches is not None:
        job.summary["patches"] = patches.to_dict()
    for line in lines:
        text = describe(line.to_dict())
        if line.verdict == DOUBTFUL and line.warned:
            warn(text, AssumptionWarning)
        elif line.verdict == DOUBTFUL:
            logging.getLogger(__name__).info("doubtful: %s", text)
    output, contact = job.case.output, job.solved.contact
    if output.fields and job.files.folder is not None and contact.complete and not contact.snapshots:
        why = "output.snapshots = 0"
        if output.snapshots:
            why = "the steps were computed without snapshots before the run was resumed; replace the run with --force"
        warn(f"output.fields = true writes nothing: {why}", CaseWarning)
    unresolved, interrupted = contact.curve.unresolved(), isinstance(job.solved.failure, Interrupted)
    if unresolved and job.solved.accurate is None and not interrupted:
        warn(f"{unresolved}; make mesh.h_contact smaller", ResolutionWarning)
    job.log.share()


def _patches(job: Job) -> Spread | None:
    """What other patches change of the stiffness of a joint; None without a joint."""
    load = job.settings.patch_load
    if job.case.joint is None or load is None:
        return None
    return spread_of_patches(job.solved.problem, load / job.case.surface.L**2)


def _evidence(job: Job, patches: Spread | None) -> Evidence:
    """What the assumptions are judged by."""
    case, strain = job.case, job.solved.strain
    side = None if case.joint is None or case.joint.nominal_area is None else math.sqrt(case.joint.nominal_area)
    return Evidence(
        job.solved.contact.curve, job.solved.problem, si=case.units == "SI",
        h=case.mesh.h_contact if case.accuracy.tolerance is None and case.mesh.file is None else None,
        small_strain=None if strain is None else (strain.percent, strain.limit),
        density=case.material.density, vibration=job.numbers, side=side or case.surface.L, patches=patches,
    )  # fmt: skip


def _figures(job: Job) -> None:
    """Draw the figures, each on one rank."""
    from asperity.output.results import Results
    from asperity.plot import draw, figures_of

    folder = _folder(job)
    read = cache(partial(Results.read, folder, job.solved.problem.surface))
    names = on_root_bcast(job.comm, lambda: list(figures_of(read())))
    spread(job.comm, [lambda name=name: draw(read(), name) for name in names], near=True)  # type: ignore[misc]


def _report(job: Job) -> None:
    from asperity.plot.report import write_report

    on_root(job.comm, partial(write_report, _folder(job)))


def _folder(job: Job) -> Path:
    assert job.files.folder is not None
    return job.files.folder


def _writes(job: Job) -> bool:
    """Whether the curve is whole and there is a folder."""
    return job.solved.complete and job.files.folder is not None


def _has_fields(job: Job) -> bool:
    """Whether the case requests what needs snapshots, and there are some, as a run that continues may not have."""
    return _writes(job) and (job.case.output.figures or job.case.output.fields) and bool(job.solved.contact.snapshots)


#: Name of a stage, whether a job does it, and how, on all ranks; in this order.
STAGES: tuple[tuple[str, Callable[[Job], bool], Callable[[Job], None]], ...] = (
    ("fields", _has_fields, _fields),
    ("joint", lambda job: job.solved.complete and job.case.joint is not None and job.case.dynamics is None, _joint),
    ("dynamics", lambda job: job.solved.complete and job.case.dynamics is not None, _dynamics),
    ("slip", lambda job: job.solved.complete and job.case.slip is not None, _slip),
    ("indentation", lambda job: job.solved.complete and job.case.tool is not None, _indentation),
    ("assumptions", lambda job: True, _assumptions),
    ("figures", lambda job: _writes(job) and (job.case.output.figures or job.case.output.report), _figures),
    ("report", lambda job: _writes(job) and job.case.output.report, _report),
)
