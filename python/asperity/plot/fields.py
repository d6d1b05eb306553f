"""Figures of a surface and of its spectrum."""

from __future__ import annotations

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
