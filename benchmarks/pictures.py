# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

"""Small PNG files for the documentation."""

from __future__ import annotations

from pathlib import Path

from PIL import Image

WIDTH, COLOURS = 1200, 256


def shrink(source: Path, target: Path | None = None) -> None:
    """Write a picture with fewer pixels and colours, over itself unless a target is given."""
    with Image.open(source) as image:
        flat = image.convert("RGB")
    if flat.width > WIDTH:
        flat = flat.resize((WIDTH, round(flat.height * WIDTH / flat.width)), Image.Resampling.LANCZOS)
    flat.quantize(COLOURS, kmeans=4, dither=Image.Dither.NONE).save(target or source, optimize=True)
