"""Warnings: they point to the line of the user, say numbers that help, and are the same in all systems of units."""

from __future__ import annotations

import re
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import asperity as asp
from asperity.errors import AsperityWarning
from asperity.mesh.resolution import doubt_of_waves, unresolved_height

STEEP: dict[str, Any] = {"kind": "self-affine", "H": 0.8, "rms_slope": 0.2, "lambda_short": 0.2, "lambda_roll": 0.5}


def press(tmp_path: Path) -> None:
    surface = asp.Surface.from_spec(**STEEP, L=1.0)
    size = asp.MeshSize(h_contact=0.2, h_max=0.5, growth=1.0)
    asp.solve_contact(surface, asp.Material(E=1.0, nu=0.3), delta_max=0.01, steps=1, size=size)


def run(tmp_path: Path) -> None:
    case = {
        "units": "other", "surface": STEEP | {"L": 1.0}, "material": {"E": 1.0, "nu": 0.3},
        "mesh": {"h_contact": 0.2, "h_max": 0.5, "growth": 1.0}, "loading": {"delta_max": 0.01, "steps": 1},
        "contact": {"penalty": 20.0},
    }  # fmt: skip
    asp.run(asp.Case.from_dict(case), tmp_path / "out")


def vibrate(tmp_path: Path) -> None:
    delta = np.linspace(0.0, 1.0, 30)[1:]
    asp.run_dynamics({"delta": delta, "force": delta**1.5}, units="other", preload=1.0, omega=(0.9, 1.1), tol=1e-2)
    asp.ContactOscillator(asp.PowerLaw(9.5), zeta=0.01)
    asp.Surface.from_spec("weierstrass-mandelbrot", L=1.0, D=2.4, G=1e-5, f_max=2, gamma=1.01, M=3)


@pytest.mark.parametrize("call", [press, run, vibrate])
def test_a_warning_points_to_the_line_of_the_user(tmp_path: Path, call: Callable[[Path], None]) -> None:
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        call(tmp_path)
    own = [w for w in caught if issubclass(w.category, AsperityWarning)]
    assert {w.filename for w in own} <= {__file__} and (own or call is vibrate)


@pytest.mark.parametrize("unit", [1.0, 1e-9, 1e-6, 3e-4, 7.0])
def test_a_slope_of_the_limit_is_within_it_in_all_units(unit: float) -> None:
    """The rms slope of a sinusoid along x and y is pi 2^0.5 amplitude over wavelength; here 0.1 but for rounding."""
    amplitude = 0.1 / asp.Surface.from_spec("sinusoid", L=1.0, amplitude=1.0).rms_slope()
    for more, warned in ((1.0, False), (1.0 + 1e-12, False), (1.001, True)):
        surface = asp.Surface.from_spec("sinusoid", L=unit, amplitude=more * amplitude * unit)
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            surface.check_small_slope()
        assert bool(caught) == warned


@pytest.mark.parametrize("h", [1e-6, 1.2e-5, 1.204e-5, 1.25e-5, 9.9e-6, 1.0001e-5])
def test_the_size_that_would_resolve_is_another_one_and_resolves(h: float) -> None:
    """For approaches at which the size is just too large, and others."""
    spec = STEEP | {"L": 1e-4, "rms_slope": 0.06, "lambda_roll": 50e-6, "lambda_short": 20e-6}
    surface = asp.Surface.from_spec(**spec)
    found = 0
    for delta in np.geomspace(1e-9, 1e-5, 60):
        if text := doubt_of_waves(surface, h, delta):
            size = float(re.findall(r"about as much: (\S+) would resolve", text)[0])
            assert f"{h:.3g}" not in (f"{size:g}", f"{size:.3g}") and size < h
            assert unresolved_height(surface, size, delta) <= unresolved_height(surface, h, delta)
            found += 1
    assert found or h < 2e-6
