"""Figures of a surface and its contact: maps, area over the load, and the surface that templates/turn.js turns."""

from __future__ import annotations

import base64
import io
import math
from collections.abc import Iterable
from typing import Any

import numpy as np
from matplotlib import colormaps
from matplotlib.colors import LightSource, LogNorm, to_hex
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from PIL import Image

from asperity.arrays import Array
from asperity.curve import Curve
from asperity.output.results import PIXELS, Raster, Results, facets
from asperity.plot import style
from asperity.plot.curves import LOAD, draw_branches, load_axis
from asperity.reference.leakage import flow
from asperity.surface import Spectrum, Surface
from asperity.surface.spectrum import SelfAffineFit
from asperity.units import prefix, quantity

BINS = 40  # of the distribution of the pressure
FLOW_PIXELS, FLOW_RANGE = 200, (1e-2, 10.0)  # of a map of the flow, and of its colours over the mean
RELIEF = 0.1  # range of the heights that shade a map, over its side
NODES = 134  # of the turning surface along each side, every third pixel of the map: 48 kB
RAISED = 0.25  # range of the heights of the turning surface, over the side
UNLOADED = 184  # grey
MILLISECONDS = 700  # of a picture of the growing spots


@style.styled
def surface_map(surface: Surface, unit: str = "m", n: int = 401) -> Figure:
    """Draw the heights of a surface at n x n nodes, and the point of first touch; `unit` is that of length, or ""."""
    figure, (axis,) = style.figure(style.SINGLE + 0.6, 4.3, "")
    axis.grid(False)
    heights, side, touch = surface.grid(n), surface.L, surface.maximum()
    across, across_unit = prefix(side / 2, unit)
    up, up_unit = prefix(np.ptp(heights) or side, unit)
    extent = (0, side * across, 0, side * across)
    mean = heights.mean()
    look = {"origin": "lower", "cmap": "cividis", "interpolation": "bilinear"}
    image = axis.imshow((heights - mean) * up, extent=extent, **look)
    axis.plot(
        touch[0] * across, touch[1] * across, "o", mfc="none", mec=style.VERMILION, ms=9, mew=1.6,
        clip_on=False, zorder=5, label=f"first touch, {(touch[2] - mean) * up:.3g} {up_unit}",
    )  # fmt: skip
    axis.set(xlabel=style.label("$x$", across_unit), ylabel=style.label("$y$", across_unit))
    axis.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), borderaxespad=0.2, handlelength=1)
    rough = f"$S_q$ = {surface.statistics().Sq * up:.3g} {up_unit}".rstrip()
    axis.annotate(rough, (1.0, 1.0), (0, 5), xycoords="axes fraction", textcoords="offset points", ha="right")
    figure.colorbar(image, ax=axis, shrink=0.9).set_label(style.label("height above the mean plane", up_unit))
    return figure


@style.styled
def spectrum_figure(spectrum: Spectrum, unit: str = "", affine: SelfAffineFit | None = None) -> Figure:
    """Draw the power spectral density, over it that of the self-affine equivalent; `unit` is that of length."""
    figure, (axis,) = style.figure(style.SINGLE, 3.4, "power spectral density")
    there = spectrum.density > 0
    axis.loglog(spectrum.q[there], spectrum.density[there], color=style.BLUE)
    if affine is not None:
        wavelengths = [affine.lambda_long, affine.lambda_roll or affine.lambda_long, affine.lambda_short]
        q = 2 * np.pi / np.array(wavelengths)
        label = f"$H$ = {affine.H:.2f} ± {affine.error_H:.2f}"
        axis.loglog(q, affine.density(q), color=style.VERMILION, label=label)
        axis.set_ylim(bottom=affine.density(q).min() / 100)  # what lies below is rounding
        axis.legend(loc="lower left")
    per, fourth = (f"1/{unit}", f"{unit}$^4$") if unit else ("", "")
    axis.set(xlabel=style.label("wave number $q$", per), ylabel=style.label("density $C(q)$", fourth))
    return figure


