"""`asperity run`: the whole job of a case file."""

from __future__ import annotations

import gc
import logging
import sys
from pathlib import Path

import click

from asperity.cli import options
from asperity.runtime.progress import Progress, ProgressLine, silence, world_rank


@click.command()
@options.case_file
@options.output("OUT", "Run directory; default out/<name of the case>.")
@click.option("--resume", is_flag=True, help="Continue the run in OUT, or start it where there is none.")
@click.option("--force", is_flag=True, help="Replace the run in OUT.")
@click.option("--allow-code", is_flag=True, help="Run the file that material.law names, with all your rights.")
@options.job_ranks
@click.option("-q", "--quiet", is_flag=True, help="Show no progress.")
@click.option("-v", "--verbose", is_flag=True, help="Show the lines of run.log instead.")
@options.overrides
def run(
    case_file: str, output: str | None, resume: bool, force: bool, allow_code: bool, ranks: int | None, quiet: bool,
    verbose: bool, overrides: tuple[str, ...],
) -> None:  # fmt: skip
    """Solve a case and write its results.

    OUT receives case.toml (the completed input), curve.csv (force against approach), summary.json and, if the case
    requests them, dynamics, figures, fields and report.html.
    """
    from asperity.case import Case
    from asperity.runtime import launch, run_folder

    case = Case.load(case_file, overrides)
    folder = Path(output) if output else Path("out") / Path(case_file).stem
    if launch.started_ranks() is None:  # before the libraries start; mpirun adds words of its own to a refusal
        run_folder.check(folder, resume=resume, force=force)
    options.start_ranks(ranks, quiet)
    from asperity.curve.power_law import with_misfit
    from asperity.job import run_case
    from asperity.output.assumptions import DOUBTFUL, describe
    from asperity.output.results import Results
    from asperity.output.verdict import doubts, verdict
    from asperity.runtime import compat

    compat.start()
    gc.freeze()  # what the modules hold is no garbage, and each solver that goes has the rest searched
    progress = Progress() if quiet or verbose or world_rank() else ProgressLine()
    if verbose and not world_rank():
        lines = logging.StreamHandler(sys.stdout)
        lines.handleError = lambda record: silence(sys.stdout)  # type: ignore[method-assign]
        logging.basicConfig(handlers=[lines], format="%(asctime)s %(message)s")
    with progress:
        result = run_case.run(case, folder, progress=progress, resume=resume, force=force, allow_code=allow_code)
    if quiet or world_rank():
        return
    if result.contact is None:
        options.say(f"{folder} holds the complete run of {len(result.curve)} steps; nothing is left to do")
    if (fit := result.fit) is not None:
        k, n = with_misfit(fit.to_dict())
        options.say(f"P* = k (delta/L)^n with k = {k}, n = {n} (misfit of the fit), R^2 = {fit.r2:.5f}")
    if len(result.curve):
        vibration = {**result.summary.get("dynamics", {}), "units": case.units}
        found = Results(folder, result.curve, case.to_dict(), result.summary, thresholds=vibration)
        for sentence in verdict(found):  # without reading meshes and fields again
            options.say(sentence)
    records = result.summary.get("assumptions", [])
    for record in records:
        if record["verdict"] == DOUBTFUL and not (record["warned"] and result.contact):  # which shows the warning
            options.say(f"doubtful: {describe(record)}")
    for sentence in doubts(records):
        options.say(sentence)
    options.say(f"written to {folder}")
    if (folder / run_folder.REPORT).is_file():
        options.say(f"report: {folder / run_folder.REPORT}")
