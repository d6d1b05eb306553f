"""`asperity import-map`: from the height map of an instrument to a surface and a case."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import asdict, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
import numpy as np

from asperity.cli import options
from asperity.cli.surface import described, show, show_iso
from asperity.errors import InputError
from asperity.units import LENGTHS, quantity

if TYPE_CHECKING:
    from asperity.surface import HeightMap, Spectrum
    from asperity.surface.scans import HeightField, Trend
    from asperity.surface.spectrum import SelfAffineFit

CASE = """# The measured patch of patch.npz pressed by a rigid flat: set material and approach. SI units.

[surface]
kind = "file"
path = "patch.npz"

[material]
E = 200e9
nu = 0.3

[loading]
delta_max = {delta:.3g}              # of a light load
steps = 10

[accuracy]
tolerance = 0.05                 # of the force; without it, one mesh of mesh.h_contact
"""
HIGH = 8.0  # height of the summit above the mean plane over the rms height that no Gaussian surface reaches
LARGEST = 0.1  # side of a patch [m]
STEPPED = 32  # different heights, of a sample of them, below which a spectrum is that of the steps
SMOOTHEST = 1e-4  # rms slope; below it, heights and distances may have different units


@click.command()
@click.argument("map_file", metavar="MAP")
@options.output("OUT", "Folder; default out/<name of the file>.")
@click.option("--pixel", type=options.Length(most=2), metavar="LENGTH[,LENGTH]",
              help="Distance between heights, or along x and y.")  # fmt: skip
@click.option("--unit", metavar="UNIT", is_eager=True,
              help=f"{', '.join(filter(str.isascii, LENGTHS))}, or a number of metres.")  # fmt: skip
@click.option("--channel", metavar="NAME", help="Channel of an instrument, or its number.")
@click.option("--array", metavar="NAME", help="Heights of an .npz file; default z.")
@click.option("--missing", type=float, metavar="VALUE", help="Value that marks a missing height.")
@click.option("--spikes", type=click.Choice(["keep", "fill"]), default="keep",
              help="Heights as of dust; fill: missing.")  # fmt: skip
@click.option("--level", type=click.Choice(["mean", "plane", "curvature"]), default="plane",
              help="Trend to remove; default plane.")  # fmt: skip
@click.option("--window", type=options.Length(), nargs=3, metavar="X Y SIDE", help="Square to cut; default: largest.")
@click.option("--cutoff", type=options.Length(), metavar="LENGTH", help="Wavelength of a Gaussian filter.")
@options.as_json
def import_map(
    map_file: str, output: str | None, as_json: bool, spikes: str, level: Trend,
    window: tuple[float, float, float] | None, cutoff: float | None, **given: Any,
) -> None:  # fmt: skip
    """Make a case from a measured height map.

    Levels the map and cuts a square patch. MAP is .npz or .npy, text (a matrix, or lines of x, y, z), or a file of an
    instrument that SurfaceTopography reads; --pixel and --unit are for what it does not say. Lengths are written as
    0.2um; without a unit in metres. OUT receives patch.npz, case.toml, measured.json and pictures.
    """
    from asperity.plot import save
    from asperity.plot.contact import spectrum_figure
    from asperity.runtime.files import files_into
    from asperity.runtime.progress import Progress, ProgressLine
    from asperity.runtime.run_folder import holds_run
    from asperity.surface.height_map import HeightMap
    from asperity.surface.scans import HeightField

    progress = Progress() if as_json else ProgressLine()
    folder = Path(output) if output else Path("out") / Path(map_file).stem
    if folder.is_file() or holds_run(folder):
        raise InputError(f"{folder} {'is a file' if folder.is_file() else 'holds a run'}; give another folder to -o")
    with progress:
        progress.stage(f"read {map_file}")
        read = HeightField.read(map_file, **given)
        progress.stage(f"level {' x '.join(map(str, read.z.shape[::-1]))} heights")
        whole, notes = read.filled(window).levelled(level), read.notes
        if spikes == "fill" and (high := whole.spikes()).any():
            read = replace(read, z=np.where(high, np.nan, read.z))
            whole = read.filled(window).levelled(level)
            notes += (f"{np.count_nonzero(high)} heights are spikes, which are filled",)
        bare, patch = (
            (field.square() if window is None else field.window(*window)).levelled(level)
            for field in (whole, whole if cutoff is None else whole.filtered(cutoff))
        )
        patch.check_plausible()
        progress.stage("statistics")
        spectrum, affine = _self_affine(read, bare)  # without the filter, which bends the spectrum near its cut-off
        surface = HeightMap.of(patch.z, patch.size[0])
        origin = {"file": map_file, "channel": read.channel or None, "level": level, "cutoff": cutoff,
                  "filled": read.missing if window is None else read.missing_in(*window)}  # fmt: skip
        with files_into(folder) as aside:  # whole, or not at all
            patch.save(aside / "patch.npz", about=origin)
            progress.stage("figures")
            save(spectrum_figure(spectrum, "m", affine), aside / "spectrum.png")
            found = described(surface, aside, "m")
            about = origin | {"notes": notes, "side": surface.L, "nodes": len(patch.z),
                              "self_affine": affine and asdict(affine)} | found  # fmt: skip
            (aside / "measured.json").write_text(f"{json.dumps(about, indent=2)}\n", encoding="utf-8")
            text = CASE.format(delta=surface.light_approach())
            (aside / "case.toml").write_text(text, encoding="utf-8")
    if as_json:
        options.print_json(about)
        return
    for sentence in notes:
        options.say(sentence)
    rows = [("side", quantity(surface.L, "m")), ("nodes", f"{len(patch.z)}")]
    if origin["filled"]:
        rows.append(("gaps that were filled", f"{100 * origin['filled']:.2g} %"))
    if affine is not None:
        roll = "none on the patch" if affine.lambda_roll is None else quantity(affine.lambda_roll, "m")
        rows += [("Hurst exponent", f"{affine.H:.2f} ± {affine.error_H:.2f}"), ("roll-off wavelength", roll)]
    show(map_file, found, "m", rows)
    show_iso(found["iso25178"], "m")
    for sentence in _doubts(surface, bare, affine):
        options.say(sentence)
    options.say(f"written to {folder}; next: asperity check {folder / 'case.toml'}")


def _self_affine(read: HeightField, patch: HeightField) -> tuple[Spectrum, SelfAffineFit | None]:
    """Spectrum of a patch, and its self-affine equivalent; without one, a line says why."""
    from asperity.surface.spectrum import fit_self_affine, psd

    spectrum = psd(patch.z, len(patch.z) * patch.dx)
    levels = np.unique(read.z.ravel()[:: max(read.z.size // 100_000, 1)]).size
    try:
        if levels < STEPPED:
            raise InputError(f"the map has {levels} different heights, it takes {STEPPED} at least")
        return spectrum, fit_self_affine(spectrum, 4 * patch.dx)
    except InputError as error:
        click.echo(f"no Hurst exponent: {error}", err=True)
        return spectrum, None


def _doubts(surface: HeightMap, bare: HeightField, affine: SelfAffineFit | None) -> Iterator[str]:
    """What is doubtful of a surface and of its heights before the filter, which hides dust, a sentence each."""
    slope, spikes, highest = surface.rms_slope(), bare.spikes(), float(bare.z.max() / bare.z.std())
    if surface.L > LARGEST:
        yield f"the side of {quantity(surface.L, 'm')} is long for roughness: if lengths are not in metres, give --unit"
    if slope < SMOOTHEST:
        yield (
            f"the rms slope of {slope:.1e} is small for roughness: if heights and distances have different units in "
            "the file, write both in one"
        )
    if affine is not None and not -affine.error_H <= affine.H <= 1.0 + affine.error_H:
        yield f"H = {affine.H:.2f} is outside 0 to 1: the spectrum is not that of a self-affine surface"
    if spikes.any():
        top = quantity(float(bare.z[spikes].max()), "m")
        yield (
            f"{np.count_nonzero(spikes)} heights stand above their neighbours as dust and spikes of an instrument do, "
            f"the highest {top} above the mean: if they do not belong to the surface, "
            "--spikes fill takes them for missing"
        )
    elif highest > HIGH:
        yield (
            f"the highest point is {highest:.0f} rms heights above the mean, as dust is: if it does not belong to the "
            "surface, mark it as missing (NaN) in the map, and it is filled"
        )
