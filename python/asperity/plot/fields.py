# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

"""Figures of geometry and contact: surface, section of the mesh, pressure, contact area."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib import colormaps
from matplotlib.collections import PolyCollection
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from matplotlib.ticker import FuncFormatter, LogLocator, NullLocator
from matplotlib.tri import Triangulation

from asperity.arrays import Array
from asperity.output.results import Results
from asperity.plot import style
from asperity.plot.curves import LOAD
from asperity.plot.section import cut
from asperity.units import prefix


@style.styled
def surface_map(heights: Array, side: float, touch: tuple[float, float, float], unit: str = "m") -> Figure:
    """Draw the heights of a surface and the point of first touch.

    Args:
        heights: heights at the nodes of a regular grid over the patch (length), shape (n, n), index [iy, ix].
        side: side of the patch (length).
        touch: x, y, z of the highest point (length).
        unit: unit of length, "" if unknown.
    """
    figure, axis = style.figure(style.SINGLE, 3.5)
    across, across_unit = prefix(side / 2, unit)
    up, up_unit = prefix(np.ptp(heights) or side, unit)
    extent = (0, side * across, 0, side * across)
    mean = heights.mean()
    image = axis.imshow(
        (heights - mean) * up, origin="lower", extent=extent, cmap="cividis",
        interpolation="bilinear",
    )  # fmt: skip
    axis.plot(
        touch[0] * across, touch[1] * across, "o", mfc="none", mec=style.VERMILION, ms=9, mew=1.6,
        clip_on=False, zorder=5, label=f"first touch, {(touch[2] - mean) * up:.3g} {up_unit}",
    )  # fmt: skip
    axis.set_xlabel(style.label("$x$", across_unit))
    axis.set_ylabel(style.label("$y$", across_unit))
    axis.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), borderaxespad=0.2, handlelength=1)
    bar = figure.colorbar(image, ax=axis, shrink=0.9)
    bar.set_label(style.label("height above the mean plane", up_unit))
    return figure


@style.styled
def mesh_cut(results: Results) -> Figure:
    """Draw a vertical section of the mesh through the highest point, as a whole and at the contact."""
    mesh = results.mesh
    x0, y0, top = _summit(results)
    polygons, sizes = cut(mesh["points"], mesh["tets"], y0)
    unit = results.unit("length")
    across, across_unit = prefix(float(mesh["points"][:, 0].max()) / 2, unit)
    fine, fine_unit = prefix(float(np.min(sizes)) * 5, unit)
    figure, (whole, zoom) = style.figure(style.DOUBLE, 3.6, columns=2)
    collection: Any = None
    for axis, factor, width in ((whole, across, 0.3), (zoom, fine, 0.6)):
        collection = PolyCollection(
            [polygon * factor for polygon in polygons], array=sizes * fine, cmap="cividis",
            norm=LogNorm(), edgecolors="black", linewidths=width,
        )  # fmt: skip
        axis.add_collection(collection)
        axis.set_aspect("equal")
    whole.margins(0.02)
    whole.autoscale_view()
    half = _zoom_width(polygons, sizes, x0, top)
    middle = float(np.clip(x0, half, max(mesh["points"][:, 0].max() - half, half)))
    zoom.set_xlim((middle - half) * fine, (middle + half) * fine)
    zoom.set_ylim((top - 1.7 * half) * fine, (top + 0.3 * half) * fine)
    delta = float(np.max(results.curve.delta, initial=0.0))
    zoom.axhline(top * fine, color=style.BLUE, label="flat at first touch")
    zoom.axhline((top - delta) * fine, color=style.VERMILION, ls="--", label="flat at its lowest")
    figure.legend(loc="outside upper center", ncols=2)
    for axis, name in ((whole, across_unit), (zoom, fine_unit)):
        axis.set_xlabel(style.label("$x$", name))
        axis.set_ylabel(style.label("$z$", name))
    bar = figure.colorbar(collection, ax=[whole, zoom], shrink=0.85)
    bar.set_label(style.label("element size", fine_unit))
    bar.ax.yaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
    bar.ax.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    bar.ax.yaxis.set_minor_locator(NullLocator())
    return figure


def _summit(results: Results) -> tuple[float, float, float]:
    """Return the highest point: x, y of the surface, z of the mesh, whose origin may differ."""
    x, y, z = results.mesh["points"][np.argmax(results.mesh["points"][:, 2])]
    if results.surface is not None:
        x, y, _ = results.surface.maximum()
    return float(x), float(y), float(z)


def _zoom_width(polygons: list[Array], sizes: Array, x0: float, top: float) -> float:
    """Return the half width of a window that shows about a dozen of the elements at the summit."""
    middles = np.array([polygon.mean(axis=0) for polygon in polygons])
    near = np.argsort(np.hypot(middles[:, 0] - x0, middles[:, 1] - top))[:20]
    return 6 * float(np.median(sizes[near]))


@style.styled
def pressure_maps(results: Results, count: int = 4) -> Figure:
    """Draw the contact pressure at up to `count` load levels, with one colour scale."""
    top = results.top
    chosen = _levels(top, count)
    unit = results.unit("stress")
    scale, name = prefix(float(top["pressure"][chosen].max()), unit)
    across, across_unit = prefix(float(top["points"].max()) / 2, results.unit("length"))
    x, y = top["points"].T * across
    mesh = Triangulation(x, y, top["triangles"])
    highest = float(top["pressure"][chosen].max()) * scale or 1.0
    levels = np.linspace(0, highest, 65)
    levels[0] = highest * 1e-3  # smaller pressures are negligible and stay blank
    columns = min(len(chosen), 4)
    figure, axes = style.figure(0.6 + 1.9 * columns, 2.5, columns=columns)
    image: Any = None
    for axis, i in zip(np.atleast_1d(axes), chosen, strict=True):
        axis.set_facecolor(style.PALE)
        image = axis.tricontourf(mesh, top["pressure"][i] * scale, levels, cmap="inferno_r")
        axis.set_aspect("equal")
        axis.set_xlabel(style.label("$x$", across_unit))
        axis.set_title(f"{_branch(top, i)}$\\delta/L$ = {_strain(results, i):.3g}")
        if axis.get_subplotspec().is_first_col():
            axis.set_ylabel(style.label("$y$", across_unit))
        else:
            axis.tick_params(labelleft=False)
    bar = figure.colorbar(image, ax=axes, shrink=0.8, ticks=_round_ticks(highest))
    bar.set_label(style.label("contact pressure", name))
    return figure


@style.styled
def contact_area(results: Results, count: int = 6) -> Figure:
    """Draw the regions in contact at selected load levels, and the contact area over the load."""
    figure, (plan, share) = style.figure(style.DOUBLE, 3.3, columns=2)
    if results.snapshots:
        _patches(plan, results, count)
    else:
        plan.set_axis_off()
    _area_curve(share, results)
    style.letters(plan, share)
    return figure


def _patches(axis: Any, results: Results, count: int) -> None:
    """Draw the contact patches of the loading, the earliest on top and darkest."""
    top = results.top
    loads = [i for i in _levels(top, count) if str(top["branch"][i]) == "load"]
    across, across_unit = prefix(float(top["points"].max()) / 2, results.unit("length"))
    x, y = top["points"].T * across
    mesh = Triangulation(x, y, top["triangles"])
    shades = colormaps["YlGnBu"](np.linspace(0.35, 1.0, len(loads)))
    keys = []
    for i, shade in zip(reversed(loads), shades, strict=True):
        pressure, gap = top["pressure"][i], top["gap"][i]
        if pressure.max() > 0:
            # positive in contact, negative outside: its zero line runs between the nodes
            state = pressure / pressure.max() - gap / (gap.max() or 1.0)
            axis.tricontourf(mesh, state, [0.0, np.inf], colors=[shade])
        keys.append(Patch(color=shade, label=f"{_strain(results, i):.3g}"))
    axis.set_facecolor(style.PALE)
    axis.set_aspect("equal")
    axis.set_xlabel(style.label("$x$", across_unit))
    axis.set_ylabel(style.label("$y$", across_unit))
    axis.legend(
        handles=keys[::-1], title="in contact at $\\delta/L$", loc="upper left",
        bbox_to_anchor=(1.0, 1.0), handlelength=1,
    )  # fmt: skip


def _area_curve(axis: Any, results: Results) -> None:
    for name, mark, text in (("load", "o-", "loading"), ("unload", "s--", "unloading")):
        for n, piece in enumerate(results.branches(name)):
            axis.plot(
                piece.P_star, 100 * piece.area_fraction, mark, mfc="white",
                color=style.BLUE if name == "load" else style.VERMILION,
                label=text if n == 0 else None,
            )  # fmt: skip
    axis.set_xlabel(LOAD)
    axis.set_ylabel("contact area, share of $A_0$ (%)")
    axis.set_xlim(left=0)
    axis.set_ylim(bottom=0)
    axis.legend(loc="best")
    style.grid(axis)


def _levels(top: Any, count: int) -> list[int]:
    """Return at most `count` snapshots at equal steps, without those that have no load."""
    loaded = np.flatnonzero(top["pressure"].max(axis=1) > 0)
    if not len(loaded):
        loaded = np.arange(len(top["pressure"]))
    return sorted({int(loaded[i]) for i in np.linspace(len(loaded) - 1, 0, count).round().astype(int)})


def _branch(top: Any, i: int) -> str:
    name = str(top["branch"][i])
    return "" if name == "load" else f"{name}ing, "


def _strain(results: Results, i: int) -> float:
    side = results.case["surface"]["L"] if results.case else float(results.top["points"].max())
    return float(results.top["delta"][i]) / side


def _round_ticks(highest: float) -> Array:
    from matplotlib.ticker import MaxNLocator

    return np.array([t for t in MaxNLocator(5).tick_values(0, highest) if 0 <= t <= highest])
