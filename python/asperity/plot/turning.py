"""The loaded surface in three dimensions, as data for templates/turn.js."""

from __future__ import annotations

import base64
import io
from typing import Any

import numpy as np
from matplotlib import colormaps
from matplotlib.colors import to_hex
from matplotlib.image import imsave

from asperity.output.results import Results
from asperity.plot.contact import PIXELS, Raster
from asperity.units import quantity

NODES = 134  # of the shape along each side, every third pixel of the map: 48 kB
RELIEF = 0.25  # range of the heights shown, over the side
UNLOADED = "#B8B8B8"


def turning_surface(results: Results) -> dict[str, Any] | None:
    """Deformed surface at the greatest approach with the pressure on it.

    Returns:
        None without a pressure map, else what the page shows: nodes of the shape along each side; heights, base64 of 16
        bits each from lowest to highest, rows in y; colours, base64 of a PNG file, the pressure over the patch, its
        first row at y = 0; relief, the range of the heights over the side as shown; scale, the colours of the legend;
        highest, the greatest pressure with its unit; caption
    """
    top = results.top
    if not results.snapshots or not np.any(top["pressure"] > 0.0):
        return None
    on_grid = Raster(top)
    i = int(np.argmax(top["delta"]))
    z = -on_grid(top["gap"][i])[:: PIXELS // (NODES - 1), :: PIXELS // (NODES - 1)]  # below the flat
    span = float(np.ptp(z)) or 1.0
    highest = float(top["pressure"][i].max()) or 1.0  # as in the table; between the pixels
    factor = RELIEF * float(np.ptp(top["points"][:, 0])) / span
    approach = quantity(float(top["delta"][i]), results.unit("length"), 3)
    pressure, picture = on_grid.pressure(i), io.BytesIO()
    colours = colormaps["inferno_r"].with_extremes(bad=UNLOADED)
    imsave(picture, np.where(pressure > 0.0, pressure, np.nan), vmin=0.0, vmax=highest, cmap=colours, format="png")
    return {
        "nodes": len(z),
        "heights": base64.b64encode(np.round((z - z.min()) / span * 65535).astype("<u2").tobytes()).decode(),
        "colours": base64.b64encode(picture.getvalue()).decode(),
        "relief": RELIEF,
        "scale": ", ".join(to_hex(colour) for colour in colormaps["inferno_r"](np.linspace(0.0, 1.0, 9))),
        "highest": quantity(highest, results.unit("stress"), 3),
        "caption": f"The surface under the flat at the greatest approach, {approach}, with the contact pressure; "
        f"heights {factor:.2g} times enlarged. Drag it, or use the arrow keys.",
    }
