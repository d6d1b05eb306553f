"""Area over load beside theories of rough contact: the theories, and the figure."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from made_up_run import write_run

import asperity as asp
from asperity.output.fields import gather_top_states
from asperity.output.results import Results
from asperity.plot.contact import contact_area, persson_area, persson_density, pressed_thirds


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


def test_theories_are_drawn_for_rough_surfaces(tmp_path: Path) -> None:
    results = Results.read(write_run(tmp_path / "out"))
    smooth = {**results.case, "surface": {"kind": "sphere", "L": 1e-6, "radius": 2e-6}}
    for run, theories in ((results, ["Persson, elastic", "Bush, Gibson, Thomas, elastic"]),
                          (replace(results, case=smooth), [])):  # fmt: skip
        area, pressure = contact_area(run).axes
        labels = area.get_legend_handles_labels()[1]
        assert labels == ["loading", "error bar", *theories]
        assert area.get_xscale() == area.get_yscale() == "log"
        assert any("in contact" in text for text in pressure.get_legend_handles_labels()[1])


def test_the_pressures_of_the_thirds_have_the_force_and_the_area_of_the_curve(tmp_path: Path) -> None:
    """Unlike those at the nodes, which reach beyond the contact."""
    wave = asp.Surface.from_spec("sinusoid", L=1e-6, amplitude=5e-9, dims=2)
    size = asp.MeshSize(h_contact=0.1e-6)
    result = asp.solve_contact(wave, asp.Material(E=200e9, nu=0.3), delta_max=4e-9, steps=3, size=size, snapshots=3)
    top = gather_top_states(result, wave.L, 200e9)
    assert top is not None and len(top["steps"]) == 3
    for i, step in enumerate(top["steps"]):
        row = result.curve.where(result.curve.step == step)
        pressure, area = pressed_thirds(top, i)
        assert pressure @ area == pytest.approx(row.force[0], rel=1e-6)
        assert area.sum() == pytest.approx(row.area_fraction[0] * wave.L**2, rel=1e-9)
