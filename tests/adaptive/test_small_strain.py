"""Small against finite strain on a coarse mesh: closed forms of a plane block, the choice, its record, resuming."""

from __future__ import annotations

import json
import tomllib
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import here, world

from asperity.adaptive import small_strain
from asperity.adaptive.mesh_plan import COARSE
from asperity.adaptive.refine import refine
from asperity.adaptive.small_strain import SmallStrain, choose_kinematics, differences
from asperity.adaptive.solve_contact import solve_contact
from asperity.case import Case
from asperity.curve import Curve
from asperity.errors import InputError, Interrupted
from asperity.model.material import Material
from asperity.model.problem import Problem
from asperity.model.settings import AccuracyTarget, MeshSize
from asperity.quasistatic.callbacks import Callbacks
from asperity.quasistatic.make import make_contact_solver
from asperity.run_case import run
from asperity.surface import Flat, Sinusoid, Surface

AUTO = Material(1.0, 0.3, kinematics="auto")
SIZE = MeshSize(0.3, h_max=0.6)
WAVY: dict[str, Any] = {
    "units": "other",
    "surface": {"kind": "sinusoid", "L": 1.0, "amplitude": 0.01},
    "material": {"E": 1.0, "nu": 0.3, "kinematics": "auto"},
    "mesh": {"h_contact": 0.4, "h_max": 1.0, "growth": 1.0},
    "loading": {"delta_max": 0.008, "steps": 3, "unload": True, "unload_steps": 1},
}


def plane(delta: float, **settings: Any) -> Problem:
    """A plane block, which is in uniaxial strain."""
    return Problem.of(Flat(L=1.0), AUTO, delta_max=delta, steps=2, size=SIZE, **settings)


def hencky(e: Any) -> Any:
    """Force in small strain over that in logarithmic strain in uniaxial strain: -e against ln(1 - e)/(1 - e)."""
    return e * (1 - e) / -np.log1p(-e) - 1


def found(**changes: Any) -> SmallStrain:
    values: dict[str, Any] = {"kinematics": "small", "limit": 1.0, "branch": ("load",), "delta": np.array([0.1])}
    values |= {"percent": np.array([-0.5]), "slope_seen": 1.0, "h": 0.1, "dofs": 5000, "reason": ""}
    return SmallStrain(**(values | changes))


# --- the estimate ---------------------------------------------------------------------------------------------


def test_the_difference_of_a_plane_block_is_that_of_the_closed_form() -> None:
    chosen, strain = choose_kinematics(plane(0.1), comm=here())
    assert strain.percent == pytest.approx(100 * hencky(strain.delta), abs=1e-3)
    assert strain.delta == pytest.approx([0.05, 0.1])
    assert (chosen.material.kinematics, strain.kinematics, strain.slope_seen) == ("finite", "finite", 1.0)


def test_the_unloading_is_relative_to_the_greatest_force() -> None:
    _, strain = choose_kinematics(plane(0.02, unload_steps=2), comm=here())
    assert strain.branch == ("load", "load", "unload", "unload")
    top = -np.log1p(-0.02) / (1 - 0.02)
    e = strain.delta[2:]
    assert strain.percent[2:] == pytest.approx(100 * (e + np.log1p(-e) / (1 - e)) / top, abs=0.05)
    assert strain.percent[-1] == 0.0


@pytest.mark.parametrize(("tolerance", "delta"), [(None, 0.01 / 1.5), (0.006, 0.002 / 1.5)])
def test_small_strain_is_chosen_below_the_limit(tolerance: float | None, delta: float) -> None:
    """A third of the tolerance, or 1 %; the difference of a plane block is about 1.5 of its strain."""
    kinematics = []
    for part in (0.98, 1.03):
        chosen, strain = choose_kinematics(plane(part * delta), tolerance, here())
        kinematics.append(chosen.material.kinematics)
        assert strain.greatest == pytest.approx(strain.limit * part, rel=0.02)
    assert kinematics == ["small", "finite"]


def test_a_steep_surface_lightly_pressed_is_seen_by_a_finer_mesh() -> None:
    """The summit of the first coarse mesh lies below the last position of the flat."""
    steep = Surface.from_spec("self-affine", L=1.0, H=0.8, rms_slope=0.7, lambda_short=0.05, seed=1)
    chosen, strain = choose_kinematics(Problem.of(steep, AUTO, delta_max=0.003, steps=3), comm=here())
    assert strain.h < COARSE and not strain.reason
    assert strain.greatest is not None and strain.greatest == pytest.approx(3.9, abs=1.0)
    assert chosen.material.kinematics == "finite"


