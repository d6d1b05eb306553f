# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

"""Style of all figures: sizes, colours, labels."""

from __future__ import annotations

import functools
import io
from collections.abc import Callable
from pathlib import Path
from typing import Any, ParamSpec

import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

from asperity.runtime.files import replace_file

P = ParamSpec("P")

# Okabe and Ito's colours, distinguishable for colour-blind readers
BLACK, ORANGE, SKY, GREEN = "#000000", "#E69F00", "#56B4E9", "#009E73"
YELLOW, BLUE, VERMILION, PURPLE = "#F0E442", "#0072B2", "#D55E00", "#CC79A7"
GREY, PALE = "#7F7F7F", "#EDEDED"

SINGLE, DOUBLE = 4.2, 7.6  # widths, inches
DPI = 200

_RC: dict[str, Any] = {
    "font.size": 9.0,
    "axes.titlesize": 9.0,
    "axes.labelsize": 9.0,
    "xtick.labelsize": 8.0,
    "ytick.labelsize": 8.0,
    "legend.fontsize": 8.0,
    "legend.frameon": False,
    "legend.handlelength": 1.8,
    "axes.linewidth": 0.7,
    "axes.axisbelow": True,
    "lines.linewidth": 1.4,
    "lines.markersize": 3.6,
    "xtick.direction": "in",
    "ytick.direction": "in",
    "xtick.top": True,
    "ytick.right": True,
    "mathtext.fontset": "dejavusans",
    "axes.formatter.use_mathtext": True,
    "axes.formatter.limits": (-3, 4),
}


def styled(draw: Callable[P, Figure]) -> Callable[P, Figure]:
    """Make a function draw its figure in this style, regardless of the user's settings."""

    @functools.wraps(draw)
    def in_style(*args: P.args, **kwargs: P.kwargs) -> Figure:
        with mpl.rc_context(mpl.rcParamsDefault), mpl.rc_context(_RC):
            return draw(*args, **kwargs)

    return in_style


def figure(width: float, height: float, columns: int = 1, rows: int = 1) -> tuple[Figure, Any]:
    """Return a new figure and its axes (an array if there are several); sizes in inches."""
    result = Figure(figsize=(width, height), layout="constrained")
    return result, result.subplots(rows, columns)


def save(figure: Figure, path: str | Path) -> Path:
    """Write a figure in the format of the suffix and return its path; the file is complete or absent."""
    path, picture = Path(path), io.BytesIO()
    with mpl.rc_context(_RC):
        figure.savefig(picture, dpi=DPI, format=path.suffix[1:] or "png")
    replace_file(path, picture.getvalue())
    return path


def grid(*axes: Axes) -> None:
    """Draw faint lines at the major ticks."""
    for axis in axes:
        axis.grid(color="#E2E2E2", linewidth=0.6)


def label(quantity: str, unit: str) -> str:
    """Return the label of an axis: "name (unit)"."""
    return f"{quantity} ({unit})" if unit else quantity


def letters(*axes: Axes) -> None:
    """Label panels (a), (b), ..."""
    for axis, letter in zip(axes, "abcdefgh", strict=False):
        axis.annotate(
            f"({letter})", (0, 1), (-30, 5), xycoords="axes fraction", textcoords="offset points",
            fontweight="bold",
        )  # fmt: skip


def logarithmic(axis: Axes) -> None:
    """Make both scales logarithmic, with x labelled at 1, 2 and 5."""
    axis.set_xscale("log")
    axis.set_yscale("log")
    axis.xaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
    axis.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axis.xaxis.set_minor_formatter(NullFormatter())
