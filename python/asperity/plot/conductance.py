"""Figure of the conductance of the joint per area over the pressure."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from asperity.arrays import Array
from asperity.model.material import Material
from asperity.output.gap_conductance import gap_conductance, harmonic_mean
from asperity.output.results import Results
from asperity.plot import style
from asperity.plot.curves import LOOKS
from asperity.reference.conductance import TABOR, cooper_mikic_yovanovich, mikic_elastic
from asperity.units import prefix


@style.styled
def conductance(results: Results, *, ax: style.Place | None = None) -> Figure:
    """Draw the conductance over the pressure with the law of the literature for summits of the kind."""
    figure, axes = style.figure(style.SINGLE, 3.4, ax=ax)
    axis = axes[0]
    p, h, error = gap_conductance(results.case, results.curve)
    of_p, unit_p = prefix(float(np.nanmax(p)), results.unit("stress"))
    of_h, unit_h = prefix(float(np.nanmax(h)), results.unit("length") and "W/(m²K)")
    for branch, (mark, colour, text) in LOOKS.items():
        rows = (results.curve.branch == branch) & (h > 0)
        if rows.any():
            bar = of_h * error[rows] if np.isfinite(error[rows]).any() else None
            axis.errorbar(of_p * p[rows], of_h * h[rows], yerr=bar, fmt=mark, color=colour, mfc="white", label=text)
    _law(axis, results, p[(p > 0) & (h > 0)], of_p, of_h)
    style.logarithmic(axis)
    axis.set_xlabel(style.label("nominal pressure", unit_p))
    axis.set_ylabel(style.label("conductance $h$", unit_h))
    axis.legend(loc="best")
    style.grid(axis)
    return figure


def _law(axis: Any, results: Results, pressures: Array, of_p: float, of_h: float) -> None:
    """Draw the law of Gaussian summits; sigma/m of a face on its mirror is that of the face."""
    if results.surface is None or not results.surface.rough:
        return
    height, material = results.surface.statistics(513), results.case["material"]
    m = height.rms_slope / math.sqrt(math.pi)  # mean absolute slope of a profile, isotropic and Gaussian
    p = np.geomspace(pressures.min(), pressures.max(), 50)
    if material.get("yield_strength"):
        law, name = cooper_mikic_yovanovich(p, TABOR * material["yield_strength"]), "Cooper-Mikic-Yovanovich, $H=2.8Y$"
    else:
        law, name = mikic_elastic(p, Material(material["E"], material["nu"]).reduced_modulus, m), "Mikic, elastic"
    h = harmonic_mean(material) * m / height.Sq * law
    axis.plot(of_p * p, of_h * h, "-", color=style.GREY, label=name)
