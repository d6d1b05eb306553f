"""`asperity report`: one HTML page of a run."""

from __future__ import annotations

import click

from asperity.cli import options


@click.command()
@options.run_folder
def command(folder: str) -> None:
    """Write the report of a run.

    One self-contained page, OUT/report.html, from the files of the run, whose figures are drawn again.
    """
    from asperity.plot import plot_run
    from asperity.plot.report import write_report

    with options.files_of_run(folder):
        plot_run(folder)
        options.say(f"written {write_report(folder)}")
