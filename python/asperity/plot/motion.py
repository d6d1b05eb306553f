"""Figure of short motions in time: a step, a shock, a chirp."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from asperity.output.results import Results
from asperity.plot import style
from asperity.plot.vibration import SYMBOLS, Scale, where
from asperity.units import prefix


@style.styled
def motion(results: Results) -> Figure:
    """Draw displacement and force over the time, a panel for each course of the force."""
    rows, scale = results.motion, Scale.of(results.thresholds)
    shapes = [str(shape) for shape in dict.fromkeys(rows["shape"])]
    known = scale is not None and np.isfinite(scale.frequency)
    factor, second = prefix(float(np.nanmax(rows["time"])), "s" if scale.si else "") if scale and known else (1.0, "")
    figure, axes = style.figure(style.DOUBLE, 1.0 + 2.1 * len(shapes), *shapes, rows=len(shapes), sharex=True)
    driven = results.thresholds.get("excitation", "force")
    for axis, shape in zip(axes, shapes, strict=True):
        of = where(rows, rows["shape"] == shape)
        t, u = factor * of["time"] if known else of["tau"], of["u"]
        axis.fill_between(t, 0, 1, where=u < -1.0, transform=axis.get_xaxis_transform(), color=style.PALE, lw=0)
        axis.plot(t, of["F_hat"], color=style.VERMILION, lw=0.9, label=SYMBOLS[driven])
        axis.plot(t, u, color=style.BLUE, lw=1.1, label="displacement $u$")
        axis.set(xlim=(t[0], t[-1]), ylabel="$u = (z - z_s)/z_s$")
        if scale is not None:
            scale.lengths(axis, "right")
    axes[0].legend(loc="best", ncols=2)
    axes[-1].set_xlabel(style.label("time", second) if known else "time $\\omega_s t$")
    return figure
