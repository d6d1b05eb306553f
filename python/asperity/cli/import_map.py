"""`asperity import-map`: from the height map of an instrument to a surface and a case."""

from __future__ import annotations

import json
from collections.abc import Callable
from contextlib import suppress
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from asperity.cli import options
from asperity.errors import CompatError, InputError
from asperity.units import LENGTHS

if TYPE_CHECKING:
    from asperity.surface import HeightMap, Spectrum, SurfaceStatistics
    from asperity.surface.measured import HeightField
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


@click.command()
@click.argument("map_file", metavar="MAP")
@options.output("OUT", "Folder; default out/<name of the file>.")
@click.option(
    "--pixel", type=float, metavar="LENGTH", help="Distance between heights in metres, where the file has none."
)
@click.option(
    "--unit",
    type=click.Choice([name for name in LENGTHS if name.isascii()]),
    help="Of lengths whose unit the file does not name; default m.",
)
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
def command(
    map_file: str,
    output: str | None,
    pixel: float | None,
    unit: str | None,
    missing: float | None,
    level: str,
    window: tuple[float, float, float] | None,
    despike: bool,
    cutoff: float | None,
    tip_radius: float | None,
    shortest: float | None,
    as_json: bool,
) -> None:
    """Make a case from a measured height map.

    Levels the map, cuts a square patch, and computes its statistics, spectrum and Hurst exponent. MAP is .npz or .npy,
    text (a matrix, or x, y, z, with any separator), or a file of an instrument that SurfaceTopography reads. Lengths in
    metres. OUT receives patch.npz, case.toml to start from, measured.json, surface.png and spectrum.png.
    """
    from asperity.runtime.files import files_into
    from asperity.runtime.progress import Progress, StepLines
    from asperity.surface.height_map import MOST, HeightMap
    from asperity.surface.measured import HeightField
    from asperity.surface.statistics import psd
    from asperity.surface.texture import repeating_wave

    if tip_radius is not None and not tip_radius > 0:
        raise InputError(f"tip-radius = {tip_radius:g} is not a positive length")
    progress = Progress() if as_json else StepLines()
    progress.stage(f"read {map_file}")
    whole = HeightField.read(map_file, pixel=pixel, unit=unit, missing=missing)
    zeros, gaps = whole.odd_zeros(), whole.missing
    ny, nx = whole.z.shape
    if min(nx, ny) > MOST and window is None and cutoff is None:
        raise InputError(
            f"{map_file}: {nx} x {ny} heights are more than the {MOST} x {MOST} of a surface; cut a window (--window), "
            "or filter the map (--cutoff): a patch of fewer heights, a fifth of the cut-off apart, is kept"
        )
    progress.stage(f"level {nx} x {ny} heights")
    whole = whole.filled().levelled(level)  # type: ignore[arg-type]
    if despike:
        progress.stage("remove spikes")
        whole = whole.despiked()

    reliable = whole.reliable(tip_radius)
    limited = cutoff is None and reliable > 2 * min(whole.dx, whole.dy)
    cutoff = reliable if limited else cutoff

    def cut(field: HeightField) -> HeightField:
        return (field.square() if window is None else field.window(*window)).levelled(level)  # type: ignore[arg-type]

    def filtered(cutoff: float) -> HeightField:
        patch = cut(whole.filtered(cutoff))
        return patch.thinned(max(1, int(cutoff / (KEPT * patch.dx)))).square() if len(patch.z) > MOST else patch

    bare = cut(whole)  # the filter would bend the spectrum near its cut-off
    patch = bare
    if cutoff is not None:
        progress.stage("filter")
        patch = filtered(cutoff)
    patch.check_plausible()
    side = bare.size[0]
    shortest = 4 * bare.dx if shortest is None else shortest
    if not 2 * bare.dx <= shortest < side:
        raise InputError(f"shortest = {shortest:g} must lie between two pixels, {2 * bare.dx:g}, and the side {side:g}")
    folder = Path(output) if output else Path("out") / Path(map_file).stem
    progress.stage("statistics")
    surface = HeightMap.of(patch.z, patch.size[0])
    left_out = [reliable, *_left_out(surface, bare)] if limited else None
    with files_into(folder) as aside:  # whole, or not at all
        patch.save(aside / "patch.npz", left_out=left_out)
        statistics, summit = surface.statistics(min(len(patch.z), 1025)), surface.maximum()
        spectrum = psd(bare.z, len(bare.z) * bare.dx)
        wave = repeating_wave(bare.z, side)
        affine = _self_affine(spectrum, shortest) if wave is None else None
        progress.stage("figures")
        _draw(aside, surface, summit, spectrum, affine)
        about = {"file": map_file, "side": surface.L, "nodes": len(patch.z), "level": level, "cutoff": cutoff}
        about |= {"filled": gaps, "despike": despike, "instrument": left_out}
        about |= {"statistics": asdict(statistics), "self_affine": None if affine is None else asdict(affine)}
        about |= {"repeating_wave": None if wave is None else asdict(wave)}
        (aside / "measured.json").write_text(f"{json.dumps(about, indent=2)}\n", encoding="utf-8")
        (aside / "case.toml").write_text(_case(surface), encoding="utf-8")
        try:
            cost = _cost(aside / "case.toml", surface)
        except InputError as error:
            raise InputError(str(error).replace(str(aside), str(folder))) from None
        except CompatError:  # the map can be made where nothing is solved
            cost = ""
    progress.done()
    if as_json:
        options.print_json(about)
        return
    _show(map_file, surface.L, len(patch.z), gaps, statistics, affine)
    if left_out is not None:
        options.say(
            f"waves shorter than {reliable:.3g} m, which the instrument does not resolve, are filtered: what it shows "
            f"of them would change the force at the approach of the case by {left_out[1]:+.1%} and the area by "
            f"{left_out[2]:+.1%}; --cutoff filters at another wavelength"
        )
    elif cutoff is not None and cutoff < reliable:
        options.say(f"waves shorter than {reliable:.3g} m are not resolved by the instrument: --cutoff is below that")
    _doubts(statistics, surface.L, bare, affine, wave, zeros)
    if not _spike(whole, cut, bare, wave, statistics) and cost:
        options.say(cost)
    options.say(f"written to {folder}; next: asperity check {folder / 'case.toml'}")


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


