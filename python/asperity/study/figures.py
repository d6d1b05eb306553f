"""Figures of a study: families of curves and their exponents, with ensemble mean and band."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from asperity.plot import style
from asperity.plot.curves import DELTA, LOAD
from asperity.study.results import StudyLevel, StudyResults, ensemble_curve

_SYMBOLS = {
    "surface.D": "$D$", "surface.G": "$G$", "material.yield_strength": "$\\sigma_y$",
    "material.tangent_modulus": "$E_t$", "material.E": "$E$", "material.nu": "$\\nu$",
    "block.height": "$h_b$", "loading.delta_max": "$\\delta_{max}$", "mesh.h_contact": "$h$",
}  # fmt: skip
_ABSENT = {"material.yield_strength": "elastic", "material.tangent_modulus": ""}


def colours(count: int) -> list[Any]:
    """Colours in the order of the levels, from dark to light, distinguishable without colour vision."""
    return [mpl.colormaps["viridis"](x) for x in np.linspace(0.0, 0.88, max(count, 1))]


def name_of(key: str) -> str:
    """Symbol of a dotted key if it has one, else its name."""
    return _SYMBOLS.get(key, key.split(".")[-1])


def label_of(parameters: Mapping[str, Any], scale: Mapping[str, tuple[float, str]] | None = None) -> str:
    """Text of the values of a level for a legend; `scale`: key -> (unit of the value, text after the number)."""
    parts = []
    for key, value in parameters.items():
        factor, unit = (scale or {}).get(key, (1.0, ""))
        if value is None:
            parts.append(_ABSENT.get(key, f"no {name_of(key)}"))
        elif isinstance(value, float):
            parts.append(f"{name_of(key)} = {value / factor:.4g}{unit}")
        else:
            parts.append(f"{name_of(key)} = {value}")
    return ", ".join(part for part in parts if part) or "all"


def draw_curves(
    axis: Axes, results: StudyResults, levels: Sequence[StudyLevel], labels: Sequence[str], over_greatest: bool = False
) -> None:
    """Draw the mean load of each level with a band of one standard deviation.

    With `over_greatest` the curve of each level is divided by its last mean value.
    """
    for level, text, colour in zip(levels, labels, colours(len(levels)), strict=True):
        x, mean, spread = ensemble_curve(results.curve(row) for row in level.rows)
        unit = mean[-1] if over_greatest else 1.0
        axis.plot(x, mean / unit, color=colour, label=text)
        if len(level.rows) > 1:
            axis.fill_between(x, (mean - spread) / unit, (mean + spread) / unit, color=colour, alpha=0.15, lw=0)
    axis.set_xlabel(DELTA)
    axis.set_ylabel(LOAD)
    axis.set_xlim(left=0)
    axis.set_ylim(bottom=0)
    style.grid(axis)


def draw_column(
    axis: Axes, levels: Sequence[StudyLevel], labels: Sequence[str], column: str, colour: str, text: str,
    shift: float = 0.0, marker: str = "o",
) -> None:  # fmt: skip
    """Draw a column over the levels: a dot for each case, and next to them the mean with one standard deviation."""
    for i, level in enumerate(levels):
        values = level.column(column)
        values = values[np.isfinite(values)]
        if not values.size:
            continue
        axis.plot(np.full(values.size, i + shift), values, ".", color=colour, alpha=0.35, ms=4, mew=0)
        spread = values.std(ddof=1) if values.size > 1 else 0.0
        axis.errorbar(
            i + shift + 0.1, values.mean(), spread, fmt=marker, color=colour, mfc="white", capsize=2.5, ms=4.5,
            label=text if i == 0 else None,
        )  # fmt: skip
    axis.set_xticks(range(len(levels)), labels)
    axis.set_xlim(-0.5, len(levels) - 0.5)
    style.grid(axis)


@style.styled
def family_figure(results: StudyResults, name: str, *, ax: style.Place | None = None) -> Figure:
    """Draw the mean curves of a family and the exponents of its cases."""
    levels = results.levels(name)
    labels = [label_of(level.parameters) for level in levels]
    figure, axes = style.figure(style.DOUBLE, 3.9, columns=2, ax=ax)
    style.titles(axes, ("mean curves", "exponents"))
    left, right = axes
    draw_curves(left, results, levels, labels)
    numbers = [str(i + 1) for i in range(len(levels))]
    draw_column(right, levels, numbers, "n", style.BLUE, "linear fit", -0.15)
    draw_column(right, levels, numbers, "n_log", style.VERMILION, "logarithmic fit", 0.15, "s")
    right.axhline(1.0, color=style.GREY, lw=0.8)
    right.set_xlabel("level, in the order of the legend")
    right.set_ylabel("exponent $n$")
    right.legend(loc="best")
    lines = left.get_lines()[: len(labels)]
    for i, line in enumerate(lines, start=1):
        line.set_label(f"{i}: {line.get_label()}")
    style.legend(figure, axes, ax, lines, min(4, max(1, len(lines))))
    title = next(family.title for family in results.families if family.name == name)
    seeds = max((len(level.rows) for level in levels), default=0)
    if ax is None:
        figure.suptitle(f"{title} ({seeds} per level; band: one standard deviation)")
    return figure


def plot_study(folder: str | Path) -> list[Path]:
    """Draw a figure for each family of a study in its folder figures/; return the files."""
    results = StudyResults.read(folder)
    target = results.folder / "figures"
    target.mkdir(exist_ok=True)
    return [
        style.save(family_figure(results, family.name), target / f"family_{family.name}.png")
        for family in results.families
        if results.family(family.name)
    ]
