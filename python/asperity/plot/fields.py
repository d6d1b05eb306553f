"""Figures of geometry: surface, its spectrum, and section of the mesh."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.collections import PolyCollection
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullLocator

from asperity.arrays import Array
from asperity.output.results import Results
from asperity.plot import style
from asperity.plot.section import cut
from asperity.surface import Spectrum
from asperity.surface.self_affine_fit import SelfAffineFit
from asperity.units import prefix


@style.styled
def surface_map(
    heights: Array, side: float, touch: tuple[float, float, float], unit: str = "m", *, ax: style.Place | None = None
) -> Figure:
    """Draw the heights of a surface and the point of first touch.

    Args:
        heights: at the nodes of a regular grid over the patch [length], shape (n, n), index [iy, ix]
        side: of the patch [length]
        touch: x, y, z of the highest point [length]
        unit: of length, "" if unknown
    """
    figure, (axis, *_) = style.figure(style.SINGLE + 0.6, 4.3, ax=ax)
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
    rough = f"$S_q$ = {heights.std() * up:.3g} {up_unit}".rstrip()
    axis.annotate(rough, (1.0, 1.0), (0, 5), xycoords="axes fraction", textcoords="offset points", ha="right")
    bar = figure.colorbar(image, ax=axis, shrink=0.9)
    bar.set_label(style.label("height above the mean plane", up_unit))
    return figure


@style.styled
def spectrum_figure(
    spectrum: Spectrum, unit: str = "", affine: SelfAffineFit | None = None, *, ax: style.Place | None = None
) -> Figure:  # fmt: skip
    """Draw the power spectral density.

    The self-affine equivalent is drawn over the spectrum; `unit` is that of length.
    """
    figure, (axis, *_) = style.figure(style.SINGLE, 3.4, ax=ax)
    style.titles([axis], ("power spectral density",))
    there = spectrum.density > 0
    axis.loglog(spectrum.q[there], spectrum.density[there], color=style.BLUE)
    if affine is not None:
        wavelengths = [affine.lambda_long, affine.lambda_roll or affine.lambda_long, affine.lambda_short]
        q = 2 * np.pi / np.array(wavelengths)
        label = f"$H$ = {affine.H:.2f} ± {affine.error_H:.2f}"
        axis.loglog(q, affine.density(q), color=style.VERMILION, label=label)
        axis.set_ylim(bottom=affine.density(q).min() / 100)  # what lies below is rounding
        axis.legend(loc="lower left")
    axis.set_xlabel(style.label("wave number $q$", f"1/{unit}" if unit else ""))
    axis.set_ylabel(style.label("density $C(q)$", f"{unit}$^4$" if unit else ""))
    style.grid(axis)
    return figure


@style.styled
def mesh_cut(results: Results, *, ax: style.Place | None = None) -> Figure:
    """Draw a vertical section of the mesh through the highest point, as a whole and at the contact."""
    mesh = results.mesh
    x0, y0, top = _summit(results)
    polygons, sizes = cut(mesh["points"], mesh["tets"], y0)
    unit = results.unit("length")
    across, across_unit = prefix(float(mesh["points"][:, 0].max()) / 2, unit)
    fine, fine_unit = prefix(float(np.min(sizes)) * 5, unit)
    figure, axes = style.figure(style.WIDE, 5.2, columns=2, ax=ax)
    style.titles(axes, ("section through the summit", "at the summit"))
    panels = ((across, across_unit, 0.3), (fine, fine_unit, 0.6))
    collection: Any = None
    for axis, (factor, name, width) in zip(axes, panels, strict=False):
        collection = PolyCollection(
            [polygon * factor for polygon in polygons], array=sizes * fine, cmap="cividis",
            norm=LogNorm(), edgecolors="black", linewidths=width, rasterized=True,
        )  # fmt: skip
        axis.add_collection(collection)
        axis.set_aspect("equal")
        axis.set_xlabel(style.label("$x$", name))
        axis.set_ylabel(style.label("$z$", name))
    axes[0].margins(0.02)
    axes[0].autoscale_view()
    if len(axes) > 1:
        half = _zoom_width(polygons, sizes, x0, top)
        middle = float(np.clip(x0, half, max(mesh["points"][:, 0].max() - half, half)))
        _flats(axes[1], results, (middle, half, top), fine)
    _size_bar(figure, axes, collection, fine_unit)
    return figure


def _flats(zoom: Any, results: Results, window: tuple[float, float, float], fine: float) -> None:
    """Show the window at the summit (middle, half width, highest point), and the flat at its ends."""
    middle, half, top = window
    zoom.set_xlim((middle - half) * fine, (middle + half) * fine)
    zoom.set_ylim((top - 1.7 * half) * fine, (top + 0.3 * half) * fine)
    delta = float(np.max(results.curve.delta, initial=0.0))
    zoom.axhline(top * fine, color=style.BLUE, label="flat at first touch")
    zoom.axhline((top - delta) * fine, color=style.VERMILION, ls="--", label="flat at its lowest")
    zoom.legend(loc="lower left", frameon=True, framealpha=0.9, edgecolor="none")


def _size_bar(figure: Any, axes: Any, collection: Any, unit: str) -> None:
    bar = figure.colorbar(collection, ax=axes, shrink=0.85)
    bar.set_label(style.label("element size", unit))
    bar.ax.yaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
    bar.ax.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    bar.ax.yaxis.set_minor_locator(NullLocator())


def _summit(results: Results) -> tuple[float, float, float]:
    """Highest point: x, y of the surface, z of the mesh, whose origin may differ."""
    x, y, z = results.mesh["points"][np.argmax(results.mesh["points"][:, 2])]
    if results.surface is not None:
        x, y, _ = results.surface.maximum()
    return float(x), float(y), float(z)


def _zoom_width(polygons: list[Array], sizes: Array, x0: float, top: float) -> float:
    """Half width of a window that shows about a dozen of the elements at the summit."""
    middles = np.array([polygon.mean(axis=0) for polygon in polygons])
    near = np.argsort(np.hypot(middles[:, 0] - x0, middles[:, 1] - top))[:20]
    return 6 * float(np.median(sizes[near]))
