"""The whole job of a case: curve, law, dynamics, and the files a run leaves in its folder."""

from __future__ import annotations

import json
import logging
import platform
import warnings
from collections.abc import Callable, Mapping, Sequence
from contextlib import nullcontext
from dataclasses import asdict, dataclass, replace
from importlib import metadata
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Any

from asperity.case import Case
from asperity.curve import Curve
from asperity.errors import CheckError, ConvergenceError, InputError, Interrupted, OutputError, ResolutionWarning
from asperity.model.material import Material
from asperity.power_law import PowerLawFit
from asperity.runtime.files import UNREADABLE, files_into, on_root, remove_asides, replace_file
from asperity.runtime.progress import Progress, log_file

if TYPE_CHECKING:
    from mpi4py import MPI

    from asperity.adaptive.solve_to_tolerance import AccurateResult
    from asperity.quasistatic.solve_contact import ContactResult

PACKAGES = ("numpy", "scipy", "mpi4py", "petsc4py", "gmsh")


@dataclass(frozen=True)
class RunResult:
    """Outcome of a case.

    Attributes:
        curve: accepted steps
        fit: power law of the loading branch; None when it has fewer than three points
        summary: what summary.json holds
        contact: the solved contact, with mesh and last state; None when a resumed run had nothing left to do
        dynamics: what `dynamics.run_dynamics` returned, None when not asked for
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
    comm: MPI.Comm | None = None,
) -> RunResult:
    """Run a case and write its results; collective over `comm`.

    Args:
        case: the input, or the path of a case file
        folder: receives the files; None writes nothing
        progress: told of stages and steps
        resume: continue from a checkpoint in `folder`
        comm: communicator; default all ranks

    Raises:
        InputError: the case is wrong
        CheckpointError: `folder` holds no checkpoint of this case to resume from
        ConvergenceError: the path could not be followed, the files hold the part before; or the tolerance was not met,
            what was found is kept like a finished run
        Interrupted: SIGTERM or SIGINT asked to end; the files and the checkpoint hold the part before
        CheckError: the run is complete, but violates a balance
        OutputError: a file cannot be written
    """
    from mpi4py import MPI

    from asperity.quasistatic.checkpoint import Checkpoint, identity
    from asperity.quasistatic.solve_contact import PartialResult
    from asperity.runtime.interrupt import StopRequest

    case = case if isinstance(case, Case) else Case.load(case)
    comm = MPI.COMM_WORLD if comm is None else comm
    progress = progress or Progress()
    out = None if folder is None else Path(folder)
    writer = _Writer(case, out if comm.rank == 0 else None)
    checkpoint = None
    if out is not None:
        checkpoint = Checkpoint(out / "checkpoint", identity(case), comm, case.output.checkpoint)
    if resume:
        if checkpoint is None:
            raise InputError("give the folder of the run to resume")
        checkpoint.require()
        done = on_root(comm, writer.finished)
        if done is not None:
            return RunResult(done[0], _fit(done[0]), done[1], None)
    elif checkpoint is not None:
        checkpoint.clear()
    on_root(comm, writer.begin)
    failure: ConvergenceError | None = None
    accurate = None
    log = None if out is None or comm.rank > 0 else out / "run.log"
    with nullcontext() if out is None else StopRequest(comm) as request, log_file(log, append=resume):
        settings = _settings(case, comm, progress, writer, None if request is None else request.agreed)
        try:
            if case.accuracy.tolerance is None:
                contact = _solve(case, settings | {"checkpoint": checkpoint})
            else:
                accurate = _solve_to_tolerance(case, settings | {"checkpoint": checkpoint}, writer)
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

    def write() -> None:
        (writer.steps if accurate is None else writer.curve)(contact.curve)
        writer.summary(summary)

    on_root(comm, write)
    complete = accurate is not None and not doubts  # though perhaps not as accurate as asked for
    if failure is not None and not complete:
        raise failure
    result = RunResult(contact.curve, fit, summary, contact)
    result = _after(case, result, contact, out, comm, progress, writer, finished=failure is None)
    if summary["unresolved"] and accurate is None and comm.rank == 0:
        warnings.warn(f"{summary['unresolved']}; make mesh.h_contact smaller", ResolutionWarning, stacklevel=2)
    if failure is not None:
        raise failure
    return result


def material_of(case: Case) -> Material:
    """The material of a case."""
    m = case.material
    return Material(m.E, m.nu, m.yield_strength, m.tangent_modulus or 0.0)


def _settings(
    case: Case,
    comm: MPI.Comm,
    progress: Progress,
    writer: _Writer,
    stop: Callable[[], str] | None,
) -> dict[str, Any]:
    """Arguments of `statics.solve_contact` but for surface, material and mesh; writes the curve step by step."""
    from asperity.quasistatic.newton import SolverOptions
    from asperity.quasistatic.solve_contact import Formulation

    loading = case.loading

    def on_stage(name: str) -> None:
        reason = "" if stop is None else stop()
        if reason:
            raise Interrupted(f"stopped by {reason} before the load path (next: {name})")
        progress.stage(name)
        logging.getLogger(__name__).info("%s", name)

    def on_step(rows: Sequence[Mapping[str, Any]], fraction: float) -> None:
        on_root(comm, lambda: writer.steps(Curve.from_rows(rows)))
        progress.step(rows[-1], fraction)

    return dict(
        height=case.block.height,
        sides=case.block.sides,
        delta_max=loading.delta_max,
        force_max=loading.force_max,
        steps=loading.steps,
        unload_steps=loading.unload_steps if loading.unload else 0,
        cycles=loading.cycles,
        integrator=loading.integrator,
        formulation=Formulation(**case.contact.model_dump()),
        kernels=case.solver.kernels,
        options=SolverOptions(case.solver.linear, case.solver.rtol, case.solver.newton_max),
        snapshots=case.output.snapshots if case.output.figures or case.output.fields else 0,
        comm=comm,
        on_stage=on_stage,
        on_step=on_step,
        stop=stop,
    )


def _solve(case: Case, settings: dict[str, Any]) -> ContactResult:
    """The static part of a case on one mesh."""
    from asperity.mesh.block import BlockMesh
    from asperity.quasistatic.solve_contact import MeshSize, solve_contact

    mesh = case.mesh
    return solve_contact(
        case.build_surface(),
        material_of(case),
        size=MeshSize(mesh.h_contact, mesh.growth, mesh.h_max),
        block=BlockMesh.read(mesh.file) if mesh.file is not None else None,
        **settings,
    )


def _solve_to_tolerance(case: Case, settings: dict[str, Any], writer: _Writer) -> AccurateResult:
    """The static part of a case on meshes that its tolerance chooses."""
    from asperity.adaptive.solve_to_tolerance import Goal, solve_to_tolerance

    if case.mesh.file is not None:
        raise InputError("mesh.file cannot go with accuracy.tolerance, which chooses the mesh: leave one of them out")
    wanted = case.accuracy
    assert wanted.tolerance is not None
    return solve_to_tolerance(
        case.build_surface(),
        material_of(case),
        Goal(wanted.tolerance, wanted.max_dofs, wanted.max_seconds),
        on_curve=lambda curve: on_root(settings["comm"], lambda: writer.curve(curve)),
        **settings,
    )


def _fit(curve: Curve) -> PowerLawFit | None:
    try:
        return curve.fit()
    except InputError:
        return None


def _after(
    case: Case,
    result: RunResult,
    contact: ContactResult,
    folder: Path | None,
    comm: MPI.Comm,
    progress: Progress,
    writer: _Writer,
    finished: bool,
) -> RunResult:
    """What follows a complete curve: fields, dynamics, figures, report; on rank 0 but for the gathering."""
    from asperity.output.fields import gather_states, write_figure_data, write_vtkhdf

    seconds = result.summary["seconds"]
    if contact.snapshots and folder is not None:
        progress.stage("fields")
        start = perf_counter()
        states = gather_states(contact, case.surface.L, case.material.E)
        block = contact.block
        if comm.rank == 0 and block is not None:
            with files_into(folder / "fields") as aside:
                write_figure_data(aside, block, states)
                if case.output.fields:
                    write_vtkhdf(aside / "contact.vtkhdf", block, states)
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

            plot_run(folder)
            seconds["figures"] = perf_counter() - start
            writer.summary(result.summary)
        if folder is not None and case.output.report:
            from asperity.plot.report import write_report

            write_report(folder)
        result.summary["finished"] = finished
        writer.summary(result.summary)
        return dynamics

    # the others wait, for a process that ends with an error would end all
    return replace(result, dynamics=on_root(comm, serial))


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
    )


def summarise(case: Case, contact: ContactResult, fit: PowerLawFit | None, ranks: int) -> dict[str, Any]:
    """Contents of summary.json."""
    return {
        "exit_reason": contact.reason,
        "finished": False,
        "fit": None if fit is None else fit.to_dict(),
        "dofs": contact.dofs,
        "cells": contact.cells,
        **asdict(contact.counts),
        "checks": asdict(contact.checks) | {"energy_ratio": contact.checks.energy_ratio},
        "unresolved": contact.curve.unresolved(),
        "seconds": {k: round(v, 4) for k, v in contact.phases.seconds.items()},
        "calls": contact.phases.calls,
        "peak_memory_MiB": round(contact.memory / 2**20, 1),
        "ranks": ranks,
        "seed": getattr(case.surface, "seed", None),
        "case_hash": case.hash(),
        "versions": versions(),
    }


def versions() -> dict[str, str]:
    """Versions of this package and of what it computes with."""
    from asperity import __version__

    found = {"asperity": __version__, "python": platform.python_version()}
    try:
        import dolfinx

        found["dolfinx"] = dolfinx.__version__
    except ImportError:
        pass
    for name in PACKAGES:
        try:
            found[name] = metadata.version(name)
        except metadata.PackageNotFoundError:
            continue
    return found


class _Writer:
    """Writes the files of a run; without a folder (and on all ranks but the first) nothing."""

    def __init__(self, case: Case, folder: Path | None) -> None:
        self._case, self._folder = case, folder
        self._whole = False

    def begin(self) -> None:
        """Make the folder and write the completed input."""
        if self._folder is not None:
            self._folder.mkdir(parents=True, exist_ok=True)
            remove_asides(self._folder)
            replace_file(self._folder / "case.toml", self._case.to_toml().encode())

    def finished(self) -> tuple[Curve, dict[str, Any]] | None:
        """Curve and summary when the folder holds all that the case asks for, else None."""
        assert self._folder is not None
        try:
            summary = json.loads((self._folder / "summary.json").read_text(encoding="utf-8"))
            text = (self._folder / "case.toml").read_text(encoding="utf-8")
            curve = Curve.read(self._folder / "curve.csv")
            done = summary["finished"] is True and summary["case_hash"] == self._case.hash()
        except (*UNREADABLE, InputError):
            return None
        return (curve, summary) if done and text == self._case.to_toml() else None

    def steps(self, curve: Curve) -> None:
        """Write the curve so far; a killed run keeps it, unless it has had a whole one on a coarser mesh."""
        if not self._whole:
            self._write(curve)

    def curve(self, curve: Curve) -> None:
        """Write a whole curve."""
        self._whole = True
        self._write(curve)

    def _write(self, curve: Curve) -> None:
        if self._folder is not None:
            curve.write(self._folder / "curve.csv")

    def summary(self, summary: dict[str, Any]) -> None:
        """Write summary.json."""
        if self._folder is not None:
            text = json.dumps(summary, indent=2, default=float)
            replace_file(self._folder / "summary.json", f"{text}\n".encode())
