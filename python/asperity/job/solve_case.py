"""The static part of a case: kinematics, one mesh or those of a tolerance."""

from __future__ import annotations

import logging
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from asperity.adaptive.mesh_error import AccurateResult
from asperity.adaptive.refine import refine
from asperity.adaptive.small_strain import SmallStrain, choose_kinematics
from asperity.case import Case
from asperity.curve import Curve
from asperity.dynamics import DynamicsSettings
from asperity.errors import CheckError, ConvergenceError, Interrupted
from asperity.mesh.block import BlockMesh
from asperity.model.problem import Problem
from asperity.model.settings import AccuracyTarget
from asperity.output.assumption import Evidence
from asperity.output.patches import Spread, spread_of_patches
from asperity.output.run_files import RunFiles
from asperity.output.summary import summarise
from asperity.quasistatic.callbacks import Callbacks
from asperity.quasistatic.contact_result import ContactResult, PartialResult, refuse_wrong
from asperity.quasistatic.solve_problem import solve_problem
from asperity.runtime.progress import Progress, row_line

if TYPE_CHECKING:
    from mpi4py import MPI

    from asperity.dynamics.joint import Numbers


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
        h = roughness = None
        if accurate is not None:
            h, roughness = accurate.levels[-1].h, accurate.roughness_share()
        elif case.mesh.file is None and tolerance is None:  # a run with a tolerance may have no bar
            h = case.mesh.h_contact
        change = None if self.strain is None else (self.strain.percent, self.strain.limit)
        return Evidence(
            self.contact.curve, self.problem, si=case.units == "SI", tolerance=tolerance, h=h, roughness=roughness,
            small_strain=change, density=case.material.density, vibration=vibration, side=case.nominal_side,
            patches=self._patches(case),
        )  # fmt: skip

    def _patches(self, case: Case) -> Spread | None:
        """What other patches change of the stiffness of a joint, None without a joint or without its preload."""
        if case.joint is None:
            return None
        settings = DynamicsSettings.of_case(case.to_dict())
        if settings.load is None:
            return None
        return spread_of_patches(self.problem, settings.load / settings.factor / case.surface.L**2)


def solve_case(
    case: Case,
    problem: Problem,
    files: RunFiles,
    progress: Progress,
    stop: Callable[[], str] | None,
    comm: MPI.Comm,
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
    chosen, strain = choose_kinematics(problem, case.accuracy.tolerance, comm)
    if strain is not None:
        hooks.stage(strain.describe())
        files.note(f'kinematics = "auto" took "{strain.kinematics}"')
    accurate = failure = None
    try:
        wanted = case.accuracy
        if wanted.tolerance is None:
            block = None if case.mesh.file is None else BlockMesh.read(case.mesh.file)
            contact = solve_problem(chosen, block=block, comm=comm, hooks=hooks, checked=False)
        else:
            target = AccuracyTarget(wanted.tolerance, wanted.max_dofs, wanted.max_seconds, wanted.area_tolerance)
            accurate = refine(chosen, target, comm, replace(hooks, on_curve=files.curve))
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
        stiffness=case.has_stiffness, conductance=output.conductance, on_part=progress.part,
    )  # fmt: skip
