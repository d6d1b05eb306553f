"""Figure of the slip of a joint: loops, and damping and stiffness over the amplitude."""

from __future__ import annotations

from itertools import cycle
from typing import Any

import numpy as np
from matplotlib import colormaps
from matplotlib.collections import EllipseCollection
from matplotlib.colors import Normalize
from matplotlib.figure import Figure

from asperity.output.results import Results
from asperity.plot import style
from asperity.slip.joint_slip import slip_of_case
from asperity.slip.path import path_of_law
from asperity.slip.tangential import TangentialVibration
from asperity.units import prefix

_COLOURS = (style.BLUE, style.VERMILION, style.GREEN, style.PURPLE, style.ORANGE, style.SKY)
STICK = 1e-6  # slip over the greatest one, below which a node sticks
_SMOOTH = 40  # steps from rest to an amplitude


@style.styled
def slip(results: Results) -> Figure:
    """Draw the loops without their secants, and loss factor and secant stiffness of slip_loops.csv.

    Loops are those of the law, by Masing's rule, where there is one; points are those of the solid in slip.csv.
    """
    figure, axes = style.figure(style.WIDE, 3.4, columns=3)
    style.titles(axes, ("loops", "loss factor", "secant stiffness"))
    _loops(axes[0], results)
    factor, unit = prefix(float(results.slip_loops["k_secant"].max()), results.unit("stiffness"))
    for axis, name, scale in ((axes[1], "eta", 1.0), (axes[2], "k_secant", factor)):
        _over_amplitude(axis, results, name, scale)
        axis.set_xlabel(r"amplitude $T/(\mu P)$")
    style.logarithmic(axes[1])
    axes[1].set_ylabel(r"loss factor $\eta = W/(\pi T u)$")
    axes[2].set(xlim=(0, 1), ylabel=style.label("$T/u$", unit))
    axes[2].set_ylim(bottom=0)
    if "eta_curve" in results.slip_loops:
        axes[1].legend(loc="best")
    for axis in axes:
        style.grid(axis)
    return figure


@style.styled
def slip_map(results: Results, count: int = 4) -> Figure:
    """Draw the slip of each node in contact at up to `count` amplitudes, each node a disc of its area."""
    nodes = results.slip_nodes
    amplitudes = np.unique(nodes["amplitude"])[-count:]
    figure, axes = style.figure(0.5 + 2.6 * len(amplitudes), 2.8, columns=len(amplitudes))
    style.titles(axes, [rf"$T/(\mu P)$ = {amplitude:g}" for amplitude in amplitudes])
    box = np.array([(nodes[name].min(), nodes[name].max()) for name in ("x", "y")])
    across, unit = prefix(float(box.max()), results.unit("length"))
    middle, half = across * box.mean(axis=1), 0.6 * across * np.ptp(box, axis=1).max() * np.array([-1.0, 1.0])
    most = float(nodes["slip"].max())
    scale, unit_of_slip = prefix(most, results.unit("length"))
    discs: Any = None
    for axis, amplitude in zip(axes, amplitudes, strict=False):
        of = (nodes["amplitude"] == amplitude) & (nodes["area"] > 0.0)
        size = 2.0 * across * np.sqrt(nodes["area"][of] / np.pi)
        slips = np.ma.masked_less(scale * nodes["slip"][of], STICK * scale * most)
        at = across * np.column_stack([nodes["x"][of], nodes["y"][of]])
        discs = EllipseCollection(
            size, size, np.zeros(size.size), units="xy", offsets=at,
            transOffset=axis.transData, array=slips, cmap=colormaps["viridis_r"].with_extremes(bad=style.GREY), lw=0,
            norm=Normalize(0.0, scale * most),
        )  # fmt: skip
        axis.add_collection(discs)
        axis.set(xlim=middle[0] + half, ylim=middle[1] + half, aspect="equal", facecolor=style.PALE)
        axis.set_xlabel(style.label("$x$", unit))
        axis.set_ylabel(style.label("$y$", unit))
        axis.label_outer()
    figure.colorbar(discs, ax=axes, shrink=0.8).set_label(style.label("slip", unit_of_slip))
    return figure


