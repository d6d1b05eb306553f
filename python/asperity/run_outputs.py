# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

"""What follows the curve of a case in the folder of its run: fields, vibration, figures, report."""

from __future__ import annotations

import warnings
from math import isfinite
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Any

from asperity.case import Case
from asperity.case.schema import DynamicsSection
from asperity.curve import Curve
from asperity.errors import AsperityError, AsperityWarning
from asperity.output.run_files import RunFiles
from asperity.runtime.files import files_into
from asperity.runtime.parallel import on_root_bcast
from asperity.runtime.progress import Progress
from asperity.runtime.run_folder import DISTRIBUTIONS, FIELDS, VTKHDF
from asperity.surface import Surface

if TYPE_CHECKING:
    from asperity.dynamics import Dynamics
    from asperity.dynamics.joint import Numbers
    from asperity.quasistatic.contact_result import ContactResult


def write_outputs(
    case: Case,
    surface: Surface,
    contact: ContactResult,
    summary: dict[str, Any],
    folder: Path | None,
    writer: RunFiles,
    progress: Progress,
    finished: bool,
) -> Dynamics | None:
    """Write what a case requests in addition to its curve; collective.

    Args:
        case: the input
        surface: its top
        contact: with the curve, mesh and snapshots
        summary: of the run; receives the seconds of each part, the vibration, and `finished`
        folder: of the run; None writes nothing
        writer: of its curve and summary, for rank 0
        progress: receives stages
        finished: whether the run has done what was requested

    Returns:
        the vibration, None when not requested
    """
    comm, seconds = contact.solver.solid.comm, summary["seconds"]
    if contact.snapshots and folder is not None:
        progress.stage("fields")
        start = perf_counter()
        _write_fields(case, contact, folder)
        seconds["fields"] = perf_counter() - start

    def serial() -> Dynamics | None:
        dynamics = None
        if case.dynamics is not None:
            progress.stage("dynamics")
            start = perf_counter()
            dynamics = _vibration(case, contact.curve, folder)
            found = dynamics.to_dict()
            summary["dynamics"] = {name: found[name] for name in ("law", "load", "numbers", "laws", "notes")}
            seconds["dynamics"] = perf_counter() - start
        writer.summary(summary)
        if folder is not None and (case.output.figures or case.output.report):
            from asperity.plot import plot_run

            progress.stage("figures")
            start = perf_counter()
            plot_run(folder, surface)
            seconds["figures"] = perf_counter() - start
            writer.summary(summary)
        if folder is not None and case.output.report:
            from asperity.plot.report import write_report

            write_report(folder, finished)
        summary["finished"] = finished  # not before all is there: a finished run is not continued
        writer.summary(summary)
        return dynamics

    # the others wait, for a process that ends with an error would end all
    return on_root_bcast(comm, serial)


def _write_fields(case: Case, contact: ContactResult, folder: Path) -> None:
    """Write the snapshots for figures, ParaView and distributions; collective."""
    from asperity.output.distributions import write_distributions
    from asperity.output.fields import gather_states, write_figure_data, write_vtkhdf

    states = gather_states(contact, case.surface.L, case.material.E)
    block = contact.block
    if contact.solver.solid.comm.rank == 0 and block is not None:
        with files_into(folder / FIELDS) as aside:
            write_figure_data(aside, block, states)
            if case.output.fields:
                write_vtkhdf(aside / VTKHDF, block, states)
            if case.output.distributions:
                write_distributions(aside / DISTRIBUTIONS, block, states)


def _of_small_vibration(case: Case) -> dict[str, Any]:
    """Law, preload, mass and damping of the vibration of a case, as `run_dynamics` takes them."""
    from asperity.dynamics import Joint

    section = case.dynamics or DynamicsSection()
    joint = None if case.joint is None else Joint(**case.joint.model_dump())
    zeta = section.zeta if joint is None or joint.damping is None else joint.damping
    return {
        "law": section.law, "load": section.preload, "overload": section.overload, "zeta": zeta,
        "gravity": section.gravity, "joint": joint, "units": case.units, "patch_area": case.surface.L**2,
    }  # fmt: skip


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
            found = small_vibration(curve, **_of_small_vibration(case))
        except AsperityError:
            return None
    return found if isfinite(found.frequency) else None


def _vibration(case: Case, curve: Curve, folder: Path | None) -> Dynamics:
    """Vibration on the curve of a case."""
    from asperity.dynamics import run_dynamics
    from asperity.dynamics.law.choice import LACK

    section = case.dynamics
    assert section is not None
    result = run_dynamics(
        curve, models=section.model, damping=section.damping, forcing=section.forcing, omega=section.omega,
        out_dir=folder, **_of_small_vibration(case),
    )  # fmt: skip
    if LACK in result.notes:
        warnings.warn(LACK, AsperityWarning, stacklevel=2)
    return result
