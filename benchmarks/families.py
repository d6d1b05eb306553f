"""Families of curves and of columns of a study, with ensemble mean and band, drawn on axes."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes

from asperity.arrays import Array
from asperity.curve import Curve
from asperity.plot import style
from asperity.plot.curves import DELTA, LOAD
from asperity.study import StudyLevel, StudyResults


def colours(count: int) -> list[Any]:
    """Colours in the order of the levels, from dark to light, distinguishable without colour vision."""
    return [mpl.colormaps["viridis"](x) for x in np.linspace(0.0, 0.88, max(count, 1))]


def ensemble_curve(curves: Iterable[Curve], points: int = 60) -> tuple[Array, Array, Array]:
    """Mean and standard deviation of P* over the loading branches of curves, on their common range.

    Returns:
        delta*, mean and standard deviation, each (points,); the deviation of one curve is 0
    """
    loads = [c.loading() for c in curves]
    x = np.linspace(0.0, min(float(c.delta_star.max()) for c in loads), points)
    y = np.array([np.interp(x, np.r_[0.0, c.delta_star], np.r_[0.0, c.P_star]) for c in loads])
    return x, y.mean(axis=0), y.std(axis=0, ddof=1) if len(y) > 1 else np.zeros(points)


def draw_curves(axis: Axes, results: StudyResults, levels: Sequence[StudyLevel], labels: Sequence[str]) -> None:
    """Draw the mean load of each level with a band of one standard deviation."""
    for level, text, colour in zip(levels, labels, colours(len(levels)), strict=True):
        x, mean, spread = ensemble_curve(results.curve(row) for row in level.rows)
        axis.plot(x, mean, color=colour, label=text)
        if len(level.rows) > 1:
            axis.fill_between(x, mean - spread, mean + spread, color=colour, alpha=0.15, lw=0)
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
