"""`asperity surface`: roughness parameters and a picture of a case's surface."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

import click

from asperity.cli import options
from asperity.units import quantity

if TYPE_CHECKING:
    from asperity.arrays import Array
    from asperity.surface import Surface
    from asperity.surface.iso25178 import ISO25178


@click.command()
@options.case_file
@options.output("DIR", "Folder for surface.png and abbott.png.")
@click.option("--to", "mesh", metavar="FILE", help="Mesh of the block, without a solve: FILE.inp (CalculiX, Abaqus), "
              ".msh, .vtk, .stl, .bdf or .unv.")  # fmt: skip
@options.as_json
@options.overrides
def surface(case_file: str, output: str | None, mesh: str | None, as_json: bool, overrides: tuple[str, ...]) -> None:
    """Show the roughness of a case's surface.

    Its statistics, shortest wavelength and point of first contact, and of rough ones the parameters of ISO 25178; with
    -o also a picture and the Abbott curve.
    """
    from asperity.case import Case
    from asperity.surface.iso25178 import heights_of, iso25178

    case = Case.load(case_file, overrides)
    surface = case.build_surface()
    metre = "m" if case.units == "SI" else ""
    values = asdict(surface.statistics())
    z, dx, dy = heights_of(surface)
    found = iso25178(z, dx, dy) if surface.rough else None
    rows = [] if found else [(key, quantity(values[key], metre)) for key in ("Sq", "Sz")]
    rows.append(("rms slope", f"{values['rms_slope']:.4g}"))
    rows.append(("rms curvature", f"{values['rms_curvature']:.4g} {'1/m' if metre else ''}".rstrip()))
    rows.append(("shortest wavelength", quantity(surface.feature_size, metre)))
    rows.append(("first touch x, y, z", ", ".join(quantity(value, metre) for value in surface.maximum())))
    if as_json:
        iso = None if found is None else found.to_dict()
        touch = {"iso25178": iso, "shortest_wavelength": surface.feature_size, "first_touch": surface.maximum()}
        options.print_json({"kind": case.surface.kind, "statistics": values} | touch)
    else:
        options.table(case.surface.kind, rows)
        if found is not None:
            options.table("ISO 25178", iso_rows(found, metre))
    if output:
        Path(output).mkdir(parents=True, exist_ok=True)
        path = draw(Path(output), surface, z, found, metre)
        if not as_json:
            options.say(f"written {path}")
    if mesh:
        from asperity.output.mesh_file import block_of_case, write_mesh

        block, top = block_of_case(case)
        written = write_mesh(block, top, mesh, f"block of {Path(case_file).name}")
        if not as_json:
            options.say(f"written {written}: {len(block.points)} nodes, {len(block.tets)} tetrahedra of second order")


def draw(folder: Path, surface: Surface, z: Array, found: ISO25178 | None, metre: str) -> Path:
    """Write a picture of a surface, whose path is returned, and with its parameters the Abbott curve of heights."""
    from asperity.plot import save, surface_map
    from asperity.plot.fields import abbott_figure

    if found is not None:
        save(abbott_figure(z, found, metre), folder / "abbott.png")
    return save(surface_map(surface.grid(401), surface.L, surface.maximum(), unit=metre), folder / "surface.png")


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
