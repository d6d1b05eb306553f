# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

"""What follows the curve of a case in the folder of its run: fields, vibration, figures, report."""

from __future__ import annotations

import warnings
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Any

from asperity.case import Case
from asperity.curve import Curve
from asperity.errors import AsperityWarning
from asperity.output.run_files import RunFiles
from asperity.runtime.files import files_into
from asperity.runtime.parallel import on_root_bcast
from asperity.runtime.progress import Progress
from asperity.runtime.run_folder import DISTRIBUTIONS, FIELDS, VTKHDF
from asperity.surface import Surface

if TYPE_CHECKING:
    from asperity.dynamics import Dynamics
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


def _vibration(case: Case, curve: Curve, folder: Path | None) -> Dynamics:
    """Vibration on the curve of a case."""
    from asperity.dynamics import Joint, run_dynamics
    from asperity.dynamics.law.choice import LACK

    assert case.dynamics is not None
    settings = case.dynamics.model_dump()
    load, models = settings.pop("preload"), settings.pop("model")
    joint = None if case.joint is None else Joint(**case.joint.model_dump())
    if joint is not None and joint.damping is not None:
        settings["zeta"] = joint.damping
    result = run_dynamics(
        curve, load=load, models=models, out_dir=folder, units=case.units, joint=joint,
        patch_area=case.surface.L**2, **settings,
    )  # fmt: skip
    if LACK in result.notes:
        warnings.warn(LACK, AsperityWarning, stacklevel=2)
    return result
