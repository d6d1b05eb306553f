"""`asperity check`: refuses and warns as a run does, estimates, and solves nothing."""

from __future__ import annotations

import shutil
import warnings
from pathlib import Path

import pytest
from conftest import call

import asperity as asp
from asperity.case import Case
from asperity.errors import AsperityError, AsperityWarning
from asperity.mesh.generate import build_block

ROOT = Path(__file__).parents[2]
COARSE = """
units = "other"
surface = {kind = "sinusoid", L = 1.0, amplitude = 0.02}
material = {E = 1.0, nu = 0.3}
mesh = {h_contact = 0.4, h_max = 1.0, growth = 1.0}
loading = {delta_max = 0.02, steps = 2}
"""
ROUGH = COARSE.replace("sinusoid", "weierstrass-mandelbrot").replace("amplitude = 0.02", "D = 2.4, G = 3e-5")
FRACTAL = f"""
units = "other"
surface = {{kind = "weierstrass-mandelbrot", L = 1e-6, D = 2.5, G = 1e-11}}
material = {{E = 1.0, nu = 0.3}}
mesh = {{file = "{ROOT / "meshes/fractal.npz"}"}}
loading = {{delta_max = 1e-8}}
"""
DEEP = """
units = "other"
surface = {kind = "sphere", shape = "paraboloid", L = 2, radius = 0.5}
material = {E = 10, nu = 0.3}
block = {height = 1, sides = "free"}
mesh = {h_contact = 0.2, h_max = 1.0}
loading = {delta_max = 0.02, steps = 2}
"""
STEEP = """
units = "other"
surface = {kind = "self-affine", L = 1.0, H = 0.5, rms_slope = 3.0, lambda_roll = 0.2, lambda_short = 0.02}
material = {E = 1.0, nu = 0.3}
mesh = {h_contact = 0.3, h_max = 0.5}
loading = {delta_max = 0.002, steps = 2}
"""
OF_MESH = """
units = "other"
surface = {kind = "sinusoid", L = 1.0, amplitude = 0.02}
material = {E = 1.0, nu = 0.3}
mesh = {file = "mesh.npz"}
loading = {delta_max = 0.02, steps = 2}
"""
REFUSED = {
    "a valley below the block": (DEEP, []),
    "the same to a force": (DEEP, ["loading.delta_max=", "loading.force_max=0.02"]),
    "the same to a tolerance": (DEEP, ["mesh=", "accuracy.tolerance=0.1"]),
    "slopes that the elements miss": (STEEP, []),
    "the same to a force that is reached": (STEEP, ["loading.delta_max=", "loading.force_max=1e-5"]),
    "the mesh of another height": (OF_MESH, ["block.height=1.1"]),
    "a mesh whose sides do not fit": (OF_MESH, ['block.sides="periodic"']),
    "more than the block": (COARSE, ["loading.delta_max=1.1"]),
    "a key": (COARSE, ["material.mu=0.3"]),
    "two masters of the mesh": (FRACTAL, ["accuracy.tolerance=0.1"]),
    "the mesh of another surface": (FRACTAL, []),
    "too few dofs": (ROUGH, ["accuracy.tolerance=0.1", "accuracy.max_dofs=1000"]),
    "too few dofs of few elements": (COARSE, ["accuracy.tolerance=0.1", "accuracy.max_dofs=1000"]),
}
DOUBTFUL = {
    "a key that is not used": (COARSE, ["accuracy.max_dofs=5000"]),
    "deeper than the valleys": (COARSE, ["loading.delta_max=0.045", "block.height=4.0"]),
    "steep": (ROUGH, []),
    "short waves": (COARSE, ["surface.wavelength=0.1", "surface.amplitude=0.005", "mesh.growth=10.0"]),
}


@pytest.fixture
def case_file(tmp_path: Path) -> Path:
    return tmp_path / "case.toml"


