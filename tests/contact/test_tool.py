"""Tools of any height: closed forms, exchange of tool and surface, finite strain, ranks, tolerance, refusals."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import ELASTIC, PLASTIC, call, here, world

from asperity import reference as ref
from asperity import run
from asperity.adaptive.solve_contact import solve_contact
from asperity.case import Case
from asperity.case.case_file import identity, refuse_another
from asperity.curve import Curve
from asperity.errors import CheckpointError, InputError, MeshError, ResolutionWarning
from asperity.model.material import Material
from asperity.model.problem import Problem
from asperity.model.settings import Formulation, MeshSize
from asperity.output.indentation import indentation_of
from asperity.output.results import Results
from asperity.quasistatic.checkpoint import Checkpoint
from asperity.quasistatic.contact_result import PartialResult
from asperity.quasistatic.newton import NewtonSolver, StepStats
from asperity.reference.halfspace import added_to_spot
from asperity.surface import Composite, Cone, Flat, Pyramid, SelfAffine, Sinusoid, Sphere, Surface, composite

CORNER = (0.0, 0.0)  # a quarter of a contact
PLANE = Flat(L=1.0)
RUBBER = replace(ELASTIC, kinematics="finite")
FORCE_AT_THIRD = 0.2575
SIZE = MeshSize(0.15, growth=0.6, h_max=0.5)


def pressed(surface: Surface, tool: Surface, delta: float, h: float, method: str = "active-set") -> Curve:
    """Curve of an elastic block, three high."""
    return solve_contact(
        surface, ELASTIC, tool=tool, delta_max=delta, steps=1, height=3.0, size=MeshSize(h, growth=0.4, h_max=0.5),
        formulation=Formulation(method), comm=here(),
    ).curve  # fmt: skip


def on_half_space(curve: Curve, radius: float) -> float:
    """Approach of the last step on a half-space: less what base and sides add [L]."""
    unit = added_to_spot(radius, CORNER, 3.0, ELASTIC.nu, "rollers")
    return float(curve.delta[-1] - curve.force[-1] / ELASTIC.reduced_modulus * unit)


@pytest.mark.parametrize("method", ["active-set", "penalty", "nitsche"])
def test_a_sphere_on_a_plane_is_that_of_hertz(method: str) -> None:
    ball, a = Sphere(L=1.0, radius=10.0, centre=CORNER, shape="paraboloid"), 0.05
    curve = pressed(PLANE, ball, a**2 / 10.0, a / 6, method)
    delta, hertz = on_half_space(curve, a), ref.Hertz(10.0, ELASTIC.reduced_modulus)
    assert 4.0 * curve.force[-1] == pytest.approx(float(hertz.force(delta)), rel=0.01)
    assert 4.0 * curve.area_fraction[-1] == pytest.approx(np.pi * float(hertz.radius(delta)) ** 2, rel=0.03)
    other = pressed(ball, PLANE, a**2 / 10.0, a / 6, method)
    assert curve.force[-1] == pytest.approx(other.force[-1], rel=3e-3)
    assert curve.mean_gap[-1] == pytest.approx(other.mean_gap[-1], rel=3e-3)


def test_a_cone_is_that_of_sneddon() -> None:
    """F = (2/pi) E' d^2/slope, Sneddon, Int. J. Engng Sci. 3 (1965) 47."""
    slope, a = 0.05, 0.1
    cone = Cone(L=1.0, half_angle=float(np.degrees(np.arctan(1 / slope))), centre=CORNER)
    curve = pressed(PLANE, cone, 0.5 * np.pi * a * slope, a / 8)
    delta = on_half_space(curve, a)
    assert 4.0 * curve.force[-1] == pytest.approx(2 / np.pi * ELASTIC.reduced_modulus * delta**2 / slope, rel=0.01)


def test_a_bonded_layer_under_a_paraboloid() -> None:
    """Another program's 0.0321; a half-space would bear 0.0293."""
    ball = Sphere(L=2.0, radius=0.5, shape="paraboloid")
    curve = solve_contact(
        Flat(L=2.0), Material(10.0, 0.3), tool=ball, delta_max=0.02, steps=1, height=1.0, sides="free",
        size=MeshSize(0.04), comm=here(),
    ).curve  # fmt: skip
    assert curve.force[-1] == pytest.approx(0.0321, rel=0.01)


