"""Figures of the contact: pressure, regions in contact, area and spots over the load."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib import colormaps
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from matplotlib.ticker import MaxNLocator
from matplotlib.tri import Triangulation
from numpy.typing import NDArray

from asperity.arrays import Array
from asperity.mesh.element import shares
from asperity.output.results import Results
from asperity.plot import style
from asperity.plot.curves import LOAD, draw_branches, load_axis
from asperity.units import prefix, quantity

PIXELS = 400  # of a map, along each side


@style.styled
def pressure_maps(results: Results, count: int = 4) -> Figure:
    """Draw the contact pressure at up to `count` load levels, with one colour scale."""
    chosen = _levels(results.top, count)
    figure, axes = style.figure(1.1 + 2.5 * len(chosen), 3.0, columns=len(chosen))
    style.titles(axes, [_title(results, i) for i in chosen])
    image, unit = _maps(axes, results, chosen)
    figure.colorbar(image, ax=axes, shrink=0.8).set_label(style.label("contact pressure", unit))
    return figure


def _title(results: Results, i: int) -> str:
    """Approach, force and number of contact spots of a snapshot."""
    top = results.top
    name = str(top["branch"][i])
    text = f"{'' if name == 'load' else f'{name}ing, '}$\\delta/L$ = {_strain(results, i):.3g}"
    row = results.curve.where(results.curve.step == int(top["steps"][i]))
    if not len(row):
        return text
    spots = f", {row.spots[0]} spot{'s' if row.spots[0] > 1 else ''}" if row.spots[0] else ""
    return f"{text}\n{quantity(row.force[0], results.unit('force'), 3, bar=row.bar('P_star', 0))}{spots}"


def _maps(axes: Sequence[Any], results: Results, chosen: Sequence[int]) -> tuple[Any, str]:
    """Draw a map of each level; return an image for the colour bar, and the unit of pressure."""
    top = results.top
    highest = float(top["pressure"][list(chosen)].max())
    scale, unit = prefix(highest, results.unit("stress"))
    on_grid = Raster(top)
    image: Any = None
    for axis, i in zip(axes, chosen, strict=True):
        shown = np.where(touching(on_grid, top, i), on_grid(top["pressure"][i]) * scale, np.nan)
        image = _map(axis, results, shown, cmap="inferno_r", vmin=0.0, vmax=highest * scale or 1.0)
        axis.label_outer()
    return image, unit


def _map(axis: Any, results: Results, values: Array, **look: Any) -> Any:
    """Draw values on the squares of a `Raster` over the patch, unknown ones pale; return the image."""
    points = results.top["points"]
    across, unit = prefix(float(points.max()) / 2, results.unit("length"))
    extent = (0, float(points[:, 0].max()) * across, 0, float(points[:, 1].max()) * across)
    axis.set_facecolor(style.PALE)
    axis.set_xlabel(style.label("$x$", unit))
    axis.set_ylabel(style.label("$y$", unit))
    return axis.imshow(values, origin="lower", extent=extent, interpolation="nearest", **look)


class Raster:
    """Values at the nodes of the top, linear in its triangles, at the middles of PIXELS x PIXELS equal squares.

    Attributes:
        edge_nodes: node on the edge of a facet whose third each square lies in (PIXELS, PIXELS)
    """

    def __init__(self, top: Any) -> None:
        x, y = top["points"].T
        mesh = Triangulation(x, y, top["triangles"])
        middles = (np.arange(PIXELS) + 0.5) / PIXELS
        at = np.meshgrid(x.min() + middles * np.ptp(x), y.min() + middles * np.ptp(y))
        found: Any = mesh.get_trifinder()(*at)
        self._nodes = top["triangles"][found]
        self._shares = shares(np.stack(at, axis=-1), *np.moveaxis(top["points"][self._nodes], 2, 0))
        # of four triangles of a facet three begin at a corner, see `element.FACE_TRIANGLES`
        at_corner = (np.arange(3) == 0) & (found < 3 * len(top["triangles"]) // 4)[..., None]
        nearest = np.where(at_corner, -np.inf, self._shares).argmax(axis=-1)[..., None]
        self.edge_nodes = np.take_along_axis(self._nodes, nearest, axis=-1)[..., 0]

    def __call__(self, values: Array) -> Array:
        return np.asarray((values[self._nodes] * self._shares).sum(axis=-1))


def touching(on_grid: Raster, top: Any, i: int) -> NDArray[np.bool_]:
    """Where a snapshot is in contact: the touched thirds of facets, whose patches are the spots that count."""
    return np.asarray(top["touched"][i][on_grid.edge_nodes], dtype=bool)


@style.styled
def contact_area(results: Results, count: int = 6) -> Figure:
    """Draw the regions in contact at up to `count` load levels, and contact area and number of spots over the load."""
    figure, axes = style.figure(style.WIDE, 3.9, columns=3, width_ratios=(1.25, 1, 1))
    style.titles(axes, ("regions in contact", "contact area", "contact spots"))
    if results.snapshots:
        _patches(axes[0], results, count)
    else:
        axes[0].set_axis_off()
    for draw, axis in zip((_area_curve, _spots), axes[1:], strict=True):
        axis.set_xlabel(LOAD)
        draw(axis, results)
    return figure


def _patches(axis: Any, results: Results, count: int) -> None:
    """Draw the contact patches of the loading, the earliest darkest."""
    top = results.top
    loads = [i for i in _levels(top, count) if str(top["branch"][i]) == "load"]
    shades = colormaps["YlGnBu"](np.linspace(1.0, 0.35, len(loads)))
    on_grid = Raster(top)
    first = np.full((PIXELS, PIXELS), np.nan)  # the level at which a point comes into contact
    for n, i in reversed(list(enumerate(loads))):
        first[touching(on_grid, top, i)] = n
    _map(axis, results, first, cmap=ListedColormap(shades), vmin=-0.5, vmax=len(loads) - 0.5)
    keys = [Patch(color=shade, label=f"{_strain(results, i):.3g}") for i, shade in zip(loads, shades, strict=True)]
    axis.legend(handles=keys, title="at $\\delta/L$", loc="upper left", bbox_to_anchor=(1.0, 1.0), handlelength=1)


def _area_curve(axis: Any, results: Results) -> None:
    draw_branches(axis, results, "P_star", "area_fraction", 100.0)
    for piece in results.branches("load"):
        area, bar = piece.area_fraction, np.nan_to_num(piece.error_area_fraction)
        if np.any(bar > 0):
            low, high = 100.0 * np.maximum(area - bar, 0.0), 100.0 * (area + bar)
            axis.fill_between(piece.P_star, low, high, color=style.BLUE, alpha=0.2, lw=0, label="error bar")
    axis.set_ylabel("share of $A_0$ (%)")
    axis.set_ylim(bottom=0)
    axis.legend(loc="best")
    load_axis(axis, results, "top")


def _spots(axis: Any, results: Results) -> None:
    if not np.any(results.curve.spots > 0):
        axis.annotate("not counted", (0.5, 0.5), xycoords="axes fraction", ha="center", color=style.GREY)
        return
    draw_branches(axis, results, "P_star", "spots")
    axis.set_ylabel("number of spots")
    axis.yaxis.set_major_locator(MaxNLocator(integer=True))
    axis.set_ylim(bottom=0)
    load_axis(axis, results, "top")


def _levels(top: Any, count: int) -> list[int]:
    """At most `count` snapshots at equal steps, without those that have no load."""
    loaded = np.flatnonzero(top["pressure"].max(axis=1) > 0)
    if not len(loaded):
        loaded = np.arange(len(top["pressure"]))
    return sorted({int(loaded[i]) for i in np.linspace(len(loaded) - 1, 0, count).round().astype(int)})


def _strain(results: Results, i: int) -> float:
    side = results.case["surface"]["L"] if results.case else float(results.top["points"].max())
    return float(results.top["delta"][i]) / side
