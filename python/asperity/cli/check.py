"""`asperity check`: what a run of a case would refuse or warn of, and what it would take."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

import click

from asperity.cli import options
from asperity.cli.surface import described, show, show_iso
from asperity.runtime.progress import duration
from asperity.units import quantity

if TYPE_CHECKING:
    from asperity.adaptive.estimate import Estimate
    from asperity.case import Case
    from asperity.model.problem import Problem
    from asperity.surface import Surface

MOST_MADE = 2_000_000  # dofs of a mesh that is made to be judged: half a minute


@click.command()
@options.case_file
@click.option("--ranks", type=click.IntRange(min=1), default=1, metavar="N", help="Ranks that share the work.")
@options.output("DIR", "Folder for pictures of the surface; shows ISO 25178 too.")
@options.as_json
@options.overrides
def check(case_file: str, ranks: int, output: str | None, as_json: bool, overrides: tuple[str, ...]) -> None:
    """Check a case and describe its surface, without solving.

    Makes the meshes of a run, and refuses and warns in the same words. Estimates degrees of freedom (dofs), memory and
    time to a factor of 1.5. Only the run can judge what depends on the solution, such as plastic strains. DIR receives
    surface.png. Exit code 0 when a run accepts the case, 2 when it refuses it.
    """
    from asperity.adaptive.estimate import estimate
    from asperity.case import Case

    case = Case.load(case_file, overrides)
    problem = case.problem()
    surface = problem.surface
    metre, folder = "m" if case.units == "SI" else "", Path(output) if output else None
    rough = {"kind": problem.composite.kind or "surface and tool"} | described(problem.composite, folder, metre)
    if not as_json:
        show(rough["kind"], rough, metre)
        if folder is not None:
            if problem.composite.rough:
                show_iso(rough["iso25178"], metre)
            options.say(f"written {folder / 'surface.png'}")
    found = estimate(case, ranks, surface)
    made = found.dofs <= MOST_MADE or case.accuracy.tolerance is not None
    if made:
        prepare(case, problem, found.approach)
    if as_json:
        totals = {"dofs": found.dofs, "seconds": found.seconds, "memory": found.memory, "ranks": ranks}
        options.print_json({"case": case_file, "accepted": True, "surface": rough, "estimate": asdict(found) | totals})
        return
    rows = [
        (f"mesh of h_contact = {level.h_contact:.3g}, {level.steps} steps", f"{level.dofs}", duration(level.seconds))
        for level in found.levels
    ]
    options.table(case_file, rows, ("", "dofs", "one core"))
    for sentence in _sentences(case, surface, found, ranks):
        options.say(sentence)
    unknown = "" if made else f"; its mesh of {found.dofs} dofs was not made here, and may be refused"
    options.say(f"{case_file}: a run accepts this case{unknown}")


def prepare(case: Case, problem: Problem, approach: float) -> None:
    """Do what a run does before its first step: refuse (InputError) where it refuses, warn where it warns.

    Args:
        approach: greatest one, where the load path gives a force that of a half-space [length]
    """
    from mpi4py import MPI

    from asperity.adaptive.guide import guide_of
    from asperity.adaptive.meshes import MeshFamily, PlannedMesh
    from asperity.mesh.block import BlockMesh
    from asperity.quasistatic.make import distributed, make_block
    from asperity.quasistatic.solve_problem import judge, refuse_other_height

    comm, surface = MPI.COMM_SELF, problem.surface

    def take(block: BlockMesh | None) -> None:
        refuse_other_height(problem, block)
        distributed(comm, surface, block, problem.sides)

    if case.accuracy.tolerance is not None:
        family, meshes = MeshFamily(problem, guide_of(problem), case.accuracy.max_dofs), list[PlannedMesh]()
        for _ in range(2):  # the meshes without which there is no error bar
            meshes.append(family.next(meshes))
            take(family.block)
    elif case.mesh.file is not None:
        take(BlockMesh.read(case.mesh.file))
    else:
        block = make_block(comm, problem, approach)
        judge(problem, block, approach)
        take(block)


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
