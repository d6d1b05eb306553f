"""Small pictures for notebooks, and packages that are installed where they are wanted."""

from __future__ import annotations

import base64
import html
import importlib
import io
from collections.abc import Callable
from typing import Any

from asperity.errors import CompatError

SIZE = 3.6, 2.4  # of a picture [inches]


def optional(name: str) -> Any:
    """A package that asperity does not need itself.

    Raises:
        CompatError: it is not installed
    """
    try:
        return importlib.import_module(name)
    except ImportError:
        raise CompatError(f"the package {name} is not installed: pip install {name}") from None


def picture(caption: str, draw: Callable[[Any], object]) -> str:
    """What a function draws into small axes of matplotlib, as a picture in HTML with a caption."""
    from matplotlib.figure import Figure

    figure, file = Figure(figsize=SIZE, layout="constrained"), io.BytesIO()
    draw(figure.add_subplot())
    figure.savefig(file, format="png")
    data = base64.b64encode(file.getvalue()).decode()
    return (
        f'<figure style="margin:0"><img alt="" src="data:image/png;base64,{data}"/>'
        f"<figcaption>{html.escape(caption)}</figcaption></figure>"
    )
