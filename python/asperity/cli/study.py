"""`asperity study`: one case with some keys varied, over the ranks of a job."""

from __future__ import annotations

from pathlib import Path

import click

from asperity.cli import options
from asperity.errors import ConvergenceError
from asperity.runtime.parallel import on_root_bcast
from asperity.runtime.progress import world_rank


@click.command()
@click.argument("study_file", metavar="STUDY.toml")
@options.output("OUT", "Folder of the study; default out/<name of the file>.")
@options.job_ranks
@click.option("-q", "--quiet", is_flag=True, help="Show no progress.")
@options.overrides
def study(study_file: str, output: str | None, ranks: int | None, quiet: bool, overrides: tuple[str, ...]) -> None:
    """Run a case over a grid of parameters.

    As many cases at a time as there are ranks (--ranks, or mpirun). OUT receives results.csv, one row a
    case, and cases/. Cases that are done are not repeated, so the same command continues a study that was stopped. A
    case that fails is recorded in the table and does not stop the others; exit code 3 when one has failed.
    """
    from asperity.study import Study, run_study

    options.start_ranks(ranks, quiet)
    cases = on_root_bcast(None, lambda: Study.load(study_file, overrides))
    folder = Path(output) if output else Path("out") / Path(study_file).stem
    say = None if quiet else lambda line: click.echo(line)
    counts = run_study(cases, folder, say=say)
    if not quiet and world_rank() == 0:
        click.echo(f"{counts.done} of {counts.cases} cases done, {counts.failed} failed, {counts.run} run now")
        click.echo(f"written to {folder}")
    if counts.failed:
        raise ConvergenceError(f"{counts.failed} of {counts.cases} cases failed; see exit_reason in its results.csv")
