"""`asperity import-map`: from the height map of an instrument to a surface and a case."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import asdict, dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from asperity.cli import options
from asperity.cli.surface import iso_rows
from asperity.errors import CompatError, InputError
from asperity.runtime.text_table import DECIMALS
from asperity.units import LENGTHS, quantity

if TYPE_CHECKING:
    from asperity.surface import HeightMap, Spectrum, SurfaceStatistics
    from asperity.surface.iso25178 import ISO25178
    from asperity.surface.measured import HeightField, Trend
    from asperity.surface.self_affine_fit import SelfAffineFit
    from asperity.surface.texture import Wave

CASE = """# The measured patch of patch.npz pressed by a rigid flat: set material and approach. SI units.

[surface]
kind = "file"
path = "patch.npz"

[material]
E = 200e9
nu = 0.3

[loading]
delta_max = {delta:.3g}              # {share:.1%} of the heights are above the flat then
steps = 10

[accuracy]
tolerance = 0.05                 # of the force; without it, one mesh of mesh.h_contact
"""
CELLS = 500  # most per side of the half-space that shows what the instrument leaves out
KEPT = 5  # heights per wavelength of the filter that a patch keeps which has too many of them
HIGH = 8.0  # height of the summit above the mean plane over the rms height that no Gaussian surface reaches
FORM = 2.5  # Sq of a second-order form over that of the rest; random surfaces without roll-off reach 2
LARGEST = 0.1  # side of a patch [m]
SMOOTHEST = 1e-4  # rms slope; below it, heights and distances may have different units


class Pixel(click.ParamType):
    """A length, or those along x and y with a comma."""

    name = "length"

    def convert(
        self, value: str, parameter: click.Parameter | None, context: click.Context | None
    ) -> tuple[float, float]:
        """Both lengths."""
        try:
            x, y = (float(part) for part in (value.split(",") * 2 if "," not in value else value.split(",")))
        except ValueError:
            self.fail(f"{value}: give a length in metres, or two as 1e-6,2e-6")
        return x, y


@click.command()
@click.argument("map_file", metavar="MAP")
@options.output("OUT", "Folder; default out/<name of the file>.")
@click.option("--pixel", type=Pixel(), metavar="LENGTH[,LENGTH]",
              help="Distance between heights in metres, or those along x and y, where the file has none.")  # fmt: skip
@click.option("--unit", metavar="UNIT",
              help=f"Of lengths whose unit the file does not name: {', '.join(filter(str.isascii, LENGTHS))}, or a "
              "number of metres; default m.")  # fmt: skip
@click.option("--channel", metavar="NAME", help="Of the file of an instrument, or its number; default the heights.")
@click.option("--array", metavar="NAME", help="Of the heights in an .npz file; default z, or the only map.")
@click.option("--decimal", type=click.Choice(tuple(DECIMALS)), help="Of text in which 1,234 may be both.")
@click.option("--missing", type=float, metavar="VALUE", help="Value in the file that stands for a missing height.")
@click.option("--level", type=click.Choice(["mean", "plane", "curvature"]), default="plane", show_default=True,
              help="Trend to remove.")  # fmt: skip
@click.option("--window", type=float, nargs=3, metavar="X Y SIDE", help="Square to cut; default the largest.")
@click.option("--despike", is_flag=True, help="Remove spikes and streaks, and fill them as gaps.")
@click.option("--cutoff", type=float, metavar="LENGTH", help="Wavelength of a Gaussian low-pass filter; default none.")
@click.option("--tip-radius", type=float, metavar="LENGTH",
              help="Of the instrument in metres; waves that it does not resolve are filtered.")  # fmt: skip
@click.option("--shortest", type=float, metavar="LENGTH",
              help="Shortest wavelength for the Hurst exponent; default 4 pixels.")  # fmt: skip
@options.as_json
@options.serial
def command(map_file: str, output: str | None, as_json: bool, **given: Any) -> None:
    """Make a case from a measured height map.

    Levels the map, cuts a square patch, and computes its statistics, spectrum and Hurst exponent. MAP is .npz or .npy,
    text (a matrix, or x, y, z, with any separator), or a file of an instrument that SurfaceTopography reads. Lengths in
    metres. OUT receives patch.npz, case.toml to start from, measured.json, surface.png, abbott.png and spectrum.png.
    """
    from asperity.runtime.files import files_into
    from asperity.runtime.progress import Progress, StepLines

    progress = Progress() if as_json else StepLines()
    folder = Path(output) if output else Path("out") / Path(map_file).stem
    scan = _scan(map_file, progress.stage, **given)
    about: dict[str, Any] = {"file": map_file, "channel": scan.channel or None, "notes": scan.notes}
    about |= {"side": scan.surface.L, "nodes": len(scan.patch.z), "level": given["level"]}
    about |= {
        "cutoff": scan.cutoff,
        "filled": scan.filled,
        "despike": given["despike"],
        "instrument": scan.left_out,
    }
    for name, part in (("statistics", scan.statistics), ("self_affine", scan.affine), ("repeating_wave", scan.wave)):
        about[name] = None if part is None else asdict(part)
    about["iso25178"] = scan.iso.to_dict()
    with files_into(folder) as aside:  # whole, or not at all
        origin = {name: about[name] for name in ("file", "channel", "level", "cutoff", "filled", "despike")}
        scan.patch.save(aside / "patch.npz", left_out=scan.left_out, about=origin)
        progress.stage("figures")
        _draw(aside, scan)
        (aside / "measured.json").write_text(f"{json.dumps(about, indent=2)}\n", encoding="utf-8")
        (aside / "case.toml").write_text(_case(scan.surface), encoding="utf-8")
        try:
            cost = _cost(aside / "case.toml", scan.surface)
        except InputError as error:
            raise InputError(str(error).replace(str(aside), str(folder))) from None
        except CompatError:  # the map can be made where nothing is solved
            cost = ""
    progress.done()
    if as_json:
        options.print_json(about)
        return
    for sentence in scan.notes:
        options.say(sentence)
    _show(map_file, scan)
    for sentence in _doubts(scan):
        options.say(sentence)
    spike, despiking = _spike(scan)
    for sentence in (spike, "" if despiking else cost):
        if sentence:
            options.say(sentence)
    options.say(f"written to {folder}; next: asperity check {folder / 'case.toml'}")


def _scan(
    map_file: str, stage: Callable[[str], None], *, pixel: tuple[float, float] | None, unit: str | None,
    missing: float | None, channel: str | None, array: str | None, decimal: str | None, level: Trend,
    window: tuple[float, float, float] | None, despike: bool, cutoff: float | None,
    tip_radius: float | None, shortest: float | None,
) -> _Scan:  # fmt: skip
    """Read, level, filter and cut a map; `stage` announces the parts, the others are the options of the command."""
    from asperity.surface.height_map import HeightMap
    from asperity.surface.measured import HeightField
    from asperity.surface.patch import MOST

    if tip_radius is not None and not tip_radius > 0:
        raise InputError(f"tip-radius = {tip_radius:g} is not a positive length")
    stage(f"read {map_file}")
    whole = HeightField.read(
        map_file, pixel=pixel, unit=unit, missing=missing, channel=channel, array=array, decimal=decimal
    )
    named, notes = whole.channel, whole.notes
    zeros, filled = whole.odd_zeros(), whole.missing if window is None else whole.missing_in(*window)
    ny, nx = whole.z.shape
    if min(nx, ny) > MOST and window is None and cutoff is None:
        raise InputError(
            f"{map_file}: {nx} x {ny} heights are more than the {MOST} x {MOST} of a surface; cut a window (--window), "
            "or filter the map (--cutoff): a patch of fewer heights, a fifth of the cut-off apart, is kept"
        )
    stage(f"level {nx} x {ny} heights")
    whole = whole.filled(window).levelled(level)
    if despike:
        stage("remove spikes")
        whole = whole.despiked()
    reliable = whole.reliable(tip_radius)
    limited = cutoff is None and reliable > 2 * min(whole.dx, whole.dy)
    cutoff = reliable if limited else cutoff

    def cut(field: HeightField) -> HeightField:
        return (field.square() if window is None else field.window(*window)).levelled(level)

    patch = bare = cut(whole)
    if cutoff is not None:
        stage("filter")
        patch = cut(whole.filtered(cutoff))
        if len(patch.z) > MOST:
            patch = patch.thinned(max(1, int(cutoff / (KEPT * patch.dx)))).square()
    patch.check_plausible()
    stage("statistics")
    spectrum, wave, affine = _spectrum(bare, shortest)
    surface = HeightMap.of(patch.z, patch.size[0])
    statistics = surface.statistics(min(len(patch.z), 1025))
    left_out = (reliable, *_left_out(surface, bare)) if limited else None
    return _Scan(
        whole, cut, bare, patch, filled, zeros, cutoff, reliable, left_out, surface, statistics, spectrum, wave,
        affine, named, notes,
    )  # fmt: skip


def _left_out(smooth: HeightMap, bare: HeightField) -> tuple[float, float]:
    """Relative change of force and area of a light contact by the waves that a filter has taken from a patch."""
    from asperity.reference.halfspace import RoughHalfSpace, cells_per_side
    from asperity.surface import HeightMap
    from asperity.surface.cutoff import approach_of_share

    layer = RoughHalfSpace(cells_per_side(min(len(smooth.heights), CELLS)), height=1.0, nu=0.3)
    plane = smooth.maximum()[2] - approach_of_share(smooth)  # of the flat, the same for both
    found = []
    for surface in (smooth, HeightMap.of(bare.z, bare.size[0])):
        summit, side = surface.maximum()[2], surface.L
        curve = layer.curve(layer.heights(surface), summit / side, [(summit - plane) / side])
        found.append((float(curve.P_star[0]), float(curve.area_fraction[0])))
    (force, area), (more, larger) = found
    return more / force - 1.0, larger / area - 1.0


def _spectrum(bare: HeightField, shortest: float | None) -> tuple[Spectrum, Wave | None, SelfAffineFit | None]:
    """Spectrum, wave that repeats, and self-affine equivalent down to a wavelength [m] where there is no such wave."""
    from asperity.surface.self_affine_fit import fit_self_affine
    from asperity.surface.statistics import psd
    from asperity.surface.texture import repeating_wave

    shortest, side = 4 * bare.dx if shortest is None else shortest, bare.size[0]
    if not 2 * bare.dx <= shortest < side:
        raise InputError(f"shortest = {shortest:g} must lie between two pixels, {2 * bare.dx:g}, and the side {side:g}")
    spectrum, wave = psd(bare.z, len(bare.z) * bare.dx), repeating_wave(bare.z, side)
    try:
        return spectrum, wave, None if wave is not None else fit_self_affine(spectrum, shortest)
    except InputError as error:
        click.echo(f"no Hurst exponent: {error}", err=True)
        return spectrum, wave, None


def _case(surface: HeightMap) -> str:
    """Text of case.toml, with the approach of a light load."""
    from asperity.surface.cutoff import approach_of_share, share_of_approach

    delta = float(f"{approach_of_share(surface):.3g}")
    return CASE.format(delta=delta, share=share_of_approach(surface, delta))


def _draw(folder: Path, scan: _Scan) -> None:
    from asperity.plot import save, surface_map
    from asperity.plot.fields import abbott_figure, spectrum_figure
    from asperity.surface.iso25178 import AbbottCurve

    surface = scan.surface
    save(surface_map(surface.grid(401), surface.L, surface.maximum(), unit="m"), folder / "surface.png")
    save(abbott_figure(AbbottCurve.of(scan.patch.z), scan.iso, "m"), folder / "abbott.png")
    save(spectrum_figure(scan.spectrum, "m", scan.affine), folder / "spectrum.png")


def _show(title: str, scan: _Scan) -> None:
    """Print the statistics."""
    statistics, affine = scan.statistics, scan.affine
    rows = [("side", quantity(scan.surface.L, "m")), ("nodes", f"{len(scan.patch.z)}"),
            ("Sq", quantity(statistics.Sq, "m")), ("Sz", quantity(statistics.Sz, "m")),
            ("rms slope", f"{statistics.rms_slope:.4g}")]  # fmt: skip
    if scan.filled:
        rows.insert(2, ("gaps that were filled", f"{100 * scan.filled:.2g} %"))
    if affine is not None:
        roll = "none on the patch" if affine.lambda_roll is None else _metres(affine.lambda_roll)
        rows += [("Hurst exponent", f"{affine.H:.2f} ± {affine.error_H:.2f}"), ("roll-off wavelength", roll)]
    options.table(title, rows)
    options.table("ISO 25178", iso_rows(scan.iso, "m"))


def _metres(length: float) -> str:
    return quantity(length, "m", 3)


def _doubts(scan: _Scan) -> Iterator[str]:
    """What the instrument does not resolve, and what is doubtful, a sentence each."""
    import numpy as np

    slope, affine, wave, bare = scan.statistics.rms_slope, scan.affine, scan.wave, scan.bare
    if scan.left_out is not None:
        yield (
            f"waves shorter than {_metres(scan.reliable)}, which the instrument does not resolve, are filtered: what "
            f"it shows of them would change the force at the approach of the case by {scan.left_out[1]:+.1%} and the "
            f"area by {scan.left_out[2]:+.1%}; --cutoff filters at another wavelength"
        )
    elif scan.cutoff is not None and scan.cutoff < scan.reliable:
        yield f"waves shorter than {_metres(scan.reliable)} are not resolved by the instrument: --cutoff is below that"
    if scan.surface.L > LARGEST:
        yield f"the side of {_metres(scan.surface.L)} is long for roughness: if lengths are not in metres, give --unit"
    if slope < SMOOTHEST:
        yield (
            f"the rms slope of {slope:.1e} is small for roughness: if heights and distances have different units in "
            "the file, write both in one"
        )
    if scan.zeros:
        yield f"{scan.zeros:.2%} of the heights are exactly 0: if they are missing, give --missing 0"
    if wave is not None:
        yield (
            f"no Hurst exponent: waves of {_metres(wave.length)} repeat, with {wave.share:.0%} of the mean square "
            "height, as on turned or textured surfaces"
        )
    if affine is not None and not -affine.error_H <= affine.H <= 1.0 + affine.error_H:
        yield f"H = {affine.H:.2f} is outside 0 to 1: the spectrum is not that of a self-affine surface"
    elif affine is not None and scan.surface.limited:
        yield "steps or edges change the spectrum: H may not be that of the roughness"
    without = bare.levelled("curvature").z
    rest, form = float(np.std(without)), float(np.std(bare.z - without))
    if form > FORM * rest:
        yield (
            f"the map has a form of second order, as of a sphere, with Sq = {_metres(form)}, and "
            f"{_metres(rest)} without it: "
            "if only roughness is meant, --level curvature removes the form"
        )


def _spike(scan: _Scan) -> tuple[str, bool]:
    """Sentence on a summit that may be dust or a spike, and whether it recommends --despike, which is tried before.

    Crests of a wave are no spikes.
    """
    from asperity.surface.spikes import STANDS_OUT, prominence_of_summit

    spike, statistics = prominence_of_summit(scan.bare.z), scan.statistics
    if spike > STANDS_OUT and scan.wave is None:
        with suppress(InputError):
            if prominence_of_summit(scan.cut(scan.whole.despiked()).z) <= STANDS_OUT:
                return (
                    f"the highest point stands {spike:.0f} times the local roughness above its surroundings, as dust "
                    "or a spike of the instrument does: --despike removes such heights"
                ), True
    if statistics.Sp <= HIGH * statistics.Sq:
        return "", False
    return (
        f"the highest point is {statistics.Sp / statistics.Sq:.0f} rms heights above the mean: if it does not "
        "belong to the surface, mark it as missing (NaN) in the map, and it is filled"
    ), False


def _cost(case_file: Path, surface: HeightMap) -> str:
    """Sentences on steps of the map, and on a tolerance that will probably not be met, with the filter it takes.

    Raises:
        InputError: the case cannot be run
    """
    from asperity.adaptive.cutoff import filter_advice, note_on_steps
    from asperity.adaptive.estimate import estimate
    from asperity.case import Case

    case = Case.load(case_file)
    found = estimate(case, surface=surface)
    notes = note_on_steps(surface, found.approach), filter_advice(case, found, surface)
    return "\n".join(filter(None, notes))


@dataclass(frozen=True)
class _Scan:
    """A map, its patch, and what is known of it.

    Attributes:
        whole: the levelled map
        cut: makes the patch of a levelled map
        bare: the patch without a filter, which would bend the spectrum near its cut-off
        patch: what becomes the surface
        filled, zeros: shares of the heights that were missing, in the window if there is one, and that are exactly 0
        cutoff: of the filter [m], None without
        reliable: wavelength below which the map shows its instrument [m]
        left_out: see `HeightMap.left_out`; None unless the filter is that of the instrument
        channel, notes: see `HeightField`
        statistics: of the surface; spectrum, repeating wave and self-affine equivalent are those of `bare`
    """

    whole: HeightField
    cut: Callable[[HeightField], HeightField]
    bare: HeightField
    patch: HeightField
    filled: float
    zeros: float
    cutoff: float | None
    reliable: float
    left_out: tuple[float, float, float] | None
    surface: HeightMap
    statistics: SurfaceStatistics
    spectrum: Spectrum
    wave: Wave | None
    affine: SelfAffineFit | None
    channel: str
    notes: tuple[str, ...]

    @cached_property
    def iso(self) -> ISO25178:
        """Parameters of ISO 25178 of the patch."""
        from asperity.surface.iso25178 import iso25178

        return iso25178(self.patch.z, self.patch.dx, self.patch.dy)