def test_the_shapes_of_tips() -> None:
    """Projected areas over the square of the depth: 24.5 and 2.6 of triangles, 24.5 of a square, and of a cone."""
    at = (np.arange(2000) + 0.5) / 2000
    shapes = {
        24.5: Pyramid(L=1.0, angle=65.27),
        2.6: Pyramid(L=1.0, angle=35.26),
        24.504: Pyramid(L=1.0, faces=4, angle=68.0),
    }
    for area, shape in [*shapes.items(), (24.5, Cone(L=1.0, half_angle=70.3))]:
        depth = 0.03
        assert np.mean(shape.on_product(at, at) > -depth) / depth**2 == pytest.approx(area, rel=0.01)
        assert shape.maximum() == (0.5, 0.5, 0.0)
    blunt = Cone(L=1.0, half_angle=45.0, radius=0.2)
    rim = 0.2 * np.sqrt(0.5)
    assert float(blunt.height(0.5 + rim, 0.5)) == pytest.approx(-0.2 * (1 - np.sqrt(0.5)))
    assert float(blunt.height(0.5, 0.9)) == pytest.approx(-0.2 * (1 - np.sqrt(0.5)) - (0.4 - rim))


def test_the_composite_surface_is_the_sum() -> None:
    wave, ball = Sinusoid(L=1.0, amplitude=0.01, wavelength=0.25, dims=2), Sphere(L=1.0, radius=2.0, centre=(0.3, 0.6))
    both = composite(wave, ball)
    assert isinstance(both, Composite)
    assert composite(PLANE, ball) is ball and composite(wave, PLANE) is wave
    x, y, z = both.maximum()
    at = np.linspace(0.0, 1.0, 2001)
    assert z == pytest.approx(float((wave.on_product(at, at) + ball.on_product(at, at)).max()), abs=1e-6)
    assert np.hypot(*both.gradient(x, y)) < 1e-8
    assert both.mean() == pytest.approx(wave.mean() + ball.mean())


def test_a_rough_tool_on_a_plane_is_a_rough_solid_under_the_flat() -> None:
    """The theorem of the composite surface, for small slopes: within both bars."""
    rough = SelfAffine(L=1.0, H=0.8, lambda_short=0.25, rms_height=0.004, seed=2)
    curves = []
    for solid, tool in ((rough, None), (PLANE, rough)):
        found = solve_contact(solid, ELASTIC, tool=tool, delta_max=0.006, steps=5, tolerance=0.05, comm=here())
        assert found.met
        curves.append(found.curve)
    one, two = curves
    assert np.all(np.abs(one.P_star - two.P_star) < one.error_P_star + two.error_P_star)
    np.testing.assert_allclose(two.mean_gap, one.mean_gap, rtol=0.02)


def test_a_rough_tool_on_a_rough_solid_has_the_sum_under_the_flat() -> None:
    """Two waves of one length: their sum is a wave, whose solution is that of the flat."""
    wave, tool = (Sinusoid(L=1.0, amplitude=a, dims=2) for a in (0.004, 0.002))
    both = Sinusoid(L=1.0, amplitude=0.006, dims=2)
    force = [
        solve_contact(
            solid, PLASTIC, tool=rigid, delta_max=0.004, steps=2, size=MeshSize(0.09), comm=here()
        ).curve.force
        for solid, rigid in ((wave, tool), (both, None))
    ]
    np.testing.assert_allclose(force[0], force[1], rtol=5e-3)


@pytest.mark.parametrize(
    "tool", [Sphere(L=1.0, radius=0.5), Cone(L=1.0, half_angle=70.3), Pyramid(L=1.0)], ids=lambda t: t.kind
)
def test_the_work_of_a_tool_in_finite_strain_is_the_energy_stored(tool: Surface) -> None:
    """The force is normal to the tool: another direction would store another energy than the force over the depth."""
    delta = 0.02 if tool.kind == "sphere" else 0.05
    result = solve_contact(
        PLANE, RUBBER, tool=tool, delta_max=delta, steps=8, size=MeshSize(0.06, growth=0.5), comm=here()
    )
    curve, n = result.curve, {"sphere": 1.5}.get(tool.kind, 2.0)
    factor, ends = curve.force / curve.delta**n, np.append(0.0, curve.delta) ** (n + 1.0) / (n + 1.0)  # of a power law
    between = np.append(factor[0], 0.5 * (factor[1:] + factor[:-1]))
    work = float(between @ np.diff(ends))
    assert result.checks.stored == pytest.approx(work, rel=0.01)
    assert result.checks.penetration < 1e-9


def test_the_force_of_a_steep_tip_is_that_of_a_body_without_a_length() -> None:
    """Force over depth^2 of a corner of a cube is constant: the node below the tip stays there."""
    curve = solve_contact(
        PLANE, RUBBER, tool=Pyramid(L=1.0, angle=35.26), delta_max=0.04, steps=6, size=MeshSize(0.06, growth=0.5),
        comm=here(),
    ).curve  # fmt: skip
    factor = curve.force[1:] / curve.delta[1:] ** 2
    assert np.ptp(factor) < 0.06 * factor.mean()


