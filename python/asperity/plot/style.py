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
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter, ScalarFormatter
from PIL import Image

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
PAGE = 110  # pixels of a page to an inch, so that text has the size of that on the page
_RAISED = str.maketrans("0123456789-\u2212", "⁰¹²³⁴⁵⁶⁷⁸⁹⁻⁻")

_RC: dict[str, Any] = {
    "font.size": 9.0,
    "axes.titlesize": "medium",
    "figure.titlesize": "medium",
    "xtick.labelsize": "small",
    "ytick.labelsize": "small",
    "legend.fontsize": "small",
    "legend.title_fontsize": "small",
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


def styled(draw: Callable[P, Figure]) -> Callable[P, Any]:
    """Make a function draw in this style; `matplotlib.rcParams` stay as they are."""

    @functools.wraps(draw)
    def in_style(*args: P.args, **kwargs: P.kwargs) -> Any:
        with mpl.rc_context(_RC):
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
        for scale in (axis.xaxis, axis.yaxis):
            scale.set_major_formatter(Numbers())
    return new, axes


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
    with mpl.rc_context(_RC | {"svg.hashsalt": path.stem}):
        figure.set_dpi(DPI)
        canvas = get_registered_canvas_class(form)(figure)
        getattr(canvas, f"print_{form}")(picture, **fixed)  # `Figure.savefig` draws twice
    replace_file(path, picture.getvalue())
    return path


def pixels(figure: Figure) -> Image.Image:
    """Picture of a figure, of the size that it has on a page."""
    with mpl.rc_context(_RC):
        figure.set_dpi(PAGE)
        canvas = FigureCanvasAgg(figure)
        canvas.draw()
        return Image.fromarray(np.asarray(canvas.buffer_rgba())).convert("RGB")


def save_in(folder: Path, name: str, figure: Figure) -> Path:
    """Write a figure of a run: as an SVG file, or as a PNG file where it has fields."""
    return save(figure, folder / f"{name}.{'png' if name in FIELD_PICTURES else 'svg'}")


def label(quantity: str, unit: str) -> str:
    """Label of an axis: "name (unit)"."""
    return f"{quantity} ({unit})" if unit else quantity


def physical_axis(axis: Any, side: str, quantity: str, scale: float, unit: str) -> None:
    """Draw a second axis of a physical quantity at a side, "top" or "right", after the limits of the axis are set.

    `scale` is the physical value of 1 in `unit`, which is "" if unknown; no axis is drawn where the scale is NaN.
    """
    if not np.isfinite(scale):
        return
    first = axis.xaxis if side == "top" else axis.yaxis
    low, high = first.get_view_interval()
    factor, name = prefix(high * scale, unit)
    factor *= scale
    axis.tick_params(**{side: False}, which="both")
    draw = axis.secondary_xaxis if side == "top" else axis.secondary_yaxis
    second = draw(side, functions=(lambda x: x * factor, lambda x: x / factor))
    own = second.xaxis if side == "top" else second.yaxis
    if first.get_scale() == "linear":
        own.set_major_formatter(Numbers())
    else:
        _few_labels(own, factor * low, factor * high)
    second.grid(False)
    if side == "top":
        axis.yaxis.get_offset_text().set_x(-0.17)  # left of the labels at the top
    own.set_label_text(label(quantity, name))


def logarithmic(axis: Axes, names: str = "xy") -> None:
    """Make scales logarithmic."""
    for name in names:
        getattr(axis, f"set_{name}scale")("log")
        scale = getattr(axis, f"{name}axis")
        _few_labels(scale, *scale.get_view_interval())


def _few_labels(scale: Any, low: float, high: float) -> None:
    """Label a logarithmic scale at 1, 2 and 5 where it is shorter than two decades."""
    if high < 100 * low:
        scale.set_major_locator(LogLocator(subs=(1, 2, 5)))
        scale.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        scale.set_minor_formatter(NullFormatter())
