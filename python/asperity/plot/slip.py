"""Figure of the slip of a joint: loops, and damping and stiffness over the amplitude."""

from __future__ import annotations

from itertools import cycle

import numpy as np
from matplotlib.figure import Figure

from asperity.output.results import Results
from asperity.plot import style
from asperity.slip.joint_slip import JointSlip
from asperity.units import prefix


@style.styled
def slip(results: Results) -> Figure:
    """Draw the loops of slip.csv, and loss factor and secant stiffness of slip_loops.csv.

    A loop is much narrower than long: the force is drawn over the displacement less that without slip.
    """
    figure, axes = style.figure(style.WIDE, 3.4, "loops", "loss factor", "secant stiffness")
    states, rows = results.slip, results.slip_loops
    light = np.flatnonzero(states["T"] > 0.0)[0]  # the first state of the smallest amplitude
    slipped = states["u"] - states["T"] * (states["u"][light] / states["T"][light])
    of_u, unit_u = prefix(float(np.abs(slipped).max()), results.unit("length"))
    of_t, unit_t = prefix(float(np.abs(states["T"]).max()), results.unit("force"))
    for colour, amplitude in zip(cycle(style.COLOURS), np.unique(states["amplitude"]), strict=False):
        of = states["amplitude"] == amplitude
        axes[0].plot(of_u * slipped[of], of_t * states["T"][of], "-", color=colour, label=f"{amplitude:g}")
    axes[0].set(xlabel=style.label("displacement by slip, $u - T/k$", unit_u))
    axes[0].set(ylabel=style.label("tangential force $T$", unit_t))
    axes[0].legend(title=r"$T/(\mu P)$", loc="upper left")
    factor, unit = prefix(float(rows["k_secant"].max()), results.unit("stiffness"))
    for axis, name, scale in ((axes[1], "eta", 1.0), (axes[2], "k_secant", factor)):
        x, bar = rows["amplitude"], scale * rows[f"error_{name}"] if f"error_{name}" in rows else None
        axis.errorbar(x, scale * rows[name], yerr=bar, mfc="white", fmt="o-", color=style.BLUE)
        axis.set_xlabel(r"amplitude $T/(\mu P)$")
    style.logarithmic(axes[1])
    axes[1].set_ylabel(r"loss factor $\eta = W/(\pi T u)$")
    axes[2].set(xlim=(0, 1), ylim=(0, None), ylabel=style.label("$T/u$", unit))
    return figure


@style.styled
def response(found: JointSlip) -> Figure:
    """Draw the amplitude of the tangential vibration over frequency, one curve per force."""
    figure, (axis,) = style.figure(style.SINGLE, 3.4, "")
    si, curves = found.units == "SI", found.responses
    of_a, unit_a = prefix(max(float(a.max()) for _, a in curves.values()), "m" if si else "")
    of_f, unit_f = prefix(max(float(f.max()) for f, _ in curves.values()), "Hz" if si else "")
    for colour, (share, (f, a)) in zip(cycle(style.COLOURS), curves.items(), strict=False):
        axis.plot(of_f * f, of_a * a, "-", color=colour, label=f"{share:g}")
        axis.plot(of_f * f[a.argmax()], of_a * a.max(), "o", color=style.BLACK, markersize=3)
    middle = [float(f[a.argmax()]) for f, a in curves.values()]
    low, high = 0.8 * min(middle), 1.15 * max(middle)
    least = min(float(a[(low < f) & (f < high)].min()) for f, a in curves.values())
    axis.set(xlim=(of_f * low, of_f * high), ylim=(0.8 * of_a * least, None))
    style.logarithmic(axis, "y")
    axis.set(xlabel=style.label("frequency", unit_f), ylabel=style.label("amplitude of $u$", unit_a))
    axis.legend(title=r"$F/(\mu P)$", loc="best")
    return figure
