"""`asperity check`: what a run of a case would refuse or warn of, and what it would take."""

from __future__ import annotations

from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import click

from asperity.cli import options
from asperity.runtime.progress import duration
from asperity.units import per_cent, quantity

if TYPE_CHECKING:
    from asperity.adaptive.estimate import Estimate
    from asperity.case import Case


@click.command()
@options.case_file
@click.option("--ranks", type=click.IntRange(min=1), default=1, show_default=True, help="Ranks that share the work.")
@options.as_json
@options.overrides
@options.serial
def command(case_file: str, ranks: int, as_json: bool, overrides: tuple[str, ...]) -> None:
    """Check and estimate a case without solving it.

    Refuses and warns as a run does, then estimates degrees of freedom (dofs), memory and time from the size field of
    the mesh and rates measured on one machine: expect a factor of two. What depends on the solution, such as plastic
    strains, only the run can judge. Exit code 0 when a run accepts the case, 2 when it refuses it.
    """
    from asperity.case import Case

    case = Case.load(case_file, overrides)
    judge(case)
    if as_json:
        options.print_json({"case": case_file, "accepted": True, "estimate": estimated(case, ranks)})
        return
    show_estimate(case_file, case, ranks)
    options.say(f"{case_file}: a run accepts this case")


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


def estimated(case: Case, ranks: int) -> dict[str, Any]:
    """Estimate of a case: seconds of one core, bytes of each rank and of all.

    With a tolerance also the seconds with all meshes up to accuracy.max_dofs, "most_seconds".
    """
    from asperity.adaptive.estimate import estimate, further_meshes

    found = estimate(case, ranks)
    totals = {"dofs": found.dofs, "seconds": found.seconds, "memory": found.memory, "ranks": ranks}
    if case.accuracy.tolerance is not None:
        totals["most_seconds"] = found.seconds + sum(m.seconds for m in further_meshes(case, found))
    return asdict(found) | totals


def show_estimate(title: str, case: Case, ranks: int) -> None:
    """Print the estimate of a case, a table under a title and sentences."""
    from asperity.adaptive.cutoff import filter_advice, note_on_steps
    from asperity.adaptive.estimate import estimate

    surface = case.build_surface()
    found = estimate(case, ranks, surface)
    rows = [
        (f"mesh of h_contact = {level.h_contact:.3g}, {level.steps} steps", f"{level.dofs}", duration(level.seconds))
        for level in found.levels
    ]
    options.table(title, rows, ("", "dofs", "one core"))
    if case.loading.delta_max is None:
        approach = quantity(found.approach, "m" if case.units == "SI" else "", 2)
        options.say(f"approach at loading.{case.loading.driver}: about {approach}, that of a half-space")
    share = f", {found.of_ranks[0] / 2**30:.2f} on the first and {found.of_ranks[-1] / 2**30:.2f} on each other"
    words = f"memory of {ranks} rank{'s' if ranks > 1 else ''}: about {found.memory / 2**30:.1f} GiB"
    options.say(words + (share if ranks > 1 else ""))
    if ranks > 1:
        options.say(f"time on {ranks} ranks: at least {duration(found.seconds / ranks)}, if they share the work evenly")
    if note := note_on_steps(surface, found.approach):
        options.say(note)
    if case.accuracy.tolerance is not None:
        if advice := filter_advice(case, found, surface):
            options.say(advice)
        if found.enough:
            options.say("finer meshes follow where the error bar of the last one is above the tolerance")
        if found.least_bar is not None:
            least = per_cent(found.least_bar)
            options.say(f"accuracy.max_dofs = {case.accuracy.max_dofs} gives about {least} of the force at best")
        options.say(_range_of_time(case, found))
    if case.accuracy.area_tolerance is not None:
        options.say("accuracy.area_tolerance is not in this estimate: it often takes finer meshes")
    if case.material.kinematics == "auto":
        options.say(f"the run takes {found.kinematics} strain")


def _range_of_time(case: Case, found: Estimate) -> str:
    """The time of the planned meshes, and of all that a run may add to them, a sentence."""
    from asperity.adaptive.estimate import further_meshes

    least, further = duration(found.seconds), further_meshes(case, found)
    if not further:
        return f"time on one core: about {least}; accuracy.max_dofs = {case.accuracy.max_dofs} allows no further mesh"
    most = duration(found.seconds + sum(level.seconds for level in further))
    return (
        f"time on one core: from about {least} for these meshes to about {most} for all finer ones that "
        f"accuracy.max_dofs = {case.accuracy.max_dofs} allows"
    )
