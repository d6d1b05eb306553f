"""The parts of a case: its static part, on one mesh or those of a tolerance, then vibration and slip."""

from __future__ import annotations

import logging
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from asperity.adaptive.guide import guide_of
from asperity.adaptive.refine import AccurateResult, refine
from asperity.adaptive.small_strain import SmallStrain, choose_kinematics
from asperity.case import Case
from asperity.curve import Curve
from asperity.errors import AsperityWarning, CheckError, ConvergenceError, InputError, Interrupted, warn
from asperity.mesh.block import BlockMesh
from asperity.model.material import AUTO
from asperity.model.problem import Problem
from asperity.output.assumption import Evidence
from asperity.output.patches import spread_of_patches
from asperity.output.run_files import RunFiles
from asperity.output.summary import summarise
from asperity.quasistatic.callbacks import Callbacks
from asperity.quasistatic.contact_result import ContactResult, PartialResult, refuse_wrong
from asperity.quasistatic.solve_problem import solve_problem
from asperity.runtime.parallel import on_root, on_root_bcast
from asperity.runtime.progress import Progress, row_line
from asperity.slip import JointSlip
from asperity.slip.joint_slip import slip_of_case
from asperity.vibration import Dynamics, DynamicsSettings, run_dynamics
from asperity.vibration.numbers import Numbers
from asperity.vibration.run import small_vibration
from asperity.vibration.source import CurveColumns, met

if TYPE_CHECKING:
    from mpi4py import MPI


@dataclass(frozen=True)
class SolvedCase:
    """The static part of a case.

    Attributes:
        problem: that was solved, with the kinematics of the run
        contact: its result
        accurate: the same of a run with a tolerance
        strain: what small strain changes, of kinematics = "auto"
        failure: what stopped the run, or is wrong with its result
    """

    problem: Problem
    contact: ContactResult
    accurate: AccurateResult | None
    strain: SmallStrain | None
    failure: ConvergenceError | None

    @property
    def complete(self) -> bool:
        """Whether the curve is whole, though perhaps not as accurate as requested."""
        stopped = isinstance(self.failure, Interrupted) or self.contact.checks.violated or not self.contact.complete
        return self.failure is None or not stopped

    def summary(self, case: Case, ranks: int) -> dict[str, Any]:
        """Contents of summary.json that are known so far."""
        found = summarise(case, self.contact, ranks)
        strain = None if self.strain is None else self.strain.to_dict()
        found["model"] = {"kinematics": self.problem.material.kinematics, "small_strain": strain}
        if self.accurate is not None:
            found |= self.accurate.to_dict()
        return found

    def evidence(self, case: Case, vibration: Numbers | None) -> Evidence:
        """What the ledger of the run is made of; `vibration` has the numbers of small vibration, if there is one."""
        accurate, tolerance = self.accurate, case.accuracy.tolerance
        h = roughness = patches = None
        if accurate is not None:
            h, roughness = accurate.levels[-1].h, accurate.roughness_share()
        elif case.mesh.file is None and tolerance is None:  # a run with a tolerance may have no bar
            h = case.mesh.h_contact
        change = None if self.strain is None else (self.strain.percent, self.strain.limit)
        joint, side = case.joint, case.surface.L
        if joint is not None:
            side = side if joint.nominal_area is None else math.sqrt(joint.nominal_area)
            settings = _settings(case)
            if settings.load is not None:
                patches = spread_of_patches(self.problem, settings.load / settings.factor / case.surface.L**2)
        return Evidence(
            self.contact.curve, self.problem, si=case.units == "SI", tolerance=tolerance, h=h, roughness=roughness,
            small_strain=change, density=case.material.density, vibration=vibration, side=side,
            patches=patches,
        )  # fmt: skip


def solve_case(
    case: Case, problem: Problem, files: RunFiles, progress: Progress, stop: Callable[[], str] | None, comm: MPI.Comm
) -> SolvedCase:
    """Solve the static part of a case, and write its curve step by step; collective.

    Args:
        files: of the run; they begin when there is a mesh, so that a surface that cannot be meshed changes no file
        progress: receives stages and steps
        stop: gives the reason to stop, empty for none; collective; None never stops

    Raises:
        InputError: another mesh of a run with a tolerance cannot be made
        OutputError: a file cannot be written
    """
    hooks = _hooks(case, files, progress, stop)
    tolerance, guide = case.accuracy.tolerance, None
    if tolerance is not None and problem.material.kinematics == AUTO:
        guide = on_root(comm, lambda: guide_of(problem))
    chosen, strain = choose_kinematics(problem, tolerance, comm, guide)
    if strain is not None:
        hooks.stage(strain.describe())
    accurate = failure = None
    try:
        if tolerance is None:
            block = None if case.mesh.file is None else BlockMesh.read(case.mesh.file)
            contact = solve_problem(chosen, block=block, comm=comm, hooks=hooks, checked=False)
        else:
            target = case.accuracy
            accurate = refine(chosen, target, comm, replace(hooks, on_curve=files.curve), guide)
            contact = replace(accurate.contact, curve=accurate.curve, reason=accurate.reason)
            failure = None if accurate.met else ConvergenceError(accurate.reason)
    except PartialResult as e:
        stopped = isinstance(e.__cause__, Interrupted)
        failure = Interrupted(str(e)) if stopped else ConvergenceError(str(e))
        contact = e.result
    try:
        if accurate is not None:
            accurate.checked()
        elif not isinstance(failure, Interrupted):
            refuse_wrong(contact.checks, contact)
    except CheckError as e:
        failure = e
    return SolvedCase(chosen, contact, accurate=accurate, strain=strain, failure=failure)


