"""What is made of a finished run: `asperity report`, `export` and `compare`."""

from __future__ import annotations

from pathlib import Path

import click

from asperity.cli import options
from asperity.errors import InputError
from asperity.runtime.display import nearest
from asperity.runtime.run_folder import CURVE, EXPORTS


@click.command()
@options.run_folder
def report(folder: str) -> None:
    """Write the figures and the report of a run.

    From the files of the run in OUT: the figures in OUT/figures, SVG where they consist of lines, otherwise PNG, and
    OUT/report.html, one self-contained page.
    """
    from asperity.plot import plot_run
    from asperity.plot.report import write_report

    with options.files_of_run(folder):
        written = [*plot_run(folder), write_report(folder)]
    for path in written:
        options.say(f"written {path}")


@click.command()
@click.argument("source", metavar="OUT|CASE.toml", type=click.Path(exists=True, path_type=Path))
@click.option("--to", required=True, metavar="PROGRAM|FILE", help=f"{', '.join(EXPORTS)}, or a file of a mesh.")
@click.option("--law", type=click.Choice(("table", "unload-reload")), metavar="LAW",
              help="table: first loading, the default; unload-reload.")  # fmt: skip
@click.option("--preload", "load", type=float, metavar="W", help="Force on the patch that unload-reload starts from.")
@options.output("FILE", "File of a PROGRAM; default in OUT.")
@options.overrides
def export(
    source: Path, to: str, law: str | None, load: float | None, output: str | None, overrides: tuple[str, ...]
) -> None:
    """Write the contact of a run, or a rough block, for another program.

    The contact is pressure over approach of the mean planes, for CalculiX, Abaqus or as CSV, within 1 % if read
    linearly. --preload is by default the preload of the joint, or half of the greatest force.

    The block is FILE.inp (CalculiX, Abaqus), .msh, .vtk, .stl, .bdf or .unv: the last mesh of the run OUT, or the mesh
    of CASE.toml without a solve.
    """
    from asperity.output import export as contact
    from asperity.output.mesh_file import SUFFIXES, export_mesh

    mesh, case = Path(to).suffix.lower() in SUFFIXES, source.is_file()
    if not mesh and to not in EXPORTS:
        raise InputError(
            f"--to {to}{nearest(to, EXPORTS)}: give {', '.join(EXPORTS)}, or a file of a mesh ({', '.join(SUFFIXES)})"
        )
    if case and not mesh:
        raise InputError(f"--to {to} needs the folder of a run: run {source} first, or give a file of a mesh to --to")
    if overrides and not case:
        raise InputError("--set is for a case file: leave it out, or give CASE.toml")
    if mesh and (law, load, output) != (None, None, None):
        raise InputError(f"--law, --preload and -o are for the contact, not for the mesh {to}: leave them out")
    if mesh:
        written, block = export_mesh(source, to, overrides)
        options.say(f"written {written}: {len(block.points)} nodes, {len(block.tets)} tetrahedra of second order")
    else:
        written = contact.export(source, to, output, law=law or "table", load=load)
        options.say(f"written {written}; its head says what linear reading changes")


@click.command()
@click.argument("run", metavar="A", type=click.Path(exists=True, path_type=Path))
@click.argument("reference", metavar="B", type=click.Path(path_type=Path))
@click.option("--store", is_flag=True, help="Write the curve of the run A to the file B instead.")
@options.tolerances
def compare(run: Path, reference: Path, store: bool, tolerances: dict[str, float] | None) -> int:
    """Compare two curves, column by column.

    A is the run, B the reference; each is a run directory or a curve.csv. All columns are compared that both have,
    without iterations and times. Exit code 0 when they agree, 1 when not.

    With --store B receives the curve of the finished run A, with a JSON header of case, mesh, seed, steps, versions,
    command and the tolerance of each column.
    """
    from asperity.curve import Curve
    from asperity.output.comparison import compare_curves, compared, store_curve

    if store:
        curve = store_curve(run, reference, tolerances)
        options.say(f"written {reference} ({len(curve)} steps)")
        return 0
    if not reference.exists():
        raise InputError(f"{reference} does not exist; --store writes it from the run {run}")
    files = [path / CURVE if path.is_dir() else path for path in (run, reference)]
    if all(path.is_file() for path in files) and files[0].samefile(files[1]):
        raise InputError(f"{run} and {reference} are the same curve, so nothing is compared")
    a, b = map(Curve.read, files)
    differences = compare_curves(a, b, tolerances)
    for difference in differences:
        options.say(str(difference))
    if not differences:
        options.say(f"the curves agree ({len(a)} steps, {len(compared(a, b, tolerances))} columns)")
    return 1 if differences else 0