@style.styled
def response(found: TangentialVibration) -> Figure:
    """Draw the amplitude of the tangential vibration over frequency, one curve per force."""
    figure, axes = style.figure(style.SINGLE, 3.4)
    axis, si = axes[0], found.units == "SI"
    of_a, unit_a = prefix(max(float(a.max()) for _, a in found.responses.values()), "m" if si else "")
    of_f, unit_f = prefix(max(float(f.max()) for f, _ in found.responses.values()), "Hz" if si else "")
    for colour, (share, (f, a)) in zip(cycle(_COLOURS), found.responses.items(), strict=False):
        axis.plot(of_f * f, of_a * a, "-", color=colour, label=f"{share:g}")
        axis.plot(of_f * f[a.argmax()], of_a * a.max(), "o", color=style.BLACK, markersize=3)
    middle = [float(f[a.argmax()]) for f, a in found.responses.values()]
    low, high = 0.8 * min(middle), 1.15 * max(middle)
    axis.set_xlim(of_f * low, of_f * high)
    axis.set_yscale("log")
    axis.set_ylim(bottom=0.8 * of_a * min(float(a[(low < f) & (f < high)].min()) for f, a in found.responses.values()))
    axis.set_xlabel(style.label("frequency", unit_f))
    axis.set_ylabel(style.label("amplitude of $u$", unit_a))
    axis.legend(title=r"$F/(\mu P)$", loc="best")
    style.grid(axis)
    return figure


def _loops(axis: Any, results: Results) -> None:
    rows, loops, slip = results.slip, results.slip_loops, results.case["slip"]
    solid, law = slip.get("method") == "solid", None
    if not solid or "T_curve" in rows:
        preload = float(loops["T"][-1] / (loops["amplitude"][-1] * slip["friction"]))
        law = slip_of_case(results.case, results.curve, min(preload, float(results.curve.force.max()))).law
    for colour, amplitude in zip(cycle(_COLOURS), np.unique(rows["amplitude"])[::-1], strict=False):
        of = rows["amplitude"] == amplitude
        u, T = rows["u"][of], rows["T"][of]
        if law is not None:
            smooth = path_of_law(law, float(amplitude), steps=_SMOOTH)
            u, T = smooth.u[_SMOOTH:], smooth.T[_SMOOTH:]  # without the way from rest
        most_u, most_T = float(np.abs(u).max()), float(np.abs(T).max())
        beyond = T / most_T - u / most_u
        size = float(np.abs(beyond).max()) or 1.0
        axis.plot(u / most_u, beyond / size, "-", color=colour, label=f"{amplitude:g}: {size:.2g}")
        if solid:
            x, y = rows["u"][of] / most_u, rows["T"][of] / most_T
            axis.plot(x, (y - x) / size, "o", color=colour, markersize=3)
    axis.set_xlabel("displacement over its amplitude")
    axis.set_ylabel("force beyond the secant, over its greatest")
    axis.legend(title=r"$T/(\mu P)$: greatest over $T$", loc="center")


def _over_amplitude(axis: Any, results: Results, name: str, factor: float) -> None:
    """Draw a column over the amplitude with its error bars, and that by the normal curve where both are known."""
    rows = results.slip_loops
    bar = factor * rows[f"error_{name}"] if f"error_{name}" in rows else None
    axis.errorbar(
        rows["amplitude"], factor * rows[name], yerr=bar, fmt="o-", color=style.BLUE, mfc="white", label="solid"
    )
    if f"{name}_curve" in rows:
        curve = factor * rows[f"{name}_curve"]
        axis.plot(rows["amplitude"], curve, "s--", color=style.VERMILION, mfc="white", label="normal curve")
