# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

"""`asperity import-map`: from the height map of an instrument to a surface and a case."""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from asperity.cli import options
from asperity.errors import InputError

if TYPE_CHECKING:
    from asperity.surface import HeightMap, Spectrum, SurfaceStatistics
    from asperity.surface.fractal_fit import FractalFit
    from asperity.surface.self_affine_fit import SelfAffineFit

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
CUT = 0.02  # share of the heights above the flat at the approach of the case
LEAST = 0.02  # that approach over the range of heights, where more of them are equally high
OVERSHOOT = 0.05  # rise of the interpolation above all heights, over their range, that is no roughness
SMOOTH = 6  # pixels in the cut-off that keeps the interpolation of an edge below that
KEPT = 5  # heights per wavelength of the filter that a patch keeps which has too many of them
HIGH = 8.0  # height of the summit above the mean plane over the rms height that no Gaussian surface reaches


@click.command()
@click.argument("map_file", metavar="MAP")
@options.output("OUT", "Folder; default out/<name of the file>.")
@click.option("--pixel", type=float, metavar="LENGTH", help="Distance between heights, where the file has none.")
@click.option("--level", type=click.Choice(["mean", "plane", "curvature"]), default="plane", show_default=True,
              help="Trend to remove.")  # fmt: skip
@click.option("--window", type=float, nargs=3, metavar="X Y SIDE", help="Square to cut; default the largest.")
@click.option("--despike", is_flag=True, help="Remove spikes and streaks, and fill them as gaps.")
@click.option("--cutoff", type=float, metavar="LENGTH", help="Wavelength of a Gaussian low-pass filter; default none.")
@click.option("--fit", "fitted", is_flag=True, help="Fit D and G of the fractal surface as well.")
@click.option("--shortest", type=float, metavar="LENGTH",
              help="Shortest wavelength for the Hurst exponent, D and G; default 4 pixels.")  # fmt: skip
@options.as_json
@options.serial
def command(
    map_file: str,
    output: str | None,
    pixel: float | None,
    level: str,
    window: tuple[float, float, float] | None,
    despike: bool,
    cutoff: float | None,
    fitted: bool,
    shortest: float | None,
    as_json: bool,
) -> None:
    """Make a case from a measured height map.

    Levels the map, cuts a square patch, and computes its statistics, spectrum and Hurst exponent. MAP is a .npz, .npy,
    .csv or .txt file, or a file of an instrument that SurfaceTopography reads. Lengths in metres. OUT receives
    patch.npz, case.toml to start from, measured.json, surface.png and spectrum.png.
    """
    from asperity.runtime.files import files_into
    from asperity.runtime.progress import Progress, StepLines
    from asperity.surface.height_map import MOST, HeightMap
    from asperity.surface.measured import HeightField
    from asperity.surface.spikes import prominence_of_summit
    from asperity.surface.statistics import psd

    progress = Progress() if as_json else StepLines()
    progress.stage(f"read {map_file}")
    whole = HeightField.read(map_file, pixel=pixel)
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

    def cut(field: HeightField) -> HeightField:
        return (field.square() if window is None else field.window(*window)).levelled(level)  # type: ignore[arg-type]

    bare = cut(whole)  # the filter would bend the spectrum near its cut-off
    patch = bare
    if cutoff is not None:
        progress.stage("filter")
        patch = cut(whole.filtered(cutoff))
        if len(patch.z) > MOST:
            patch = patch.thinned(max(1, int(cutoff / (KEPT * patch.dx)))).square()
    patch.check_plausible()
    spike = prominence_of_summit(bare.z)
    side = bare.size[0]
    shortest = 4 * bare.dx if shortest is None else shortest
    if not 2 * bare.dx <= shortest < side:
        raise InputError(f"shortest = {shortest:g} must lie between two pixels, {2 * bare.dx:g}, and the side {side:g}")
    folder = Path(output) if output else Path("out") / Path(map_file).stem
    progress.stage("statistics")
    with files_into(folder) as aside:  # whole, or not at all
        surface = HeightMap(path=patch.save(aside / "patch.npz"))
        statistics = surface.statistics(min(len(patch.z), 1025))
        summit = surface.maximum()
        spectrum = psd(bare.z, len(bare.z) * bare.dx)
        affine = _self_affine(spectrum, shortest)
        fit = None
        if fitted:
            progress.stage("fit of D and G")
            fit = _fractal(bare, shortest, level)
        progress.stage("figures")
        _draw(aside, surface, summit, spectrum, affine, fit)
        cutoffs = _over_cutoff(spectrum, bare.dx)
        about = {"file": map_file, "side": surface.L, "nodes": len(patch.z), "level": level, "cutoff": cutoff}
        about |= {"despike": despike}
        about |= {"statistics": asdict(statistics), "self_affine": None if affine is None else asdict(affine)}
        about |= {"over_cutoff": cutoffs, "fit": None if fit is None else fit.to_dict()}
        (aside / "measured.json").write_text(f"{json.dumps(about, indent=2)}\n", encoding="utf-8")
        (aside / "case.toml").write_text(_case(surface, summit[2]), encoding="utf-8")
        try:
            cost = _cost(aside / "case.toml")
        except InputError as error:
            raise InputError(str(error).replace(str(aside), str(folder))) from None
    progress.done()
    if as_json:
        options.print_json(about)
        return
    overshoot = summit[2] - float(surface.heights.max())
    _show(map_file, surface.L, len(patch.z), statistics, affine, fit, cutoffs)
    _doubts(surface, statistics, overshoot, spike, affine)
    if cost:
        options.say(cost)
    options.say(f"written to {folder}; next: asperity check {folder / 'case.toml'}")


