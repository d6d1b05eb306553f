# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

"""Figure of the stiffness and the mean gap over the load."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from asperity.output.results import Results
from asperity.plot import style
from asperity.plot.curves import LOAD
from asperity.units import prefix

LOOKS = {
    "k_n": ("o-", style.BLUE, "normal, $k_n$"),
    "k_n_elastic": ("s--", style.VERMILION, "normal, elastic, $k_n^{el}$"),
    "k_t": ("^:", style.GREEN, "tangential, $k_t$"),
}


@style.styled
def stiffness(results: Results) -> Figure:
    """Draw the stiffnesses of the first loading over the load, and the mean gap of all branches."""
    figure, (left, right) = style.figure(style.DOUBLE, 3.3, columns=2)
    loading = results.curve.loading()
    factor, unit = prefix(float(np.nanmax(results.curve.k_n)), results.unit("force") and "N/m")
    for name, (mark, colour, text) in LOOKS.items():
        left.plot(loading.P_star, factor * getattr(loading, name), mark, color=colour, mfc="white", label=text)
    left.set_ylabel(style.label("stiffness", unit))
    left.legend(loc="best")
    factor, unit = prefix(float(np.nanmax(results.curve.mean_gap)), results.unit("length"))
    for branch, mark, colour in (("load", "o-", style.BLUE), ("unload", "s--", style.VERMILION)):
        for n, piece in enumerate(results.branches(branch)):
            label = None if n else f"{branch}ing"
            right.plot(piece.P_star, factor * piece.mean_gap, mark, color=colour, mfc="white", label=label)
    right.set_ylabel(style.label("mean gap", unit))
    right.legend(loc="best")
    for axis in (left, right):
        axis.set_xlabel(LOAD)
        axis.set_xlim(left=0)
        style.grid(axis)
    left.set_ylim(bottom=0)
    style.letters(left, right)
    return figure
