"""Figure of the frequency response function: receptance, or transmissibility where the base moves.

Axes are in hertz and in units of the case where these are known, else over omega_s and 1/k_n.
"""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

from asperity.arrays import Array
from asperity.output.results import Results
from asperity.plot import style
from asperity.plot.vibration import DASHES, SWEEPS, SYMBOLS, Scale, heading, pieces, truth, where
from asperity.units import prefix

_FLOOR = 1.5  # the axis of the receptance begins at its smallest value over this


@style.styled
def receptance(results: Results) -> Figure:
    """Draw amplitude over force with the backbone, or that of the mass over that of the base."""
    rows, free, thresholds = results.response, results.free, results.thresholds
    driven, n_loc, load = thresholds.get("excitation", "force"), thresholds.get("n_loc"), thresholds.get("load")
    frequency, compliance, hertz, metre, si = Scale.of(thresholds).frequency, 1.0, "", "", False
    if np.isfinite(frequency):
        si, compliance = Scale.of(thresholds).si, 1.0 / float(thresholds["numbers"]["k_n"])
        factor, hertz = prefix(frequency, "Hz") if si else (1.0, "1/time")
        frequency, metre = factor * frequency, "m" if si else "length"
    else:
        frequency = 1.0
    model = "exact" if "exact" in rows["model"] else str(rows["model"][0])
    rows = where(rows, (rows["model"] == model) & ~np.isin(rows["branch"], list(SWEEPS)))
    zeta = float(rows["zeta"][0])
    figure, (axis,) = style.figure(style.SINGLE + 1.6, 4.0, heading([zeta], thresholds.get("damping"), n_loc))
    of_base = driven != "force"
    free = where(free, free["model"] == model) if "a1" in free and not of_base else {}
    value: Array = rows["transmissibility"] if of_base else rows["a1"] / rows["F_hat"]
    rows = {**rows, "value": value}
    if of_base:
        compliance, metre, si = 1.0, "", False
    low, high = value[value > 0.0].min() / _FLOOR, 1.3 * value.max()  # 0 where orbits have no first harmonic
    if si:
        factor, metre = prefix(compliance * high, metre)
        compliance *= factor
    grid = np.linspace(rows["Omega"].min(), rows["Omega"].max(), 2001)
    linear = (np.hypot(1.0, 2.0 * zeta * grid) if of_base else 1.0) / np.hypot(1.0 - grid**2, 2.0 * zeta * grid)
    axis.plot(frequency * grid, compliance * linear, color=style.GREY, lw=0.8, label="linear")
    forcings = np.unique(rows["F_hat"])
    for forcing, colour in zip(forcings, np.resize(style.COLOURS, len(forcings)), strict=True):
        of = where(rows, rows["F_hat"] == forcing)
        for name in np.unique(of["branch"]):
            branch = where(of, of["branch"] == name)
            stable, y = truth(branch["stable"]), branch["value"]
            for start, stop in pieces(branch["Omega"], y, stable):
                axis.plot(
                    frequency * branch["Omega"][start:stop], compliance * y[start:stop], color=colour, lw=1.2,
                    ls="-" if stable[start] else DASHES,
                )  # fmt: skip
        if free:
            reached = free["a1"] <= of["a1"].max()
            x, y = free["omega_ratio"][reached], free["a1"][reached] / forcing
            axis.plot(frequency * x, compliance * y, ":", color=colour, lw=1.0)
        label = f"{SYMBOLS[driven]} = {forcing:.3g}"
        if n_loc and not of_base:  # in newton where that is known, and over the preload
            newton = f"{n_loc * forcing * load:.3g} N, " if si and load else ""
            label = f"$F$ = {newton}{n_loc * forcing:.3g} $W$"
        axis.plot([], [], color=colour, label=label)
    if free:
        axis.plot([], [], ":", color=style.GREY, label="backbone of each force")
    if not truth(rows["stable"]).all():
        axis.plot([], [], ls=DASHES, color=style.GREY, label="unstable")
    axis.set(yscale="log", xlim=(frequency * grid[0], frequency * grid[-1]), ylim=(compliance * low, compliance * high))
    if high < 300 * low:
        axis.yaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
        axis.yaxis.set_minor_formatter(NullFormatter())
    axis.yaxis.set_major_formatter(FuncFormatter(lambda y, _: f"{y:g}"))
    axis.set_xlabel(style.label("frequency", hertz) if hertz else "frequency $\\Omega = \\omega/\\omega_s$")
    force = "N" if si else "force"
    what = f"receptance $|X/F|$ ({metre}/{force})" if metre else "receptance $k_n|X/F|$"
    axis.set_ylabel("transmissibility, mass over base" if of_base else what)
    axis.legend(loc="best")
    return figure