def _case(surface: HeightMap, summit: float) -> str:
    """Text of case.toml, with the approach from the summit at which the flat cuts a light share of the heights.

    The share does not depend on the spectrum. A spike takes all of the approach, up to a tenth of the side: the share
    that the text names is then nearly nothing.
    """
    import numpy as np

    heights = surface.heights
    wanted = max(summit - float(np.quantile(heights, 1.0 - CUT)), LEAST * float(np.ptp(heights)))
    delta = min(wanted, 0.1 * surface.L)
    return CASE.format(delta=delta, share=float(np.mean(heights > summit - delta)))


def _self_affine(spectrum: Spectrum, shortest: float) -> SelfAffineFit | None:
    from asperity.surface.self_affine_fit import fit_self_affine

    try:
        return fit_self_affine(spectrum, shortest)
    except InputError as error:
        click.echo(f"no Hurst exponent: {error}", err=True)
        return None


def _fractal(patch: Any, shortest: float, level: str) -> FractalFit | None:
    from asperity.surface.fractal_fit import fit_fractal

    try:
        return fit_fractal(patch, shortest=shortest, trend=level)  # type: ignore[arg-type]
    except InputError as error:
        click.echo(f"no D and G: {error}", err=True)
        return None


def _over_cutoff(spectrum: Spectrum, pixel: float) -> list[dict[str, float]]:
    """Rms height [m] and slope of the waves longer than cut-offs an octave apart, down to two pixels."""
    import numpy as np

    from asperity.surface.self_affine_fit import rms_over_cutoff

    longest = 2 * np.pi / float(spectrum.q[0])
    wavelengths = longest / 2.0 ** np.arange(1, np.floor(np.log2(longest / (2 * pixel)) + 1e-9) + 1)
    heights, slopes = rms_over_cutoff(spectrum, wavelengths)
    rows = zip(wavelengths, heights, slopes, strict=True)
    return [{"wavelength": float(w), "rms_height": float(h), "rms_slope": float(s)} for w, h, s in rows]


def _draw(
    folder: Path, surface: Any, summit: Any, spectrum: Spectrum, affine: SelfAffineFit | None, fit: FractalFit | None
) -> None:
    from asperity.plot import save, surface_map
    from asperity.plot.measured import spectrum_figure

    save(surface_map(surface.grid(401), surface.L, summit, unit="m"), folder / "surface.png")
    save(spectrum_figure(spectrum, fit, "m", affine), folder / "spectrum.png")


