# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

"""What follows the curve of a case in the folder of its run: fields, vibration, figures, report."""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

from asperity.case import Case
from asperity.curve import Curve
from asperity.errors import AsperityError, AsperityWarning, ConvergenceError, InputError, Interrupted
from asperity.loops import LoopTable
from asperity.model.problem import Problem
from asperity.output.run_files import RunFiles
from asperity.runtime.files import files_into, write_npz
from asperity.runtime.parallel import on_root, on_root_bcast
from asperity.runtime.progress import Progress
from asperity.runtime.run_folder import BLOCK, DISTRIBUTIONS, FIELDS, LOOPS, TOP, VTKHDF
from asperity.runtime.shares import on_root_of
from asperity.runtime.timing import Phases

if TYPE_CHECKING:
    from asperity.dynamics import Dynamics, DynamicsSettings
    from asperity.dynamics.joint import Numbers
    from asperity.quasistatic.contact_result import ContactResult


def write_outputs(
    case: Case,
    problem: Problem,
    contact: ContactResult,
    summary: dict[str, Any],
    folder: Path | None,
    writer: RunFiles,
    progress: Progress,
    finished: bool,
    stop: Callable[[], str] | None = None,
) -> Dynamics | None:
    """Write what a case requests in addition to its curve; collective.

    Args:
        case: the input
        problem: of the case
        contact: with the curve, mesh and snapshots
        summary: of the run; receives the seconds of each part, the vibration, and `finished`
        folder: of the run; None writes nothing
        writer: of its curve and summary, for rank 0
        progress: receives stages
        finished: whether the run has done what was requested
        stop: polled by the loops; a reason ends them

    Returns:
        the vibration, None when not requested

    Raises:
        ConvergenceError: of the stiffness matrix or the loops, after the other files are written
        Interrupted: a reason to stop the loops
    """
    from asperity.quasistatic.stiffness_matrix import stiffness_matrix

    comm, parts = contact.solver.solid.comm, Phases(summary["seconds"])
    if contact.snapshots and folder is not None:
        progress.stage("fields")
        with parts.phase("fields"):
            _write_fields(case, contact, folder)

    loops, failure = None, None
    try:
        if case.output.stiffness_matrix:
            progress.stage("stiffness matrix")
            with parts.phase("stiffness matrix"):
                matrix = stiffness_matrix(contact.solver)
            scaled = None if matrix is None else matrix.scaled(case.material.E, case.surface.L)
            summary["stiffness_matrix"] = None if scaled is None else scaled.to_dict()
        if case.loops is not None:
            progress.stage("loops")
            with parts.phase("loops"):
                loops = compute_loops(case, problem, contact, stop)
    except Interrupted:
        raise
    except (ConvergenceError, InputError) as e:  # on all ranks; what does not need them is written all the same
        failure, finished = e, False
        summary["exit_reason"] = str(e)

    def vibrate() -> Dynamics | None:
        dynamics = None
        if loops is not None:
            summary["loops"] = loops.to_dict()
            for text in loop_doubts(loops, float(contact.curve.force.max())):
                warnings.warn(text, AsperityWarning, stacklevel=2)
            if folder is not None:
                loops.write(folder / LOOPS)
        if case.dynamics is not None and not _lacks_loops(case, loops):
            progress.stage("dynamics")
            with parts.phase("dynamics"):
                dynamics = _vibration(case, contact.curve, folder, loops)
                found = dynamics.to_dict()
            summary["dynamics"] = {name: found[name] for name in ("law", "load", "numbers", "laws", "notes")}
            if radiated := _radiation(case, dynamics):
                summary["radiation"] = radiated
        writer.summary(summary)
        return dynamics

    def finish() -> None:
        if folder is not None and case.output.report:
            from asperity.plot.report import write_report

            writer.summary(summary)
            write_report(folder, finished)
        summary["finished"] = finished  # not before all is there: a finished run is not continued
        writer.summary(summary)

    def draw() -> None:
        from asperity.plot import plot_run

        assert folder is not None
        progress.stage("figures")
        with parts.phase("figures"):
            plot_run(folder, problem.surface)

    dynamics = on_root_bcast(comm, vibrate)  # the others wait, for a process that ends with an error would end all
    if folder is not None and (case.output.figures or case.output.report):
        on_root(comm, draw)
    on_root(comm, finish)
    if failure is not None:
        raise failure
    return dynamics


def _lacks_loops(case: Case, loops: LoopTable | None) -> bool:
    """Whether the vibration is damped by loops that were requested and not found."""
    from asperity.dynamics.law.damping import LOOPS as OF_LOOPS

    return case.dynamics is not None and case.dynamics.damping == OF_LOOPS and case.loops is not None and loops is None


def _write_fields(case: Case, contact: ContactResult, folder: Path) -> None:
    """Write the snapshots for figures, ParaView and distributions; collective."""
    from asperity.output.distributions import write_distributions
    from asperity.output.fields import gather_top_states, mesh_streams, vtkhdf_streams, write_top, write_vtkhdf_streams

    L, E = case.surface.L, case.material.E
    top, mesh = gather_top_states(contact, L, E), mesh_streams(contact, L)
    grid = vtkhdf_streams(contact, E) if case.output.fields else {}

    def write() -> None:
        assert top is not None
        with files_into(folder / FIELDS) as aside:
            write_top(aside / TOP, top)
            write_npz(aside / BLOCK, mesh.items(), compress=True)
            if grid:
                write_vtkhdf_streams(aside / VTKHDF, grid, [s.delta for s in contact.snapshots])
            if case.output.distributions:
                write_distributions(aside / DISTRIBUTIONS, top, L)

    on_root_of(contact.solver.solid.comm, [*mesh.values(), *grid.values()], write)


