"""`asperity surface`: roughness parameters and a picture of a case's surface."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

import click

from asperity.cli import options
from asperity.units import quantity

if TYPE_CHECKING:
    from asperity.surface.iso25178 import ISO25178


@click.command()
@options.case_file
@options.output("DIR", "Folder for surface.png and abbott.png.")
@click.option("--to", "mesh", metavar="FILE", help="Mesh of the block, without a solve: FILE.inp (CalculiX, Abaqus), "
              ".msh, .vtu, .stl, .bdf or .unv.")  # fmt: skip
@options.as_json
@options.overrides
def command(case_file: str, output: str | None, mesh: str | None, as_json: bool, overrides: tuple[str, ...]) -> None:
    """Show the roughness of a case's surface.

    Its statistics, shortest wavelength and point of first contact, and of rough ones the parameters of ISO 25178; with
    -o also a picture and the Abbott curve.
    """
    from asperity.case import Case
    from asperity.surface.iso25178 import AbbottCurve, heights_of, iso25178

    case = Case.load(case_file, overrides)
    surface = case.build_surface()
    metre = "m" if case.units == "SI" else ""
    values = asdict(surface.statistics())
    rows = [(label, _text(values[key], power, metre)) for key, (label, power) in _SHOWN.items()]
    shortest = ("shortest wavelength", quantity(surface.feature_size, metre))
    spot = ", ".join(quantity(value, metre) for value in surface.maximum())
    z, dx, dy = heights_of(surface)
    found = iso25178(z, dx, dy) if surface.rough else None
    if as_json:
        iso = None if found is None else found.to_dict()
        touch = {"iso25178": iso, "shortest_wavelength": surface.feature_size, "first_touch": surface.maximum()}
        options.print_json({"kind": case.surface.kind, "statistics": values} | touch)
    else:
        options.table(f"{case.surface.kind}", [*rows, shortest, ("first touch x, y, z", spot)])
        if found is not None:
            options.table("ISO 25178", iso_rows(found, metre))
    if output:
        from asperity.plot import save, surface_map
        from asperity.plot.fields import abbott_figure

        folder = Path(output)
        folder.mkdir(parents=True, exist_ok=True)
        figure = surface_map(surface.grid(401), surface.L, surface.maximum(), unit=metre)
        path = save(figure, folder / "surface.png")
        if found is not None:
            save(abbott_figure(AbbottCurve.of(z), found, metre), folder / "abbott.png")
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


def iso_rows(found: ISO25178, metre: str) -> list[tuple[str, str]]:
    """Names and values of ISO 25178, in per cent where they are ratios of areas."""
    rows = []
    for name, value in found.to_dict().items():
        if value is None:
            text = "beyond the patch"
        elif name in ("Sdr", "Smr1", "Smr2"):
            text = f"{100 * value:.4g} %"
        else:
            text = f"{value:.4g}" if name in ("Ssk", "Sku", "Sdq", "Str") else quantity(value, metre)
        rows.append((name, text))
    return rows
