"""The rule that chooses small or finite strain against both solved on one mesh, its choice, and its record."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import here, make_contact_solver, world

from asperity.adaptive.guide import choose_kinematics
from asperity.adaptive.solve_contact import refine, solve_contact
from asperity.case import Case
from asperity.errors import InputError
from asperity.job.run_case import run
from asperity.model.material import Material
from asperity.model.problem import Problem
from asperity.model.settings import AccuracyTarget, MeshSize
from asperity.surface import Flat, SelfAffine, Sinusoid, Sphere, Surface

AUTO = Material(1.0, 0.3, kinematics="auto")
WAVY: dict[str, Any] = {
    "units": "other",
    "surface": {"kind": "sinusoid", "L": 1.0, "amplitude": 0.01},
    "material": {"E": 1.0, "nu": 0.3, "kinematics": "auto"},
    "mesh": {"h_contact": 0.4, "h_max": 1.0, "growth": 1.0},
    "loading": {"delta_max": 0.008, "steps": 3, "unload": True, "unload_steps": 1},
}


def change(problem: Problem, comm: Any = None) -> float:
    """Estimated change of the force [per cent]."""
    _, found = choose_kinematics(problem, comm=comm or here())
    assert found is not None
    return found.percent


@pytest.mark.parametrize("sides", ["rollers", "free"])
@pytest.mark.parametrize("e", [0.001, 0.05])
def test_of_a_plane_block_it_is_the_closed_form(e: float, sides: str) -> None:
    """Uniaxial: -e against ln(1 - e)/(1 - e); pressed by a force its compression is found."""
    driven: tuple[dict[str, Any], ...] = ({"delta_max": e}, {"force_max": e * AUTO.block_modulus(sides)})
    for found in [change(Problem.of(Flat(L=1.0), AUTO, sides=sides, **given)) for given in driven]:
        assert found == pytest.approx(-100 * (e * (1 - e) / -np.log1p(-e) - 1), rel=0.1)


@pytest.mark.parametrize(
    ("surface", "depth", "yields", "most"),
    [
        (SelfAffine(L=1.0, H=0.7, slope=0.12, lambda_roll=0.5, lambda_short=0.15, seed=12), 0.012, None, 3.0),
        (SelfAffine(L=1.0, H=0.8, slope=0.4, lambda_roll=0.5, lambda_short=0.1, seed=3), 0.04, (0.005, 0.2), 15.0),
        (Sphere(L=1.0, radius=1.0, centre=(0.4, 0.45), shape="paraboloid"), 0.02, (0.002, 0.001), 5.0),
        (Flat(L=1.0), 0.04, (0.005, 0.02), 5.0),
    ],
    ids=["elastic", "steep", "indented", "block that flows"],
)
def test_it_errs_towards_finite_strain(
    surface: Surface, depth: float, yields: tuple[float, float] | None, most: float
) -> None:
    """The forces of both strains on one mesh, along the path, differ by less, but not much."""
    forces, (strength, modulus) = [], yields or (None, 0.0)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of the slopes
        auto = Material(1.0, 0.3, strength, modulus, kinematics="auto")
        estimated = change(Problem.of(surface, auto, delta_max=depth))
        for kinematics in ("small", "finite"):
            material = Material(1.0, 0.3, strength, modulus, kinematics=kinematics)
            curve = solve_contact(surface, material, delta_max=depth, steps=5, size=MeshSize(0.09), comm=here()).curve
            forces.append(np.interp(depth * np.arange(1, 6) / 5, curve.delta, curve.force))
    found = 100.0 * float(np.max(np.abs(forces[0] / forces[1] - 1.0)))
    assert found <= estimated <= most * found + 0.5


@pytest.mark.parametrize(("tolerance", "delta"), [(None, 0.05 / 3 / 1.5), (0.006, 0.002 / 1.5)])
def test_small_strain_is_chosen_below_the_limit(tolerance: float | None, delta: float) -> None:
    """A third of the tolerance, or of 5 %; the change of a plane block is 1.5 of its strain."""
    for part, kinematics in ((0.98, "small"), (1.03, "finite")):
        chosen, found = choose_kinematics(Problem.of(Flat(L=1.0), AUTO, delta_max=part * delta), tolerance, here())
        assert found is not None and chosen.material.kinematics == found.kinematics == kinematics
        assert found.percent == pytest.approx(found.limit * part, rel=0.01)
    given = Problem.of(Flat(L=1.0), Material(1.0, 0.3), delta_max=0.5)
    assert choose_kinematics(given, tolerance, here()) == (given, None)


def test_a_solver_refuses_what_is_not_decided() -> None:
    message, size = r"asp\.choose_kinematics", MeshSize(0.3, h_max=0.6)
    with pytest.raises(InputError, match=message):
        solve_contact(Flat(L=1.0), AUTO, delta_max=0.01, size=size, comm=here())
    with pytest.raises(InputError, match=message):
        make_contact_solver(here(), Flat(L=1.0), None, AUTO)
    with pytest.raises(InputError, match=message):
        refine(Problem.of(Flat(L=1.0), AUTO, delta_max=0.01), AccuracyTarget(0.1), here())
    with pytest.raises(InputError, match='kinematics = "large" is not a choice, legal: "small"'):
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
def test_the_choice_and_its_record_are_the_same_on_any_number_of_ranks(shared_path: Path) -> None:
    problem = Problem.of(Sinusoid(L=1.0, amplitude=0.02, dims=2), AUTO, delta_max=0.01, steps=3)
    assert change(problem) == change(problem, world())
    summary = run(Case.from_dict(WAVY), shared_path / "out").summary
    assert world().allgather(summary["model"]) == [summary["model"]] * world().size
    model = summary["model"]
    assert model["kinematics"] == "small" and 0.1 < model["small_strain"]["greatest_percent"] < 1.0
    assert Case.load(shared_path / "out/case.toml") == Case.from_dict(WAVY)
    assert "small strain changes the force by up to" in (shared_path / "out/run.log").read_text()
    given = run(Case.from_dict(WAVY | {"material": {"E": 1.0, "nu": 0.3}})).summary["model"]
    assert given == {"kinematics": "small", "small_strain": None}
