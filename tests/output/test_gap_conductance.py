"""Conductance of a joint per area: a round spot in closed form, the figure."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import asperity as asp
from asperity.output.results import Results
from asperity.plot import figures_of

L, K1, K2 = 1e-3, 50.0, 200.0


def write(folder: Path, **material: float) -> Path:
    """A run of a sphere that is elastic: spots of Hertz, C = 4 a, first pressed and then lifted off."""
    z = np.append(np.linspace(1e-7, 1e-6, 10), np.linspace(0.9e-6, 1e-7, 6))
    force, a = 200e9 / 0.91 * 4 / 3 * np.sqrt(1e-2) * z**1.5, np.sqrt(1e-2 * z)
    rows = [
        {
            "branch": "load" if i < 10 else "unload", "delta": z[i], "force": force[i], "conductance": 4 * a[i],
            "error_conductance": 0.02 * 4 * a[i], "delta_star": z[i] / L, "P_star": force[i] / L**2,
        }
        for i in range(z.size)
    ]  # fmt: skip
    asp.Curve.from_rows(rows).write(folder / "curve.csv")
    case = {"surface": {"kind": "sphere", "L": L, "radius": 1e-2}, "material": {"E": 200e9, "nu": 0.3, **material}}
    case |= {"loading": {"delta_max": 1e-6, "unload": True}, "output": {"stiffness": True}}
    (folder / "case.toml").write_text(asp.Case.from_dict(case).to_toml(), encoding="utf-8")
    return folder


def test_a_round_spot_between_two_half_spaces(tmp_path: Path) -> None:
    """Holm: 1/(4 k1 a) + 1/(4 k2 a) is the resistance of a round spot."""
    p, h, error = Results.read(write(tmp_path, conductivity=K1, conductivity_other=K2)).gap_conductance()
    a = np.cbrt(0.75 * p * L**2 * 1e-2 * 0.91 / 200e9)
    np.testing.assert_allclose(h * L**2, 1.0 / (1.0 / (4 * K1 * a) + 1.0 / (4 * K2 * a)), rtol=1e-9)
    np.testing.assert_allclose(error, 0.02 * h, rtol=1e-9)


def test_like_bodies_have_twice_the_radius(tmp_path: Path) -> None:
    h = 2 * K1 * 1e-4 / L**2
    assert Results.read(write(tmp_path, conductivity=K1)).gap_conductance()[1].max() == pytest.approx(h, rel=1e-9)


def test_without_a_conductivity_there_is_none(tmp_path: Path) -> None:
    write(tmp_path)
    assert "conductance" not in figures_of(Results.read(tmp_path))
