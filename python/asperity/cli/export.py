"""`asperity export`: the contact of a run for another program."""

from __future__ import annotations

from typing import Any

import click

from asperity.cli import options
from asperity.runtime.run_folder import EXPORTS


@click.command()
@options.run_folder
@click.option("--to", required=True, type=click.Choice(tuple(EXPORTS)), help="Program or kind of file.")
@click.option("--law", type=click.Choice(("auto", "table", "unload-reload")),
              help="First loading (table), or the branch through the preload; default auto (after yield the branch) "
              "for python, table for the others.")  # fmt: skip
@click.option("--preload", "load", type=float, metavar="W", help="Force on the patch that the branch passes through; "
              "default that of the joint, or half of the greatest force.")  # fmt: skip
@options.output("FILE", "File to write; default in OUT.")
def command(folder: str, to: str, output: str | None, **settings: Any) -> None:
    """Write the contact of a run for another program.

    Nominal pressure over the approach of the mean planes, from first touch: a contact property to include in a deck of
    CalculiX or Abaqus, a CSV file, or a Python module with force and stiffness that needs NumPy only. With the section
    [slip] of the case also friction and stick slope in a deck, and the tangential force as an array of sliders. --to
    mesh writes the rough block itself: FILE.inp for CalculiX and Abaqus, .msh, .vtu, .stl, .bdf or .unv.
    """
    from asperity.output.export import export

    options.say(f"written {export(folder, to, output, **settings)}")
