"""Area over load beside theories of rough contact: the theories, and the figure."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from made_up_run import write_run

from asperity.output.results import Results
from asperity.plot import figures_of
from asperity.plot.area_load import area_load, persson_area, persson_density


def test_persson_in_closed_form() -> None:
    slope = 0.1
    light = np.array([1e-6, 1e-5])
    np.testing.assert_allclose(persson_area(light, slope), math.sqrt(8.0 / math.pi) * light / slope, rtol=1e-6)
    assert persson_area(np.array([1.0]), slope)[0] == pytest.approx(1.0)
    p = np.linspace(0.0, 1.0, 200_001)
    for mean in (0.001, 0.02, 0.06):  # the density holds the area, and carries the load
        density = persson_density(p, mean, slope)
        assert np.trapezoid(density, p) == pytest.approx(persson_area(np.array([mean]), slope)[0], rel=1e-6)
        assert np.trapezoid(p * density, p) == pytest.approx(mean, rel=1e-6)


def test_the_figure_is_that_of_rough_surfaces(tmp_path: Path) -> None:
    results = Results.read(write_run(tmp_path / "out"))
    assert results.surface.rough and "area_load" in figures_of(results)
    area, pressure = area_load(results).axes
    labels = area.get_legend_handles_labels()[1]
    assert labels == ["this run", "Persson, elastic", "Bush, Gibson, Thomas, elastic"]
    assert area.get_xscale() == area.get_yscale() == "log"
    assert any("in contact" in text for text in pressure.get_legend_handles_labels()[1])
    smooth = {**results.case, "surface": {"kind": "sphere", "L": 1e-6, "radius": 2e-6}}
    assert "area_load" not in figures_of(replace(results, case=smooth))
