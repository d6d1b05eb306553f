"""The loaded surface in three dimensions, as data for templates/turn.js, and its spots as they grow."""

from __future__ import annotations

import base64
import io
from typing import Any

import numpy as np
from matplotlib import colormaps
from matplotlib.colors import to_hex
from PIL import Image

from asperity.arrays import Array
from asperity.output.raster import PIXELS, Raster
from asperity.output.results import Results
from asperity.plot import style
from asperity.plot.contact import pressure_map
from asperity.units import quantity

NODES = 134  # of the shape along each side, every third pixel of the map: 48 kB
RELIEF = 0.25  # range of the heights shown, over the side
UNLOADED = 184  # grey
MILLISECONDS = 700  # of a picture of the growing spots


def turning_surface(results: Results, on_grid: Raster) -> dict[str, Any] | None:
    """Deformed surface at the greatest approach with the pressure on it.

    Args:
        results: of a run with snapshots
        on_grid: squares of its whole top

    Returns:
        None without pressure, else what the page shows: nodes of the shape along each side; heights, base64 of 16
        bits each from lowest to highest, rows in y; colours, base64 of a PNG file, the pressure over the patch, its
        first row at y = 0; relief, the range of the heights over the side as shown; scale, the colours of the legend;
        highest, the greatest pressure with its unit; side and range, of the patch and of the heights with their unit;
        caption
    """
    top = results.top
    if not np.any(top["pressure"] > 0.0):
        return None
    i = int(np.argmax(top["delta"]))
    below = top["gap"][i] + (0.0 if results.tool is None else results.tool.height(*top["points"].T))
    z = -on_grid(below)[:: PIXELS // (NODES - 1), :: PIXELS // (NODES - 1)]  # below the plane of the flat
    span = float(np.ptp(z)) or 1.0
    highest = float(top["pressure"][i].max()) or 1.0  # as in the table; between the pixels
    length, side = results.unit("length"), float(np.ptp(top["points"][:, 0]))
    approach = quantity(float(top["delta"][i]), length, 3)
    row, load = results.curve.where(results.curve.step == int(top["steps"][i])), ""
    if len(row):
        load = f" under a load of {quantity(row.force[0], results.unit('force'), 3, bar=row.bar('P_star', 0))},"
    return {
        "nodes": len(z),
        "heights": base64.b64encode(np.round((z - z.min()) / span * 65535).astype("<u2").tobytes()).decode(),
        "colours": _png([_picture(on_grid.pressure(i), highest)]),
        "relief": RELIEF,
        "scale": ", ".join(to_hex(colour) for colour in colormaps["inferno_r"](np.linspace(0.0, 1.0, 9))),
        "highest": quantity(highest, results.unit("stress"), 3),
        "side": quantity(side, length, 3),
        "range": quantity(span, length, 3),
        "caption": f"The surface at the greatest approach, {approach},{load} with the contact pressure; "
        f"heights {RELIEF * side / span:.2g} times enlarged. Drag it, or use the arrow keys.",
    }


def growing_spots(results: Results, on_grid: Raster) -> str | None:
    """Pressure at the saved steps of the loading, one after the other: base64 of an animated PNG file.

    None with fewer than two steps under pressure.
    """
    top = on_grid.top
    levels = [i for i, name in enumerate(top["branch"]) if name == "load" and top["pressure"][i].max() > 0.0]
    if len(levels) < 2:
        return None
    highest = max(float(top["pressure"][i].max()) for i in levels)
    return _png([style.pixels(pressure_map(results, on_grid, i, highest)) for i in levels])


def _picture(pressure: Array, highest: float) -> Image.Image:
    """Colours of a pressure, grey out of contact, the first row at the top."""
    picture = colormaps["inferno_r"](np.nan_to_num(pressure) / highest, bytes=True)[..., :3]
    picture[~(pressure > 0.0)] = UNLOADED
    return Image.fromarray(picture)


def _png(frames: list[Image.Image]) -> str:
    file = io.BytesIO()
    frames[0].save(file, "PNG", save_all=len(frames) > 1, append_images=frames[1:], duration=MILLISECONDS, loop=0)
    return base64.b64encode(file.getvalue()).decode()
