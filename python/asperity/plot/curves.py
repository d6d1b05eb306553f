"""Figures of load over approach with its power law and local exponent, and of plasticity."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.figure import Figure

from asperity.arrays import Array
from asperity.curve import Curve
from asperity.curve.power_law import with_misfit
from asperity.curve.slope import fitted_rows
from asperity.output.results import Results
from asperity.plot import style

DELTA, LOAD = "approach $\\delta^{*}{=}\\,\\delta/L$", "load $P^{*}{=}\\,P/(A_0E')$"
LOOKS = {  # branch -> format, colour, words
    "load": ("o-", style.BLUE, "loading"),
    "unload": ("s--", style.VERMILION, "unloading"),
    "reload": ("^:", style.GREEN, "reloading"),
}


@style.styled
def force_curve(results: Results) -> Figure:
    """Draw P* over delta* with the fit over its range, on linear and on logarithmic axes, and the local exponent.

    The band is the error bar of each step, if the run computed one. The second axes are in physical units.
    """
    figure, axes = style.figure(style.WIDE, 3.7, columns=3)
    style.titles(axes, ("load and approach", "logarithmic", "local exponent"))
    for draw, axis in zip((_linear, _logarithmic, _exponents), axes, strict=True):
        style.grid(axis)
        axis.set_xlabel(DELTA)
        draw(axis, results)
    return figure


def _linear(axis: Any, results: Results) -> None:
    for name in LOOKS:
        _branch(axis, results, name)
    _fit(axis, results)
    axis.set_ylabel(LOAD)
    axis.set_xlim(left=0)
    axis.set_ylim(bottom=0)
    axis.legend(loc="upper left")
    approach_axis(axis, results)
    load_axis(axis, results, "right")


def _logarithmic(axis: Any, results: Results) -> None:
    _branch(axis, results, "load")
    _fit(axis, results)
    axis.set_ylabel(LOAD)
    style.logarithmic(axis)


def _branch(axis: Any, results: Results, name: str) -> None:
    mark, colour, text = LOOKS[name]
    for n, piece in enumerate(results.branches(name)):
        x, y = piece.delta_star, piece.P_star
        axis.plot(x, y, mark, mfc="white", color=colour, label=text if n == 0 else None, zorder=3)
        band = np.nan_to_num(piece.error_P_star)
        if np.any(band > 0):
            # a logarithmic axis cannot show a band down to zero
            axis.fill_between(
                x, np.maximum(y - band, 1e-3 * y), y + band, color=colour, alpha=0.2, lw=0,
                label="error bar" if n == 0 and name == "load" else None,
            )  # fmt: skip


def _fit(axis: Any, results: Results) -> None:
    if (law := _law(results)) is None:
        return
    k, n, norm, low, high = law
    x = np.geomspace(low, high, 200)
    digits = [text.split()[0] for text in with_misfit(results.summary["fit"])]  # as many as its intervals allow
    text = f"$P^{{*}}{{=}}\\,{tex(float(digits[0]))}\\,(\\delta^{{*}})^{{{digits[1]}}}$, {norm} fit"
    axis.plot(x, k * x**n, color=style.BLACK, lw=1.0, zorder=4, label=text)


def _law(results: Results) -> tuple[float, float, str, float, float] | None:
    """k, n, norm and range of the fit; None without one."""
    fit = results.summary.get("fit") or {}
    loads = results.branches("load")
    if not {"k", "n"} <= set(fit) or not loads:
        return None
    low, high = fit.get("range") or (0.0, float(np.max(loads[0].delta_star)))
    low = low or min((float(x) for x in loads[0].delta_star if x > 0), default=1e-6)
    return float(fit["k"]), float(fit["n"]), str(fit["norm"]), low, high


def _exponents(axis: Any, results: Results) -> None:
    """Draw d(ln P)/d(ln delta) of the first loading next to the exponent of the fit."""
    x, exponent = local_exponent(results.curve)
    axis.plot(x, exponent, "o-", color=style.BLUE, mfc="white", label="of the curve", zorder=3)
    if (law := _law(results)) is not None:
        _, n, norm, low, high = law
        text = with_misfit(results.summary["fit"])[1]
        axis.plot((low, high), (n, n), color=style.BLACK, lw=1.0, label=f"{norm} fit, $n$ = {text}")
    axis.axhline(1.0, color=style.GREY, lw=0.7)
    axis.set_ylabel("local exponent $\\mathrm{d}\\ln P/\\mathrm{d}\\ln\\delta$")
    axis.set_xlim(left=0)
    axis.set_ylim(0, max(2.0, 1.15 * float(np.max(exponent, initial=0.0))))
    axis.legend(loc="best")
    approach_axis(axis, results)


def local_exponent(curve: Curve) -> tuple[Array, Array]:
    """Delta* (n,) and d(ln P)/d(ln delta) (n,) at the steps of the first loading that a fit uses.

    It is k_n delta/P, with the slope k_n of the curve.
    """
    load = curve.loading()
    rows = load.where(fitted_rows(load.delta, load.force))
    rows = rows.where(np.isfinite(rows.k_n))
    return rows.delta_star, rows.k_n * rows.delta / rows.force


def approach_axis(axis: Any, results: Results) -> None:
    """Add the approach in physical units at the top of axes over delta*."""
    curve = results.curve
    side = value_of_one(curve.delta, curve.delta_star)
    if np.isfinite(side):
        style.physical_axis(axis, "top", "approach $\\delta$", side, results.unit("length"))


def load_axis(axis: Any, results: Results, side: str) -> None:
    """Add the force in physical units at a side, "top" or "right", of axes over P*."""
    scale = value_of_one(results.curve.force, results.curve.P_star)
    if np.isfinite(scale):
        style.physical_axis(axis, side, "force $P$", scale, results.unit("force"))


def value_of_one(physical: Array, starred: Array) -> float:
    """Physical value of 1, NaN if unknown."""
    known = np.flatnonzero(starred > 0)
    return float(physical[known[-1]] / starred[known[-1]]) if known.size else np.nan


def tex(value: float) -> str:
    """Number as mathematical text, with a power of ten if it is far from 1."""
    mantissa, _, exponent = f"{value:.4g}".partition("e")
    return f"{mantissa}\\times 10^{{{int(exponent)}}}" if exponent else mantissa


def draw_branches(axis: Any, results: Results, x: str, y: str, factor: float = 1.0) -> None:
    """Draw one column of the curve over another, each branch in its look."""
    for name, (mark, colour, text) in LOOKS.items():
        for n, piece in enumerate(results.branches(name)):
            axis.plot(
                getattr(piece, x), factor * getattr(piece, y), mark, color=colour, mfc="white",
                label=text if n == 0 else None,
            )  # fmt: skip
    axis.set_xlim(left=0)
    style.grid(axis)


@style.styled
def plasticity(results: Results) -> Figure:
    """Draw the yielded share of the volume and the largest plastic strain over the approach."""
    figure, axes = style.figure(style.DOUBLE, 3.4, columns=2)
    style.titles(axes, ("yielded volume", "plastic strain"))
    panels = (
        ("plastic_fraction", 100.0, "yielded share of the volume (%)"),
        ("max_plastic_strain", 1.0, "largest equivalent plastic strain"),
    )
    for axis, (column, factor, text) in zip(axes, panels, strict=True):
        draw_branches(axis, results, "delta_star", column, factor)
        axis.set_xlabel(DELTA)
        axis.set_ylabel(text)
        axis.set_ylim(bottom=0)
        approach_axis(axis, results)
    axes[0].legend(loc="upper left")
    return figure
