"""Each script of examples/ runs and gives its numbers; another version of gmsh makes another mesh."""

from __future__ import annotations

import csv
import json
import runpy
import subprocess
import sys
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import ufl
from conftest import CLEAN, make_block, make_contact_solver
from mpi4py import MPI

import asperity as asp
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


MESH = "checkpoint/mesh.npz"
WAVE = """units = "other"
surface = {kind = "sinusoid", L = 1.0, amplitude = 0.05, dims = 2}
material = {E = 1.0, nu = 0.3, yield_strength = 0.01, tangent_modulus = 0.05}
mesh = {h_contact = 0.4, h_max = 1.0, growth = 1.0}
loading = {delta_max = 0.02, steps = 6}
"""


@pytest.mark.filterwarnings("ignore::asperity.errors.AsperityWarning")
def test_study(tmp_path: Path) -> None:
    """Rows as of runs alone; a failure is a row; a finished run is not repeated, a stopped one continues."""
    base, out = tmp_path / "wave.toml", tmp_path / "out"
    base.write_text(WAVE)
    grid = {"material.tangent_modulus": [0.01, 0.1], "block.height": [1.0, 0.04]}  # lower than the valleys are deep
    call = f"main({str(out)!r}, 2, {str(base)!r}, {grid})"
    code = f"import runpy; main = runpy.run_path({str(EXAMPLES / 'study.py')!r})['main']; {call}"

    def rows() -> list[dict[str, str]]:
        """Of the study in a process of its own."""
        subprocess.run([sys.executable, "-c", code], env=CLEAN, check=True, timeout=100)
        with (out / "results.csv").open(newline="") as file:
            return list(csv.DictReader(file))

    first = rows()
    assert [row["reason"].partition(":")[0] for row in first] == ["done", "error"] * 2
    assert "deepest valley" in first[1]["reason"]
    for row in first[::2]:
        alone = asp.run(asp.Case.load(base, [f"{key}={row[key]}" for key in grid]))
        assert alone.fit is not None
        expected = [alone.fit.k, alone.fit.n, alone.curve.force[-1]]
        assert [float(row[name]) for name in ("k", "n", "force")] == pytest.approx(expected, rel=1e-9)

    soft, hard = (out / f"tangent_modulus={value},height=1.0" for value in (0.01, 0.1))
    kept, saved = ((place / name).stat().st_mtime_ns for place, name in ((soft, "run.log"), (hard, MESH)))
    summary = hard / "summary.json"
    summary.write_text(
        json.dumps(json.loads(summary.read_text()) | {"finished": False})
    )  # as of a job that was stopped
    assert rows() == first and json.loads(summary.read_text())["finished"]
    assert (soft / "run.log").stat().st_mtime_ns == kept
    assert (hard / MESH).stat().st_mtime_ns == saved  # a new start writes its mesh


def test_an_example_without_its_package_names_the_extra(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pyHarm", None)
    with pytest.raises(SystemExit, match=r"pip install 'asperity\[hbm\]'"):
        run("harmonic_balance")
