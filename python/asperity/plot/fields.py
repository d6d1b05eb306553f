"""Figures of a surface, of its Abbott curve and of its spectrum."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from matplotlib.figure import Figure

from asperity.arrays import Array
from asperity.plot import style
from asperity.surface import Spectrum
from asperity.surface.spectrum import SelfAffineFit
from asperity.units import prefix


@style.styled
def surface_map(heights: Array, side: float, touch: tuple[float, float, float], unit: str = "m") -> Figure:
    """Draw the heights of a surface and the point of first touch.

    Args:
        heights: at the nodes of a regular grid over the patch [length], shape (n, n), index [iy, ix]
        side: of the patch [length]
        touch: x, y, z of the highest point [length]
        unit: of length, "" if unknown
    """
    figure, (axis,) = style.figure(style.SINGLE + 0.6, 4.3, "")
    axis.grid(False)
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
    rough = f"$S_q$ = {heights.std() * up:.3g} {up_unit}".rstrip()
    axis.annotate(rough, (1.0, 1.0), (0, 5), xycoords="axes fraction", textcoords="offset points", ha="right")
    figure.colorbar(image, ax=axis, shrink=0.9).set_label(style.label("height above the mean plane", up_unit))
    return figure


@style.styled
def abbott_figure(heights: Array, found: Mapping[str, float | None], unit: str = "") -> Figure:
    """Draw heights over their material ratio, the line through the core, and Sk, Spk and Svk; `unit` of length.

    Args:
        heights: of any shape [length]
        found: parameters of ISO 25178, see `HeightField.iso25178`
    """
    figure, (axis,) = style.figure(style.SINGLE, 3.4, "Abbott curve")
    scale, name = prefix(np.ptp(heights) / 2.0, unit)
    ratio = np.linspace(0.0, 1.0, 1001)
    height = np.quantile(heights - heights.mean(), 1.0 - ratio)
    Sk, Spk, Svk, *ratios = (float(found[key] or 0.0) for key in ("Sk", "Spk", "Svk", "Smr1", "Smr2"))
    upper, lower = np.interp(ratios, ratio, height)  # the ends of the line
    axis.plot(100.0 * ratio, scale * height, color=style.BLUE)
    axis.plot([0.0, 100.0], [scale * upper, scale * lower], "--", color=style.VERMILION, lw=1.0)
    for end in (upper, lower):
        axis.axhline(scale * end, color=style.GREY, lw=0.6)
    # the peaks of the curve are at the left, its pits at the right
    for x, base, up, label in ((70.0, upper, Spk, "Spk"), (2.0, lower, Sk, "Sk"), (2.0, lower - Svk, Svk, "Svk")):
        axis.annotate(f"{label} = {scale * up:.3g} {name}".rstrip(), (x, scale * (base + up / 2.0)), va="center")
    names = "material ratio (%), Smr1 = {:.3g}, Smr2 = {:.3g}".format(*(100.0 * ratio for ratio in ratios))
    axis.set(xlabel=names, ylabel=style.label("height above the mean", name), xlim=(0.0, 100.0))
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
