"""Figures of the dynamics; every function returns a matplotlib Figure, none shows or saves it.

The damping model stands on every figure, for it decides the physics.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from asperity.dynamics.branch import Branch
from asperity.dynamics.law import Array
from asperity.dynamics.oscillator import ContactOscillator
from asperity.dynamics.response import FrequencyResponse
from asperity.dynamics.run import Dynamics
from asperity.dynamics.sweep import ESCAPED, NOT_SETTLED, Sweep
from asperity.dynamics.table import TableLaw
from asperity.dynamics.trajectory import Trajectory
from asperity.dynamics.uncertainty import Band
from asperity.errors import AsperityError
from asperity.plot import style

_COLOURS = {"exact": style.BLUE, "taylor": style.VERMILION}
_DASHES = (0, (3, 1.5))
_NAMES = {"exact": "exact law", "taylor": "Taylor law"}


@style.styled
def operating_point(oscillator: ContactOscillator) -> Figure:
    """Force against deflection: the law, the operating point, its tangent and the Taylor series."""
    r = oscillator.restoring
    series = oscillator.taylor()
    top = min(2.2, 1.0 + r.u_range[1])
    s = np.linspace(-0.6, top, 400)
    figure, axis = style.figure(style.SINGLE + 0.6, 3.4)
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
    axis.set_xlabel("deflection $z/z_s$")
    axis.set_ylabel("force $F_s/(m g)$")
    axis.legend(loc="upper left", framealpha=0.9, frameon=True, edgecolor="none")
    style.grid(axis)
    return figure


@style.styled
def natural_frequency(oscillators: Sequence[ContactOscillator]) -> Figure:
    """omega/omega_s against the amplitude of release, with the contact-loss mark of each law."""
    figure, axis = style.figure(style.SINGLE + 0.6, 3.4)
    colours = iter((style.BLUE, style.VERMILION, style.GREEN, style.PURPLE, style.ORANGE, style.BLACK) * 4)
    marked = False
    for oscillator in oscillators:
        free = oscillator.free()
        physical = np.array(free.valid)
        colour = _COLOURS[free.model] if len(oscillators) <= 2 else next(colours)
        (line,) = axis.plot(
            free.u0[physical],
            free.omega_ratio[physical],
            color=colour,
            label=free.law if len(oscillators) > 2 else _NAMES[free.model],
        )
        if not physical.all():
            beyond = slice(max(int(np.argmin(physical)) - 1, 0), None)
            axis.plot(free.u0[beyond], free.omega_ratio[beyond], ":", color=colour, label="unphysical: $u_{min}<-1$")
        limit = oscillator.u_max
        if oscillator.model == "exact" and limit <= free.u0[-1]:
            axis.plot(
                limit,
                oscillator.free(limit).omega_ratio[0],
                "o",
                color=line.get_color(),
                ms=5,
                label=None if marked else "contact loss",
                zorder=4,
            )
            marked = True
    axis.axhline(1.0, color=style.GREY, lw=0.7)
    axis.set_xlim(left=0.0)
    axis.set_xlabel("amplitude $u_0 = (z_0 - z_s)/z_s$")
    axis.set_ylabel("natural frequency $\\omega/\\omega_s$")
    axis.legend(loc="best")
    style.grid(axis)
    return figure


@style.styled
def amplitude_frequency(
    responses: Sequence[FrequencyResponse], sweeps: Sequence[Sweep] = (), band: Band | None = None
) -> Figure:
    """Greatest deflection against frequency: solid stable, dashed unstable, folds, jumps, sweeps, contact loss.

    Args:
        responses: one panel per model; several forcings share a panel.
        sweeps: shown as triangles in the panel of their model.
        band: confidence band of the exact response.
    """
    models = list(dict.fromkeys(r.setting.model for r in responses))
    figure, axes = style.figure(0.8 + 3.7 * len(models), 3.8, columns=len(models))
    exact = [r for r in responses if r.setting.model == "exact"] or list(responses)
    top = max(float(b.u_max[b.valid].max(initial=0.0)) for r in exact for b in r.branches)
    for model, axis in zip(models, np.atleast_1d(axes), strict=True):
        chosen = [r for r in responses if r.setting.model == model]
        for r, colour in zip(chosen, (style.BLUE, style.VERMILION, style.GREEN, style.PURPLE) * 8, strict=False):
            for b in r.branches:
                _branch(axis, b, colour)
            first = r.branches[0]
            text = f"$\\hat F$ = {r.setting.F_hat:g}, $F/(mg)$ = {r.setting.F_over_mg:g}"
            axis.plot([], [], color=colour, label=text)
            _events(axis, r)
            for s in sweeps:
                if s.setting == r.setting:
                    ok = np.array([x not in (ESCAPED, NOT_SETTLED) for x in s.status])
                    axis.plot(
                        s.Omega[ok],
                        s.u_max[ok],
                        "^" if s.direction == "up" else "v",
                        color=colour,
                        mfc="white",
                        ms=3.2,
                        mew=0.7,
                        zorder=3,
                    )
            if model == "exact":
                _contact_line(axis, first.Omega, r)
        if band is not None and model == "exact":
            for edge in (band.upper, band.lower):
                axis.fill_between(band.Omega, edge[0], edge[1], color=style.SKY, alpha=0.35, lw=0)
            axis.fill_between([], [], [], color=style.SKY, alpha=0.35, label="95 % band of the law")
        axis.set_title(_NAMES[model])
        axis.set_xlabel("frequency $\\Omega = \\omega/\\omega_s$")
        axis.set_ylabel("greatest deflection $u_{max}$")
        axis.set_xlim(*chosen[0].omega)
        axis.set_ylim(0.0, 1.1 * top)
        style.grid(axis)
        axis.legend(loc="upper right", fontsize=7, handlelength=1.2)
    _key(figure, bool(sweeps), any(not r.valid for r in responses), 2 * len(models))
    figure.suptitle(_damping(responses[0].setting), fontsize=9)
    return figure


@style.styled
def backbone(
    oscillator: ContactOscillator, responses: Sequence[FrequencyResponse] = (), u_max: float | None = None
) -> Figure:
    """Backbone with the resonance peak of each forcing, found by energy balance without any sweep."""
    curve = oscillator.backbone(u_max)
    figure, axis = style.figure(style.SINGLE + 0.6, 3.6)
    for r, colour in zip(responses, (style.SKY, style.ORANGE, style.GREEN, style.PURPLE) * 8, strict=False):
        for b in r.branches:
            axis.plot(b.Omega, b.a1, color=colour, lw=0.9)
        axis.plot([], [], color=colour, lw=0.9, label=f"response, $\\hat F$ = {r.setting.F_hat:g}")
    axis.plot(curve.omega, curve.a1, color=style.BLACK, label="backbone")
    limit = oscillator.u_max
    if limit <= curve.u_max[-1]:
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
    axis.set_title(f"{curve.law}; damping {curve.damping}", fontsize=8)
    axis.legend(loc="best")
    style.grid(axis)
    return figure


@style.styled
def phase_portrait(oscillator: ContactOscillator, path: Trajectory, omega: float, last: float = 3.0) -> Figure:
    """Phase portrait and time history of the last forcing periods, flight shaded.

    Args:
        oscillator: where the motion comes from.
        path: result of `ContactOscillator.simulate`.
        omega: its Omega.
        last: forcing periods shown.
    """
    period = 2.0 * np.pi / omega
    begin = max(path.tau[-1] - last * period, path.tau[0])
    shown = path.tau >= begin
    tau, u, v = (path.tau[shown] - begin) / period, path.u[shown], path.v[shown]
    figure, (portrait, history) = style.figure(style.DOUBLE, 3.2, columns=2)
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
        fontsize=7,
        color=style.GREY,
    )
    history.set_xlim(0.0, float(tau[-1]))
    portrait.set_xlabel("deflection $u$")
    portrait.set_ylabel("speed $du/d\\tau$")
    history.set_xlabel("time / forcing period")
    history.set_ylabel("deflection $u$")
    style.grid(portrait, history)
    style.letters(portrait, history)
    figure.suptitle(
        f"$\\Omega$ = {omega:g}, $\\zeta$ = {oscillator.zeta:g}, damping {oscillator.damping}; grey: flight", fontsize=9
    )
    return figure


@style.styled
def stability_chart(
    oscillator: ContactOscillator, forcing: Sequence[float], omega: Sequence[float] = (0.4, 2.3), *, tol: float = 1e-4
) -> Figure:
    """Where folds, period doublings and grazing lie in the plane of frequency and forcing.

    Args:
        oscillator: the oscillator.
        forcing: values of F^, one response each.
        omega: window of Omega.
        tol: see `ContactOscillator.response`.
    """
    marks = {
        "fold": (style.BLUE, "fold (jump)"),
        "period doubling": (style.VERMILION, "period doubling"),
        "grazing": (style.GREEN, "onset of contact loss"),
    }
    points: dict[str, list[tuple[float, float]]] = {name: [] for name in marks}
    for f in forcing:
        try:
            r = oscillator.response(f, omega, tol=tol, subharmonics=False)
        except AsperityError:
            continue
        for e in r.events:
            points[e.kind].append((e.Omega, f))
    figure, axis = style.figure(style.SINGLE + 1.2, 3.8)
    for name, (colour, text) in marks.items():
        if points[name]:
            x, y = np.array(points[name]).T
            axis.plot(x, y, ".", color=colour, ms=4, label=text)
    t = oscillator.thresholds()
    for value, name, text, x, side in (
        (t.hysteresis, "fold", "hysteresis", 0.99, "right"),
        (t.contact_loss, "grazing", "contact loss", 0.01, "left"),
        (t.period_doubling, "period doubling", "period doubling", 0.99, "right"),
    ):
        if value is not None and min(forcing) < value < max(forcing):
            axis.axhline(value, color=marks[name][0], lw=0.8, ls=":")
            axis.annotate(
                f"onset of {text}",
                (x, value),
                xycoords=("axes fraction", "data"),
                ha=side,
                va="bottom",
                fontsize=7,
                color=marks[name][0],
            )
    axis.set_yscale("log")
    axis.set_xlim(*omega)
    axis.set_xlabel("frequency $\\Omega = \\omega/\\omega_s$")
    axis.set_ylabel("forcing $\\hat F = F/(n\\,m g)$")
    axis.set_title(
        f"{oscillator.law.describe()}, $\\zeta$ = {oscillator.zeta:g}, damping {oscillator.damping}", fontsize=8
    )
    figure.legend(loc="outside lower center", ncols=3)
    style.grid(axis)
    return figure


def save_figures(result: Dynamics, directory: str | os.PathLike[str]) -> list[Path]:
    """Draw the figures of a run into a directory; returns the files written."""
    folder = Path(directory)
    folder.mkdir(parents=True, exist_ok=True)
    first = next(iter(result.oscillators.values()))
    responses = [r for group in result.responses.values() for r in group]
    sweeps = [s for group in result.sweeps.values() for s in group]
    figures = {
        "frequency": natural_frequency(list(result.oscillators.values())),
        "response": amplitude_frequency(responses, sweeps),
    }
    if first.model == "exact":
        top = max(max(float(b.u_max.max()) for b in r.branches) for r in result.responses["exact"])
        figures["operating-point"] = operating_point(first)
        figures["backbone"] = backbone(first, result.responses["exact"], 1.05 * top)
        r = result.responses["exact"][-1]
        omega = r.peak[0]
        best = max(r.at(min(omega * 1.02, r.omega[1])), key=lambda s: (s.stable, s.u_max), default=None)
        if best is not None:
            k = np.arange(best.coefficients.size)
            v = float((1j * k * best.coefficients).sum().real) * best.Omega / best.order
            path = first.simulate(
                best.Omega, r.setting.F_hat, u=float(best.coefficients.sum().real), v=v, periods=3.0, samples=256
            )
            figures["phase"] = phase_portrait(first, path, best.Omega)
    return [style.save(figure, folder / f"{name}.png") for name, figure in figures.items()]


def _branch(axis: Any, branch: Branch, colour: str) -> None:
    """Line of a branch: solid where stable, dashed where not, faint where unphysical."""
    state = branch.stable.astype(int) + 2 * branch.valid.astype(int)
    starts = np.flatnonzero(np.diff(state, prepend=-1))
    for a, b in zip(starts, [*starts[1:], len(branch)], strict=True):
        piece = slice(a, min(b + 1, len(branch)))
        axis.plot(
            branch.Omega[piece],
            branch.u_max[piece],
            ls="-" if branch.stable[a] else _DASHES,
            color=colour,
            lw=1.4 if branch.kind == "main" else 1.0,
            alpha=1.0 if branch.valid[a] else 0.35,
        )


def _events(axis: Any, response: FrequencyResponse) -> None:
    """Folds with their jump arrows, and period doublings."""
    for e in response.events:
        valid = response.branches[e.branch].valid.all() or e.u_min >= -1.0
        if e.kind == "fold" and valid:
            axis.plot(e.Omega, e.u_max, "o", color=style.BLACK, ms=3.5, mfc="white", zorder=5)
            inside = min(max(e.Omega, response.omega[0]), response.omega[1])
            landing = [s.u_max for s in response.at(inside) if s.stable and abs(s.u_max - e.u_max) > 0.03 * e.u_max]
            if landing:
                to = min(landing, key=lambda u: abs(u - e.u_max))
                axis.annotate(
                    "",
                    (e.Omega, to),
                    (e.Omega, e.u_max),
                    zorder=4,
                    arrowprops={"arrowstyle": "->", "lw": 0.8, "color": style.GREY},
                )
        elif e.kind == "period doubling" and valid:
            axis.plot(e.Omega, e.u_max, "s", color=style.BLACK, ms=3.5, mfc="white", zorder=5)


def _contact_line(axis: Any, omega: Array, response: FrequencyResponse) -> None:
    """Line through the grazing points, beyond which contact is lost."""
    points = sorted((e.Omega, e.u_max) for e in response["grazing"])
    if len(points) > 1:
        axis.plot(*zip(*points, strict=True), ":", color=style.GREEN, lw=1.0, zorder=2)
    for x, y in points:
        axis.plot(x, y, "d", color=style.GREEN, ms=4, zorder=5)


def _key(figure: Figure, sweeps: bool, unphysical: bool, columns: int) -> None:
    """Legend of the line and mark styles, below the panels."""
    from matplotlib.lines import Line2D

    grey: dict[str, Any] = {"color": style.GREY}
    dots: dict[str, Any] = {"ls": "", "mfc": "white", "color": style.BLACK, "ms": 4}
    keys = [
        Line2D([], [], label="stable", **grey),
        Line2D([], [], ls=_DASHES, label="unstable", **grey),
        Line2D([], [], marker="o", label="fold, with jump", **dots),
        Line2D([], [], marker="d", ls=":", color=style.GREEN, ms=4, label="contact loss begins"),
    ]
    if sweeps:
        keys += [Line2D([], [], marker="^", label="sweep up", **dots), Line2D([], [], marker="v", label="down", **dots)]
    if unphysical:
        keys.append(Line2D([], [], alpha=0.35, label="unphysical ($u_{min}<-1$)", **grey))
    figure.legend(handles=keys, loc="outside lower center", ncols=columns)


def _damping(setting: Any) -> str:
    return f"$n_{{loc}}$ = {setting.n_loc:.4g}, $\\zeta$ = {setting.zeta:g}, damping {setting.damping}"