def test_the_coarse_mesh_has_the_sides_of_the_block() -> None:
    rough = Surface.from_spec("self-affine", L=1.0, H=0.8, rms_height=0.002, lambda_short=0.5, seed=1)
    block = Problem.of(rough, AUTO, sides="periodic", delta_max=0.004, steps=2, size=MeshSize(0.15))
    chosen, strain = choose_kinematics(block, comm=here())
    assert chosen.sides == "periodic" and chosen.material.kinematics == "small" and not strain.reason


def test_what_is_not_known_is_computed_in_finite_strain() -> None:
    assert found().enough
    assert not found(reason="a coarse mesh that does not converge").enough
    assert not found(percent=np.empty(0)).enough and found(percent=np.empty(0)).greatest is None
    blunt = found(slope_seen=0.4)  # a mesh that sees 0.4 of the slopes
    assert blunt.greatest == pytest.approx(1.25) and not blunt.enough
    assert "could not be compared, why" in found(percent=np.empty(0), reason="why").describe()


def test_a_light_contact_takes_a_finer_mesh() -> None:
    """On the first mesh it touches a few facets only, which show nothing."""
    surface = Surface.from_spec("sphere", L=1.0, radius=10.0, shape="paraboloid")
    problem = Problem.of(surface, AUTO, delta_max=5e-6, steps=2)
    _, strain = choose_kinematics(problem, 0.01, here())
    assert strain.h < 0.1 and not strain.reason and strain.enough


def test_a_failed_comparison_takes_finite_strain(monkeypatch: pytest.MonkeyPatch) -> None:
    """Finite strain ends early on the coarse mesh: what is known up to there is not enough."""
    true_press = small_strain._press

    def press(problem: Problem, kinematics: str, *rest: Any) -> tuple[Curve, str]:
        curve, _ = true_press(problem, kinematics, *rest)
        return (curve, "") if kinematics == "small" else (curve.where(np.arange(len(curve)) < 1), "no convergence")

    monkeypatch.setattr(small_strain, "_press", press)
    monkeypatch.setattr(small_strain, "MOST_MESHES", 1)
    chosen, strain = choose_kinematics(plane(1e-4), comm=here())
    assert chosen.material.kinematics == "finite" and strain.reason == "no convergence" and len(strain.percent) == 1


def test_steps_that_only_one_curve_has_are_left_out() -> None:
    """A step that was cut in one kinematics has no counterpart."""
    delta = np.array([0.2, 0.4, 0.6, 0.8, 1.0])
    rows = [{"delta": d, "delta_star": d, "force": d**1.5, "P_star": d**1.5} for d in delta]
    cut = {"delta": 0.9, "delta_star": 0.9, "force": 0.85, "P_star": 0.85}
    small, finite = Curve.from_rows([*rows[:-1], cut, rows[-1]]), Curve.from_rows(rows)
    branch, at, percent = differences(small, finite, 5)
    assert at.tolist() == delta.tolist() and np.abs(percent).max() < 1e-12 and set(branch) == {"load"}


# --- who decides ----------------------------------------------------------------------------------------------


def test_a_solver_refuses_what_is_not_decided() -> None:
    message = r"asp\.choose_kinematics"
    with pytest.raises(InputError, match=message):
        solve_contact(Flat(L=1.0), AUTO, delta_max=0.01, size=SIZE, comm=here())
    with pytest.raises(InputError, match=message):
        make_contact_solver(here(), Flat(L=1.0), None, AUTO)
    with pytest.raises(InputError, match=message):
        refine(plane(0.01), AccuracyTarget(0.1), here())
    with pytest.raises(InputError, match='kinematics = "large" is not one of small'):
        Material(1.0, 0.3, kinematics="large")


def test_slopes_are_a_limit_of_small_strain_alone() -> None:
    steep = Surface.from_spec("weierstrass-mandelbrot", L=1.0, D=2.4, G=1.36e-5)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for kinematics in ("finite", "auto"):
            Problem.of(steep, Material(1.0, 0.3, kinematics=kinematics), delta_max=0.01)
    with pytest.warns(UserWarning, match="rms slope"):
        Problem.of(steep, Material(1.0, 0.3), delta_max=0.01)


@pytest.mark.mpi
def test_the_choice_is_the_same_on_any_number_of_ranks(shared_path: Path) -> None:
    wave = Sinusoid(L=1.0, amplitude=0.02, dims=2)
    results = []
    for comm in (here(), world()):
        problem = Problem.of(wave, AUTO, delta_max=0.01, steps=3, unload_steps=2)
        results.append(choose_kinematics(problem, comm=comm))
    (one, first), (all_, second) = results
    assert one.material == all_.material
    assert first.greatest == second.greatest and first.slope_seen == second.slope_seen
    assert first.percent.tolist() == second.percent.tolist()
    summary = run(Case.from_dict(WAVY), shared_path / "out").summary
    assert world().allgather(summary["model"]) == [summary["model"]] * world().size
    assert summary["assumptions"] == json.loads((shared_path / "out/summary.json").read_text())["assumptions"]


