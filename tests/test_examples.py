"""Each script of examples/ runs and gives its numbers; another version of gmsh makes another mesh."""

from __future__ import annotations

import runpy
import warnings
from pathlib import Path
from typing import Any

import pytest

from asperity.errors import AsperityWarning

EXAMPLES = Path(__file__).parent.parent / "examples"


def run(name: str) -> Any:
    """What `main` of an example returns; nothing in it is doubtful."""
    with warnings.catch_warnings():
        warnings.simplefilter("error", AsperityWarning)
        return runpy.run_path(str(EXAMPLES / f"{name}.py"))["main"]()


def test_each_has_a_test() -> None:
    tested = {name.removeprefix("test_") for name in globals() if name.startswith("test_")}
    assert {path.stem for path in EXAMPLES.glob("*.py")} <= tested


def test_hertz() -> None:
    assert run("hertz") < 0.03  # of the closed form; the mesh is coarse


def test_tangent_modulus() -> None:
    assert run("tangent_modulus") == pytest.approx([1.795, 1.833, 1.830], abs=0.02)


def test_custom_surface() -> None:
    assert run("custom_surface") == pytest.approx(4.32e-3, rel=0.01)


def test_vibration() -> None:
    ratio, peak = run("vibration")
    assert ratio == pytest.approx(0.985728, abs=2e-6)  # quadrature of the law that the table is taken from
    assert peak == pytest.approx(0.9322, abs=1e-3)


def test_parallel_study() -> None:
    mean, low, high = run("parallel_study")
    assert mean == pytest.approx(1.143, abs=0.01)
    assert 1.0 < low < mean < high  # hardening is seen


def test_measured_surface() -> None:
    H, load = run("measured_surface")
    assert H == pytest.approx(3 - 2.4, abs=0.1)  # 3 - D
    assert load == pytest.approx(3.46e-3, rel=0.02)


def test_harmonic_balance() -> None:
    pytest.importorskip("pyHarm", reason="pyHarm is not installed: pip install 'asperity[hbm]'")
    different, amplitude, frequency = run("harmonic_balance")
    assert different < 5e-3  # closest to the tips of the folds; 2e-4 in the middle of the differences
    assert (amplitude, frequency) == (pytest.approx(1.0, abs=0.01), pytest.approx(1.0, abs=0.005))