def compute_loops(
    case: Case, problem: Problem, contact: ContactResult, stop: Callable[[], str] | None = None
) -> LoopTable:
    """Loops of a case about its preload, from the state at the end of the load path; collective.

    Args:
        case: with a section [loops]
        problem: that was solved
        contact: whose solver is in that state, and is so afterwards
        stop: see `solve_loops`

    Raises:
        InputError: the preload exceeds the greatest force of the curve
    """
    from asperity.quasistatic.force_loops import solve_loops
    from asperity.quasistatic.stepping import FORCE_TOLERANCE

    assert case.loops is not None
    top, key = float(contact.curve.force.max()), "loops.preload"
    preload = case.loops.preload
    if preload is None:
        preload, key = _preload(case), "the preload of the loops"
    preload = 0.5 * top if preload is None else preload
    # a load path by force ends within a small tolerance of it, and a tolerance corrects the curve
    if top < preload <= top * (1.0 + max(2.0 * FORCE_TOLERANCE, case.accuracy.tolerance or 0.0)):
        preload = top
    if not 0.0 < preload <= top:
        raise InputError(
            f"{key} = {preload:g} must lie between 0 and {top:g}, the greatest force of the curve: lower it, or load "
            "the contact further"
        )
    wanted = case.loops
    return solve_loops(
        problem, contact, preload, wanted.amplitudes, cycles=wanted.cycles, steps=wanted.steps, stop=stop
    )


def _preload(case: Case) -> float | None:
    """Static force of the vibration on the patch, None where nothing gives it."""
    settings = _settings(case)
    joint, patch = settings.joint, settings.patch_area
    load = settings.preload if settings.preload is not None or joint is None else joint.load(patch)
    return None if load is None else load / (1.0 if joint is None else joint.factor(patch))


def loop_doubts(loops: LoopTable, top: float) -> Iterator[str]:
    """Sentences on loops that are not steady, or that load the contact further than its curve.

    Args:
        loops: of the run
        top: greatest force of its curve [force]
    """
    if unsettled := loops.unsettled():
        yield (
            f"the loops of amplitude {', '.join(f'{a:g}' for a in unsettled)} are not steady yet: use more loops.cycles"
        )
    first = loops.loops[0]
    beyond = [loop.amplitude for loop in loops.loops if loop.preload * (1.0 + loop.amplitude) > top * (1.0 + 1e-6)]
    if beyond:
        yield (
            f"loops from an amplitude of {min(beyond):g} of the preload {first.preload:g} on pass the greatest force "
            f"{top:g} of the curve, for which the mesh was made: load the contact further, or lower loops.amplitudes"
        )


def _radiation(case: Case, dynamics: Dynamics) -> dict[str, float]:
    """Loss factor by radiation at the frequency of small vibration, where density and frequency are known."""
    from asperity.reference import LONG_WAVES, radiation_loss

    numbers, density, solid = dynamics.numbers, case.material.density, case.material
    if density is None or not math.isfinite(numbers.frequency):
        return {}
    omega = 2.0 * math.pi * numbers.frequency
    over = nominal_side(case) * numbers.frequency / math.sqrt(solid.solid.lame[1] / density)
    found = {"side_over_wavelength": over}
    if over <= LONG_WAVES:
        found["eta"] = radiation_loss(numbers.stiffness, omega, E=solid.E, nu=solid.nu, density=density)
    return found


def nominal_side(case: Case) -> float:
    """Side of the nominal area of what vibrates, that of the joint if it has one [length]."""
    area = None if case.joint is None else case.joint.nominal_area
    return case.surface.L if area is None else math.sqrt(area)


def _settings(case: Case) -> DynamicsSettings:
    from asperity.dynamics import DynamicsSettings

    return DynamicsSettings.of_case(case.to_dict())


def small_vibration_of(case: Case, curve: Curve) -> Numbers | None:
    """Stiffness, mass, frequency and damping of the vibration of a case; None where it has none, or no mass.

    The ledger needs them before `write_outputs`; what is wrong with them is reported there.
    """
    from asperity.dynamics.run import small_vibration

    if (case.dynamics is None and case.joint is None) or not len(curve):
        return None
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            found = small_vibration(curve, _settings(case))
        except AsperityError:
            return None
    return found if math.isfinite(found.frequency) else None


def _vibration(case: Case, curve: Curve, folder: Path | None, loops: LoopTable | None) -> Dynamics:
    """Vibration on the curve of a case."""
    from asperity.dynamics import LoopDamping, run_dynamics
    from asperity.dynamics.law.damping import LOOPS

    settings = _settings(case)
    if settings.damping == LOOPS and loops is not None:
        settings = settings.replaced(damping=LoopDamping.of(loops))
    result = run_dynamics(curve, settings, out_dir=folder)
    if result.laws is not None and result.laws.choice.note:
        warnings.warn(result.laws.choice.note, AsperityWarning, stacklevel=2)
    return result
