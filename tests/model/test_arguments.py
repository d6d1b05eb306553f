"""Arguments of a script: those of the command, with the same limits, each refused in one sentence."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from dataclasses import fields
from typing import Any

import pytest

import asperity
from asperity.adaptive.solve_contact import Arguments
from asperity.case.case_file import Case
from asperity.errors import CaseWarning, InputError
from asperity.model.load_path import Schedule
from asperity.model.problem import Problem
from asperity.quasistatic.solve_problem import Callbacks
from asperity.surface import Flat, Surface

asp: Any = asperity  # wrong types on purpose
L = 1e-6
STEEL = asp.Material(200e9, 0.3, yield_strength=1e9)
SPEC: dict[str, Any] = {"kind": "self-affine", "L": L, "H": 0.8, "rms_slope": 0.05, "lambda_short": 0.1e-6, "seed": 3}
WAVE = Surface.from_spec("sinusoid", L=L, amplitude=5e-9)


@pytest.mark.parametrize(
    ("call", "legal"),
    [
        (lambda: asp.Material("200 GPa", 0.3), 'material.E = "200 GPa" must be a number, legal: [1e-20, 1e+40]'),
        (lambda: asp.Material(), "material.E is missing: Young's modulus"),
        (lambda: asp.Material(1.0, 0.3, 0.1, yeild_strength=1.0), 'did you mean "yield_strength"?'),
        (lambda: asp.Material(1.0, 0.3, nu=0.3), "material.nu is given twice"),
        (lambda: asp.Joint(1, 2, None, 4, 5, 6), "joint has no more than 5 values: nominal_area, preload"),
        (lambda: asp.SolverOptions(krylov_rtol=-1.0), "solver.krylov_rtol = -1 is not legal"),
        (lambda: asp.solve_contact(STEEL, WAVE, delta_max=1e-9), "surface = Material("),
        (
            lambda: asp.solve_contact(WAVE, 200e9, delta_max=1e-9),
            "material = 2e+11 is not legal: it must be a material",
        ),
        (lambda: asp.solve_contact(WAVE, STEEL, delta_max=1e-9, size=6e-8), "size = 6e-08 is not legal"),
        (lambda: asp.solve_contact(WAVE, STEEL, delta_max=1e-9, formulation="nitsche"), "asp.Formulation"),
        (lambda: asp.solve_contact(WAVE, STEEL, delta_max=1e-9, stepz=3), 'did you mean "steps"?'),
        (lambda: asp.solve_contact(WAVE, STEEL, delta_max=1e-9, sides="roller"), 'block.sides = "roller" is not a'),
        (lambda: asp.solve_contact(WAVE, STEEL, delta_max=1e-9, tolerance=asp.AccuracyTarget()), "accuracy.tolerance"),
    ],
)
def test_arguments_that_no_case_has_are_refused_in_the_same_way(call: Callable[[], Any], legal: str) -> None:
    with pytest.raises(InputError) as caught:
        call()
    assert legal in str(caught.value) and "\n" not in str(caught.value)


@pytest.mark.parametrize("whole", [False, True])
def test_a_doubtful_load_is_told_to_scripts_and_commands(whole: bool) -> None:
    def make(delta_max: float) -> None:
        solid, loading = {"E": 200e9, "nu": 0.3}, {"delta_max": delta_max}
        if whole:
            Case.from_dict({"surface": SPEC, "material": solid, "loading": loading}).problem()
        else:
            Problem.of(Surface.from_spec(**SPEC), asp.Material(**solid), **loading)  # type: ignore[arg-type]

    with pytest.warns(CaseWarning, match="more than the surface's depth"):
        make(30e-9)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        make(2e-9)


def test_arguments_are_those_of_problem_load_path_and_callbacks() -> None:
    known = {field.name for kind in (Problem, Schedule, Callbacks) for field in fields(kind)}
    inside = {"surface", "material", "load_path", "block_height", "sticks"}
    assert Arguments.__optional_keys__ == known - inside | {"height", "pressure_max"}


def test_problem_and_flat_arguments_give_the_same() -> None:
    top, solid = Flat(L=1.0), asp.Material(1.0, 0.3)
    short = asp.solve_contact(top, solid, delta_max=0.01, steps=2, tolerance=0.01)
    same = asp.solve_contact(top, solid, delta_max=0.01, steps=2, tolerance=asp.AccuracyTarget(0.01))
    problem = Problem.of(top, solid, delta_max=0.01, steps=2)
    long = asp.solve_contact(problem, tolerance=0.01)
    assert short.curve.force.tolist() == same.curve.force.tolist() == long.curve.force.tolist()
    for wrong in ({"size": asp.MeshSize(0.1)}, {"substeps": 2}):
        with pytest.raises(InputError, match="leave out block, size"):
            asp.solve_contact(top, solid, delta_max=0.01, tolerance=0.01, **wrong)
    with pytest.raises(InputError, match="leave out material, steps"):
        asp.solve_contact(problem, solid, steps=3)
    one, flat = asp.solve_contact(problem), asp.solve_contact(top, solid, delta_max=0.01, steps=2)
    assert one.curve.force.tolist() == flat.curve.force.tolist()
