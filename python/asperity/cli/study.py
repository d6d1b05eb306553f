"""`asperity study`: one case with some keys varied, over the ranks of a job."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from asperity.cli import options
from asperity.runtime.parallel import on_root_bcast
from asperity.runtime.progress import world_rank

if TYPE_CHECKING:
    from asperity.study import Study


class _Part(click.ParamType):
    """A part of a study, "2/10"."""

    name = "part"

    def convert(self, value: str, parameter: click.Parameter | None, context: click.Context | None) -> tuple[int, int]:
        """Number of the part and of all parts; whether there is one is judged with the study."""
        number, slash, parts = value.partition("/")
        if not (slash and number.isdecimal() and parts.isdecimal()):
            self.fail(f"{value} is no part; give I/N, for example 1/10 for the first of ten")
        return int(number), int(parts)


@click.command()
@click.argument("study_file", metavar="STUDY.toml")
@options.output("OUT", "Folder of the study; default out/<name of the file>.")
@options.job_ranks
@click.option(
    "--only", metavar="I/N", type=_Part(), help="Run part I of N, counted from 1: one job of an array. Writes no table."
)
@click.option("--collect", is_flag=True, help="Run nothing, write the table of what has ended.")
@click.option("--ranks-per-case", default=1, show_default=True, metavar="N", help="Ranks that work on one case.")
@click.option("--retry", is_flag=True, help="Repeat the cases that failed.")
@click.option("--dry-run", is_flag=True, help="Check the file, count the cases and meshes, run nothing.")
@click.option("-q", "--quiet", is_flag=True, help="Show no progress.")
@options.overrides
def command(
    study_file: str,
    output: str | None,
    ranks: int | None,
    only: tuple[int, int] | None,
    collect: bool,
    ranks_per_case: int,
    retry: bool,
    dry_run: bool,
    quiet: bool,
    overrides: tuple[str, ...],
) -> int | None:
    """Run a case over a grid of parameters.

    As many cases at a time as there are ranks (--ranks, or mpirun). OUT receives results.csv (one row a case), cases/
    and meshes/. Cases that are in OUT already are not repeated, so the same command continues a study that was
    stopped. A case that fails is recorded in the table and does not stop the others.

    With --only any number of jobs share the cases; once they have ended, the command without it writes the table.
    """
    from asperity.study import Study, collect_study, run_study

    if only is not None and collect:
        raise click.UsageError("--only runs a part of the cases and --collect none: give one of them")

    if not (dry_run or collect):
        options.start_ranks(ranks, quiet, max(ranks_per_case, 1))
    study = on_root_bcast(None, lambda: Study.load(study_file, overrides))
    if dry_run:
        _describe(study, only)
        return None
    folder = Path(output) if output else Path("out") / Path(study_file).stem
    say = None if quiet else lambda line: click.echo(line)
    if collect:
        counts = on_root_bcast(None, lambda: collect_study(study, folder))
    else:
        counts = run_study(study, folder, only=only, ranks_per_case=ranks_per_case, retry=retry, say=say)
    if world_rank() != 0:
        return None
    if not quiet:
        which = "" if only is None else f"part {only[0]} of {only[1]}: "
        click.echo(f"{which}{counts.done} of {counts.cases} cases done, {counts.failed} failed, {counts.run} run now")
        click.echo(f"written to {folder}")
    return None


def _describe(study: Study, only: tuple[int, int] | None) -> None:
    """Print how many cases and meshes a study or its part has."""
    from asperity.study.run import part
    from asperity.study.shared_mesh import mesh_key

    entries = study.entries if only is None else [study.entries[i] for i in part(study.entries, *only)]
    meshes = len({mesh_key(entry.case) for entry in entries})
    families = ", ".join(f"{f.name} ({sum(f.name in e.families for e in entries)})" for f in study.families)
    options.say(f"{len(entries)} cases on {meshes} meshes: {families}")
