"""Style of all figures: sizes, colours, labels."""

from __future__ import annotations

import functools
import io
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any, ParamSpec

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backend_bases import get_registered_canvas_class
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter, ScalarFormatter

from asperity.errors import InputError
from asperity.runtime.files import replace_file
from asperity.runtime.run_folder import FIELD_PICTURES
from asperity.units import prefix

P = ParamSpec("P")

# Okabe and Ito's colours, distinguishable for colour-blind readers
BLACK, ORANGE, SKY, GREEN = "#000000", "#E69F00", "#56B4E9", "#009E73"
BLUE, VERMILION, PURPLE = "#0072B2", "#D55E00", "#CC79A7"
GREY, PALE = "#7F7F7F", "#EDEDED"
COLOURS = (BLUE, VERMILION, GREEN, PURPLE, ORANGE, BLACK)  # of curves of one kind

SINGLE, DOUBLE, WIDE = 4.6, 8.0, 10.5  # widths, inches
DPI = 200
_RAISED = str.maketrans("0123456789-\u2212", "⁰¹²³⁴⁵⁶⁷⁸⁹⁻⁻")

_RC: dict[str, Any] = {
    "font.size": 9.0,
    "axes.titlesize": "medium",
    "figure.titlesize": "medium",
    "xtick.labelsize": "small",
    "ytick.labelsize": "small",
    "legend.fontsize": "small",
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
    "axes.formatter.limits": (-3, 4),
    "axes.grid": True,
    "grid.color": "#E2E2E2",
    "grid.linewidth": 0.6,
}


def settings() -> dict[str, Any]:
    """Settings of this style, without those that the user has changed from matplotlib's defaults."""
    return {name: value for name, value in _RC.items() if mpl.rcParams[name] == mpl.rcParamsDefault[name]}


def styled(draw: Callable[P, Figure]) -> Callable[P, Any]:
    """Make a function draw in this style; settings of the user win, and `matplotlib.rcParams` stay as they are."""

    @functools.wraps(draw)
    def in_style(*args: P.args, **kwargs: P.kwargs) -> Any:
        with mpl.rc_context(settings()):
            return draw(*args, **kwargs)

    return in_style


def figure(width: float, height: float, *titles: str, rows: int = 1, **grid: Any) -> tuple[Figure, list[Any]]:
    """New figure of a size in inches and its panels.

    Args:
        width, height: of the figure
        titles: of the panels, row by row, with letters (a), (b), ... where there are several
        rows: of panels
        grid: see `Figure.subplots`
    """
    new = Figure(figsize=(width, height), layout="constrained")
    axes = list(np.ravel(new.subplots(rows, len(titles) // rows, **grid)))
    for axis, letter, text in zip(axes, "abcdefghijkl", titles, strict=False):
        axis.set_title(f"({letter}) {text}".rstrip() if len(axes) > 1 else text, loc="left")
        for name, sides in (("x", ("bottom", "top")), ("y", ("left", "right"))):
            getattr(axis, f"{name}axis").set_major_formatter(Numbers())
            _freeze(axis, name, **{side: mpl.rcParams[f"{name}tick.{side}"] for side in sides})
    return new, axes


def _freeze(axis: Any, name: str, **more: Any) -> None:
    """Keep the style of the ticks and the grid, which matplotlib makes when it saves the figure."""
    look = {key: mpl.rcParams[f"{name}tick.{key}"] for key in ("direction", "labelsize")}
    look |= {f"grid_{key}": mpl.rcParams[f"grid.{key}"] for key in ("color", "linewidth")}
    axis.tick_params(axis=name, which="both", **look, **more)


class Numbers(ScalarFormatter):
    """Labels of ticks as plain text, many times as fast as mathematics, with a power of ten at the end."""

    def get_offset(self) -> str:
        """Power of ten, for example ×10⁻³."""
        power = re.compile(r"1e([\u2212-]?\d+)")
        return power.sub(lambda found: "×10" + found[1].translate(_RAISED), str(super().get_offset()))


def save(figure: Figure, path: str | Path) -> Path:
    """Write a figure in the format of the suffix and return its path; the file is complete or absent.

    Fields in an SVG file are pixels, so that it stays small; the same figure gives the same file.

    Raises:
        InputError: the suffix is that of no picture
    """
    path, picture = Path(path), io.BytesIO()
    form = path.suffix[1:].lower() or "png"
    if form not in figure.canvas.get_supported_filetypes():
        raise InputError(f"{path.name} has no suffix of a picture: end it in .png, .svg or .pdf")
    fixed: dict[str, Any] = {"metadata": dict.fromkeys(("Creator", "Date", "Format", "Type"))} if form == "svg" else {}
    with mpl.rc_context(settings() | {"svg.hashsalt": path.stem}):
        figure.set_dpi(DPI)
        canvas = get_registered_canvas_class(form)(figure)
        getattr(canvas, f"print_{form}")(picture, **fixed)  # `Figure.savefig` draws twice
    replace_file(path, picture.getvalue())
    return path


def save_in(folder: Path, name: str, figure: Figure, pixels: bool = False) -> Path:
    """Write a figure of a run: as an SVG file, or as a PNG file where it has fields or `pixels` are wanted."""
    form, other = ("png", "svg") if pixels or name in FIELD_PICTURES else ("svg", "png")
    (folder / f"{name}.{other}").unlink(missing_ok=True)  # of an older drawing
    return save(figure, folder / f"{name}.{form}")


def label(quantity: str, unit: str) -> str:
    """Label of an axis: "name (unit)"."""
    return f"{quantity} ({unit})" if unit else quantity


def second_axis(axis: Any, side: str, factor: float, text: str) -> None:
    """Draw a second axis at a side, "top" or "right": the values of the first times a factor."""
    axis.tick_params(**{side: False}, which="both")
    draw = axis.secondary_xaxis if side == "top" else axis.secondary_yaxis
    second = draw(side, functions=(lambda x: x * factor, lambda x: x / factor))
    name = "x" if side == "top" else "y"
    if axis.get_xscale() == axis.get_yscale() == "linear":
        getattr(second, f"{name}axis").set_major_formatter(Numbers())
    _freeze(second, name)
    second.grid(False)
    if side == "top":
        axis.yaxis.get_offset_text().set_x(-0.17)  # left of the labels at the top
    (second.set_xlabel if side == "top" else second.set_ylabel)(text)


def physical_axis(axis: Any, side: str, quantity: str, scale: float, unit: str) -> None:
    """Draw a second axis of a physical quantity at a side, "top" or "right", after the limits of the axis are set.

    `scale` is the physical value of 1 in `unit`, which is "" if unknown; no axis is drawn where the scale is NaN.
    """
    if not np.isfinite(scale):
        return
    _, high = axis.get_xlim() if side == "top" else axis.get_ylim()
    factor, name = prefix(high * scale, unit)
    second_axis(axis, side, scale * factor, label(quantity, name))


def logarithmic(axis: Axes) -> None:
    """Make both scales logarithmic, labelled at 1, 2 and 5 where they are shorter than one and a half decades."""
    axis.set_xscale("log")
    axis.set_yscale("log")
    for scale in (axis.xaxis, axis.yaxis):
        low, high = scale.get_view_interval()
        if high < 30 * low:
            scale.set_major_locator(LogLocator(subs=(1, 2, 5)))
            scale.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
            scale.set_minor_formatter(NullFormatter())
