"""`asperity baseline`: write the curve of a run as the reference of later runs."""

from __future__ import annotations

from pathlib import Path

import click

from asperity.cli import options


@click.command()
@options.case_file
@options.run_folder
@click.argument("file", metavar="FILE", type=click.Path(dir_okay=False, path_type=Path))
@options.tolerances
def command(case_file: str, folder: str, file: Path, tolerances: dict[str, float] | None) -> int:
    """Store the curve of a run as a reference.

    FILE receives the curve of the finished run OUT of CASE.toml, for `asperity compare`.
    A JSON header holds case, mesh, seed, steps, versions, the tolerance of each column, and the commands that made it.
    """
    from asperity.output.comparison import store_curve

    curve = store_curve(case_file, folder, file, tolerances)
    options.say(f"written {file} ({len(curve)} steps)")
    return 0
