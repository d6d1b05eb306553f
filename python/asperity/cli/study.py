# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

"""`asperity study`: one case with some keys varied, over the ranks of a job."""

from __future__ import annotations

from pathlib import Path

import click

from asperity.cli import options
from asperity.runtime.parallel import on_root_bcast
from asperity.runtime.progress import world_rank


@click.command()
@click.argument("study_file", metavar="STUDY.toml")
@options.output("OUT", "Folder of the study; default out/<name of the file>.")
@options.job_ranks
@click.option("--ranks-per-case", default=1, show_default=True, metavar="N", help="Ranks that work on one case.")
@click.option("--retry", is_flag=True, help="Repeat the cases that failed.")
@click.option("--dry-run", is_flag=True, help="Check the file, count the cases and meshes, run nothing.")
@click.option("--no-figures", is_flag=True, help="Write the table only.")
@click.option("-q", "--quiet", is_flag=True, help="Show no progress.")
@options.overrides
def command(
    study_file: str,
    output: str | None,
    ranks: int | None,
    ranks_per_case: int,
    retry: bool,
    dry_run: bool,
    no_figures: bool,
    quiet: bool,
    overrides: tuple[str, ...],
) -> int | None:
    """Run a case over a grid of parameters.

    As many cases at a time as there are ranks (--ranks, or mpirun). OUT receives results.csv (one row a case), cases/,
    meshes/ and figures/. Cases that are in OUT already are not repeated, so the same command continues a study that was
    stopped. A case that fails is recorded in the table and does not stop the others.
    """
    from asperity.study import Study

    def load() -> Study:
        return Study.load(study_file, overrides)

    def most(study: Study) -> int:
        return len(study.entries) * ranks_per_case

    if not dry_run and (code := options.start_ranks(ranks, load, most, quiet, ranks_per_case)) is not None:
        return code
    study = on_root_bcast(None, load)
    if dry_run:
        from asperity.study.run import mesh_key

        meshes = len({mesh_key(entry.case) for entry in study.entries})
        families = ", ".join(f"{f.name} ({sum(f.name in e.families for e in study.entries)})" for f in study.families)
        options.say(f"{len(study.entries)} cases on {meshes} meshes: {families}")
        return None
    from asperity.study import run_study

    folder = Path(output) if output else Path("out") / Path(study_file).stem
    say = None if quiet else lambda line: click.echo(line)
    counts = run_study(study, folder, ranks_per_case=ranks_per_case, retry=retry, say=say)
    if world_rank() != 0:
        return None
    if not no_figures and counts.done:
        from asperity.study.figures import plot_study

        plot_study(folder)
    if not quiet:
        click.echo(f"{counts.done} of {counts.cases} cases done, {counts.failed} failed, {counts.run} run now")
        click.echo(f"written to {folder}")
    return None
