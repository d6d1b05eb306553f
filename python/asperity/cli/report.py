"""`asperity report`: one HTML page of a run."""

from __future__ import annotations

import click

from asperity.cli import options


@click.command()
@options.run_folder
@options.serial
def command(folder: str) -> None:
    """Write OUT/report.html, self-contained, from the files of a run."""
    from asperity.plot.report import write_report

    options.say(f"written {write_report(folder)}")
