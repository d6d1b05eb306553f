"""The loaded surface in three dimensions, as data for templates/turn.js, and its spots as they grow."""

from __future__ import annotations

import base64
import io
from dataclasses import dataclass

import numpy as np
from matplotlib import colormaps
from matplotlib.colors import to_hex
from matplotlib.image import imsave

from asperity.output.results import Results
from asperity.plot.contact import PIXELS, Raster
from asperity.units import quantity

NODES = 134  # of the shape along each side, every third pixel of the map: 48 kB
RELIEF = 0.25  # range of the heights shown, over the side
UNLOADED = 0.72  # grey
MILLISECONDS = 700  # of a picture of the growing spots


@dataclass(frozen=True)
class TurningSurface:
    """What the page shows.

    Attributes:
        nodes: of the shape along each side
        heights: base64 of their heights, 16 bits each from lowest to highest, rows in y
        colours: base64 of a PNG file, the pressure over the patch, its first row at y = 0
        relief: range of the heights over the side of the patch, as shown
        scale: colours of the legend, from no pressure to the greatest
        highest: the greatest pressure with its unit
        caption: of the figure
    """

    nodes: int
    heights: str
    colours: str
    relief: float
    scale: str
    highest: str
    caption: str


def turning_surface(results: Results) -> TurningSurface | None:
    """Deformed surface at the greatest approach with the pressure on it, None without a pressure map."""
    top = results.top
    if not results.snapshots or not np.any(top["pressure"] > 0.0):
        return None
    i = int(np.argmax(top["delta"]))
    on_grid = Raster(top)
    z = -on_grid(top["gap"][i])[:: PIXELS // (NODES - 1), :: PIXELS // (NODES - 1)]  # below the flat
    span = float(np.ptp(z)) or 1.0
    pressure = np.nan_to_num(on_grid.pressure(i))
    highest = float(top["pressure"][i].max()) or 1.0  # as in the table; between the pixels
    picture = colormaps["inferno_r"](pressure / highest)[..., :3]
    picture[pressure <= 0.0] = UNLOADED
    file = io.BytesIO()
    imsave(file, picture, format="png", origin="upper")
    factor = RELIEF * float(np.ptp(top["points"][:, 0])) / span
    return TurningSurface(
        nodes=len(z),
        heights=_text(np.round((z - z.min()) / span * 65535).astype("<u2").tobytes()),
        colours=_text(file.getvalue()),
        relief=RELIEF,
        scale=", ".join(to_hex(colour) for colour in colormaps["inferno_r"](np.linspace(0.0, 1.0, 9))),
        highest=quantity(highest, results.unit("stress"), 3),
        caption=f"The surface under the flat at the greatest approach, {quantity(*_approach(results, i), 3)}, with the "
        f"contact pressure; heights {factor:.2g} times enlarged. Drag it, or use the arrow keys.",
    )


def growing_spots(results: Results) -> str | None:
    """Base64 of an animated PNG file of the pressure at the snapshots of the loading; None with fewer than two."""
    from PIL import Image

    top = results.top
    levels = [i for i, name in enumerate(top.get("branch", ())) if name == "load" and top["pressure"][i].max() > 0.0]
    if len(levels) < 2:
        return None
    on_grid, highest = Raster(top), max(float(top["pressure"][i].max()) for i in levels)
    frames: list[Image.Image] = []
    for i in levels:
        pressure = np.nan_to_num(on_grid.pressure(i))[::-1]
        picture = colormaps["inferno_r"](pressure / highest)[..., :3]
        picture[pressure <= 0.0] = UNLOADED
        frames.append(Image.fromarray((255.0 * picture).astype(np.uint8)))
    palette = frames[-1].quantize(64)  # one for all frames, as the format has it
    frames = [frame.quantize(palette=palette, dither=Image.Dither.NONE) for frame in frames]
    file = io.BytesIO()
    frames[0].save(file, "PNG", save_all=True, append_images=frames[1:], duration=MILLISECONDS, loop=0)
    return _text(file.getvalue())


def _text(data: bytes) -> str:
    return base64.b64encode(data).decode()


def _approach(results: Results, i: int) -> tuple[float, str]:
    return float(results.top["delta"][i]), results.unit("length")