def _hooks(case: Case, files: RunFiles, progress: Progress, stop: Callable[[], str] | None) -> Callbacks:
    """Progress, checkpoint and snapshots of a run, whose curve is written step by step."""

    def on_stage(name: str) -> None:
        if reason := "" if stop is None else stop():
            raise Interrupted(f"stopped by {reason} before the load path (next: {name})")
        progress.stage(name)
        logging.getLogger(__name__).info("%s", name)

    def on_step(rows: Sequence[Mapping[str, Any]], fraction: float) -> None:
        files.curve(Curve.from_rows(rows), whole=False)
        progress.step(rows[-1], fraction)
        logging.getLogger(__name__).info("%s", row_line(rows[-1]))

    output = case.output
    return Callbacks(
        on_stage, on_step, stop, files.checkpoint,
        snapshots=output.snapshots if output.figures or output.fields else 0,
        on_ready=files.begin,
        stiffness=case.has_stiffness,
        conductance=output.stiffness,  # of which the slip needs nothing
    )  # fmt: skip


@dataclass
class VibratedCase:
    """What was found after the curve of a case.

    Attributes:
        sections: of summary.json
        dynamics: the vibration, when requested
        numbers: stiffness, frequency and damping of small vibration; None where there is none, or no mass
        failure: why a part is missing
        ends: whether the run ends there, without figures and report
    """

    sections: dict[str, Any] = field(default_factory=dict)
    dynamics: Dynamics | None = None
    numbers: Numbers | None = None
    failure: ConvergenceError | None = None
    ends: bool = False


def vibrate_case(
    case: Case, contact: ContactResult, folder: Path | None,
    stage: Callable[[str], AbstractContextManager[None]],
) -> VibratedCase:  # fmt: skip
    """Compute what a case requests in addition to its curve; collective.

    Args:
        contact: with the curve, and the solver at the end of the load path
        folder: receives the files of vibration and slip; None writes nothing
        stage: announces a part by its name, and takes its time
    """
    found, comm = VibratedCase(), contact.solver.solid.comm

    @contextmanager
    def kept(ends: bool = False) -> Iterator[None]:
        """Note an error, on all ranks: what does not need this part follows, and the run has a curve all the same."""
        try:
            yield
        except (ConvergenceError, InputError) as e:
            found.failure = e if isinstance(e, ConvergenceError) else ConvergenceError(f"{e}; the curve is kept")
            found.ends = ends or isinstance(e, Interrupted)

    if case.dynamics is None and case.joint is not None and not found.ends:
        try:
            numbers, load = on_root_bcast(comm, partial(small_vibration, contact.curve, _settings(case)))
        except InputError as e:  # the case asks for no vibration: its curve is all that it needs
            warn(f"no stiffness of the joint: {e}", AsperityWarning)
        else:
            found.sections["joint"] = {"numbers": numbers.to_dict(), "load": load}
            found.numbers = numbers if math.isfinite(numbers.frequency) else None
    if case.dynamics is not None and not found.ends:
        with kept(ends=True):
            with stage("dynamics"):  # the other ranks wait, for a process that ends with an error would end all
                found.dynamics = on_root_bcast(comm, partial(_vibration, case, contact.curve, folder))
            section, numbers = found.dynamics.to_dict(), found.dynamics.numbers
            found.sections["dynamics"] = {name: section[name] for name in ("law", "load", "numbers", "laws", "notes")}
            if case.joint is not None:
                found.sections["joint"] = {name: section[name] for name in ("numbers", "load")}
            found.numbers = numbers if math.isfinite(numbers.frequency) else None
    if case.slip is not None and not found.ends:
        with kept(), stage("slip"):
            found.sections["slip"] = _slip(case, contact, folder, found.numbers)
    return found


def _slip(case: Case, contact: ContactResult, folder: Path | None, numbers: Numbers | None) -> dict[str, Any]:
    """Section "slip" of summary.json, and its files; the mass of the normal vibration is on the joint; collective."""
    assert case.slip is not None
    preload = _preload(case, contact.curve, "slip", case.slip.preload)

    def by_curve() -> JointSlip:
        found = slip_of_case(case.to_dict(), contact.curve, preload)
        if folder is not None:
            found.write(folder)
        return found

    slip = on_root_bcast(contact.solver.solid.comm, by_curve)
    for text in slip.notes:
        warn(text, AsperityWarning)
    mass = None if numbers is None or not math.isfinite(numbers.mass) else numbers.mass
    return slip.to_dict(mass, _settings(case).factor, units=case.units)


def _preload(case: Case, curve: Curve, section: str, preload: float | None) -> float:
    """Normal force on the patch about which a section moves the flat: its own, that of the vibration, or a half."""
    top, key, settings = float(curve.force.max()), f"{section}.preload", _settings(case)
    if preload is None and settings.preload is not None:
        preload, key = settings.preload / settings.factor, f"the preload of the {section}"
    preload = 0.5 * top if preload is None else preload
    preload, lowered = met(preload, top, CurveColumns.of(curve).bar_at(top), key)  # as the law of the vibration
    if lowered:
        warn(lowered)
    return preload


def _settings(case: Case) -> DynamicsSettings:
    return DynamicsSettings.of_case(case.to_dict())


def _vibration(case: Case, curve: Curve, folder: Path | None) -> Dynamics:
    """Vibration on the curve of a case."""
    result = run_dynamics(curve, _settings(case), out_dir=folder)
    if result.choice is not None and result.choice.note:
        warn(result.choice.note, AsperityWarning)
    return result
