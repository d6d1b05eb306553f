"""Figures of a measured patch."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from asperity.plot import style
from asperity.surface import Spectrum
from asperity.surface.self_affine_fit import SelfAffineFit


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
