# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

"""Figures of an oscillator: operating point, backbone, phase portrait and time history, stability chart.

Each function returns a matplotlib Figure, except `plot_dynamics`, which writes all figures. Figures of damped motion
show the damping model, because it determines whether a resonance is limited.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import ArrayLike

from asperity.dynamics.law.checks import positives
from asperity.dynamics.law.table import TableLaw
from asperity.errors import AsperityError
from asperity.plot import style
from asperity.plot.spectra import receptance_of
from asperity.plot.vibration import Scale, amplitude_frequency, natural_frequency

if TYPE_CHECKING:
    from asperity.dynamics import ContactOscillator, Dynamics, FrequencyResponse, Trajectory

_CHART = 21  # number of forcings in a stability chart


@style.styled
def operating_point(oscillator: ContactOscillator, *, ax: style.Place | None = None) -> Figure:
    """Draw the law (force over approach), the operating point, the tangent and the Taylor series, on `ax` if given."""
    r = oscillator.restoring
    series = oscillator.taylor()
    top = min(2.2, 1.0 + r.u_range[1])
    s = np.linspace(-0.6, top, 400)
    figure, (axis, *_) = style.figure(style.SINGLE + 0.6, 3.6, ax=ax)
    axis.set_title("law at the operating point", loc="left")
    force = r.law.both(r.z_s * s)[0] / r.load
    axis.plot(s, force, color=style.BLUE, label=r.law.describe())
    axis.plot(s, series.law.both(r.z_s * s)[0] / r.load, "--", color=style.VERMILION, label="Taylor series, cubic")
    axis.plot(s, 1.0 + r.n_loc * (s - 1.0), ":", color=style.GREY, label=f"tangent, $n_{{loc}}$ = {r.n_loc:.4g}")
    if isinstance(r.law, TableLaw):
        inside = r.law.z <= top * r.z_s
        axis.plot(r.law.z[inside] / r.z_s, r.law.F[inside] / r.load, ".", color=style.BLACK, ms=3, label="points")
    axis.plot(1.0, 1.0, "o", color=style.BLACK, ms=5, label="operating point", zorder=4)
    axis.axvspan(s[0], 0.0, color=style.PALE, lw=0)
    axis.annotate("flight", (0.5 * s[0], 0.5), xycoords=("data", "axes fraction"), ha="center", color=style.GREY)
    axis.set_xlim(s[0], top)
    axis.set_ylim(-0.6, 1.05 * float(force.max()))
    axis.set_xlabel("approach $z/z_s$")
    axis.set_ylabel("force over preload $F_s/W$")
    axis.legend(loc="upper left", framealpha=0.9, frameon=True, edgecolor="none")
    style.grid(axis)
    return figure


@style.styled
def backbone(
    oscillator: ContactOscillator, responses: Sequence[FrequencyResponse] = (), u_max: float | None = None, *,
    ax: style.Place | None = None,
) -> Figure:  # fmt: skip
    """Draw the backbone and the resonance peak of each forcing, computed by energy balance, on `ax` if given."""
    curve = oscillator.backbone(u_max)
    figure, (axis, *_) = style.figure(style.SINGLE + 0.6, 3.8, ax=ax)
    for r, colour in zip(responses, (style.SKY, style.ORANGE, style.GREEN, style.PURPLE) * 8, strict=False):
        for line in r.lines():
            axis.plot(line.Omega, line.a1, color=colour, lw=0.9)
        axis.plot([], [], color=colour, lw=0.9, label=f"response, $\\hat F$ = {r.setting.F_hat:g}")
    axis.plot(curve.omega_ratio, curve.a1, color=style.BLACK, label="backbone")
    limit = oscillator.u_max
    if limit <= curve.u0[-1]:
        orbit = oscillator.free(limit).orbits[0]
        axis.plot(orbit.omega, orbit.a1, "o", color=style.YELLOW, mec=style.BLACK, ms=6, zorder=4, label="contact loss")
    peaks = [p for p in oscillator.thresholds([r.setting.F_hat for r in responses]).peaks if p["Omega"] is not None]
    if peaks:
        axis.plot(
            [p["Omega"] for p in peaks],
            [p["a1"] for p in peaks],
            "*",
            color=style.VERMILION,
            ms=10,
            zorder=5,
            label="peak by energy balance",
        )
    tops = [curve.a1[-1]] + [float(b.a1.max()) for r in responses for b in r.branches]
    axis.set_ylim(0.0, 1.05 * max(tops) if responses else None)
    if responses:
        axis.set_xlim(*responses[0].omega)
    axis.set_xlabel("frequency $\\Omega = \\omega/\\omega_s$")
    axis.set_ylabel("first harmonic $a_1$")
    axis.set_title(f"{curve.law}; damping {oscillator.damping}", fontsize="small")
    axis.legend(loc="best")
    style.grid(axis)
    return figure


@style.styled
def phase_portrait(
    oscillator: ContactOscillator, path: Trajectory, omega: float, last: float = 3.0, *, ax: style.Place | None = None
) -> Figure:
    """Draw phase portrait and time history of the last forcing periods, with flight shaded.

    Args:
        oscillator: oscillator of the motion
        path: result of `ContactOscillator.simulate`
        omega: its Omega
        last: number of forcing periods shown
        ax: two axes to draw on; they are returned
    """
    period = 2.0 * np.pi / omega
    begin = max(path.tau[-1] - last * period, path.tau[0])
    shown = path.tau >= begin
    tau, u, v = (path.tau[shown] - begin) / period, path.u[shown], path.v[shown]
    figure, axes = style.figure(style.DOUBLE, 3.4, columns=2, ax=ax)
    style.titles(axes, ("phase portrait", "time history"))
    portrait, history = axes
    portrait.plot(u, v, color=style.BLUE, lw=1.0)
    history.plot(tau, u, color=style.BLUE)
    low = min(float(u.min()) * 1.08 - 0.05, -1.1)
    portrait.axvspan(low, -1.0, color=style.PALE, lw=0)
    portrait.set_xlim(low, 1.08 * float(u.max()) + 0.05)
    for a, b in path.flight:
        if b > begin:
            history.axvspan(max(a - begin, 0.0) / period, (b - begin) / period, color=style.PALE, lw=0)
    history.axhline(-1.0, color=style.GREY, lw=0.7)
    history.annotate(
        "contact lost below",
        (0.01, -1.0),
        xycoords=("axes fraction", "data"),
        xytext=(2, 3),
        textcoords="offset points",
        fontsize="x-small",
        color=style.GREY,
    )
    history.set_xlim(0.0, float(tau[-1]))
    portrait.set_xlabel("displacement $u$")
    portrait.set_ylabel("speed $du/d\\tau$")
    history.set_xlabel("time / forcing period")
    history.set_ylabel("displacement $u$")
    style.grid(portrait, history)
    if ax is None:
        figure.suptitle(
            f"$\\Omega$ = {omega:g}, $\\zeta$ = {oscillator.zeta:g}, damping {oscillator.damping}; grey: flight"
        )
    return figure


@style.styled
def stability_chart(
    oscillator: ContactOscillator, forcing: ArrayLike, omega: Sequence[float] = (0.4, 2.3), *, tol: float = 1e-4,
    ax: style.Place | None = None,
) -> Figure:  # fmt: skip
    """Draw folds, period doublings and grazing in the plane of frequency and forcing.

    Args:
        oscillator: the oscillator
        forcing: values of F^, one response each
        omega: lowest and highest Omega
        tol: see `ContactOscillator.response`
        ax: axes to draw on; they are returned
    """
    marks = {
        "fold": (style.BLUE, "fold (jump)"),
        "period doubling": (style.VERMILION, "period doubling"),
        "grazing": (style.GREEN, "onset of contact loss"),
    }
    points: dict[str, list[tuple[float, float]]] = {name: [] for name in marks}
    values = positives("forcing", forcing)
    for f in values:
        try:
            r = oscillator.response(f, omega, tol=tol, subharmonics=False)
        except AsperityError:
            continue
        for e in r.events:
            points[e.kind].append((e.Omega, f))
    figure, (axis, *_) = style.figure(style.SINGLE + 1.2, 3.9, ax=ax)
    for name, (colour, text) in marks.items():
        if points[name]:
            x, y = np.array(points[name]).T
            axis.plot(x, y, ".", color=colour, ms=4, label=text)
    t = oscillator.thresholds()
    for value, name, text, side in (
        (t.hysteresis, "fold", "hysteresis", "top"),
        (t.contact_loss, "grazing", "contact loss", "bottom"),
        (t.period_doubling, "period doubling", "period doubling", "bottom"),
    ):
        if value is not None and min(values) < value < max(values):
            axis.axhline(value, color=marks[name][0], lw=0.8, ls=":")
            axis.annotate(
                f"onset of {text}",
                (0.99, value),
                xycoords=("axes fraction", "data"),
                ha="right",
                va=side,
                fontsize="x-small",
                color=marks[name][0],
            )
    axis.set_yscale("log")
    axis.set_xlim(*omega)
    axis.set_xlabel("frequency $\\Omega = \\omega/\\omega_s$")
    axis.set_ylabel("forcing $\\hat F = F/(n\\,W)$")
    axis.set_title(
        f"{oscillator.law.describe()}, $\\zeta$ = {oscillator.zeta:g}, damping {oscillator.damping}", fontsize="small"
    )
    style.legend(figure, [axis], ax, axis.get_legend_handles_labels()[0], 3)
    style.grid(axis)
    return figure


def plot_dynamics(result: Dynamics, directory: str | os.PathLike[str]) -> list[Path]:
    """Draw the figures of a result of `run_dynamics` into a directory; return the files written."""
    folder = Path(directory)
    folder.mkdir(parents=True, exist_ok=True)
    first = next(iter(result.oscillators.values()))
    responses = [r for group in result.responses.values() for r in group]
    sweeps = [s for group in result.sweeps.values() for s in group]
    scale = Scale.of(result.to_dict())
    figures = {
        "frequency": natural_frequency(list(result.oscillators.values()), scale),
        "response": amplitude_frequency(responses, sweeps, result.bands, scale),
        "receptance": receptance_of(result),
    }
    if first.model == "exact":
        top = max(max(float(b.u_max.max()) for b in r.branches) for r in result.responses["exact"])
        figures["operating-point"] = operating_point(first)
        figures["backbone"] = backbone(first, result.responses["exact"], 1.05 * top)
        strongest = max(r.setting.F_hat for r in result.responses["exact"])
        if first.zeta > 0.0:
            window = (responses[0].omega[0], max(responses[0].omega[1], 2.2))
            figures["stability"] = stability_chart(first, np.geomspace(0.1, 10.0, _CHART) * strongest, window)
        r = result.responses["exact"][-1]
        omega = r.peak[0]
        best = max(r.at(min(omega * 1.02, r.omega[1])), key=lambda s: (s.stable, s.u_max), default=None)
        if best is not None:
            u, v = best.start
            path = first.simulate(best.Omega, r.setting.F_hat, u=u, v=v, periods=3.0, samples=256)
            figures["phase"] = phase_portrait(first, path, best.Omega)
    return [path for name, figure in figures.items() for path in style.save_in(folder, name, figure)]
