"""Figure of contact area and pressure beside the theories of rough contact."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from asperity.arrays import Array
from asperity.output.results import Results
from asperity.plot import style
from asperity.plot.contact import pressed_thirds
from asperity.plot.curves import LOAD, draw_branches
from asperity.units import prefix

BINS = 40


@style.styled
def area_load(results: Results) -> Figure:
    """Draw contact area over load on logarithmic axes, and the distribution of the pressure at the greatest load.

    Persson's theory and that of Bush, Gibson and Thomas need the rms slope of the surface alone.
    """
    i = int(np.argmax([p.mean() for p in results.top["pressure"]])) if results.snapshots else -1
    pressures, areas = pressed_thirds(results.top, i) if results.snapshots else (np.empty(0), np.empty(0))
    figure, axes = style.figure(style.DOUBLE, 3.6, "area and load", "pressure at the greatest load")
    slope = results.surface.rms_slope()
    _area(axes[0], results, slope)
    if (pressures > 0.0).any():
        _distribution(axes[1], results, slope, i, pressures, areas / results.surface.L**2)
    else:
        axes[1].set_axis_off()
    return figure


def persson_area(load: Array, slope: float) -> Array:
    """Contact area over the nominal one at loads P/(A0 E') (n,) (Persson, J. Chem. Phys. 115 (2001) 3840)."""
    from scipy.special import erf

    return np.asarray(erf(math.sqrt(2.0) * load / slope))


def persson_density(pressure: Array, mean: float, slope: float) -> Array:
    """Density of the pressure over E' on the nominal area at p/E' (n,), under the mean P/(A0 E')."""
    width = slope / 2.0
    low, high = ((pressure - sign * mean) / width for sign in (1.0, -1.0))
    return np.asarray((np.exp(-(low**2) / 2.0) - np.exp(-(high**2) / 2.0)) / (math.sqrt(2.0 * math.pi) * width))


def _area(axis: Any, results: Results, slope: float) -> None:
    load = results.curve.loading()
    p = load.P_star[(load.P_star > 0.0) & (load.area_fraction > 0.0)]
    draw_branches(axis, results, "P_star", "area_fraction", names=("load",))
    axis.lines[0].set_label("this run")
    line = np.geomspace(p.min() / 2.0, p.max() * 2.0, 100)
    axis.plot(line, persson_area(line, slope), color=style.VERMILION, label="Persson, elastic")
    bush = math.sqrt(2.0 * math.pi) * line / slope
    axis.plot(line[bush < 1.0], bush[bush < 1.0], "--", color=style.GREEN, label="Bush, Gibson, Thomas, elastic")
    axis.set(xlabel=LOAD, ylabel="contact area over the nominal area")
    style.logarithmic(axis)
    axis.legend(loc="upper left", title=f"rms slope {slope:.3g}", title_fontsize="small")


def _distribution(axis: Any, results: Results, slope: float, i: int, pressures: Array, shares: Array) -> None:
    """Draw the density of the pressures of a snapshot, each on a share of the patch."""
    highest = float(results.top["pressure"][i].max())  # as in the table; few thirds have more
    scale, unit = prefix(highest, results.unit("stress"))
    edges = np.linspace(0.0, highest * scale, BINS + 1)
    axis.hist(np.minimum(pressures, highest) * scale, edges, weights=shares / np.diff(edges)[0], color=style.SKY,
              label=f"this run, {100 * shares.sum():.3g} % in contact")  # fmt: skip
    row = results.curve.where(results.curve.step == int(results.top["steps"][i]))
    solid = results.case["material"]
    if len(row) and not solid.get("yield_strength"):
        modulus = solid["E"] / (1.0 - solid["nu"] ** 2)
        p = np.linspace(0.0, edges[-1], 200)
        axis.plot(p, persson_density(p / scale / modulus, float(row.P_star[0]), slope) / (scale * modulus),
                  color=style.VERMILION, label="Persson")  # fmt: skip
    mean = float(row.mean_pressure[0]) * scale if len(row) else math.nan  # force over area, as in the report
    if math.isfinite(mean):
        axis.axvline(mean, color=style.BLACK, lw=0.8, ls=":", label=f"force over area {mean:.3g} {unit}".rstrip())
    density = style.label("density on the nominal area", f"1/{unit}" if unit else "")
    axis.set(xlabel=style.label("contact pressure", unit), ylabel=density, xlim=(0.0, edges[-1]))
    axis.set_ylim(top=1.25 * axis.get_ylim()[1])
    axis.legend(loc="upper left")
