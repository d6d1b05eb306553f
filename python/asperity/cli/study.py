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
@click.option("--ranks-per-case", default=1, show_default=True, metavar="N", help="Ranks that work on one case.")
@click.option("--only", metavar="I/N", help="Part I of N of the cases: one job of an array, in an OUT of its own.")
@click.option("--retry", is_flag=True, help="Repeat the cases that failed.")
@click.option("--dry-run", is_flag=True, help="Check the file, count the cases, run nothing.")
@click.option("-q", "--quiet", is_flag=True, help="Show no progress.")
@options.overrides
def study(
    study_file: str, output: str | None, ranks: int | None, ranks_per_case: int, only: str | None, retry: bool,
    dry_run: bool, quiet: bool, overrides: tuple[str, ...],
) -> None:  # fmt: skip
    """Run a case over a grid of parameters.

    As many cases at a time as there are ranks (--ranks, or mpirun). OUT receives results.csv, one row a
    case, and cases/. Cases that are in OUT already are not repeated, so the same command continues a study that was
    stopped. A case that fails is recorded in the table and does not stop the others; exit code 3 when one has failed.
    """
    from asperity.study import Study, read_table, run_study

    if not dry_run:
        options.start_ranks(ranks, quiet, max(ranks_per_case, 1))
    cases = on_root_bcast(None, lambda: Study.load(study_file, overrides))
    cases = cases if only is None else cases.part(only)
    if dry_run:
        options.say(f"{len(cases.entries)} cases")
        return
    folder = Path(output) if output else Path("out") / Path(study_file).stem
    say = None if quiet else lambda line: click.echo(line)
    counts = run_study(cases, folder, ranks_per_case=ranks_per_case, retry=retry, say=say)
    if not quiet and world_rank() == 0:
        click.echo(f"{counts.done} of {counts.cases} cases done, {counts.failed} failed, {counts.run} run now")
        click.echo(f"written to {folder}")
        if counts.failed:
            columns = ("case", *cases.keys, "exit_reason")
            failed = (row for row in read_table(folder) if row["exit_reason"] != "done")
            rows = (tuple("" if row[name] is None else str(row[name]) for name in columns) for row in failed)
            options.table("failed", rows, (*columns[:-1], "reason"))
    if counts.failed:
        raise ConvergenceError(f"{counts.failed} of {counts.cases} cases failed; --retry repeats them")
