"""Vibration of a mass on the contact: natural frequency and forced response."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from numpy.typing import NDArray

from asperity.plot import style
from asperity.results import Array, Columns, Results

_MODELS = {"exact": (style.BLUE, "-", "exact law"), "taylor": (style.VERMILION, "--", "Taylor law")}
_FORCINGS = (style.BLUE, style.VERMILION, style.GREEN, style.PURPLE, style.ORANGE, style.BLACK)
_MARKS = {"sweep-up": ("^", "sweep up"), "sweep-down": ("v", "sweep down")}

_DASHES = (0, (3, 1.5))
_LOSS: dict[str, Any] = {"color": style.YELLOW, "lw": 5, "alpha": 0.6}


@style.styled
def frequency(results: Results) -> Figure:
    """Natural frequency against the amplitude of release, with the loss of contact."""
    figure, axis = style.figure(style.SINGLE + 0.4, 3.2)
    for model, (colour, line, text) in _MODELS.items():
        rows = _where(results.free, results.free["model"] == model)
        if not len(rows["u0"]):
            continue
        u, omega = rows["u0"], rows["omega_ratio"]
        kept = rows["u_min"] >= -1.0
        axis.plot(u, omega, line, color=colour, label=text)
        if kept.any() and not kept.all():
            last = int(np.flatnonzero(kept)[-1])
            meaning = "contact lost beyond" if model == "exact" else "unphysical beyond"
            axis.plot(u[last], omega[last], "o", color=colour, ms=5, label=meaning, zorder=4)
    axis.axhline(1.0, color=style.GREY, lw=0.7)
    axis.set_xlabel("amplitude $u_0 = (z_0 - z_s)/z_s$")
    axis.set_ylabel("natural frequency $\\omega_n/\\omega_s$")
    axis.set_xlim(left=0)
    axis.legend(loc="best")
    style.grid(axis)
    return figure


@style.styled
def response(results: Results) -> Figure:
    """Greatest deflection against the frequency of excitation, for each model and forcing."""
    rows = results.response
    models = [model for model in _MODELS if model in rows["model"]]
    figure, axes = style.figure(0.6 + 3.6 * len(models), 3.6, columns=len(models))
    forcings = np.unique(rows["F_hat"])
    shown: set[str] = set()
    for axis, model in zip(np.atleast_1d(axes), models, strict=True):
        for forcing, colour in zip(forcings, np.resize(_FORCINGS, len(forcings)), strict=True):
            chosen = _where(rows, (rows["model"] == model) & (rows["F_hat"] == forcing))
            for name in np.unique(chosen["branch"]):
                shown.add(str(name))
                _branch(axis, _where(chosen, chosen["branch"] == name), str(name), colour)
        axis.set_title(_MODELS[model][2])
        axis.set_xlabel("frequency $\\Omega = \\omega/\\omega_s$")
        axis.set_ylabel("greatest deflection $u_{\\max}$")
        axis.set_ylim(bottom=0)
        style.grid(axis)
    figure.legend(
        handles=[*_forcing_keys(results, forcings), *_line_keys(shown)],
        loc="outside lower center", ncols=4,
    )  # fmt: skip
    figure.suptitle(_damping(results), fontsize=9)
    return figure


def _branch(axis: Any, rows: Columns, name: str, colour: str) -> None:
    """One branch: a line, broken where its stability changes; dots for a sweep."""
    omega, u = rows["Omega"], rows["u_max"]
    if name in _MARKS:
        axis.plot(omega, u, _MARKS[name][0], color=colour, mfc="white", ms=3, mew=0.7, zorder=3)
        return
    stable, loss = _true(rows["stable"]), _true(rows["contact_loss"])
    for start, stop in _pieces(omega, u, stable):
        line = "-" if stable[start] else _DASHES
        axis.plot(omega[start:stop], u[start:stop], ls=line, color=colour, lw=1.2, zorder=2)
    for start, stop in _pieces(omega, u, loss):
        if loss[start]:
            axis.plot(omega[start:stop], u[start:stop], color=style.YELLOW, lw=5, alpha=0.6, zorder=1)


def _pieces(omega: Array, u: Array, state: NDArray[np.bool_]) -> Iterator[tuple[int, int]]:
    """Ranges of one state; pieces of one curve share a point, separate curves do not."""
    reach = np.hypot(np.diff(omega) / (np.ptp(omega) or 1.0), np.diff(u) / (np.ptp(u) or 1.0))
    # continuation changes its step gradually: a sudden long one leads to another curve
    around = np.maximum(np.r_[reach[:1], reach[:-1]], np.r_[reach[1:], reach[-1:]])
    jump = reach > 8 * around
    cuts = np.flatnonzero((state[1:] != state[:-1]) | jump)
    start = 0
    for cut in [*cuts, len(omega) - 1]:
        joined = cut < len(omega) - 1 and not jump[cut]
        yield start, cut + 1 + joined
        start = cut + 1


def _forcing_keys(results: Results, forcings: Array) -> list[Line2D]:
    """Legend entries of the forcings, in both conventions where the local exponent is known."""
    n = results.thresholds.get("n_loc")
    keys = []
    for forcing, colour in zip(forcings, np.resize(_FORCINGS, len(forcings)), strict=True):
        weight = f", $F/(mg)$ = {n * forcing:.3g}" if n else ""
        keys.append(Line2D([], [], color=colour, label=f"$\\hat{{F}}$ = {forcing:g}{weight}"))
    return keys


def _line_keys(shown: set[str]) -> list[Line2D]:
    keys = [
        Line2D([], [], color=style.GREY, label="stable"),
        Line2D([], [], color=style.GREY, ls=_DASHES, label="unstable"),
        Line2D([], [], label="passes loss of contact", **_LOSS),
    ]
    for name, (mark, text) in _MARKS.items():
        if name in shown:
            keys.append(Line2D([], [], label=text, marker=mark, mfc="white", ls="", color=style.GREY))
    return keys


def _damping(results: Results) -> str:
    zeta = np.unique(results.response["zeta"])
    kind = results.thresholds.get("damping")
    ratios = ", ".join(f"{value:g}" for value in zeta)
    return f"damping ratio $\\zeta$ = {ratios}" + (f", acting {_ACTS[kind]}" if kind else "")


_ACTS = {"always": "always", "contact": "in contact", "hunt-crossley": "after Hunt and Crossley"}


def _where(columns: Columns, mask: NDArray[np.bool_]) -> Columns:
    return {name: column[mask] for name, column in columns.items()}


def _true(column: NDArray[Any]) -> NDArray[np.bool_]:
    """Truth values of a CSV column, written as True, true or 1."""
    return np.isin(np.char.lower(column.astype(str)), ("true", "1", "1.0"))
