"""`asperity estimate`: unknowns, memory and time of a case before it is run."""

from __future__ import annotations

import click

from asperity.cli import options
from asperity.runtime.progress import duration


@click.command()
@options.case_file
@click.option("--ranks", type=click.IntRange(min=1), default=1, show_default=True, help="Ranks that share the work.")
@options.overrides
@options.serial
def command(case_file: str, ranks: int, overrides: tuple[str, ...]) -> None:
    """Say how many unknowns a case has, and what memory and time it takes, without solving it.

    From the size field of the mesh, and rates measured on one machine: expect a factor of two.
    """
    from asperity.adaptive.estimate import estimate
    from asperity.case import Case

    case = Case.load(case_file, overrides)
    found = estimate(case, ranks)
    rows = [
        (f"mesh of h_contact = {level.h_contact:.3g}, {level.steps} steps", f"{level.dofs}", duration(level.seconds))
        for level in found.levels
    ]
    options.table(case_file, rows, ("", "unknowns", "one core"))
    options.say(f"memory of {ranks} rank{'s' if ranks > 1 else ''}: about {found.memory / 2**30:.1f} GiB")
    if ranks > 1:
        options.say(f"time on {ranks} ranks: {duration(found.seconds / ranks)} if they share it evenly, more in truth")
    if case.accuracy.tolerance is not None:
        options.say(
            "finer meshes follow where the error bar is not met by the last one"
            if found.enough
            else f"the next mesh has more than the {case.accuracy.max_dofs} dofs of accuracy.max_dofs: "
            "the tolerance is not expected to be met"
        )