def check(path: Path, capsys: pytest.CaptureFixture[str], *options: str) -> tuple[int, str, str]:
    """Exit code, output and errors of the command."""
    code = call("check", path, *options)
    return code, *capsys.readouterr()


@pytest.mark.parametrize("name", REFUSED)
def test_what_a_run_refuses_is_refused_in_the_same_words(
    name: str, case_file: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text, changes = REFUSED[name]
    case_file.write_text(text, encoding="utf-8")
    if text == OF_MESH:  # whose opposite sides have other nodes
        wave = asp.Surface.from_spec("sinusoid", L=1.0, amplitude=0.02)
        build_block(wave, 1.0, lambda x, y, depth: 0.3 + 0.1 * x).save(case_file.parent / "mesh.npz")
    code, _, err = check(case_file, capsys, *(f"--set={change}" for change in changes))
    assert code == 2
    with warnings.catch_warnings(), pytest.raises(AsperityError) as refused:
        warnings.simplefilter("ignore")
        asp.run(Case.load(case_file, changes))
    assert refused.value.exit_code == 2
    expected = str(refused.value)
    if name.startswith("too few dofs"):  # the estimate counts the nodes that the run has
        expected, err = "accuracy.max_dofs", err.splitlines()[-1]
    if name.endswith("force that is reached"):  # the approach of a half-space is not that of a coarse mesh
        expected = expected.partition(" smoothed by")[0]
    assert expected in err


@pytest.mark.parametrize("name", DOUBTFUL)
def test_what_a_run_warns_of_before_it_solves_is_warned_of(
    name: str, case_file: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    text, changes = DOUBTFUL[name]
    case_file.write_text(text, encoding="utf-8")

    class SetUp(Exception):
        """The run has judged its mesh and comes to its load path."""

    def stop(*_: object, **__: object) -> None:
        raise SetUp

    monkeypatch.setattr("asperity.quasistatic.solve_problem.Record", stop)
    with warnings.catch_warnings(record=True) as given, pytest.raises(SetUp):
        warnings.simplefilter("always")
        asp.run(Case.load(case_file, changes))
    expected = {str(w.message) for w in given if issubclass(w.category, AsperityWarning)}
    code, out, err = check(case_file, capsys, *(f"--set={change}" for change in changes))
    assert code == 0 and expected and "a run accepts" in out
    assert {line.removeprefix("warning: ") for line in err.splitlines()} == expected


def test_it_solves_and_writes_nothing(
    case_file: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(case_file.parent)
    monkeypatch.setattr("asperity.quasistatic.contact_solver.ContactSolver.solve", None)
    shutil.copy(ROOT / "cases/elastic.toml", case_file)
    code, out, _ = check(case_file, capsys, "--ranks", "4")
    assert code == 0 and "dofs" in out and "GiB" in out and "4 ranks" in out
    assert list(case_file.parent.iterdir()) == [case_file]


@pytest.mark.parametrize("f_max", [5, pytest.param(18, marks=pytest.mark.slow)])
def test_a_rough_case_driven_by_a_force_to_a_tolerance(
    f_max: int, case_file: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A cut-off is advised where no mesh resolves the waves, none where the meshes do."""
    text = """
    surface = {kind = "weierstrass-mandelbrot", L = 1e-6, D = 2.4, G = 1.36e-11, f_max = %d}
    material = {E = 200e9, nu = 0.3}
    loading = {force_max = 5e-4, steps = 5}
    accuracy = {tolerance = 0.02, max_dofs = 200_000}
    """
    case_file.write_text(text % f_max, encoding="utf-8")
    code, out, _ = check(case_file, capsys)
    assert code == 0 and "that of a half-space" in out and "a run accepts" in out
    assert (
        out.count("a run would need more than the 200000 dofs")
        == out.count("or cut off short waves (surface.f_max")
        == (f_max > 5)
    )
    assert "time on one core: about" in " ".join(out.split())
