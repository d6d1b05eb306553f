"""Small pictures for notebooks, and packages that are installed where they are wanted."""

from __future__ import annotations

import base64
import html
import importlib
import io
from typing import Any

import numpy as np

from asperity.arrays import Array
from asperity.errors import CompatError

WIDTH, HEIGHT = 320, 200  # of a picture [pixels]
_MARGIN = 12  # around it [pixels]
_BLUE = "#0072B2"


def optional(name: str) -> Any:
    """A package that asperity does not need itself.

    Raises:
        CompatError: it is not installed
    """
    try:
        return importlib.import_module(name)
    except ImportError:
        raise CompatError(f"the package {name} is not installed: pip install {name}") from None


def line_picture(x: Array, y: Array, caption: str, of_x: str, of_y: str) -> str:
    """A line through points (n,) in HTML, with a caption and the names of the axes."""
    known = np.isfinite(x) & np.isfinite(y)
    path = ""
    if known.sum() > 1:
        along, up = (_scaled(v[known]) for v in (x, y))
        across = _MARGIN + (WIDTH - 2 * _MARGIN) * along
        down = HEIGHT - _MARGIN - (HEIGHT - 2 * _MARGIN) * up
        path = " ".join(f"{a:.1f},{b:.1f}" for a, b in zip(across, down, strict=True))
    return (
        f'<figure style="margin:0"><svg width="{WIDTH}" height="{HEIGHT}" role="img" '
        f'style="border:1px solid #d9dfe5"><polyline points="{path}" fill="none" stroke="{_BLUE}" stroke-width="2"/>'
        f'<text x="{WIDTH - 6}" y="{HEIGHT - 4}" font-size="11" text-anchor="end">{html.escape(of_x)}</text>'
        f'<text x="6" y="14" font-size="11">{html.escape(of_y)}</text></svg>'
        f"<figcaption>{html.escape(caption)}</figcaption></figure>"
    )


def map_picture(z: Array, caption: str) -> str:
    """Heights (n, n) as a picture in HTML, with a caption; the caption alone without matplotlib."""
    picture = ""
    try:
        from matplotlib.image import imsave
    except ImportError:
        pass
    else:
        file = io.BytesIO()
        imsave(file, z, cmap="cividis", origin="lower", format="png")
        data = base64.b64encode(file.getvalue()).decode()
        picture = f'<img width="{HEIGHT}" height="{HEIGHT}" alt="heights" src="data:image/png;base64,{data}"/>'
    return f'<figure style="margin:0">{picture}<figcaption>{html.escape(caption)}</figcaption></figure>'


def _scaled(values: Array) -> Array:
    """Values (n,) from 0 to 1."""
    extent = float(np.ptp(values))
    return (values - values.min()) / extent if extent > 0.0 else np.full(len(values), 0.5)
