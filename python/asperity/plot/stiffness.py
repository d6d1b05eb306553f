"""Figures of stiffness and mean gap over the load, and of the conductance over the pressure."""

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
    figure, axes = style.figure(style.DOUBLE, 3.5, columns=2)
    style.titles(axes, ("stiffness", "mean gap"))
    for draw, axis in zip((_stiffness, _gap), axes, strict=True):
        draw(axis, results)
        axis.set_xlabel(LOAD)
        axis.set_xlim(left=0)
        axis.legend(loc="best")
        style.grid(axis)
        load_axis(axis, results, "top")
    return figure


def _stiffness(axis: Any, results: Results) -> None:
    loading = results.curve.loading()
    factor, unit = prefix(float(np.nanmax(results.curve.k_n_elastic)), results.unit("stiffness"))
    for name, (mark, colour, text) in STIFFNESSES.items():
        axis.plot(loading.P_star, factor * getattr(loading, name), mark, color=colour, mfc="white", label=text)
    axis.set_ylabel(style.label("stiffness", unit))
    axis.set_ylim(bottom=0)
    scale, side = value_of_one(loading.force, loading.P_star), value_of_one(loading.delta, loading.delta_star)
    if np.isfinite(scale * side):
        style.second_axis(axis, "right", side / (factor * scale), "$k^{*}{=}\\,k/(LE')$")


def _gap(axis: Any, results: Results) -> None:
    factor, unit = prefix(float(np.nanmax(results.curve.mean_gap)), results.unit("length"))
    draw_branches(axis, results, "P_star", "mean_gap", factor)
    axis.set_ylabel(style.label("mean gap", unit))


@style.styled
def conductance(results: Results) -> Figure:
    """Draw the conductance over the pressure with the law of the literature for summits of the kind."""
    figure, axes = style.figure(style.SINGLE, 3.4)
    axis = axes[0]
    p, h, error = gap_conductance(results.case, results.curve)
    of_p, unit_p = prefix(float(np.nanmax(p)), results.unit("stress"))
    of_h, unit_h = prefix(float(np.nanmax(h)), results.unit("conductance"))
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
