# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

"""`asperity check`: what a run of a case would refuse or warn of, and what it would take."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from asperity.cli import options
from asperity.cli.estimate import estimated, show_estimate

if TYPE_CHECKING:
    from asperity.case import Case


@click.command()
@options.case_and_ranks
def command(case_file: str, case: Case, ranks: int, as_json: bool) -> int:
    """Check and estimate a case without solving it.

    Refuses and warns as a run does, then estimates degrees of freedom, memory and time. What depends on the solution,
    such as plastic strains, only the run can judge. Exit code 0 when a run accepts the case, 2 when it refuses it.
    """
    judge(case)
    if as_json:
        options.print_json({"case": case_file, "accepted": True, "estimate": estimated(case, ranks)})
        return 0
    show_estimate(case_file, case, ranks)
    options.say(f"{case_file}: a run accepts this case")
    return 0


def judge(case: Case) -> None:
    """Refuse a case that a run refuses, and warn where a run warns before it solves.

    Raises:
        InputError: the reason, in one sentence
    """
    from asperity.mesh.block import BlockMesh
    from asperity.mesh.resolution import warn_of_missed_waves

    surface = case.problem().surface
    if case.mesh.file is not None:
        BlockMesh.read(case.mesh.file).check(surface)
    elif case.accuracy.tolerance is None and case.loading.delta_max is not None:
        warn_of_missed_waves(surface, case.mesh.h_contact, case.loading.delta_max)
