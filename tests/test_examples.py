"""Each script of examples/ runs and gives its numbers; another version of gmsh makes another mesh."""

from __future__ import annotations

import runpy
import sys
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import ufl
from mpi4py import MPI

import asperity as asp
from asperity.errors import AsperityWarning
from asperity.quasistatic.make import make_block, make_contact_solver

EXAMPLES = Path(__file__).parent.parent / "examples"


def run(name: str) -> Any:
    """What `main` of an example returns; nothing in it is doubtful."""
    with warnings.catch_warnings():
        warnings.simplefilter("error", AsperityWarning)
        return runpy.run_path(str(EXAMPLES / f"{name}.py"))["main"]()


def test_each_has_a_test() -> None:
    tested = {name.removeprefix("test_") for name in globals() if name.startswith("test_")}
    assert {path.stem for path in EXAMPLES.glob("*.py")} <= tested


def test_pressed_block() -> None:
    """Its forces are those of its law in asperity; the penalty is soft where its mesh is."""
    exponent, lacking = run("pressed_block")
    assert 1.0 < exponent < 2.0 and abs(lacking) < 0.05
    example = runpy.run_path(str(EXAMPLES / "pressed_block.py"))
    block_of, plastic = example["Block"], example["j2"]

    @asp.law(
        state={"plastic_strain": (3, 3), "accumulated": ()}, E=example["E"], nu=example["NU"], symmetric=True
    )  # no strength: cells keep the volumetric strain of each point
    def law(strain: Any, state: Any) -> Any:
        pairs = [(0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)]
        stress, after = plastic(strain, [*(state.plastic_strain[ij] for ij in pairs), state.accumulated])
        matrix = ufl.as_matrix([[after[i] for i in row] for row in ((0, 3, 4), (3, 1, 5), (4, 5, 2))])
        return stress, {"plastic_strain": matrix, "accumulated": after[6]}

    wave, approaches = asp.Surface.from_spec("sinusoid", L=1.0, amplitude=0.02, dims=2), np.linspace(0.005, 0.02, 4)
    mesh = make_block(MPI.COMM_WORLD, wave, 1.0, 0.02, asp.MeshSize(h_contact=0.7, h_max=0.9))
    solid = asp.Material.of_law(law)
    for method in ("active-set", "penalty"):
        exact = method == "active-set"
        settings: dict[str, Any] = {"formulation": asp.Formulation(method), "options": asp.SolverOptions(rtol=1e-10)}
        ours = make_contact_solver(MPI.COMM_WORLD, wave, mesh, solid, **settings)
        expected = [ours.step(delta).converged * ours.force for delta in approaches]
        theirs = block_of(ours.solid.mesh)
        if not exact:
            top = ours.contact_surface
            theirs.stiffness.x.array[top.cells] = 10.0 * 2**2 / top.diameter
        forces = theirs.press(ours.summit, approaches, exact)
        assert np.abs(forces - expected).max() < 1e-6 * max(expected)


def test_custom_surface() -> None:
    assert run("custom_surface") == pytest.approx(4.32e-3, rel=0.01)


def test_harmonic_balance() -> None:
    pytest.importorskip("pyHarm", reason="pyHarm is not installed: pip install 'asperity[hbm]'")
    different, amplitude, frequency = run("harmonic_balance")
    assert different < 5e-3  # closest to the tips of the folds; 2e-4 in the middle of the differences
    assert (amplitude, frequency) == (pytest.approx(1.0, abs=0.01), pytest.approx(1.0, abs=0.005))


def test_an_example_without_its_package_names_the_extra(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pyHarm", None)
    with pytest.raises(SystemExit, match=r"pip install 'asperity\[hbm\]'"):
        run("harmonic_balance")