def _case(surface: HeightMap) -> str:
    """Text of case.toml, with the approach of a light load."""
    from asperity.surface.cutoff import approach_of_share, share_of_approach

    delta = float(f"{approach_of_share(surface):.3g}")
    return CASE.format(delta=delta, share=share_of_approach(surface, delta))


def _self_affine(spectrum: Spectrum, shortest: float) -> SelfAffineFit | None:
    from asperity.surface.self_affine_fit import fit_self_affine

    try:
        return fit_self_affine(spectrum, shortest)
    except InputError as error:
        click.echo(f"no Hurst exponent: {error}", err=True)
        return None


def _draw(folder: Path, surface: Any, summit: Any, spectrum: Spectrum, affine: SelfAffineFit | None) -> None:
    from asperity.plot import save, surface_map
    from asperity.plot.fields import spectrum_figure

    save(surface_map(surface.grid(401), surface.L, summit, unit="m"), folder / "surface.png")
    save(spectrum_figure(spectrum, "m", affine), folder / "spectrum.png")


def _show(
    title: str, side: float, nodes: int, gaps: float, statistics: SurfaceStatistics, affine: SelfAffineFit | None
) -> None:
    """Print the statistics."""
    rows = [("side", f"{side:.4g} m"), ("nodes", f"{nodes}"), ("Sq", f"{statistics.Sq:.4g} m"),
            ("Sz", f"{statistics.Sz:.4g} m"), ("rms slope", f"{statistics.rms_slope:.4g}")]  # fmt: skip
    if gaps:
        rows.insert(2, ("gaps that were filled", f"{100 * gaps:.2g} %"))
    if affine is not None:
        roll = "none on the patch" if affine.lambda_roll is None else f"{affine.lambda_roll:.3g} m"
        rows += [("Hurst exponent", f"{affine.H:.2f} ± {affine.error_H:.2f}"), ("roll-off wavelength", roll)]
    options.table(title, rows)


def _doubts(
    statistics: SurfaceStatistics, side: float, bare: HeightField, affine: SelfAffineFit | None, wave: Wave | None,
    zeros: float,
) -> None:  # fmt: skip
    """Print what is doubtful; `bare` is the patch without a filter, `zeros` the share of heights of exactly 0."""
    import numpy as np

    if side > LARGEST:
        options.say(f"the side of {side:.3g} m is long for roughness: if lengths are not in metres, give --unit")
    if statistics.rms_slope < SMOOTHEST:
        options.say(
            f"the rms slope of {statistics.rms_slope:.1e} is small for roughness: if heights and distances have "
            "different units in the file, write both in one"
        )
    if zeros:
        options.say(f"{zeros:.2%} of the heights are exactly 0: if they are missing, give --missing 0")
    if wave is not None:
        options.say(
            f"no Hurst exponent: waves of {wave.length:.3g} m repeat, with {wave.share:.0%} of the mean square height, "
            "as on turned or textured surfaces"
        )
    if affine is not None and not -affine.error_H <= affine.H <= 1.0 + affine.error_H:
        options.say(f"H = {affine.H:.2f} is outside 0 to 1: the spectrum is not that of a self-affine surface")
    without = bare.levelled("curvature").z
    rest, form = float(np.std(without)), float(np.std(bare.z - without))
    if form > FORM * rest:
        options.say(
            f"the map has a form of second order, as of a sphere, with Sq = {form:.3g} m, and {rest:.3g} m without it: "
            "if only roughness is meant, --level curvature removes the form"
        )


def _spike(
    whole: HeightField, cut: Callable[[HeightField], HeightField], bare: HeightField, wave: Wave | None,
    statistics: SurfaceStatistics,
) -> bool:  # fmt: skip
    """Print if the summit may be dust or a spike, and return whether --despike is recommended: it is tried before.

    `cut` makes the patch of the levelled map, `bare` is the patch without a filter. Crests of a wave are no spikes.
    """
    from asperity.surface.spikes import STANDS_OUT, prominence_of_summit

    spike = prominence_of_summit(bare.z)
    if spike > STANDS_OUT and wave is None:
        with suppress(InputError):
            if prominence_of_summit(cut(whole.despiked()).z) <= STANDS_OUT:
                options.say(
                    f"the highest point stands {spike:.0f} times the local roughness above its surroundings, as dust "
                    "or a spike of the instrument does: --despike removes such heights"
                )
                return True
    if statistics.Sp > HIGH * statistics.Sq:
        options.say(
            f"the highest point is {statistics.Sp / statistics.Sq:.0f} rms heights above the mean: if it does not "
            "belong to the surface, mark it as missing (NaN) in the map, and it is filled"
        )
    return False


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
