"""`asperity store`: keep the curve of a run as a reference for later ones."""

from __future__ import annotations

from pathlib import Path

import click

from asperity.cli import options


@click.command()
@options.case_file
@options.run_folder
@click.argument("file", metavar="FILE", type=click.Path(dir_okay=False, path_type=Path))
@options.tolerances
@options.serial
def command(case_file: str, folder: str, file: Path, tolerances: dict[str, float] | None) -> int:
    """Write the curve of the finished run OUT of CASE.toml to FILE, a reference for `asperity compare`.

    A JSON header says what made it: case, mesh, seed, steps, versions, the tolerance of each column, the command.
    """
    from asperity.output.comparison import store_curve

    curve = store_curve(case_file, folder, file, tolerances)
    options.say(f"written {file} ({len(curve)} steps)")
    return 0
