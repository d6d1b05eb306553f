# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

"""Figures of a measured patch."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from asperity.plot import style
from asperity.surface import Spectrum
from asperity.surface.fractal_fit import FractalFit
from asperity.surface.self_affine_fit import SelfAffineFit


@style.styled
def spectrum_figure(
    spectrum: Spectrum, fit: FractalFit | None = None, unit: str = "", affine: SelfAffineFit | None = None, *,
    ax: style.Place | None = None,
) -> Figure:  # fmt: skip
    """Draw the power spectral density, and the band variances with those of the Weierstrass-Mandelbrot equivalent.

    Args:
        spectrum: radial spectrum of the patch
        fit: its Weierstrass-Mandelbrot equivalent
        unit: unit of length
        affine: the self-affine equivalent, drawn over the spectrum
        ax: axes to draw on, one for each panel; they are returned
    """
    columns = 1 if fit is None else 2
    figure, axes = style.figure(style.SINGLE if fit is None else style.DOUBLE, 3.4, columns=columns, ax=ax)
    style.titles(axes, ("power spectral density", "Weierstrass-Mandelbrot equivalent"))
    left = axes[0]
    there = spectrum.density > 0
    left.loglog(spectrum.q[there], spectrum.density[there], color=style.BLUE)
    if affine is not None:
        wavelengths = [affine.lambda_long, affine.lambda_roll or affine.lambda_long, affine.lambda_short]
        q = 2 * np.pi / np.array(wavelengths)
        label = f"$H$ = {affine.H:.2f} ± {affine.error_H:.2f}"
        left.loglog(q, affine.density(q), color=style.VERMILION, label=label)
        left.set_ylim(bottom=affine.density(q).min() / 100)  # what lies below is rounding
        left.legend(loc="lower left")
    left.set_xlabel(style.label("wave number $q$", f"1/{unit}" if unit else ""))
    left.set_ylabel(style.label("density $C(q)$", f"{unit}$^4$" if unit else ""))
    style.grid(left)
    if fit is not None and len(axes) > 1:
        right = axes[1]
        right.loglog(fit.wavelength, fit.variance, "o", color=style.BLUE, mfc="white", label="patch")
        text = f"$D$ = {fit.D:.3f} ({fit.ci_D[0]:.3f} to {fit.ci_D[1]:.3f})\n$G$ = {fit.G:.3g} {unit}".rstrip()
        right.loglog(fit.wavelength, fit.model, "-", color=style.VERMILION, label=text)
        right.set_xlabel(style.label("wavelength", unit))
        right.set_ylabel(style.label("variance in the band", f"{unit}$^2$" if unit else ""))
        right.legend(loc="upper left")
        style.grid(right)
    return figure