# --- in the files of a run ------------------------------------------------------------------------------------


def test_a_run_keeps_its_choice(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Stopped on the coarse mesh, then on the path, continued and called again: computed once, and then only read."""
    from asperity.runtime import interrupt

    case, folder = Case.from_dict(WAVY), tmp_path / "out"
    straight = run(case).summary["model"]
    assert straight["kinematics"] == "small" and straight["small_strain"]["greatest_percent"] < 1.0

    def attempt(stop_after: int) -> dict[str, Any]:
        answers = iter([""] * stop_after + ["the test"] * 100)
        with monkeypatch.context() as patch:
            patch.setattr(interrupt.StopRequest, "agreed", lambda self: next(answers))
            return dict(run(case, folder, resume=True).summary)

    with pytest.raises(Interrupted, match="coarse mesh, small strain: stopped by the test"):
        attempt(4)
    with pytest.raises(Interrupted, match="stopped by the test"):
        attempt(18)
    summary = attempt(100)
    assert summary["model"] == straight
    assert case.to_toml() in (folder / "case.toml").read_text()
    assert (folder / "case.toml").read_text().startswith('# kinematics = "auto" took "small"\n')
    assert Case.load(folder / "case.toml") == case
    monkeypatch.setattr(small_strain, "_comparisons", None)
    assert run(case, folder, resume=True).contact is None  # finished: nothing is computed
    log = (folder / "run.log").read_text()
    assert "kinematics = small: small strain changes the force by up to" in log


def test_a_path_is_not_continued_in_other_kinematics(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A continued run may choose otherwise, for more cycles show more: its path starts again."""
    from asperity.runtime import interrupt

    case, folder = Case.from_dict(WAVY), tmp_path / "out"
    with monkeypatch.context() as patch:
        answers = iter([""] * 20 + ["the test"] * 100)
        patch.setattr(interrupt.StopRequest, "agreed", lambda self: next(answers))
        with pytest.raises(Interrupted, match=r"^stopped by the test after step 2"):
            run(case, folder)
    monkeypatch.setattr(small_strain, "ONE_MESH", 1e-6)
    resumed = run(case, folder, resume=True)
    finite = run(Case.from_dict(WAVY | {"material": {"E": 1.0, "nu": 0.3, "kinematics": "finite"}}))
    assert resumed.summary["model"]["kinematics"] == "finite"
    assert resumed.curve.force.tolist() == finite.curve.force.tolist()


def test_a_run_in_finite_strain_or_on_request_reports_the_difference(tmp_path: Path) -> None:
    finite = Case.from_dict(WAVY | {"material": {"E": 1.0, "nu": 0.3, "kinematics": "finite"}})
    asked = Case.from_dict(WAVY | {"material": {"E": 1.0, "nu": 0.3}, "output": {"small_strain": True}})
    quiet = Case.from_dict(WAVY | {"material": {"E": 1.0, "nu": 0.3}})
    models = [run(case, tmp_path / name).summary["model"] for name, case in (("f", finite), ("a", asked), ("q", quiet))]
    assert [model["kinematics"] for model in models] == ["finite", "small", "small"]
    assert models[0]["small_strain"] == models[1]["small_strain"] and models[2]["small_strain"] is None
    assert "# " not in (tmp_path / "f/case.toml").read_text()
    curves = [Curve.read(tmp_path / name / "curve.csv") for name in ("a", "q")]
    assert curves[0].force.tolist() == curves[1].force.tolist()


def test_a_run_with_a_tolerance_chooses_too(tmp_path: Path) -> None:
    case = {
        "units": "other",
        "surface": {"kind": "sphere", "L": 1.0, "radius": 1.5},
        "material": {"E": 1.0, "nu": 0.3, "kinematics": "auto"},
        "loading": {"delta_max": 0.004, "steps": 5},
        "accuracy": {"tolerance": 0.05},
    }
    summary = run(Case.from_dict(case), tmp_path).summary
    model = summary["model"]
    assert model["small_strain"]["limit_percent"] == pytest.approx(5.0 / 3.0)
    assert model["kinematics"] == "small" and 0.0 < model["small_strain"]["greatest_percent"] < 5.0 / 3.0
    assert summary["accuracy"]["met"] and tomllib.loads((tmp_path / "case.toml").read_text())


def test_an_interrupted_comparison_is_no_failure() -> None:
    hooks = Callbacks(stop=lambda: "the test")
    with pytest.raises(Interrupted, match="coarse mesh, small strain: stopped by the test"):
        choose_kinematics(plane(0.01), comm=here(), hooks=hooks)
