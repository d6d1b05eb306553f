"""Figures of stiffness and mean gap over the load, and of the conductance over the pressure."""

from __future__ import annotations

import math

import numpy as np
from matplotlib.figure import Figure

from asperity.model.material import Material
from asperity.output.gap_conductance import gap_conductance, harmonic_mean
from asperity.output.results import Results
from asperity.plot import style
from asperity.plot.curves import LOAD, LOOKS, draw_branches, load_axis, value_of_one
from asperity.reference.conductance import TABOR, cooper_mikic_yovanovich, mikic_elastic
from asperity.units import prefix

STIFFNESSES = {
    "k_n": ("o-", style.BLUE, "slope of the curve, $k_n$"),
    "k_n_elastic": ("s--", style.VERMILION, "normal, elastic, $k_n^{el}$"),
    "k_t": ("^:", style.GREEN, "tangential, $k_t$"),
}


@style.styled
def stiffness(results: Results) -> Figure:
    """Draw the stiffnesses of the first loading over the load, and the mean gap of all branches."""
    figure, (left, right) = style.figure(style.DOUBLE, 3.5, "stiffness", "mean gap")
    curve, loading = results.curve, results.curve.loading()
    factor, unit = prefix(float(np.nanmax(curve.k_n_elastic)), results.unit("stiffness"))
    for name, (mark, colour, text) in STIFFNESSES.items():
        left.plot(loading.P_star, factor * getattr(loading, name), mark, color=colour, mfc="white", label=text)
    left.set(ylabel=style.label("stiffness", unit), ylim=(0, None))
    scale, side = value_of_one(loading.force, loading.P_star), value_of_one(loading.delta, loading.delta_star)
    if np.isfinite(scale * side):
        style.second_axis(left, "right", side / (factor * scale), "$k^{*}{=}\\,k/(LE')$")
    factor, unit = prefix(float(np.nanmax(curve.mean_gap)), results.unit("length"))
    draw_branches(right, results, "P_star", "mean_gap", factor)
    right.set_ylabel(style.label("mean gap", unit))
    for axis in (left, right):
        axis.set(xlabel=LOAD, xlim=(0, None))
        axis.legend(loc="best")
        load_axis(axis, results, "top")
    return figure


@style.styled
def conductance(results: Results) -> Figure:
    """Draw the conductance over the pressure with the law of the literature for Gaussian summits of the kind."""
    figure, (axis,) = style.figure(style.SINGLE, 3.4, "")
    p, h, error = gap_conductance(results.case, results.curve)
    of_p, unit_p = prefix(float(np.nanmax(p)), results.unit("stress"))
    of_h, unit_h = prefix(float(np.nanmax(h)), results.unit("conductance"))
    for branch, (mark, colour, text) in LOOKS.items():
        rows = (results.curve.branch == branch) & (h > 0)
        if rows.any():
            bar = of_h * error[rows] if np.isfinite(error[rows]).any() else None
            axis.errorbar(of_p * p[rows], of_h * h[rows], yerr=bar, fmt=mark, color=colour, mfc="white", label=text)
    if results.surface is not None and results.surface.rough:
        # sigma/m of a face on its mirror is that of the face
        height, material = results.surface.statistics(513), results.case["material"]
        m = height.rms_slope / math.sqrt(math.pi)  # mean absolute slope of a profile, isotropic and Gaussian
        known = p[(p > 0) & (h > 0)]
        at = np.geomspace(known.min(), known.max(), 50)
        if material.get("yield_strength"):
            name = "Cooper-Mikic-Yovanovich, $H=2.8Y$"
            law = cooper_mikic_yovanovich(at, TABOR * material["yield_strength"])
        else:
            name = "Mikic, elastic"
            law = mikic_elastic(at, Material(material["E"], material["nu"]).reduced_modulus, m)
        expected = harmonic_mean(material) * m / height.Sq * law
        axis.plot(of_p * at, of_h * expected, "-", color=style.GREY, label=name)
    style.logarithmic(axis)
    axis.set(xlabel=style.label("nominal pressure", unit_p), ylabel=style.label("conductance $h$", unit_h))
    axis.legend(loc="best")
    return figure
