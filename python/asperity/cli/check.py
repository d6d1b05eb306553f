"""`asperity check`: what a run of a case would refuse or warn of, and what it would take."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict
from typing import TYPE_CHECKING

import click

from asperity.cli import options
from asperity.runtime.progress import duration
from asperity.units import quantity

if TYPE_CHECKING:
    from asperity.adaptive.estimate import Estimate
    from asperity.case import Case
    from asperity.surface import Surface


@click.command()
@options.case_file
@click.option("--ranks", type=click.IntRange(min=1), default=1, show_default=True, help="Ranks that share the work.")
@options.as_json
@options.overrides
def check(case_file: str, ranks: int, as_json: bool, overrides: tuple[str, ...]) -> None:
    """Check and estimate a case without solving it.

    Refuses and warns as a run does, then estimates degrees of freedom (dofs), memory and time from the size field of
    the mesh and rates measured on one machine: expect a factor of 1.5 on a core as fast. What depends on the solution,
    such as plastic strains, only the run can judge. Exit code 0 when a run accepts the case, 2 when it refuses it.
    """
    from asperity.adaptive.estimate import estimate
    from asperity.case import Case

    case = Case.load(case_file, overrides)
    judge(case)
    surface = case.build_surface()
    found = estimate(case, ranks, surface)
    if as_json:
        totals = {"dofs": found.dofs, "seconds": found.seconds, "memory": found.memory, "ranks": ranks}
        options.print_json({"case": case_file, "accepted": True, "estimate": asdict(found) | totals})
        return
    rows = [
        (f"mesh of h_contact = {level.h_contact:.3g}, {level.steps} steps", f"{level.dofs}", duration(level.seconds))
        for level in found.levels
    ]
    options.table(case_file, rows, ("", "dofs", "one core"))
    for sentence in _sentences(case, surface, found, ranks):
        options.say(sentence)
    options.say(f"{case_file}: a run accepts this case")


def judge(case: Case) -> None:
    """Refuse (InputError) a case that a run refuses, and warn where a run warns before it solves."""
    from asperity.mesh.block import BlockMesh
    from asperity.mesh.resolution import judge_mesh

    surface = case.problem().surface
    if case.mesh.file is not None:
        BlockMesh.read(case.mesh.file).check(surface)
    elif case.accuracy.tolerance is None and case.loading.delta_max is not None:
        judge_mesh(0.0, surface, case.mesh.h_contact, case.loading.delta_max)


def _sentences(case: Case, surface: Surface, found: Estimate, ranks: int) -> Iterator[str]:
    """What an estimate says."""
    from asperity.adaptive.estimate import filter_advice, note_on_steps

    if case.loading.delta_max is None:
        approach = quantity(found.approach, "m" if case.units == "SI" else "", 2)
        yield f"approach at loading.{case.loading.driver}: about {approach}, that of a half-space"
    share = f", {found.of_ranks[0] / 2**30:.2f} on the first and {found.of_ranks[-1] / 2**30:.2f} on each other"
    words = f"memory of {ranks} rank{'s' if ranks > 1 else ''}: about {found.memory / 2**30:.1f} GiB"
    yield words + (share if ranks > 1 else "")
    if ranks > 1:
        yield f"time on {ranks} ranks: at least {duration(found.seconds / ranks)}, if they share the work evenly"
    if note := note_on_steps(surface, found.approach):
        yield note
    if case.accuracy.tolerance is not None:
        yield (
            filter_advice(case, found, surface)
            or "finer meshes follow where the error bar of the last one is above the tolerance"
        )
        yield f"time on one core: about {duration(found.seconds)}"
    if case.accuracy.area_tolerance is not None:
        yield "accuracy.area_tolerance is not in this estimate: it often takes finer meshes"
    if case.material.kinematics == "auto":
        yield f"the run takes {found.kinematics} strain"
