"""The package at a prompt: representations, functions of dolfinx, JSON, completion."""

from __future__ import annotations

import json
import math
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import asperity as asp
from asperity.cli import group

MAIN = "from asperity.cli import main; main()"  # as the script of the package does
ROOT = Path(__file__).parent.parent
FLAT: dict[str, Any] = {
    "units": "other", "surface": {"kind": "flat", "L": 2.0}, "material": {"E": 5.0, "nu": 0.3},
    "mesh": {"h_contact": 2.0, "h_max": 2.0}, "loading": {"delta_max": 0.01, "steps": 3, "unload": True},
}  # fmt: skip


@pytest.fixture(scope="module")
def result() -> Any:
    return asp.run(asp.Case.from_dict(FLAT))


def test_a_result_draws_itself(result: Any) -> None:
    assert len(result.plot().axes) >= 3
    with pytest.raises(asp.InputError, match="there is no figure 'slip' of this result: choose"):
        result.plot("slip")


# --- functions of dolfinx -------------------------------------------------------------------------------------


@pytest.mark.mpi
def test_displacement_and_stress_of_a_block_in_uniaxial_strain() -> None:
    """Closed form: u_z = -delta z/h, sigma_zz = -M delta/h, sigma_xx = sigma_yy = lambda/M sigma_zz, no shear."""
    import ufl
    from dolfinx import fem

    case = asp.Case.from_dict(FLAT | {"loading": {"delta_max": 0.02, "steps": 1}, "block": {"height": 4.0}})
    contact = asp.run(case).contact
    assert contact is not None
    u, stress = contact.displacement(), contact.stress()
    z, strain = u.function_space.tabulate_dof_coordinates()[:, 2], 0.02 / 4.0
    np.testing.assert_allclose(u.x.array.reshape(-1, 3)[:, 2], -strain * z, atol=1e-10)
    nu = 0.3
    confined = (1 - nu) / ((1 + nu) * (1 - 2 * nu))  # in units of E
    expected = -confined * strain * np.diag([nu / (1 - nu), nu / (1 - nu), 1.0])
    tensors = stress.x.array.reshape(-1, 3, 3)
    np.testing.assert_allclose(tensors, np.broadcast_to(expected, tensors.shape), atol=1e-9)
    energy = 0.5 * contact.solver.solid.comm.allreduce(
        fem.assemble_scalar(fem.form(ufl.inner(stress, ufl.sym(ufl.grad(u))) * ufl.dx))
    )
    assert energy == pytest.approx(0.5 * confined * strain**2 * 2.0, rel=1e-8)  # volume 2 in units of L^3


def test_the_stress_function_is_that_of_the_fields() -> None:
    """Of a plastic wave, whose stress varies and has shear."""
    wave = asp.Surface.from_spec("sinusoid", L=1.0, amplitude=0.05, dims=2)
    solid = asp.Material(1.0, 0.3, 0.005, 0.05)
    size = asp.MeshSize(h_contact=0.3, h_max=0.8)
    result = asp.solve_contact(wave, solid, delta_max=0.02, steps=2, size=size, snapshots=1)
    tensors = result.stress().x.array.reshape(-1, 3, 3)
    rows = result.snapshots[-1].stress
    for i, (a, b) in enumerate(((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))):
        np.testing.assert_allclose(tensors[:, a, b], rows[:, i], atol=1e-14)
        np.testing.assert_array_equal(tensors[:, a, b], tensors[:, b, a])
    assert np.abs(rows[:, 3:]).max() > 1e-4


# --- JSON -----------------------------------------------------------------------------------------------------


@pytest.fixture
def call(capsys: pytest.CaptureFixture[str]) -> Callable[..., Any]:
    """Runs a command; the JSON that it prints, with nothing else on its standard output."""

    def run(*arguments: str | Path) -> Any:
        capsys.readouterr()
        assert not group.main([str(a) for a in arguments], "asperity", standalone_mode=False)
        return json.loads(capsys.readouterr().out)

    return run


@pytest.mark.filterwarnings("ignore")
def test_commands_print_json(tmp_path: Path, call: Callable[..., Any]) -> None:
    demo = ROOT / "cases/single.toml"
    check = call("check", demo, "--json", "--ranks", "2")
    estimate = check["estimate"]
    assert (check["case"], check["accepted"]) == (str(demo), True)
    assert estimate["ranks"] == 2 and estimate["levels"][-1]["dofs"] == estimate["dofs"] > 10_000
    surface = check["surface"]
    assert surface["statistics"]["Sq"] > 0 and len(surface["first_touch"]) == 3
    thresholds = call("dynamics", "--power-law", "1.5", "--set", "dynamics.model=exact", "--json")
    assert thresholds["exact"]["kappa"] == pytest.approx(-1 / 24)
    np.save(tmp_path / "map.npy", 1e-8 * np.random.default_rng(0).standard_normal((65, 65)))
    about = call("import-map", tmp_path / "map.npy", "--pixel", "1e-8", "-o", tmp_path / "map", "--json")
    assert about == json.loads((tmp_path / "map/measured.json").read_text()) and about["statistics"]["Sq"] > 0
    assert (tmp_path / "map/surface.png").is_file() and (tmp_path / "map/spectrum.png").is_file()


def test_the_shell_completes_commands_and_options() -> None:
    for words, expected in (("asperity ru", "plain,run"), ("asperity run --ra", "plain,--ranks")):
        count = str(len(words.split()) - 1)
        environ = {**os.environ, "_ASPERITY_COMPLETE": "bash_complete", "COMP_WORDS": words, "COMP_CWORD": count}
        done = subprocess.run([sys.executable, "-c", MAIN], env=environ, capture_output=True, text=True, timeout=60)
        assert expected in done.stdout.split(), done.stderr


def test_json_has_no_numbers_that_are_not_finite(capsys: pytest.CaptureFixture[str]) -> None:
    from asperity.cli import options

    options.print_json({"a": [math.nan, 1.0, (math.inf, "x")]})
    assert json.loads(capsys.readouterr().out) == {"a": [None, 1.0, [None, "x"]]}
