"""The surface that turns on the page."""

from __future__ import annotations

import base64
import io
from pathlib import Path

import matplotlib.image
import numpy as np
import pytest
from made_up_run import write_run
from PIL import Image

from asperity.output.results import Results
from asperity.plot.contact import Raster
from asperity.plot.turning import growing_spots, turning_surface

MOST = 300_000  # bytes that the surface may add to a page


def test_the_data_of_the_page_are_those_of_the_run(tmp_path: Path) -> None:
    results = Results.read(write_run(tmp_path))
    shown = turning_surface(results, Raster(results.top))
    assert shown is not None and len(shown["heights"]) + len(shown["colours"]) < MOST
    heights = np.frombuffer(base64.b64decode(shown["heights"]), "<u2").reshape(shown["nodes"], shown["nodes"])
    gap = results.top["gap"][4].reshape(91, 91)  # at the greatest approach, on the grid of the file
    there = 1.0 - gap / gap.max()
    x = (np.arange(0, 400, 3) + 0.5) / 400 * 90
    nearest = there[np.ix_(x.round().astype(int), x.round().astype(int))]
    assert np.corrcoef(heights.ravel(), nearest.ravel())[0, 1] > 0.99
    picture = matplotlib.image.imread(io.BytesIO(base64.b64decode(shown["colours"])))[..., :3]
    coloured = np.ptp(picture, axis=-1) > 0.01
    assert coloured.mean() == pytest.approx(results.top["touched"][4].mean(), rel=0.1)
    assert "30 nm" in shown["caption"]


def test_the_spots_grow_as_those_of_the_run(tmp_path: Path) -> None:
    results = Results.read(write_run(tmp_path))
    moving = Image.open(io.BytesIO(base64.b64decode(growing_spots(Raster(results.top)) or "")))
    pressed = (results.top["branch"] == "load") & (results.top["pressure"].max(axis=1) > 0.0)
    assert moving.n_frames == pressed.sum()  # type: ignore[attr-defined]
    for frame, touched in enumerate(results.top["touched"][pressed]):
        moving.seek(frame)
        coloured = np.ptp(np.asarray(moving.convert("RGB"), float), axis=-1) > 10.0
        assert coloured.mean() == pytest.approx(touched.mean(), rel=0.1)


def test_without_pressure_there_is_none(tmp_path: Path) -> None:
    results = Results.read(write_run(tmp_path))
    results.top["pressure"][:] = 0.0
    assert turning_surface(results, on_grid := Raster(results.top)) is None and growing_spots(on_grid) is None
