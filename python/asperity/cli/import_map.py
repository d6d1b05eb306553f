"""`asperity import-map`: from the height map of an instrument to a surface and a case."""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path

import click

from asperity.cli import options
from asperity.errors import InputError

CASE = """# The measured patch of patch.npz pressed by a rigid flat: set material and approach. SI units.

[surface]
kind = "file"
path = "patch.npz"

[material]
E = 200e9
nu = 0.3

[loading]
delta_max = {delta:.3g}
steps = 10
"""


@click.command()
@click.argument("map_file", metavar="MAP")
@options.output("OUT", "Folder; default out/<name of the file>.")
@click.option("--pixel", type=float, metavar="LENGTH", help="Distance between heights, where the file has none.")
@click.option("--level", type=click.Choice(["mean", "plane", "curvature"]), default="plane", show_default=True,
              help="Trend to remove.")  # fmt: skip
@click.option("--window", type=float, nargs=3, metavar="X Y SIDE", help="Square to cut; default the largest.")
@click.option("--cutoff", type=float, metavar="LENGTH", help="Wavelength of a Gaussian low-pass filter.")
@click.option("--shortest", type=float, metavar="LENGTH", help="Shortest wavelength for D and G; default 4 pixels.")
@options.serial
def command(
    map_file: str,
    output: str | None,
    pixel: float | None,
    level: str,
    window: tuple[float, float, float] | None,
    cutoff: float | None,
    shortest: float | None,
) -> None:
    """Make a case from a measured height map.

    Levels the map, cuts a square patch, and computes its statistics and its D and G. MAP is a .npz, .npy, .csv or .txt
    file, or a file of an instrument that SurfaceTopography reads. Lengths in metres. OUT receives patch.npz, case.toml
    to start from, measured.json, surface.png and spectrum.png.
    """
    from asperity.plot import save, surface_map
    from asperity.plot.measured import spectrum_figure
    from asperity.runtime.files import replace_file
    from asperity.surface import Surface
    from asperity.surface.fractal_fit import fit_fractal
    from asperity.surface.measured import HeightField

    whole = HeightField.read(map_file, pixel=pixel).filled().levelled(level)  # type: ignore[arg-type]

    def cut(field: HeightField) -> HeightField:
        return (field.square() if window is None else field.window(*window)).levelled(level)  # type: ignore[arg-type]

    patch = cut(whole if cutoff is None else whole.filtered(cutoff))
    folder = Path(output) if output else Path("out") / Path(map_file).stem
    folder.mkdir(parents=True, exist_ok=True)
    surface = Surface.from_spec(kind="file", path=str(patch.save(folder / "patch.npz")))
    statistics = surface.statistics()
    try:
        # the filter would bend the spectrum near its cut-off
        fit = fit_fractal(cut(whole), shortest=shortest, trend=level)  # type: ignore[arg-type]
    except InputError as error:
        fit = None
        options.say(f"no D and G: {error}")
    about = {"file": map_file, "side": surface.L, "nodes": len(patch.z), "level": level, "cutoff": cutoff}
    about |= {"statistics": asdict(statistics), "fit": None if fit is None else fit.to_dict()}
    replace_file(folder / "measured.json", f"{json.dumps(about, indent=2)}\n".encode())
    replace_file(folder / "case.toml", CASE.format(delta=0.5 * statistics.Sp).encode())
    save(surface_map(surface.grid(401), surface.L, surface.maximum(), unit="m"), folder / "surface.png")
    save(spectrum_figure(surface.psd(), fit, "m"), folder / "spectrum.png")
    rows = [("side", f"{surface.L:.4g} m"), ("nodes", f"{len(patch.z)}"), ("Sq", f"{statistics.Sq:.4g} m"),
            ("Sz", f"{statistics.Sz:.4g} m"), ("rms slope", f"{statistics.rms_slope:.4g}")]  # fmt: skip
    if fit is not None:
        rows += [("D", f"{fit.D:.3f} ({fit.ci_D[0]:.3f} to {fit.ci_D[1]:.3f})"),
                 ("G", f"{fit.G:.3g} m ({fit.ci_G[0]:.2g} to {fit.ci_G[1]:.2g})"),
                 ("chance of this misfit", f"{fit.p_value:.2g}")]  # fmt: skip
    options.table(map_file, rows)
    options.say(f"written to {folder}")
