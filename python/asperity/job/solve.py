"""The static part of a case, on one mesh or those of a tolerance."""

from __future__ import annotations

import logging
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from asperity.adaptive.guide import SmallStrain, choose_kinematics, guide_of
from asperity.adaptive.solve_contact import AccurateResult, refine
from asperity.case import Case
from asperity.curve import Curve
from asperity.errors import CheckError, ConvergenceError, Interrupted
from asperity.mesh.block import BlockMesh
from asperity.model.material import AUTO
from asperity.model.problem import Problem
from asperity.output.run_files import RunFiles, summarise
from asperity.quasistatic.contact_result import ContactResult, PartialResult, refuse_wrong
from asperity.quasistatic.solve_problem import Callbacks, solve_problem
from asperity.runtime.parallel import on_root
from asperity.runtime.progress import Progress

if TYPE_CHECKING:
    from mpi4py import MPI

_LOGGED = {  # column of curve.csv: format of its values
    "step": "{}", "branch": "{}", "delta_star": "{:.4e}", "P_star": "{:.4e}", "area_fraction": "{:.4f}",
    "newton": "{}", "krylov": "{}", "seconds": "{:.1f} s",
}  # fmt: skip


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
            accurate = refine(chosen, case.accuracy, comm, replace(hooks, on_curve=files.curve), guide)
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
    logger, output = logging.getLogger(__name__), case.output

    def on_stage(name: str) -> None:
        if reason := "" if stop is None else stop():
            raise Interrupted(f"stopped by {reason} before the load path (next: {name})")
        progress.stage(name)
        logger.info("%s", name)

    def on_step(rows: Sequence[Mapping[str, Any]], fraction: float) -> None:
        files.curve(Curve.from_rows(rows), whole=False)
        progress.step(rows[-1], fraction)
        logger.info("%s", ", ".join(f"{name} {form.format(rows[-1][name])}" for name, form in _LOGGED.items()))

    return Callbacks(
        on_stage, on_step, stop, files.checkpoint,
        snapshots=output.snapshots if output.figures or output.fields else 0,
        on_ready=files.begin,
        stiffness=case.has_stiffness,
        flow=output.flow,
    )  # fmt: skip
