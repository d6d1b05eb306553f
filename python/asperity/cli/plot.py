"""`asperity plot`: the figures of a run."""

from __future__ import annotations

import click

from asperity.cli import options


@click.command()
@options.run_folder
@options.serial
def command(folder: str) -> None:
    """Draw OUT/figures/*.png from the files of a run."""
    from asperity.plot import plot_run

    for path in plot_run(folder):
        options.say(f"written {path}")
