"""Figure of the slip of a joint: loops, and damping and stiffness over the amplitude."""

from __future__ import annotations

from itertools import cycle
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from asperity.output.results import Results
from asperity.plot import style
from asperity.slip.tangential import TangentialVibration
from asperity.units import prefix

_SMOOTH = 40  # points of a leg of a loop


@style.styled
def slip(results: Results) -> Figure:
    """Draw the loops without their secants, and loss factor and secant stiffness of slip_loops.csv.

    A loop is a smooth line through the states of slip.csv.
    """
    figure, axes = style.figure(style.WIDE, 3.4, "loops", "loss factor", "secant stiffness")
    _loops(axes[0], results)
    rows = results.slip_loops
    factor, unit = prefix(float(rows["k_secant"].max()), results.unit("stiffness"))
    for axis, name, scale in ((axes[1], "eta", 1.0), (axes[2], "k_secant", factor)):
        x, bar = rows["amplitude"], scale * rows[f"error_{name}"] if f"error_{name}" in rows else None
        axis.errorbar(x, scale * rows[name], yerr=bar, mfc="white", fmt="o-", color=style.BLUE)
        axis.set_xlabel(r"amplitude $T/(\mu P)$")
    style.logarithmic(axes[1])
    axes[1].set_ylabel(r"loss factor $\eta = W/(\pi T u)$")
    axes[2].set(xlim=(0, 1), ylim=(0, None), ylabel=style.label("$T/u$", unit))
    return figure


def _loops(axis: Any, results: Results) -> None:
    from scipy.interpolate import CubicSpline

    colours = cycle(style.COLOURS)
    for amplitude in np.unique(results.slip["amplitude"])[::-1]:
        of = results.slip["amplitude"] == amplitude
        u, T = results.slip["u"][of], results.slip["T"][of]
        low = int(u.argmin())  # where the loop turns
        first = int(u[:low].argmax())
        u, T = u[first:] / np.abs(u).max(), T[first:] / np.abs(T).max()
        legs = []
        for leg in (slice(None, low - first + 1), slice(low - first, None)):
            at = np.linspace(u[leg][0], u[leg][-1], _SMOOTH)
            forth = np.argsort(u[leg])
            legs.append((at, CubicSpline(u[leg][forth], T[leg][forth])(at) - at))
        at, beyond = np.concatenate(legs, axis=1)
        size = float(np.abs(beyond).max()) or 1.0
        axis.plot(at, beyond / size, "-", color=next(colours), label=f"{amplitude:g}: {size:.2g}")
    axis.set(xlabel="displacement over its amplitude", ylabel="force beyond the secant, over its greatest")
    axis.legend(title=r"$T/(\mu P)$: greatest over $T$", loc="center")


@style.styled
def response(found: TangentialVibration) -> Figure:
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
