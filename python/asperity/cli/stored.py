"""`asperity baseline` and `compare`: the curve of a run stored as a reference, and another one compared with it."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path

import click

from asperity.cli import options
from asperity.errors import InputError
from asperity.runtime.run_folder import CURVE


@click.command()
@options.case_file
@options.run_folder
@click.argument("file", metavar="FILE", type=click.Path(dir_okay=False, path_type=Path))
@options.tolerances
def baseline(case_file: str, folder: str, file: Path, tolerances: dict[str, float] | None) -> None:
    """Store the curve of a run as a reference.

    FILE receives the curve of the finished run OUT of CASE.toml, for `asperity compare`.
    A JSON header holds case, mesh, seed, steps, versions, the tolerance of each column, and the commands that made it.
    """
    from asperity.output.comparison import store_curve

    curve = store_curve(case_file, folder, file, tolerances)
    options.say(f"written {file} ({len(curve)} steps)")


@click.command()
@click.argument("first", metavar="A", type=click.Path(exists=True, path_type=Path))
@click.argument("second", metavar="B", type=click.Path(exists=True, path_type=Path))
@options.tolerances
@options.as_json
def compare(first: Path, second: Path, tolerances: dict[str, float] | None, as_json: bool) -> int:
    """Compare two curves, column by column.

    A is the run, B the reference; each is a run directory or a curve.csv. Exit code 0 when they agree, 1 when not.
    """
    from asperity.curve import Curve
    from asperity.output.comparison import compare_curves

    files = [path / CURVE if path.is_dir() else path for path in (first, second)]
    if all(path.is_file() for path in files) and files[0].samefile(files[1]):
        raise InputError(f"{first} and {second} are the same curve, so nothing is compared")
    a, b = map(Curve.read, files)
    differences = compare_curves(a, b, tolerances)
    if as_json:
        found = [asdict(difference) for difference in differences]
        options.print_json({"agree": not found, "steps": len(a), "differences": found})
        return 1 if found else 0
    for difference in differences:
        options.say(str(difference))
    if not differences:
        options.say(f"the curves agree ({len(a)} steps)")
    return 1 if differences else 0