def _show(
    title: str, side: float, nodes: int, statistics: SurfaceStatistics, affine: SelfAffineFit | None,
    fit: FractalFit | None, cutoffs: list[dict[str, float]],
) -> None:  # fmt: skip
    """Print the statistics, rms height and slope over the cut-off."""
    rows = [("side", f"{side:.4g} m"), ("nodes", f"{nodes}"), ("Sq", f"{statistics.Sq:.4g} m"),
            ("Sz", f"{statistics.Sz:.4g} m"), ("rms slope", f"{statistics.rms_slope:.4g}")]  # fmt: skip
    if affine is not None:
        roll = "none on the patch" if affine.lambda_roll is None else f"{affine.lambda_roll:.3g} m"
        rows += [("Hurst exponent", f"{affine.H:.2f} ± {affine.error_H:.2f}"), ("roll-off wavelength", roll)]
    if fit is not None:
        rows += [("D", f"{fit.D:.3f} ({fit.ci_D[0]:.3f} to {fit.ci_D[1]:.3f})"),
                 ("G", f"{fit.G:.3g} m ({fit.ci_G[0]:.2g} to {fit.ci_G[1]:.2g})"),
                 ("chance of this misfit", f"{fit.p_value:.2g}")]  # fmt: skip
    options.table(title, rows)
    options.table(
        "waves longer than the cut-off, from the spectrum",
        [(f"{c['wavelength']:.3g} m", f"{c['rms_height']:.3g} m", f"{c['rms_slope']:.3g}") for c in cutoffs],
        ("cut-off", "rms height", "rms slope"),
    )


def _doubts(
    surface: HeightMap, statistics: SurfaceStatistics, overshoot: float, spike: float, affine: SelfAffineFit | None
) -> None:
    """Print what is doubtful.

    Args:
        surface: of the patch
        statistics: of the patch
        overshoot: of the interpolation above all heights [m]
        spike: prominence of the highest point, see `spikes.prominence_of_summit`
        affine: Hurst exponent
    """
    from asperity.surface.spikes import STANDS_OUT

    if affine is not None and not -affine.error_H <= affine.H <= 1.0 + affine.error_H:
        options.say(
            f"H = {affine.H:.2f} is outside 0 to 1, so no power law of a self-affine surface fits: below 0 it is noise "
            "that a filter removes (--cutoff), above 1 the map is smooth"
        )
    if overshoot > OVERSHOOT * statistics.Sz:
        options.say(
            f"between the heights the surface rises {overshoot:.2g} m above the highest of them, at an edge or noise "
            f"that pixels do not resolve: a filter removes that (--cutoff {SMOOTH * surface.feature_size / 2:.2g})"
        )
    if spike > STANDS_OUT:
        options.say(
            f"the highest point stands {spike:.0f} times the local roughness above its surroundings, as dust or a "
            "spike of the instrument does: --despike removes such heights"
        )
    elif statistics.Sp > HIGH * statistics.Sq:
        options.say(
            f"the highest point is {statistics.Sp / statistics.Sq:.0f} rms heights above the mean: if it does not "
            "belong to the surface, mark it as missing (NaN) in the map, and it is filled"
        )


def _cost(case_file: Path) -> str:
    """A sentence if the case will probably not meet its tolerance, with the filter it takes; empty otherwise.

    Raises:
        InputError: the case cannot be run
    """
    from asperity.adaptive.estimate import estimate
    from asperity.case import Case

    case = Case.load(case_file)
    most = case.accuracy.max_dofs
    found = estimate(case)
    if found.enough:
        return ""
    return (
        f"the map is rough down to its pixels: a run would need more than the {most} dofs of accuracy.max_dofs for "
        f"the {case.accuracy.tolerance:.0%} of accuracy.tolerance; raise one of them, or filter the map (--cutoff "
        f"{found.cutoff(most):.2g})"
    )
