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
from asperity.quasistatic.callbacks import Callbacks
from asperity.surface import Flat, Surface

asp: Any = asperity  # wrong types on purpose
L = 1e-6
STEEL = asp.Material(200e9, 0.3, yield_strength=1e9)
SPEC: dict[str, Any] = {"kind": "self-affine", "L": L, "H": 0.8, "rms_slope": 0.05, "lambda_short": 0.1e-6, "seed": 3}
WAVE = Surface.from_spec("sinusoid", L=L, amplitude=5e-9)


@pytest.mark.parametrize(
    ("call", "legal"),
    [
        (lambda: asp.Material("200 GPa", 0.3), "material.E = '200 GPa' must be a number"),
        (lambda: asp.Material(True, 0.3), "material.E = True must be a number"),
        (lambda: asp.Material(float("nan"), 0.3), "material.E = nan must lie in"),
        (lambda: asp.Material(1.0, 0.3, 0.1, 1.0), "material.tangent_modulus = 1"),
        (lambda: asp.Material(1.0, 0.3, 0.1, -0.1), "material.tangent_modulus = -0.1"),
        (lambda: asp.Material(1.0, 0.3, hardening="kinematic"), "needs material.yield_strength"),
        (lambda: asp.Material(1.0, 0.3, 0.1, 0.1, "kinetic"), "material.hardening = .* must be"),
        (lambda: asp.Material(1.0, 0.3, 0.1, 0.1, 1.5), "material.hardening = 1.5 must be"),
        (lambda: asp.Formulation("nitsche", gamma=float("nan")), "contact.gamma = nan is below .* is stable"),
        (lambda: asp.MeshSize("40 nm"), "mesh.h_contact = '40 nm' must be a number"),
        (lambda: asp.Formulation(1), "contact.method = 1 must be a text"),
        (lambda: asp.SolverOptions(newton_max=2.5), "solver.newton_max = 2.5 must be a whole number"),
        (lambda: asp.SolverOptions(krylov_rtol=-1.0), r"krylov_rtol = -1.0 must lie in \(0, 1\)"),
        (lambda: asp.SolverOptions(krylov_rtol=float("nan")), r"krylov_rtol = nan must lie in \(0, 1\)"),
        (lambda: asp.Joint(preload=1.0, pressure=2.0), "joint.preload and joint.pressure are both given"),
        (lambda: asp.Joint(pressure=-1.0), "joint.pressure = -1.0 is not legal"),
        (lambda: asp.AccuracyTarget("1 %"), "accuracy.tolerance = '1 %' must be a number"),
        (
            lambda: Schedule(delta_max="1e-9"),  # type: ignore[arg-type]
            "loading.delta_max = '1e-9' must be a number",
        ),
        (lambda: asp.solve_contact(STEEL, WAVE, delta_max=1e-9), "surface = Material.* must be a surface"),
        (lambda: asp.solve_contact(WAVE, 200e9, delta_max=1e-9), r"material = 2e\+11 must be a material"),
        (lambda: asp.solve_contact(WAVE, STEEL, delta_max=1e-9, size=6e-8), "size = 6e-08 must be .*asp.MeshSize"),
        (lambda: asp.solve_contact(WAVE, STEEL, pressure_max="1 GPa"), "loading.pressure_max = '1 GPa' must be"),
        (lambda: asp.solve_contact(WAVE, STEEL, delta_max=1e-9, steps=2.0), "loading.steps = 2 must be a whole number"),
        (lambda: asp.solve_contact(WAVE, STEEL, delta_max=1e-9, sides="roller"), "block.sides = .* is not one of"),
        (lambda: asp.solve_contact(WAVE, STEEL, delta_max=1e-9, integrator="rk4"), "loading.integrator = .* not one"),
        (lambda: asp.solve_contact(WAVE, STEEL, delta_max=1e-9, formulation="nitsche"), "must be .*asp.Formulation"),
        (lambda: asp.solve_contact(WAVE, STEEL, delta_max=1e-9, options="cg"), "options = 'cg' must be .*asp.Solver"),
        (lambda: asp.solve_contact(WAVE, STEEL, delta_max=1e-9, tolerance="1 %"), "accuracy.tolerance = '1 %' must be"),
    ],
)
def test_a_value_of_another_type_is_refused_with_the_legal_form(call: Callable[[], Any], legal: str) -> None:
    with pytest.raises(InputError, match=legal) as caught:
        call()
    assert "\n" not in str(caught.value)


def tables_of(changes: dict[str, Any]) -> dict[str, Any]:
    """Tables of a case with these keys."""
    tables: dict[str, Any] = {"surface": SPEC, "material": {"E": 200e9, "nu": 0.3}, "loading": {}}
    if not {"loading.force_max", "loading.pressure_max"} & changes.keys():
        tables["loading"]["delta_max"] = 2e-9
    for key, value in changes.items():
        section, name = key.split(".")
        tables.setdefault(section, {})[name] = value
    return tables


def of_script(tables: dict[str, Any]) -> Problem:
    """The problem of a case as a script makes it."""
    kinds = {"size": ("mesh", asp.MeshSize), "formulation": ("contact", asp.Formulation)}
    kinds["options"] = ("solver", asp.SolverOptions)
    parts = {name: kind(**tables.get(section, {})) for name, (section, kind) in kinds.items()}
    surface, material = Surface.from_spec(**tables["surface"]), asp.Material(**tables["material"])
    return Problem.of(surface, material, **parts, **tables["loading"], **tables.get("block", {}))


# metres for micrometres, more than the block; above the greatest size; GPa for Pa
REFUSED: dict[str, tuple[Any, ...]] = {
    "loading.delta_max": (0.02, 1.1e-6, 1e-14, -1e-9), "loading.force_max": (1.0, 1e-20),
    "loading.pressure_max": (1e12,), "loading.steps": (0,), "loading.cycles": (0,), "block.height": (1.0,),
    "mesh.h_contact": (0.04, 0.5e-6), "mesh.h_max": (1e-12,), "mesh.growth": (0.0,),
    "material.E": (0.0, float("inf")), "material.nu": (0.4951, -1.0), "material.yield_strength": (1.0, 300e9, 0.0),
    "contact.method": ("glue",), "contact.penalty": (1e9,), "solver.linear": ("qr",), "solver.rtol": (0.5,),
    "solver.newton_max": (0,),
}  # fmt: skip


@pytest.mark.parametrize(("key", "value"), [(key, value) for key, values in REFUSED.items() for value in values])
@pytest.mark.parametrize("make", [of_script, lambda tables: Case.from_dict(tables).problem()])
def test_script_and_command_refuse_the_same(make: Callable[[Any], Problem], key: str, value: Any) -> None:
    with pytest.raises(InputError, match=key.partition(".")[2]):
        make(tables_of({key: value}))


@pytest.mark.parametrize("make", [of_script, lambda tables: Case.from_dict(tables).problem()])
def test_script_and_command_warn_of_the_same(make: Callable[[Any], Problem]) -> None:
    with pytest.warns(CaseWarning, match="more than the surface's depth"):
        make(tables_of({"loading.delta_max": 30e-9}))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        make(tables_of({}))


def test_arguments_are_those_of_problem_load_path_and_callbacks() -> None:
    known = {field.name for kind in (Problem, Schedule, Callbacks) for field in fields(kind)}
    inside = {"surface", "material", "load_path", "block_height", "sticks"}
    assert Arguments.__optional_keys__ == known - inside | {"height", "pressure_max"}
    with pytest.raises(TypeError, match="stepz"):
        asp.solve_contact(WAVE, STEEL, delta_max=1e-9, stepz=3)


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