def test_a_sphere_to_a_third_of_its_radius() -> None:
    """The force of axisymmetric elements at 0.3 radii is 0.2575 E R^2: benchmarks/axisymmetric.py."""
    R = 0.2
    curve = solve_contact(
        PLANE, RUBBER, tool=Sphere(L=1.0, radius=R, centre=CORNER), delta_max=0.3 * R, steps=3, height=3.0,
        size=MeshSize(0.025, growth=0.5, h_max=0.6), comm=here(),
    ).curve  # fmt: skip
    depth = on_half_space(curve, 0.51 * R)
    assert 4.0 * curve.force[-1] / R**2 == pytest.approx(FORCE_AT_THIRD * (depth / (0.3 * R)) ** 1.5, rel=0.02)


@pytest.mark.parametrize("soft", [False, True])
def test_strain_that_turns_elements_inside_out_is_said(soft: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    """Where no step converges after strains beyond one; what was found before is kept."""
    true_solve = NewtonSolver.solve

    def solve(self: NewtonSolver, start: Any, scale: float) -> StepStats:
        stats = true_solve(self, start, scale)
        return stats if np.abs(start).max() < 0.025 else replace(stats, converged=False)

    monkeypatch.setattr(NewtonSolver, "solve", solve)
    material = Material(1.0, 0.3, 1e-2, 0.0, kinematics="finite") if soft else RUBBER
    with pytest.raises(PartialResult, match=r"the greatest strain is [12].*mesh\.h_contact") as caught:
        solve_contact(
            PLANE, material, tool=Cone(L=1.0, half_angle=45.0), delta_max=0.06, steps=8,
            size=MeshSize(0.06, growth=0.6, h_max=0.5), comm=here(),
        )  # fmt: skip
    assert ("tangent_modulus" in str(caught.value)) == soft
    assert len(caught.value.result.curve)


def test_finite_strain_tends_to_small_strain() -> None:
    shallow = Sphere(L=1.0, radius=20.0)
    force = [
        solve_contact(PLANE, material, tool=shallow, delta_max=5e-4, steps=1, size=SIZE, comm=here()).curve.force[-1]
        for material in (ELASTIC, RUBBER)
    ]
    assert force[1] == pytest.approx(force[0], rel=0.01)


@pytest.mark.mpi
@pytest.mark.usefixtures("several_ranks")
@pytest.mark.parametrize("kinematics", ["small", "finite"])
def test_ranks_agree(kinematics: str) -> None:
    material, tool = replace(PLASTIC, kinematics=kinematics), Cone(L=1.0, half_angle=75.0, radius=0.05)
    curves = [
        solve_contact(PLANE, material, tool=tool, delta_max=0.02, steps=2, size=SIZE, comm=comm, stiffness=True).curve
        for comm in (here(), world())
    ]
    for name, allowed in (("force", 1e-8), ("area_fraction", 1e-8), ("mean_gap", 1e-8), ("k_n_elastic", 1e-5)):
        one, two = (getattr(curve, name) for curve in curves)
        np.testing.assert_allclose(two, one, rtol=0, atol=allowed * np.abs(one).max(), err_msg=name)


def test_forms_agree_and_a_run_goes_on(tmp_path: Path) -> None:
    """Kernels and forms; and a run that stops and goes on is the same to the last bit."""
    tool = Sphere(L=1.0, radius=0.6)
    problem = Problem.of(PLANE, replace(PLASTIC, kinematics="finite"), tool=tool, delta_max=0.02, steps=3, size=SIZE)
    whole = solve_contact(problem, comm=here())
    forms = replace(problem, options=replace(problem.options, kernels="forms"))
    np.testing.assert_allclose(solve_contact(forms, comm=here()).curve.force, whole.curve.force, rtol=1e-6)
    polls = iter(["", "", "the test"])
    with pytest.raises(Exception, match="stopped by the test"):
        solve_contact(problem, comm=here(), stop=lambda: next(polls), checkpoint=Checkpoint(tmp_path, {}, here()))
    again = solve_contact(problem, comm=here(), checkpoint=Checkpoint(tmp_path, {}, here()))
    np.testing.assert_array_equal(again.curve.force, whole.curve.force)


@pytest.mark.parametrize(
    "tool", [Sphere(L=1.0, radius=2.0, shape="paraboloid"), Cone(L=1.0, half_angle=85.0)], ids=lambda t: t.kind
)
def test_oliver_and_pharr_return_the_modulus(tool: Surface) -> None:
    problem = Problem.of(
        PLANE, ELASTIC, tool=tool, delta_max=0.015, steps=3, unload_steps=8, size=MeshSize(0.04), height=2.0
    )
    found = indentation_of(problem, solve_contact(problem, comm=here()).curve)
    assert found is not None
    assert found.modulus == pytest.approx(ELASTIC.reduced_modulus, rel=0.02)
    assert abs(found.modulus - ELASTIC.reduced_modulus) < 2.0 * found.error_modulus


@pytest.mark.parametrize(
    ("tool", "height"),
    [
        (Pyramid(L=1.0, faces=3, angle=86.0), 1.0),
        (Pyramid(L=1.0, faces=4, angle=87.0), 1.0),
        (Sphere(L=1.0, radius=2.0, shape="paraboloid"), 0.3),
    ],
    ids=["three faces", "four faces", "thin block"],
)
def test_the_bar_of_the_modulus_holds_the_shape_of_the_tip_and_the_block(tool: Surface, height: float) -> None:
    problem = Problem.of(
        PLANE, ELASTIC, tool=tool, delta_max=0.01, steps=2, unload_steps=8, unload_to=0.4, size=MeshSize(0.03),
        height=height,
    )  # fmt: skip
    found = indentation_of(problem, solve_contact(problem, comm=here()).curve)
    assert found is not None
    assert abs(found.modulus - ELASTIC.reduced_modulus) < found.error_modulus < 0.12 * found.modulus


CASE: dict[str, Any] = {
    "surface": {"kind": "flat", "L": 1e-5},
    "tool": {"kind": "cone", "half_angle": 80.0},
    "material": {"E": 100e9, "nu": 0.3, "yield_strength": 1e9, "tangent_modulus": 5e9, "kinematics": "small"},
    "mesh": {"h_contact": 1e-6, "h_max": 4e-6},
    "loading": {"delta_max": 3e-7, "steps": 3, "unload_steps": 8},
}


def test_a_case_with_a_tool(tmp_path: Path) -> None:
    """Its folder has the tool, numbers of an indentation, a figure, a report; that of another tool is refused."""
    case = Case.from_dict(CASE)
    assert case.tool is not None and case.tool.L == 1e-5
    again = tmp_path / "again.toml"
    again.write_text(case.to_toml())
    assert Case.load(again) == case
    result = run(case, tmp_path / "out")
    found = result.summary["indentation"]
    assert 0.0 < found["hardness"] < 5e9 and found["modulus"] == pytest.approx(110e9, rel=0.1)
    assert call("report", tmp_path / "out") == 0
    assert "by Oliver and Pharr" in (tmp_path / "out/report.html").read_text()
    assert (tmp_path / "out/figures/indentation.svg").is_file()
    assert Results.read(tmp_path / "out").tool.kind == "cone"
    other = Case.from_dict({**CASE, "tool": {"kind": "cone", "half_angle": 75.0}})
    with pytest.raises(CheckpointError, match=r"tool.half_angle = 80 there, 75 here"):
        refuse_another(tmp_path, identity(case), identity(other))


def test_refusals() -> None:
    """Each in one sentence."""
    refused: list[tuple[dict[str, Any], str]] = [
        ({"tool": {"kind": "cone"}}, "tool.half_angle is missing"),
        ({"tool": {"kind": "con"}}, 'tool.kind = "con" is unknown'),
        ({"tool": {"kind": "sphere", "radius": 1e-9}}, "tool.radius = 1e-09 is"),
        ({"contact": {"friction": 0.2}}, "contact.friction"),
        ({"contact": {"method": "penalty"}, "material": {**CASE["material"], "kinematics": "auto"}}, "contact.method"),
        ({"joint": {"mass": 1.0}}, r"\[joint\] is of two like rough faces"),
        ({"tool": {**CASE["tool"], "L": 2e-5}}, "tool.L = 2e-05 is not surface.L"),
    ]
    for change, text in refused:
        with pytest.raises(InputError, match=text):
            Case.from_dict({**CASE, **change}).problem()
    tip = Cone(L=1.0, half_angle=45.0)
    with pytest.raises(MeshError, match="the tool is finer than the mesh"):
        solve_contact(PLANE, ELASTIC, tool=tip, delta_max=1e-3, steps=1, size=MeshSize(0.3, h_max=0.5), comm=here())
    ripples = Sinusoid(L=1.0, amplitude=0.003, wavelength=0.1, dims=2)
    with pytest.warns(ResolutionWarning):
        Problem.of(PLANE, ELASTIC, tool=ripples, delta_max=0.01)
        solve_contact(PLANE, ELASTIC, tool=ripples, delta_max=0.01, steps=1, size=MeshSize(0.2, h_max=0.5), comm=here())
