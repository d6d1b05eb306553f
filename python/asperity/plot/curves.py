"""Figures of the columns of a curve: load over approach, stiffness, mean gap, conductance."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from asperity.arrays import Array
from asperity.curve import Curve
from asperity.curve.power_law import with_misfit
from asperity.curve.slope import fitted_rows
from asperity.output.results import Results
from asperity.plot import style
from asperity.units import prefix

DELTA, LOAD = "approach $\\delta^{*}{=}\\,\\delta/L$", "load $P^{*}{=}\\,P/(A_0E')$"
LOOKS = {  # branch -> format, colour, words
    "load": ("o-", style.BLUE, "loading"),
    "hold": ("D-", style.PURPLE, "hold"),
    "unload": ("s--", style.VERMILION, "unloading"),
    "reload": ("^:", style.GREEN, "reloading"),
}
STIFFNESSES = {
    "k_n": ("o-", style.BLUE, "slope of the curve, $k_n$"),
    "k_n_elastic": ("s--", style.VERMILION, "normal, elastic, $k_n^{el}$"),
    "k_t": ("^:", style.GREEN, "tangential, $k_t$"),
}


def draw_branches(
    axis: Any, results: Results, x: str, y: str, factor: float = 1.0, names: Sequence[str] = tuple(LOOKS)
) -> None:
    """Draw one column of the curve over another, each branch in its look, with the band of its error bar if known."""
    for name in names:
        mark, colour, text = LOOKS[name]
        for n, piece in enumerate(results.branches(name)):
            at, value = getattr(piece, x), factor * getattr(piece, y)
            axis.plot(at, value, mark, mfc="white", color=colour, label=text if n == 0 else None, zorder=3)
            words = "error bar" if n == 0 and name == "load" else None
            _draw_band(axis, at, value, factor * getattr(piece, f"error_{y}", np.zeros(len(value))), colour, words)


def _draw_band(axis: Any, at: Array, value: Array, error: Array, colour: str, label: str | None = None) -> None:
    """Draw the band of an error bar, if some of it is known."""
    band = np.nan_to_num(error)
    if np.any(band > 0.0):
        low = np.maximum(value - band, 1e-3 * value)  # a logarithmic axis cannot show a band down to zero
        axis.fill_between(at, low, value + band, color=colour, alpha=0.2, lw=0, label=label)


@style.styled
def force_curve(results: Results) -> Figure:
    """(a) Load over approach with the fitted power law. (b) The same on logarithmic axes. (c) Local exponent of the
    loading; a power law has a constant one.

    The band is the error bar of each step, if the run computed one. The second axes are in physical units.
    """
    figure, axes = style.figure(style.WIDE, 3.7, "load and approach", "logarithmic", "local exponent")
    linear, logarithmic, exponents = axes
    law = _law(results)
    for axis, names in ((linear, tuple(LOOKS)), (logarithmic, ("load",))):
        draw_branches(axis, results, "delta_star", "P_star", names=names)
        axis.set(xlabel=DELTA, ylabel=LOAD)
        if law is not None:
            k, n, (low, high) = law
            x = np.geomspace(low, high, 200)
            digits = [text.split()[0] for text in with_misfit(results.summary["fit"])]  # as its intervals allow
            text = f"$P^{{*}}{{=}}\\,{tex(float(digits[0]))}\\,(\\delta^{{*}})^{{{digits[1]}}}$, fit"
            axis.plot(x, k * x**n, color=style.BLACK, lw=1.0, zorder=4, label=text)
    linear.set(xlim=(0, None), ylim=(0, None))
    linear.legend(loc="upper left")
    style.logarithmic(logarithmic)

    x, exponent = local_exponent(results.curve)
    exponents.plot(x, exponent, "o-", color=style.BLUE, mfc="white", label="of the curve", zorder=3)
    if law is not None:
        _, n, bounds = law
        text = f"fit, $n$ = {with_misfit(results.summary['fit'])[1]}"
        exponents.plot(bounds, (n, n), color=style.BLACK, lw=1.0, label=text)
    exponents.axhline(1.0, color=style.GREY, lw=0.7)
    exponents.set(xlabel=DELTA, ylabel="local exponent $\\mathrm{d}\\ln P/\\mathrm{d}\\ln\\delta$", xlim=(0, None))
    exponents.set_ylim(0, max(2.0, 1.15 * float(np.max(exponent, initial=0.0))))
    exponents.legend(loc="best")
    for axis in axes:
        approach_axis(axis, results)
    load_axis(linear, results, "right")
    return figure


def _law(results: Results) -> tuple[float, float, tuple[float, float]] | None:
    """k, n and range of the fit; None without one."""
    fit = results.summary.get("fit") or {}
    loads = results.branches("load")
    if not {"k", "n"} <= set(fit) or not loads:
        return None
    low, high = fit.get("range") or (0.0, float(np.max(loads[0].delta_star)))
    low = low or min((float(x) for x in loads[0].delta_star if x > 0), default=1e-6)
    return float(fit["k"]), float(fit["n"]), (low, high)


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
    side = value_of_one(results.curve.delta, results.curve.delta_star)
    style.physical_axis(axis, "top", "approach $\\delta$", side, results.unit("length"))


def load_axis(axis: Any, results: Results, side: str) -> None:
    """Add the force in physical units at a side, "top" or "right", of axes over P*."""
    scale = value_of_one(results.curve.force, results.curve.P_star)
    style.physical_axis(axis, side, "force $P$", scale, results.unit("force"))


def value_of_one(physical: Array, starred: Array) -> float:
    """Physical value of 1, NaN if unknown."""
    known = np.flatnonzero(starred > 0)
    return float(physical[known[-1]] / starred[known[-1]]) if known.size else np.nan


def tex(value: float) -> str:
    """Number as mathematical text, with a power of ten if it is far from 1."""
    mantissa, _, exponent = f"{value:.4g}".partition("e")
    return f"{mantissa}\\times 10^{{{int(exponent)}}}" if exponent else mantissa


@style.styled
def indentation(results: Results) -> Figure:
    """(a) Force over depth. (b) Hardness, the force over the projected area of contact."""
    figure, (left, right) = style.figure(style.DOUBLE, 3.7, "force over depth", "hardness")
    factor, unit = prefix(float(np.nanmax(results.curve.mean_pressure)), results.unit("stress"))
    draw_branches(left, results, "delta_star", "P_star")
    draw_branches(right, results, "delta_star", "mean_pressure", factor, names=("load",))
    for axis, text in ((left, LOAD), (right, style.label("hardness", unit))):
        axis.set(xlabel=DELTA, ylabel=text, xlim=(0, None), ylim=(0, None))
        approach_axis(axis, results)
    left.legend(loc="best")
    load_axis(left, results, "right")
    return figure


@style.styled
def stiffness(results: Results) -> Figure:
    """(a) Stiffness of the contact during loading. (b) Mean gap."""
    figure, (left, right) = style.figure(style.DOUBLE, 3.5, "stiffness", "mean gap")
    curve, loading = results.curve, results.curve.loading()
    factor, unit = prefix(float(np.nanmax(curve.k_n_elastic)), results.unit("stiffness"))
    for name, (mark, colour, text) in STIFFNESSES.items():
        left.plot(loading.P_star, factor * getattr(loading, name), mark, color=colour, mfc="white", label=text)
    left.set(ylabel=style.label("stiffness", unit), ylim=(0, None))
    factor, unit = prefix(float(np.nanmax(curve.mean_gap)), results.unit("length"))
    draw_branches(right, results, "P_star", "mean_gap", factor)
    right.set_ylabel(style.label("mean gap", unit))
    for axis in (left, right):
        axis.set(xlabel=LOAD, xlim=(0, None))
        axis.legend(loc="best")
        load_axis(axis, results, "top")
    return figure


@style.styled
def leakage(results: Results) -> Figure:
    """(a) Transmissivity of the gap over the load; a dotted line marks the last load with an open channel. (b) Mean gap
    and hydraulic aperture.
    """
    figure, (left, right) = style.figure(style.DOUBLE, 3.5, "transmissivity", "apertures")
    loading, unit = results.curve.loading(), results.unit("length")

    def draw(axis: Any, name: str, words: str, colour: str, factor: float = 1.0) -> Array:
        value, error = (factor * getattr(loading, f"{of}{name}") for of in ("", "error_"))
        known = value > 0.0
        at = loading.P_star[known]
        axis.plot(at, value[known], "o-", color=colour, mfc="white", label=words)
        _draw_band(axis, at, value[known], error[known], colour)
        return at

    for along, colour in (("x", style.BLUE), ("y", style.VERMILION)):
        at = draw(left, f"transmissivity_{along}", f"along ${along}$", colour)
        if 0 < len(at) < len(loading):
            left.axvline(at[-1], color=colour, lw=0.7, ls=":")
    factor, of_gap = prefix(float(np.nanmax(loading.mean_gap)), unit)
    draw(right, "mean_gap", "mean gap", style.BLUE, factor)
    draw(right, "hydraulic_aperture", "hydraulic aperture", style.VERMILION, factor)
    left.set(xlabel=LOAD, ylabel=style.label("transmissivity $T$", f"{unit}³" if unit else ""))
    right.set(xlabel=LOAD, ylabel=style.label("aperture", of_gap))
    for axis in (left, right):
        style.logarithmic(axis)
        axis.legend(loc="best")
    return figure


@style.styled
def over_time(results: Results) -> Figure:
    """(a) Contact area, (b) load and (c) approach over time."""
    figure, axes = style.figure(style.WIDE, 3.7, "contact area", "load", "approach")
    for axis, name, words in zip(
        axes, ("area_fraction", "P_star", "delta_star"), ("contact area $A/A_0$", LOAD, DELTA), strict=True
    ):
        draw_branches(axis, results, "time", name)
        axis.set(xlabel="time (s)", ylabel=words, xlim=(0, None), ylim=(0, None))
    axes[0].legend(loc="best")
    return figure


@style.styled
def conductance(results: Results) -> Figure:
    """Conductance per nominal area over the nominal pressure."""
    figure, (axis,) = style.figure(style.SINGLE, 3.4, "")
    p, h, error = results.gap_conductance()
    of_p, unit_p = prefix(float(np.nanmax(p)), results.unit("stress"))
    of_h, unit_h = prefix(float(np.nanmax(h)), results.unit("conductance"))
    for branch, (mark, colour, text) in LOOKS.items():
        rows = (results.curve.branch == branch) & (h > 0)
        if rows.any():
            bar = of_h * error[rows] if np.isfinite(error[rows]).any() else None
            axis.errorbar(of_p * p[rows], of_h * h[rows], yerr=bar, fmt=mark, color=colour, mfc="white", label=text)
    style.logarithmic(axis)
    axis.set(xlabel=style.label("nominal pressure", unit_p), ylabel=style.label("conductance $h$", unit_h))
    axis.legend(loc="best")
    return figure