@style.styled
def pressure_maps(results: Results, count: int = 4) -> Figure:
    """Contact pressure on the shaded surface at selected approaches, with force and number of spots. Last: the spot of
    the greatest pressure, the blue square, with the facets of the mesh.
    """
    top = results.top
    chosen = _levels(top, count - 1)
    last = max(chosen, key=lambda level: float(top["pressure"][level].max()))
    highest = float(top["pressure"][chosen].max())
    peak = quantity(highest, results.unit("stress"), 3) if highest > 0.0 else "no pressure"
    titles = [*(_title(results, level) for level in chosen), f"spot of the greatest\npressure, {peak}"]
    figure, axes = style.figure(1.1 + 2.5 * len(titles), 3.0, *titles)
    scale, unit = prefix(highest, results.unit("stress"))
    look = {"cmap": "inferno_r", "vmin": 0.0, "vmax": highest * scale or 1.0}
    on_patch = Raster(top)
    _relief(axes[:-1], results, on_patch)
    for axis, i in zip(axes, chosen, strict=False):
        image = _map(axis, results, on_patch, on_patch.pressure(i) * scale, **look)
        axis.label_outer()
    on_spot = Raster(top, _around_peak(results, last))
    _relief(axes[-1:], results, on_spot)
    _map(axes[-1], results, on_spot, on_spot.pressure(last) * scale, **look)
    # the facets there, and the box on the patch
    corners, across = facets(top)[0], _across(results)[0]
    at = top["points"][corners]  # (3, facets, 2)
    seen = ((at.max(axis=0) > on_spot.box[0]) & (at.min(axis=0) < on_spot.box[1])).all(axis=1)
    axes[-1].triplot(*(across * top["points"]).T, corners[:, seen].T, color=style.GREY, lw=0.4)
    low, high = across * on_spot.box
    axes[-1].set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), ylabel="")
    box = Rectangle(tuple(low), *(high - low), fill=False, ec=style.BLUE, lw=0.9)
    axes[chosen.index(last)].add_patch(box)
    figure.colorbar(image, ax=axes, shrink=0.8).set_label(style.label("contact pressure", unit))
    return figure


@style.styled
def flow_maps(results: Results, count: int = 3) -> Figure:
    """Flow of a film along x through the open gap at selected loads, over its mean. Pale: no flow."""
    periodic = results.case.get("block", {}).get("sides") == "periodic"
    on_patch, found = Raster(results.top, n=FLOW_PIXELS), []
    for i in np.flatnonzero(results.top["branch"] == "load"):
        size = np.linalg.norm(flow(on_patch.gap(i), periodic), axis=0)
        if size.any():
            found.append((i, size))
    chosen = [found[k] for k in sorted({int(k) for k in np.linspace(len(found) - 1, 0, count).round()})]
    figure, axes = style.figure(1.1 + 2.5 * len(chosen), 3.0, *(_title(results, i) for i, _ in chosen))
    for axis, (_, size) in zip(axes, chosen, strict=True):
        shown = np.ma.masked_equal(size / size.mean(), 0.0)
        image = _map(axis, results, on_patch, shown, cmap="viridis", norm=LogNorm(*FLOW_RANGE))
        axis.label_outer()
    figure.colorbar(image, ax=axes, shrink=0.8, extend="both").set_label("flow over its mean on the patch")
    return figure


@style.styled
def pressure_map(results: Results, on_patch: Raster, i: int, highest: float) -> Figure:
    """Draw the contact pressure of a snapshot; `highest` is that of the colour scale [force/length^2]."""
    figure, (axis,) = style.figure(style.SINGLE, 4.0, _title(results, i))
    scale, unit = prefix(highest, results.unit("stress"))
    look = {"cmap": "inferno_r", "vmin": 0.0, "vmax": highest * scale}
    image = _map(axis, results, on_patch, on_patch.pressure(i) * scale, **look)
    figure.colorbar(image, ax=axis, shrink=0.9).set_label(style.label("contact pressure", unit))
    return figure


def _around_peak(results: Results, i: int) -> Array:
    """Square around the greatest pressure of a snapshot, four radii of the largest spot wide (2, 2)."""
    top, points = results.top, results.top["points"]
    low, high = points.min(axis=0), points.max(axis=0)
    row = _row(results, i)
    spot = float(row.largest_spot[0]) if len(row) else np.nan
    half = min(2.0 * np.sqrt(spot / np.pi) if spot > 0.0 else np.inf, float((high - low).min()) / 4.0)
    middle = np.clip(points[top["pressure"][i].argmax()], low + half, high - half)
    return np.array([middle - half, middle + half])


def _title(results: Results, i: int) -> str:
    """Approach, force and number of contact spots of a snapshot."""
    name = str(results.top["branch"][i])
    text = f"{'' if name == 'load' else f'{name}ing, '}$\\delta/L$ = {_approach(results, i) / _side(results):.3g}"
    row = _row(results, i)
    if not len(row):
        return text
    spots = f", {row.spots[0]} spot{'s' if row.spots[0] > 1 else ''}" if row.spots[0] else ""
    return f"{text}\n{quantity(row.force[0], results.unit('force'), 3, bar=row.bar('P_star', 0))}{spots}"


