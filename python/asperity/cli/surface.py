"""`asperity surface`: roughness parameters and a picture of a case's surface."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path

import click

from asperity.cli import options
from asperity.units import quantity


@click.command()
@options.case_file
@options.output("DIR", "Folder for surface.png.")
@click.option("--to", "mesh", metavar="FILE", help="Mesh of the block, without a solve: FILE.inp (CalculiX, Abaqus), "
              ".msh, .vtu, .stl, .bdf or .unv.")  # fmt: skip
@options.as_json
@options.overrides
@options.serial
def command(case_file: str, output: str | None, mesh: str | None, as_json: bool, overrides: tuple[str, ...]) -> None:
    """Show the roughness of a case's surface.

    Its statistics, shortest wavelength and point of first contact; with -o also a picture.
    """
    from asperity.case import Case

    case = Case.load(case_file, overrides)
    surface = case.build_surface()
    metre = "m" if case.units == "SI" else ""
    values = asdict(surface.statistics())
    rows = [(label, _text(values[key], power, metre)) for key, (label, power) in _SHOWN.items()]
    shortest = ("shortest wavelength", quantity(surface.feature_size, metre))
    spot = ", ".join(quantity(value, metre) for value in surface.maximum())
    if as_json:
        touch = {"shortest_wavelength": surface.feature_size, "first_touch": surface.maximum()}
        options.print_json({"kind": case.surface.kind, "statistics": values} | touch)
    else:
        options.table(f"{case.surface.kind}", [*rows, shortest, ("first touch x, y, z", spot)])
    if output:
        from asperity.plot import save, surface_map

        folder = Path(output)
        folder.mkdir(parents=True, exist_ok=True)
        figure = surface_map(surface.grid(401), surface.L, surface.maximum(), unit=metre)
        path = save(figure, folder / "surface.png")
        if not as_json:
            options.say(f"written {path}")
    if mesh:
        from asperity.output.mesh_file import block_of_case, write_mesh

        block, top = block_of_case(case)
        written = write_mesh(block, top, mesh, f"block of {Path(case_file).name}")
        if not as_json:
            options.say(f"written {written}: {len(block.points)} nodes, {len(block.tets)} tetrahedra of second order")


# key of SurfaceStatistics -> label and power of length
_SHOWN = {
    "Sq": ("Sq, rms height", 1),
    "Sa": ("Sa, mean height deviation", 1),
    "Sz": ("Sz, peak to valley", 1),
    "Sp": ("Sp, peak above mean", 1),
    "skewness": ("skewness", 0),
    "kurtosis": ("kurtosis", 0),
    "rms_slope": ("rms slope", 0),
    "rms_curvature": ("rms curvature", -1),
}


def _text(value: float, power: int, metre: str) -> str:
    if power == -1:
        return f"{value:.4g} {'1/m' if metre else ''}".rstrip()
    return quantity(value, metre) if power else f"{value:.4g}"
