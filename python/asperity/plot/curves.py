# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

"""Figures of load over approach with its power law, and of plasticity."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.figure import Figure

from asperity.output.results import Results
from asperity.plot import style

DELTA, LOAD = "approach $\\delta^{*}{=}\\,\\delta/L$", "load $P^{*}{=}\\,P/(A_0E')$"


@style.styled
def force_curve(results: Results) -> Figure:
    """Draw P* over delta* with the fit over its range, on linear and on logarithmic axes.

    The band is the error bar of each step, if the run computed one.
    """
    figure, (linear, logarithmic) = style.figure(style.DOUBLE, 3.3, columns=2)
    for axis in (linear, logarithmic):
        _branch(axis, results, "load", "o", "-", style.BLUE, "loading")
        _fit(axis, results)
        axis.set_xlabel(DELTA)
        axis.set_ylabel(LOAD)
        style.grid(axis)
    _branch(linear, results, "unload", "s", "--", style.VERMILION, "unloading")
    _branch(linear, results, "reload", "^", ":", style.GREEN, "reloading")
    linear.set_xlim(left=0)
    linear.set_ylim(bottom=0)
    style.logarithmic(logarithmic)
    linear.legend(loc="upper left")
    style.letters(linear, logarithmic)
    return figure


def _branch(axis: Any, results: Results, name: str, mark: str, line: str, colour: str, text: str) -> None:
    for n, piece in enumerate(results.branches(name)):
        x, y = piece.delta_star, piece.P_star
        first = n == 0
        axis.plot(
            x, y, line, marker=mark, mfc="white", color=colour, label=text if first else None,
            zorder=3,
        )  # fmt: skip
        band = np.nan_to_num(piece.error_P_star)
        if np.any(band > 0):
            # a logarithmic axis cannot show a band down to zero
            axis.fill_between(
                x, np.maximum(y - band, 1e-3 * y), y + band, color=colour, alpha=0.2, lw=0,
                label="error bar" if first and name == "load" else None,
            )  # fmt: skip


def _fit(axis: Any, results: Results) -> None:
    fit = results.summary.get("fit") or {}
    loads = results.branches("load")
    if not {"k", "n"} <= set(fit) or not loads:
        return
    low, high = fit.get("range") or (0.0, float(np.max(loads[0].delta_star)))
    low = low or min((float(x) for x in loads[0].delta_star if x > 0), default=1e-6)
    x = np.geomspace(low, high, 200)
    text = f"$P^{{*}}{{=}}\\,{tex(fit['k'])}\\,(\\delta^{{*}})^{{{fit['n']:.3f}}}$, {fit['norm']} fit"
    axis.plot(x, fit["k"] * x ** fit["n"], color=style.BLACK, lw=1.0, zorder=4, label=text)


def tex(value: float, digits: int = 4) -> str:
    """Return a number as mathematical text, with a power of ten if it is far from 1."""
    mantissa, _, exponent = f"{value:.{digits}g}".partition("e")
    return f"{mantissa}\\times 10^{{{int(exponent)}}}" if exponent else mantissa


@style.styled
def plasticity(results: Results) -> Figure:
    """Draw the yielded share of the volume and the largest plastic strain over the approach."""
    figure, (share, strain) = style.figure(style.DOUBLE, 3.0, columns=2)
    panels = (
        (share, "plastic_fraction", 100.0, "yielded share of the volume (%)"),
        (strain, "max_plastic_strain", 1.0, "largest equivalent plastic strain"),
    )
    looks = {
        "load": ("o-", style.BLUE, "loading"),
        "unload": ("s--", style.VERMILION, "unloading"),
        "reload": ("^:", style.GREEN, "reloading"),
    }
    for axis, column, factor, text in panels:
        for name, (mark, colour, branch) in looks.items():
            for n, piece in enumerate(results.branches(name)):
                axis.plot(
                    piece.delta_star, factor * getattr(piece, column), mark, color=colour,
                    mfc="white", label=branch if n == 0 else None,
                )  # fmt: skip
        axis.set_xlabel(DELTA)
        axis.set_ylabel(text)
        axis.set_xlim(left=0)
        axis.set_ylim(bottom=0)
        style.grid(axis)
    share.legend(loc="upper left")
    style.letters(share, strain)
    return figure