def _across(results: Results) -> tuple[float, str]:
    """Factor and unit of lengths on the patch."""
    return prefix(float(results.top["points"].max()) / 2, results.unit("length"))


def _map(axis: Any, results: Results, on_grid: Raster, values: Array, **look: Any) -> Any:
    """Draw values on the squares of a `Raster`, unknown ones pale; return the image."""
    across, unit = _across(results)
    axis.grid(False)
    axis.set(facecolor=style.PALE, xlabel=style.label("$x$", unit), ylabel=style.label("$y$", unit))
    extent = tuple((on_grid.box * across).T.ravel())
    return axis.imshow(values, origin="lower", extent=extent, interpolation="nearest", **look)


def _relief(axes: Iterable[Any], results: Results, on_grid: Raster) -> None:
    """Shade the surface that is pressed, light from the upper left."""
    if results.surface is None:
        return
    x, y = np.meshgrid(*(np.linspace(low, high, PIXELS // 2) for low, high in on_grid.box.T))
    z = results.surface.height(x, y)
    light = LightSource().hillshade(z * RELIEF * len(z) / (float(np.ptp(z)) or 1.0))
    for axis in axes:
        _map(axis, results, on_grid, light, cmap="gray", vmin=-2.0, vmax=1.0)


def pressed_thirds(top: Any, i: int) -> tuple[Array, Array]:
    """Pressure and area (n,) of the touched thirds of facets in a snapshot, with the force and area of the curve.

    A pressure at nodes reaches beyond the contact by a facet: the force of each corner goes to the touched thirds
    around it.
    """
    corner, edge = facets(top)
    following, count = np.roll(corner, -1, axis=0), len(top["points"])
    x, y = np.moveaxis(top["points"][corner], 2, 0)
    third = np.abs((x[1] - x[0]) * (y[2] - y[0]) - (x[2] - x[0]) * (y[1] - y[0])) / 6.0
    hats = np.bincount(corner.ravel(), np.tile(third, 3), count)
    touched = top["touched"][i][edge].astype(bool)
    area = np.where(touched, third, 0.0)
    around = sum(np.bincount(ends.ravel(), area.ravel(), count) for ends in (corner, following))
    share = np.divide(top["pressure"][i] * hats, around, out=np.zeros(count), where=around > 0.0)
    return (share[corner] + share[following])[touched], area[touched]


@style.styled
def contact_area(results: Results) -> Figure:
    """(a) Contact area over load. (b) Distribution of the pressure over the nominal area at the greatest load."""
    figure, (area, pressure) = style.figure(style.DOUBLE, 3.6, "contact area", "pressure at the greatest load")
    draw_branches(area, results, "P_star", "area_fraction", names=("load",))
    area.set(xlabel=LOAD, ylabel="contact area over the nominal area")
    style.logarithmic(area)
    area.legend(loc="lower right")
    load_axis(area, results, "top")
    if results.snapshots:
        _distribution(pressure, results)
    else:
        pressure.set_axis_off()
    return figure


def _distribution(axis: Any, results: Results) -> None:
    """Draw the density of the pressures in the snapshot of the greatest load."""
    top = results.top
    i = int(np.argmax([p.mean() for p in top["pressure"]]))
    pressures, areas = pressed_thirds(top, i)
    if not (pressures > 0.0).any():
        axis.set_axis_off()
        return
    shares = areas / np.prod(np.ptp(top["points"], axis=0))
    highest = float(top["pressure"][i].max())  # as in the table; few thirds have more
    scale, unit = prefix(highest, results.unit("stress"))
    edges = np.linspace(0.0, highest * scale, BINS + 1)
    axis.hist(np.minimum(pressures, highest) * scale, edges, weights=shares / np.diff(edges)[0], color=style.SKY,
              label=f"{100 * shares.sum():.3g} % in contact")  # fmt: skip
    row = _row(results, i)
    mean = float(row.mean_pressure[0]) * scale if len(row) else math.nan  # force over area, as in the report
    if math.isfinite(mean):
        axis.axvline(mean, color=style.BLACK, lw=0.8, ls=":", label=f"force over area {mean:.3g} {unit}".rstrip())
    density = style.label("density on the nominal area", f"1/{unit}" if unit else "")
    axis.set(xlabel=style.label("contact pressure", unit), ylabel=density, xlim=(0.0, edges[-1]))
    axis.set_ylim(top=1.3 * axis.get_ylim()[1])
    axis.legend(loc="upper left")


def _levels(top: Any, count: int) -> list[int]:
    """At most `count` snapshots at equal steps, without those that have no load."""
    loaded = np.flatnonzero(top["pressure"].max(axis=1) > 0)
    if not len(loaded):
        loaded = np.arange(len(top["pressure"]))
    return sorted({int(loaded[i]) for i in np.linspace(len(loaded) - 1, 0, count).round().astype(int)})


def _row(results: Results, i: int) -> Curve:
    """Row of the curve in which a snapshot was made; none in a run without a curve."""
    return results.curve.where(results.curve.step == int(results.top["steps"][i]))


def _approach(results: Results, i: int) -> float:
    """Approach of a snapshot, that of the curve, which is corrected for the error of the mesh [length]."""
    row = _row(results, i)
    return float(row.delta[0] if len(row) else results.top["delta"][i])


def _side(results: Results) -> float:
    return float(results.case["surface"]["L"] if results.case else results.top["points"].max())


def turning_surface(results: Results, on_grid: Raster) -> dict[str, Any] | None:
    """Deformed surface at the greatest approach with the pressure on it.

    Args:
        results: of a run with snapshots
        on_grid: squares of its whole top

    Returns:
        None without pressure, else what the page shows: nodes of the shape along each side; heights, base64 of 16
        bits each from lowest to highest, rows in y; colours, base64 of a PNG file, the pressure over the patch, its
        first row at y = 0; relief, the range of the heights over the side as shown; scale, the colours of the legend;
        highest, the greatest pressure with its unit; side and range, of the patch and of the heights with their unit;
        caption
    """
    top = results.top
    if not np.any(top["pressure"] > 0.0):
        return None
    i = int(np.argmax(top["delta"]))
    below = top["gap"][i] + (0.0 if results.tool is None else results.tool.height(*top["points"].T))
    z = -on_grid(below)[:: PIXELS // (NODES - 1), :: PIXELS // (NODES - 1)]  # below the plane of the flat
    span = float(np.ptp(z)) or 1.0
    highest = float(top["pressure"][i].max()) or 1.0  # as in the table; between the pixels
    length, side = results.unit("length"), float(np.ptp(top["points"][:, 0]))
    approach = quantity(_approach(results, i), length, 3)
    row, load = _row(results, i), ""
    if len(row):
        load = f" under a load of {quantity(row.force[0], results.unit('force'), 3, bar=row.bar('P_star', 0))},"
    return {
        "nodes": len(z),
        "heights": base64.b64encode(np.round((z - z.min()) / span * 65535).astype("<u2").tobytes()).decode(),
        "colours": _png([_picture(on_grid.pressure(i), highest)]),
        "relief": RAISED,
        "scale": ", ".join(to_hex(colour) for colour in colormaps["inferno_r"](np.linspace(0.0, 1.0, 9))),
        "highest": quantity(highest, results.unit("stress"), 3),
        "side": quantity(side, length, 3),
        "range": quantity(span, length, 3),
        "caption": f"The surface at the greatest approach, {approach},{load} with the contact pressure; "
        f"heights {RAISED * side / span:.2g} times enlarged. Drag it, or use the arrow keys.",
    }


def growing_spots(results: Results, on_grid: Raster) -> str | None:
    """Pressure at the saved steps of the loading, one after the other: base64 of an animated PNG file.

    None with fewer than two steps under pressure.
    """
    top = on_grid.top
    levels = [i for i, name in enumerate(top["branch"]) if name == "load" and top["pressure"][i].max() > 0.0]
    if len(levels) < 2:
        return None
    highest = max(float(top["pressure"][i].max()) for i in levels)
    return _png([style.pixels(pressure_map(results, on_grid, i, highest)) for i in levels])


def _picture(pressure: Array, highest: float) -> Image.Image:
    """Colours of a pressure, grey out of contact, the first row at the top."""
    picture = colormaps["inferno_r"](np.nan_to_num(pressure) / highest, bytes=True)[..., :3]
    picture[~(pressure > 0.0)] = UNLOADED
    return Image.fromarray(picture)


def _png(frames: list[Image.Image]) -> str:
    file = io.BytesIO()
    frames[0].save(file, "PNG", save_all=len(frames) > 1, append_images=frames[1:], duration=MILLISECONDS, loop=0)
    return base64.b64encode(file.getvalue()).decode()
