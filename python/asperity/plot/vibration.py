"""Figures of vibration, free, forced and short, and of slip: its loops, damping and response."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import cycle
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import PathPatch
from matplotlib.path import Path
from numpy.typing import NDArray

from asperity.arrays import Array
from asperity.output.results import Columns, Results
from asperity.plot import style
from asperity.slip.joint_slip import JointSlip
from asperity.units import prefix, quantity

MODELS = {"exact": (style.BLUE, "-", "exact law"), "taylor": (style.VERMILION, "--", "Taylor law")}
DASHES = (0, (3, 1.5))  # offset, and lengths of line and gap [line widths]
#: Excitation -> symbol of its dimensionless amplitude.
SYMBOLS = {"force": "$\\hat{F}$", "base": "base $b/z_s$", "acceleration": "base $\\ddot b/(\\omega_s^2 z_s)$"}
_MARKS = {"fold": ("o", "fold"), "period doubling": ("s", "period doubling")}
_ACTS = {"contact": "in contact", "hunt-crossley": "after Hunt and Crossley"}
_Event = Mapping[str, Any]  # special orbit as in thresholds.json, with its model and forcing
_FAINT = 0.35  # opacity of what is not physical
_FLOOR = 1.5  # the axis of the receptance begins at its smallest value over this


def heading(zeta: Iterable[float], damping: str | None, n_loc: float | None) -> str:
    """Title: local exponent, damping ratio, damping model."""
    exponent = f"$n_{{loc}}$ = {n_loc:.4g}, " if n_loc else ""
    acting = f", acting {_ACTS.get(damping, damping)}" if damping else ""
    return f"{exponent}damping ratio $\\zeta$ = {', '.join(f'{value:g}' for value in zeta)}{acting}"


def scales(thresholds: Mapping[str, Any]) -> tuple[float, float, bool]:
    """Static approach z_s [length] and frequency of small vibration [1/time], and whether they are in m and Hz.

    They are those of thresholds.json: NaN where unknown, as of an assumed law, which has no units.
    """
    if thresholds.get("laws") is None and not thresholds.get("joint"):
        return np.nan, np.nan, False
    frequency = (thresholds.get("numbers") or {}).get("f")
    return float(thresholds["z_s"]), np.nan if frequency is None else frequency, thresholds.get("units") != "other"


def _physical(axis: Any, thresholds: Mapping[str, Any], lengths: str, frequencies: str = "") -> None:
    """Add physical axes of the displacement at one side and of the frequency at another, where they are known."""
    length, frequency, si = scales(thresholds)
    style.physical_axis(axis, lengths, "displacement", length, "m" if si else "")
    if frequencies:
        style.physical_axis(axis, frequencies, "frequency", frequency, "Hz" if si else "")


def _coloured(rows: Columns) -> list[tuple[float, str]]:
    """Each amplitude of the excitation in rows of response.csv, with its colour."""
    forcings = [float(forcing) for forcing in np.unique(rows["F_hat"])]
    return list(zip(forcings, np.resize(style.COLOURS, len(forcings)).tolist(), strict=True))


def _in_words(thresholds: Mapping[str, Any], forcing: float) -> str:
    """An amplitude of the excitation: dimensionless, and as a force in newton and over the preload, where known."""
    driven, n_loc, load = thresholds.get("excitation", "force"), thresholds.get("n_loc"), thresholds.get("load")
    text = f"{SYMBOLS[driven]} = {forcing:.3g}"
    if not n_loc or driven != "force":
        return text
    newton = f"{quantity(n_loc * forcing * load, 'N', 3)} = " if load and scales(thresholds)[2] else ""
    return f"{text}, $F$ = {newton}{n_loc * forcing:.3g} $W$"


@style.styled
def frequency(results: Results) -> Figure:
    """Natural frequency over the amplitude of free vibration about the static deflection. Beyond the dot contact is
    lost (exact law), or the Taylor law pulls although there is no contact.
    """
    figure, (axis,) = style.figure(style.SINGLE + 0.8, 3.7, "natural frequency of free vibration")
    for model, (colour, line, text) in MODELS.items():
        rows = where(results.free, results.free["model"] == model)
        u, omega, low = rows["u0"], rows["omega_ratio"], rows["u_min"]
        if not len(u):
            continue
        axis.plot(u, omega, line, color=colour, label=text)
        kept = np.flatnonzero(low >= -1.0)
        if 0 < len(kept) < len(u):
            last = slice(kept[-1], kept[-1] + 2)
            at = (np.interp(1.0, -low[last], values[last]) for values in (u, omega))
            words = "contact lost beyond" if model == "exact" else "unphysical beyond"
            axis.plot(*at, "o", color=colour, ms=5, zorder=4, label=words)
    axis.axhline(1.0, color=style.GREY, lw=0.7)
    axis.set(xlabel="amplitude $u_0 = (z_0 - z_s)/z_s$", ylabel="natural frequency $\\omega_n/\\omega_s$")
    axis.set_xlim(left=0)
    axis.legend(loc="best")
    _physical(axis, results.thresholds, "top", "right")
    return figure


@style.styled
def response(results: Results) -> Figure:
    """Forced vibration: largest displacement over the excitation frequency. Diamonds joined by a dotted line mark the
    onset of contact loss.

    Stable pieces are solid, others dashed. Where a law is stiffer by a factor s^2, its response has frequencies s times
    as high and displacements 1/s^2 as large: what the error bar of the stiffness makes of the stable exact one so is
    shaded.
    """
    rows, t = results.response, results.thresholds
    driven, n_loc = t.get("excitation", "force"), t.get("n_loc")
    models = [model for model in MODELS if model in rows["model"]]
    events = [
        e | {"model": model, "F_hat": r["F_hat"]}
        for model in MODELS for r in t.get(model, {}).get("responses", ()) for e in r.get("events", ())
        if model == "exact" or e["u_min"] >= -1.0  # physical
    ]  # fmt: skip
    known = (t.get("numbers") or {}).get("k_n_bar")
    bar = np.sqrt(1.0 + known * np.array([-1.0, 1.0])) if known and known < 1.0 and driven != "base" else None
    figure, axes = style.figure(1.2 + 4.0 * len(models), 4.4, *(MODELS[model][2] for model in models))
    physical = (rows["model"] == "exact") | (rows["u_min"] >= -1.0)
    for axis, model in zip(axes, models, strict=True):
        for forcing, colour in _coloured(rows):
            of = where(rows, (rows["model"] == model) & (rows["F_hat"] == forcing))
            _branches(axis, of, "u_max", model, colour)
            if model == "exact" and bar is not None:
                _shade(axis, of, bar, colour)
            _events(axis, [e for e in events if e["model"] == model and e["F_hat"] == forcing])
        about = "" if driven == "force" else " relative to the base"
        axis.set(xlabel="frequency $\\Omega = \\omega/\\omega_s$", ylabel=f"largest displacement{about} $u_{{\\max}}$")
        top = np.nanmax(rows["u_max"][physical | ~physical.any()])
        axis.set(xlim=(rows["Omega"].min(), rows["Omega"].max()), ylim=(0, 1.1 * top))
        _physical(axis, t, "right", "top")
    keys = [Line2D([], [], color=colour, label=_in_words(t, forcing)) for forcing, colour in _coloured(rows)]
    shown = {e["kind"] for e in events}
    keys += _line_keys(shown, bool(physical.all()), bar is not None)
    figure.legend(handles=keys, loc="outside lower center", ncols=2 if len(models) == 1 else 4)
    figure.suptitle(heading(np.unique(rows["zeta"]), t.get("damping"), n_loc))
    return figure


def _branches(axis: Any, rows: Columns, column: str, model: str, colour: str) -> None:
    """Draw a column over the frequency, piece by piece: solid where stable, else dashed, faint where unphysical."""
    for piece in _pieces(rows):
        valid = (piece["u_min"] >= -1.0) | (model == "exact")
        style_of = "-" if truth(piece["stable"])[0] else DASHES
        for shown, opacity in ((valid, 1.0), (~valid, _FAINT)):
            if shown.any():
                near = shown | np.append(shown[1:], False)  # the line up to where it becomes unphysical
                y = np.where(near if opacity < 1.0 else shown, piece[column], np.nan)
                axis.plot(piece["Omega"], y, ls=style_of, color=colour, lw=1.2, zorder=2, alpha=opacity)


def _pieces(rows: Columns) -> Iterator[Columns]:
    """Rows of each piece of the branch of each damping ratio."""
    for zeta, number in sorted({*zip(rows["zeta"].tolist(), rows["branch"].tolist(), strict=True)}):
        yield where(rows, (rows["zeta"] == zeta) & (rows["branch"] == number))


def _shade(axis: Any, rows: Columns, bar: Array, colour: str) -> None:
    """Fill what the stable pieces sweep, frequencies times s and displacements over s^2, s between two factors."""
    for piece in _pieces(rows):
        line = np.stack([piece["Omega"], piece["u_max"]], axis=1)
        low, high = (line * (s, s**-2.0) for s in bar)
        corners = np.stack([low[:-1], low[1:], high[1:], high[:-1]], axis=1)  # of what each straight line sweeps
        one, two = corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1]
        turned = one[:, 0] * two[:, 1] < one[:, 1] * two[:, 0]  # an area is filled where all are positive
        corners[turned] = corners[turned, ::-1]
        if truth(piece["stable"])[0] and len(corners):
            whole = Path.make_compound_path(*(Path([*c, c[0]], closed=True) for c in corners))
            axis.add_patch(PathPatch(whole, fc=colour, alpha=0.5 * _FAINT, lw=0))


def _events(axis: Any, events: Sequence[_Event]) -> None:
    """Draw folds, period doublings, and the line through the onsets of contact loss."""
    for e in events:
        if e["kind"] in _MARKS:
            axis.plot(e["Omega"], e["u_max"], _MARKS[e["kind"]][0], color=style.BLACK, ms=3.5, mfc="white", zorder=5)
    points = sorted((e["Omega"], e["u_max"]) for e in events if e["kind"] == "grazing" and e["model"] == "exact")
    if points:
        axis.plot(*zip(*points, strict=True), "d:", color=style.GREEN, ms=4, lw=1.0, zorder=5)


def _line_keys(shown: set[str], physical: bool, band: bool) -> list[Line2D]:
    """Legend entries of the line styles and marks in the figure."""
    mark: dict[str, Any] = {"ls": "", "mfc": "white", "ms": 4}
    keys = [
        Line2D([], [], color=style.GREY, label="stable"),
        Line2D([], [], color=style.GREY, ls=DASHES, label="unstable"),
    ]
    for name, (marker, text) in _MARKS.items():
        if name in shown:
            keys.append(Line2D([], [], label=text, marker=marker, color=style.BLACK, **mark))
    if "grazing" in shown:
        keys.append(Line2D([], [], color=style.GREEN, marker="d", ls=":", ms=4, label="contact loss begins"))
    if not physical:
        keys.append(Line2D([], [], color=style.GREY, alpha=_FAINT, label="unphysical ($u_{min}<-1$)"))
    if band:
        keys.append(Line2D([], [], color=style.GREY, lw=6, alpha=0.5 * _FAINT, label="error bar of the stiffness"))
    return keys


@style.styled
def receptance(results: Results) -> Figure:
    """Frequency response function: amplitude at the forcing frequency over the force. A linear contact has one curve
    for all forces; the peak of each force lies on its backbone.
    """
    rows, free, t = results.response, results.free, results.thresholds
    of_base = t.get("excitation", "force") != "force"
    model = "exact" if "exact" in rows["model"] else str(rows["model"][0])
    rows = where(rows, rows["model"] == model)
    free = where(free, free["model"] == model) if "a1" in free and not of_base else {}
    value: Array = rows["transmissibility"] if of_base else rows["a1"] / rows["F_hat"]
    rows, zeta = {**rows, "value": value}, float(rows["zeta"][0])
    figure, (axis,) = style.figure(style.SINGLE + 1.6, 4.0, heading([zeta], t.get("damping"), t.get("n_loc")))
    grid = np.linspace(rows["Omega"].min(), rows["Omega"].max(), 2001)
    with np.errstate(divide="ignore"):  # without damping, at resonance
        linear = (np.hypot(1.0, 2.0 * zeta * grid) if of_base else 1.0) / np.hypot(1.0 - grid**2, 2.0 * zeta * grid)
    axis.plot(grid, linear, color=style.GREY, lw=0.8, label="linear")
    for forcing, colour in _coloured(rows):
        of = where(rows, rows["F_hat"] == forcing)
        _branches(axis, of, "value", model, colour)
        axis.plot([], [], color=colour, label=_in_words(t, forcing))
        if free:
            reached = free["a1"] <= of["a1"].max()
            axis.plot(free["omega_ratio"][reached], free["a1"][reached] / forcing, ":", color=colour, lw=1.0)
    if free:
        axis.plot([], [], ":", color=style.GREY, label="backbone of each force")
    if not truth(rows["stable"]).all():
        axis.plot([], [], ls=DASHES, color=style.GREY, label="unstable")
    low, high = value[value > 0.0].min() / _FLOOR, 1.3 * value.max()  # 0 where orbits have no first harmonic
    axis.set(xlim=(grid[0], grid[-1]), ylim=(low, high), xlabel="frequency $\\Omega = \\omega/\\omega_s$")
    style.logarithmic(axis, "y")
    _, frequency, si = scales(t)
    style.physical_axis(axis, "top", "frequency", frequency, "Hz" if si else "")
    if of_base:
        axis.set_ylabel("transmissibility, mass over base")
    else:
        axis.set_ylabel("receptance $k_n|X/F|$")
        compliance = 1.0 / t["numbers"]["k_n"] if np.isfinite(frequency) else np.nan
        style.physical_axis(axis, "right", "receptance $|X/F|$", compliance, "m/N" if si else "")
    axis.legend(loc="best")
    return figure


@style.styled
def motion(results: Results) -> Figure:
    """Motion in time from rest, relative to the base where it moves: displacement, and the force above it. Shaded: out
    of contact.
    """
    rows, (_, frequency, si) = results.motion, scales(results.thresholds)
    shapes = [str(shape) for shape in dict.fromkeys(rows["shape"])]
    known, factor, text = bool(np.isfinite(frequency)), 1.0, "time $\\omega_s t$"
    if known:
        factor, second = prefix(float(np.nanmax(rows["time"])), "s" if si else "")
        text = style.label("time", second)
    figure, axes = style.figure(style.DOUBLE, 1.0 + 2.1 * len(shapes), *shapes, rows=len(shapes), sharex=True)
    for axis, shape in zip(axes, shapes, strict=True):
        of = where(rows, rows["shape"] == shape)
        t, u = factor * of["time" if known else "tau"], of["u"]
        axis.fill_between(t, 0, 1, where=u < -1.0, transform=axis.get_xaxis_transform(), color=style.PALE, lw=0)
        driven = SYMBOLS[results.thresholds.get("excitation", "force")]
        axis.plot(t, of["F_hat"], color=style.VERMILION, lw=0.9, label=driven)
        axis.plot(t, u, color=style.BLUE, lw=1.1, label="displacement $u$")
        axis.set(xlim=(t[0], t[-1]), ylabel="$u = (z - z_s)/z_s$")
        _physical(axis, results.thresholds, "right")
    axes[0].legend(loc="best", ncols=2)
    axes[-1].set_xlabel(text)
    return figure


@style.styled
def slip(results: Results) -> Figure:
    """(a) Loops of the tangential force T over the displacement by slip, u less the displacement T/k without slip; the
    stiffness k is that at rest. The normal curve of like bodies gives the loops, whose area is the energy of a cycle.
    (b) Loss factor, twice the damping ratio. (c) Amplitude of the force over that of the displacement. The limit of
    friction is μP.
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
def slip_response(found: JointSlip) -> Figure:
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


def where(columns: Columns, mask: NDArray[np.bool_]) -> Columns:
    """Some rows of columns."""
    return {name: column[mask] for name, column in columns.items()}


def truth(column: NDArray[Any]) -> NDArray[np.bool_]:
    """Truth values of a column, written as True, true or 1."""
    return np.isin(np.char.lower(column.astype(str)), ("true", "1", "1.0"))
