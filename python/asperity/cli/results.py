"""What is made of a finished run: `asperity plot`, `report`, `export`, `baseline` and `compare`."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from asperity.cli import options
from asperity.errors import InputError
from asperity.runtime.run_folder import CURVE, EXPORTS


@click.command()
@options.run_folder
def plot(folder: str) -> None:
    """Draw the figures of a run.

    From the files of the run in OUT, into OUT/figures: SVG where they consist of lines, otherwise PNG.
    """
    from asperity.plot import plot_run

    with options.files_of_run(folder):
        written = plot_run(folder)
    for path in written:
        options.say(f"written {path}")


@click.command()
@options.run_folder
def report(folder: str) -> None:
    """Write the report of a run.

    One self-contained page, OUT/report.html, from the files of the run, whose figures are drawn again.
    """
    from asperity.plot import plot_run
    from asperity.plot.report import write_report

    with options.files_of_run(folder):
        plot_run(folder)
        options.say(f"written {write_report(folder)}")


@click.command()
@options.run_folder
@click.option("--to", required=True, type=click.Choice(tuple(EXPORTS)), help="Program or kind of file.")
@click.option("--law", type=click.Choice(("table", "unload-reload")),
              help="First loading (table, the default), or the branch through the preload.")  # fmt: skip
@click.option("--preload", "load", type=float, metavar="W", help="Force on the patch that the branch passes through; "
              "default that of the joint, or half of the greatest force.")  # fmt: skip
@options.output("FILE", "File to write; default in OUT.")
def export(folder: str, to: str, output: str | None, **settings: Any) -> None:
    """Write the contact of a run for another program.

    Nominal pressure over the approach of the mean planes, from first touch: a contact property to include in a deck of
    CalculiX or Abaqus, a gasket material of ANSYS, or a CSV file. Its points are so close that the pressure read
    linearly is within 1 % of the law. With the section [slip] of the case also friction and stick slope in a deck of
    the first two. --to mesh writes the rough block itself: FILE.inp for CalculiX and Abaqus, .msh, .vtk, .stl, .bdf or
    .unv.
    """
    from asperity.output.export import exported

    file, sentences = exported(folder, to, output, **settings)
    options.say(f"written {file}")
    for sentence in sentences:
        options.say(sentence)


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
def compare(first: Path, second: Path, tolerances: dict[str, float] | None) -> int:
    """Compare two curves, column by column.

    A is the run, B the reference; each is a run directory or a curve.csv. All columns are compared that both have,
    without iterations and times. Exit code 0 when they agree, 1 when not.
    """
    from asperity.curve import Curve
    from asperity.output.comparison import compare_curves, compared

    files = [path / CURVE if path.is_dir() else path for path in (first, second)]
    if all(path.is_file() for path in files) and files[0].samefile(files[1]):
        raise InputError(f"{first} and {second} are the same curve, so nothing is compared")
    a, b = map(Curve.read, files)
    differences = compare_curves(a, b, tolerances)
    for difference in differences:
        options.say(str(difference))
    if not differences:
        options.say(f"the curves agree ({len(a)} steps, {len(compared(a, b, tolerances))} columns)")
    return 1 if differences else 0
