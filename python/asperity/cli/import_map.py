"""`asperity import-map`: from the height map of an instrument to a surface and a case."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
import numpy as np

from asperity.cli import options
from asperity.cli.surface import draw, iso_rows
from asperity.errors import CompatError, InputError
from asperity.units import LENGTHS, quantity

if TYPE_CHECKING:
    from asperity.surface import HeightMap
    from asperity.surface.measured import HeightField, Trend

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
@click.option("--pixel", type=options.Lengths(), metavar="LENGTH[,LENGTH]",
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
def import_map(map_file: str, output: str | None, as_json: bool, **given: Any) -> None:
    """Make a case from a measured height map.

    Levels the map and cuts a square patch. MAP is .npz or .npy, text (a matrix, or lines of x, y, z), or a file of an
    instrument that SurfaceTopography reads; --pixel and --unit are for what it does not say. Lengths are written as
    0.2um; without a unit in metres. OUT receives patch.npz, case.toml, measured.json and pictures.
    """
    from asperity.runtime.files import files_into
    from asperity.runtime.progress import Progress, ProgressLine
    from asperity.runtime.run_folder import holds_run
    from asperity.surface.iso25178 import light_approach

    progress = Progress() if as_json else ProgressLine()
    folder = Path(output) if output else Path("out") / Path(map_file).stem
    if folder.is_file() or holds_run(folder):
        raise InputError(f"{folder} {'is a file' if folder.is_file() else 'holds a run'}; give another folder to -o")
    with progress:
        scan = _Scan(map_file, progress.stage, **given)
        origin = {"file": map_file, "channel": scan.channel or None, "level": given["level"], "cutoff": given["cutoff"],
                  "filled": scan.filled}  # fmt: skip
        about: dict[str, Any] = origin | {
            "notes": scan.notes, "side": scan.surface.L, "nodes": len(scan.patch.z), "iso25178": scan.iso.to_dict(),
            "self_affine": None if scan.affine is None else asdict(scan.affine),
        }  # fmt: skip
        with files_into(folder) as aside:  # whole, or not at all
            scan.patch.save(aside / "patch.npz", about=origin)
            progress.stage("figures")
            _draw(aside, scan)
            (aside / "measured.json").write_text(f"{json.dumps(about, indent=2)}\n", encoding="utf-8")
            text = CASE.format(delta=light_approach(scan.surface))
            (aside / "case.toml").write_text(text, encoding="utf-8")
            try:
                cost = _cost(aside / "case.toml", scan.surface)
            except InputError as error:
                text = str(error).removeprefix(f"{aside / 'case.toml'}: ").replace(str(aside), str(folder))
                raise InputError(f"{map_file} makes no case that can be run: {text}") from None
            except CompatError:  # the map can be made where nothing is solved
                cost = ""
    if as_json:
        options.print_json(about)
        return
    for sentence in scan.notes:
        options.say(sentence)
    _show(map_file, scan)
    for sentence in _doubts(scan, cost):
        options.say(sentence)
    options.say(f"written to {folder}; next: asperity check {folder / 'case.toml'}")


class _Scan:
    """A map read, levelled, filtered and cut; what is known of it, and of its patch that becomes the surface.

    Args:
        map_file: to read
        stage: announces the parts
        given: options of the command
    """

    def __init__(
        self, map_file: str, stage: Callable[[str], None], *, level: Trend, window: tuple[float, float, float] | None,
        cutoff: float | None, spikes: str, **given: Any,
    ) -> None:  # fmt: skip
        from asperity.surface.height_map import HeightMap
        from asperity.surface.iso25178 import iso25178
        from asperity.surface.measured import HeightField
        from asperity.surface.self_affine_fit import fit_self_affine
        from asperity.surface.statistics import psd

        def cut(field: HeightField) -> HeightField:
            return (field.square() if window is None else field.window(*window)).levelled(level)

        stage(f"read {map_file}")
        whole = HeightField.read(map_file, **given)
        self.channel, self.notes = whole.channel, whole.notes
        levels = np.unique(whole.z.ravel()[:: max(whole.z.size // 100_000, 1)]).size
        self.filled = whole.missing if window is None else whole.missing_in(*window)
        stage(f"level {' x '.join(map(str, whole.z.shape[::-1]))} heights")
        read, whole = whole, whole.filled(window).levelled(level)
        found = whole.spikes()
        if spikes == "fill" and found.any():
            read = read.without(found)
            self.filled = read.missing if window is None else read.missing_in(*window)
            whole = read.filled(window).levelled(level)
            self.notes += (f"{np.count_nonzero(found)} heights are spikes, which are filled",)
        bare = self.patch = cut(whole)  # without a filter, which would bend the spectrum near its cut-off
        if cutoff is not None:
            stage("filter")
            self.patch = cut(whole.filtered(cutoff))
        self.patch.check_plausible()
        self.doubt = _dust(bare)  # which a filter hides
        stage("statistics")
        self.spectrum, self.affine = psd(bare.z, len(bare.z) * bare.dx), None
        try:
            if levels < STEPPED:
                raise InputError(f"the map has {levels} different heights, it takes {STEPPED} at least")
            self.affine = fit_self_affine(self.spectrum, 4 * bare.dx)
        except InputError as error:
            click.echo(f"no Hurst exponent: {error}", err=True)
        self.surface = HeightMap.of(self.patch.z, self.patch.size[0])
        self.slope = self.surface.rms_slope()
        self.iso = iso25178(self.patch.z, self.patch.dx, self.patch.dy)


def _dust(patch: HeightField) -> str:
    """Sentence on heights of an unfiltered patch that may not belong to the surface; empty without any."""
    if (found := patch.spikes()).any():
        return (
            f"{np.count_nonzero(found)} heights stand above their neighbours as dust and spikes of an instrument do, "
            f"the highest {_metres(float(patch.z[found].max()))} above the mean: if they do not belong to the surface, "
            "--spikes fill takes them for missing"
        )
    highest = float(patch.z.max() / patch.z.std())
    return (
        ""
        if highest <= HIGH
        else (
            f"the highest point is {highest:.0f} rms heights above the mean, as dust is: if it does not belong to the "
            "surface, mark it as missing (NaN) in the map, and it is filled"
        )
    )


def _draw(folder: Path, scan: _Scan) -> None:
    from asperity.plot import save
    from asperity.plot.fields import spectrum_figure

    draw(folder, scan.surface, scan.patch.z, scan.iso, "m")
    save(spectrum_figure(scan.spectrum, "m", scan.affine), folder / "spectrum.png")


def _show(title: str, scan: _Scan) -> None:
    """Print the statistics."""
    affine = scan.affine
    rows = [
        ("side", quantity(scan.surface.L, "m")),
        ("nodes", f"{len(scan.patch.z)}"),
        ("rms slope", f"{scan.slope:.4g}"),
    ]
    if scan.filled:
        rows.insert(2, ("gaps that were filled", f"{100 * scan.filled:.2g} %"))
    if affine is not None:
        roll = "none on the patch" if affine.lambda_roll is None else _metres(affine.lambda_roll)
        rows += [("Hurst exponent", f"{affine.H:.2f} ± {affine.error_H:.2f}"), ("roll-off wavelength", roll)]
    options.table(title, rows)
    options.table("ISO 25178", iso_rows(scan.iso, "m"))


def _metres(length: float) -> str:
    return quantity(length, "m", 3)


def _doubts(scan: _Scan, cost: str) -> Iterator[str]:
    """What is doubtful, and the cost, a sentence each."""
    affine = scan.affine
    if scan.surface.L > LARGEST:
        yield f"the side of {_metres(scan.surface.L)} is long for roughness: if lengths are not in metres, give --unit"
    if scan.slope < SMOOTHEST:
        yield (
            f"the rms slope of {scan.slope:.1e} is small for roughness: if heights and distances have "
            "different units in the file, write both in one"
        )
    if affine is not None and not -affine.error_H <= affine.H <= 1.0 + affine.error_H:
        yield f"H = {affine.H:.2f} is outside 0 to 1: the spectrum is not that of a self-affine surface"
    if scan.doubt:
        yield scan.doubt
    if cost:
        yield cost


def _cost(case_file: Path, surface: HeightMap) -> str:
    """Sentences on steps of the map and on the filter that a tolerance takes; InputError of a case that cannot run."""
    from asperity.adaptive.estimate import estimate, filter_advice, note_on_steps
    from asperity.case import Case

    case = Case.load(case_file)
    found = estimate(case, surface=surface)
    notes = note_on_steps(surface, found.approach), filter_advice(case, found, surface)
    return "\n".join(filter(None, notes))
