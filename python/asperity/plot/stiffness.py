"""Figure of the stiffness and the mean gap over the load."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.figure import Figure

from asperity.output.results import Results
from asperity.plot import style
from asperity.plot.curves import LOAD, draw_branches, load_axis, value_of_one
from asperity.units import prefix

LOOKS = {
    "k_n": ("o-", style.BLUE, "slope of the curve, $k_n$"),
    "k_n_elastic": ("s--", style.VERMILION, "normal, elastic, $k_n^{el}$"),
    "k_t": ("^:", style.GREEN, "tangential, $k_t$"),
}


@style.styled
def stiffness(results: Results, *, ax: style.Place | None = None) -> Figure:
    """Draw the stiffnesses of the first loading over the load, and the mean gap of all branches."""
    figure, axes = style.figure(style.DOUBLE, 3.5, columns=2, ax=ax)
    style.titles(axes, ("stiffness", "mean gap"))
    for draw, axis in zip((_stiffness, _gap), axes, strict=False):
        draw(axis, results)
        axis.set_xlabel(LOAD)
        axis.set_xlim(left=0)
        axis.legend(loc="best")
        style.grid(axis)
        load_axis(axis, results, "top")
    return figure


def _stiffness(axis: Any, results: Results) -> None:
    loading = results.curve.loading()
    factor, unit = prefix(float(np.nanmax(results.curve.k_n_elastic)), results.unit("force") and "N/m")
    for name, (mark, colour, text) in LOOKS.items():
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
