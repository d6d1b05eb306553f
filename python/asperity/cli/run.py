"""`asperity run`: the whole job of a case file."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from asperity.cli import options
from asperity.runtime.progress import make_progress, world_rank

if TYPE_CHECKING:
    from asperity.power_law import PowerLawFit


@click.command()
@options.case_file
@options.output("OUT", "Run directory; default out/<name of the case>.")
@click.option("--resume", is_flag=True, help="Continue the run in OUT, or start it where there is none.")
@click.option("--force", is_flag=True, help="Replace the run in OUT.")
@click.option("-q", "--quiet", is_flag=True, help="Show no progress.")
@options.overrides
def command(
    case_file: str,
    output: str | None,
    resume: bool,
    force: bool,
    quiet: bool,
    overrides: tuple[str, ...],
) -> None:
    """Solve a case and write its results.

    OUT receives case.toml (the completed input), curve.csv (force against approach), summary.json and, if the case
    requests them, dynamics, figures, fields and report.html.
    """
    from asperity import run_case
    from asperity.case import Case
    from asperity.output.assumptions import doubtful

    case = Case.load(case_file, overrides)
    folder = Path(output) if output else Path("out") / Path(case_file).stem
    progress = make_progress(quiet)
    try:
        result = run_case.run(case, folder, progress=progress, resume=resume, force=force)
    finally:
        progress.done()
    if not quiet and world_rank() == 0:
        if result.contact is None:
            options.say(f"{folder} holds the complete run of {len(result.curve)} steps; nothing is left to do")
        _show_fit(result.fit)
        for line in doubtful(result.summary.get("assumptions", [])):
            options.say(f"doubtful: {line.describe()}")
        options.say(f"written to {folder}")


def _show_fit(fit: PowerLawFit | None) -> None:
    if fit is not None:
        options.say(f"P* = {fit.k:.5g} (delta/L)^{fit.n:.4f}, R^2 = {fit.r2:.5f}")
