"""Error bars and tolerance-driven runs, and the order of the load step."""

from __future__ import annotations

import json
import re
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from conftest import ELASTIC, PLASTIC, here, world
from html_page import Page

import asperity as asp
from asperity.adaptive.guide import planned_steps
from asperity.adaptive.limits import (
    LEAST_RATIO,
    LEAST_STEP,
    MESH_ORDERS,
    limit_of_area,
    limit_of_meshes,
    partner,
    shares,
    steady,
)
from asperity.adaptive.loading import loading_force
from asperity.adaptive.meshes import DOFS_ORDER
from asperity.adaptive.solve_contact import solve_contact
from asperity.case import Case
from asperity.curve import Curve
from asperity.errors import ResolutionWarning
from asperity.mesh.resolution import ELEMENTS, doubt_of_waves
from asperity.model.settings import AccuracyTarget
from asperity.output.results import Results
from asperity.quasistatic.contact_result import ContactResult, PartialResult
from asperity.quasistatic.solve_problem import solve_problem
from asperity.reference import half_space_contact

SPHERE = asp.Surface.from_spec(kind="sphere", L=1.0, radius=3.0, centre=(0.3, 0.4))


def bump() -> asp.Surface:
    """A quarter of a bump, its summit on a corner of the patch."""
    return asp.Surface.from_spec(kind="sphere", L=1.0, radius=1.0, centre=(0.0, 0.0), shape="paraboloid")


def ridges() -> asp.Surface:
    """A fractal of two wavelengths, whose contact spreads in jumps."""
    return asp.Surface.from_spec(kind="weierstrass-mandelbrot", L=1.0, D=2.4, G=1.36e-5, f_max=1)


def wave(amplitude: float = 0.01) -> asp.Surface:
    """A gentle wave in both directions."""
    return asp.Surface.from_spec(kind="sinusoid", L=1.0, amplitude=amplitude, dims=2)


def rough(f_max: int, seed: int, slope: float = 0.05) -> asp.Surface:
    """A fractal of a given rms slope, whose shortest waves are 1.5^-f_max long."""
    kind: dict[str, Any] = dict(kind="weierstrass-mandelbrot", L=1.0, D=2.4, f_max=f_max, seed=seed)
    guess = asp.Surface.from_spec(G=1e-8, **kind)
    return asp.Surface.from_spec(G=1e-8 * (slope / guess.rms_slope()) ** 2.5, **kind)


@pytest.mark.parametrize("order", [*MESH_ORDERS, 2.0])
@pytest.mark.parametrize("ratio", [1.8, 2.5, 4.0])
def test_bar_of_the_mesh_holds_for_every_order_in_its_range(order: float, ratio: float) -> None:
    exact = np.array([1.0, 3.0, 4.0])
    for error in (0.4, -0.2):
        coarse, fine = (exact * np.exp(error * h**order) for h in (1.0, 1.0 / ratio))
        factor, bar = limit_of_meshes(coarse, fine, ratio)
        left = np.log(fine * factor / exact)
        assert np.all(np.abs(left) <= bar * (1.0 + 1e-9))
        weight, share = shares(ratio)
        np.testing.assert_allclose(factor, np.exp(-weight * np.log(coarse / fine)))
        np.testing.assert_allclose(bar, share * np.abs(np.log(coarse / fine)))


def test_meshes_that_agree_by_chance_at_one_step_do_not_move_its_limit() -> None:
    """Both are off by chance beside an error of second order, which the average over the steps finds."""
    rng, exact = np.random.default_rng(1), np.linspace(1.0, 5.0, 200)
    fine = exact * np.exp(0.02 + 0.004 * rng.standard_normal(200))
    coarse = exact * np.exp(0.08 + 0.016 * rng.standard_normal(200))
    factor, bar = limit_of_meshes(coarse, fine, 2.0)
    error = np.abs(fine * factor / exact - 1.0)
    alone = np.abs(fine * (fine / coarse) ** shares(2.0)[0] / exact - 1.0)
    assert np.sqrt(np.mean(error**2)) < 0.8 * np.sqrt(np.mean(alone**2))
    assert np.mean(error <= np.hypot(bar, 2.0 * 0.004)) > 0.95  # of the finer mesh the area shows it


@pytest.mark.parametrize("inside", [-0.05, 0.0, 0.1])
def test_an_edge_that_lies_too_far_inside_on_both_meshes_is_found(inside: float) -> None:
    """By a part of the facets that it crosses, beside the random place of the edge in each: 95 % within the bar."""
    rng, rows = np.random.default_rng(2), 400
    area, edges = np.full(rows, 0.3), [np.full(rows, 0.2), np.full(rows, 0.1)]
    chance = [np.full(rows, 0.03), np.full(rows, 0.012)]  # twice the deviation
    areas = [
        area * (1.0 + 0.5 * e * rng.standard_normal(rows)) - inside * x for e, x in zip(chance, edges, strict=True)
    ]
    factor, bar = limit_of_area(areas, edges, chance, np.zeros(rows), np.ones(rows, dtype=bool))
    error = areas[1] * factor / area - 1.0
    assert np.mean(np.abs(error) <= bar) > 0.95
    assert abs(np.mean(error)) < 0.3 * abs(inside) * 0.1 / 0.3 + 0.002  # most of it


def test_a_mesh_without_a_force_is_not_extrapolated() -> None:
    factor, bar = limit_of_meshes(np.array([0.0, 1.1, 1.1]), np.array([0.1, 0.0, 1.0]), 2.0)
    assert list(factor[:2]) == [1.0, 1.0] and factor[2] < 1.0 and np.all(np.isfinite(bar))


def test_a_mesh_is_never_extrapolated_from_one_of_nearly_its_size() -> None:
    """Scatter would hide the order; max_dofs can make the last mesh hardly finer than the one before."""
    assert [partner([2.0, 1.0, last]) for last in (1.0 / LEAST_RATIO, 0.8, 1.0)] == [1, 0, 0]
    assert partner([2.0, 1.0]) == 0 and partner([2.0, 1.0, 0.8, 0.4]) == 2


def test_bars_do_not_vanish_with_a_change_of_sign() -> None:
    error = np.array([0.02, 0.01, 0.0, -0.01, -0.02])
    bars = steady(error)
    assert np.all(bars >= np.abs(error))
    assert bars[2] == pytest.approx(np.sqrt(np.mean(error**2)))


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"delta_max": 0.01, "size": asp.MeshSize(0.1)}, "chooses mesh and substeps"),
        ({"delta_max": 0.01, "substeps": 2}, "chooses mesh and substeps"),
        (
            {"delta_max": 0.01, "formulation": asp.Formulation("penalty", penalty=5.0)},
            r"contact\.penalty = 5 is too soft .* need 10 or more",
        ),
        ({"force_max": 1e-3}, r"accuracy\.max_dofs = 1000 is too small, a coarse mesh .* has \d+ dofs"),
        *(
            ({"tolerance": t, "delta_max": 0.01}, r"accuracy\.tolerance = .* legal: \[1e-06, 1\)")
            for t in (0.0, -0.1, 1.0, float("nan"))
        ),
    ],
)
def test_what_has_no_error_bar_is_refused_before_the_first_step(arguments: dict[str, Any], message: str) -> None:
    with pytest.raises(asp.InputError, match=message):
        goal = AccuracyTarget(arguments.pop("tolerance", 0.1), max_dofs=1000)
        solve_contact(wave(), ELASTIC, tolerance=goal, on_step=lambda *_: pytest.fail(), **arguments)


def test_load_steps_have_second_order_by_the_midpoint_rule_and_both_rules_one_limit() -> None:
    at = 0.04 * np.array([0.2, 0.4, 0.6, 0.8, 1.0])

    def force(rule: str, substeps: int) -> npt.NDArray[np.float64]:
        result = asp.solve_contact(
            ridges(), PLASTIC, delta_max=0.04, steps=5, substeps=substeps, integrator=rule, size=asp.MeshSize(0.25)
        )
        return loading_force(result.curve, at)

    def size(error: npt.NDArray[np.float64]) -> float:
        return float(np.sqrt(np.mean(error**2)))

    whole, half, quarter = (force("midpoint", n) for n in (1, 2, 4))
    limit = quarter + (quarter - half) / 3.0
    assert size(half / limit - 1.0) < 0.4 * size(whole / limit - 1.0)
    same, euler, finest = (force("backward-euler", n) for n in (4, 8, 16))
    other = 2.0 * finest - euler
    assert other == pytest.approx(limit, rel=2e-3)
    assert np.abs(quarter / limit - 1.0).max() < 0.25 * np.abs(same / limit - 1.0).max()
    assert size(whole / limit - 1.0) < size(euler / limit - 1.0)


@pytest.mark.parametrize(
    ("surface", "depth", "steps", "tolerance", "unsure"),
    [
        (wave(0.001), 0.0012, 3, 0.03, 1e-4),
        (rough(6, 2), 0.006, 5, 0.05, 5e-3),  # slopes of 0.05 are not small to the last digit
        (rough(5, 0, slope=0.01), 0.0012, 10, 0.05, 1e-3),
    ],
    ids=["wave", "waves shorter than the elements", "spots of a few facets"],
)
def test_the_bar_holds_the_error_against_an_independent_solution(
    surface: asp.Surface, depth: float, steps: int, tolerance: float, unsure: float
) -> None:
    """Two coarse meshes may miss the same waves, or agree by chance in the middle of the loading."""
    result = solve_contact(surface, ELASTIC, tolerance=AccuracyTarget(tolerance), delta_max=depth, steps=steps)
    assert result.met and result.reason == "done"
    branch = result.curve.loading()
    reference = [
        half_space_contact(surface, 256, delta_star=float(d), height=1.0, tolerance=1e-6).P_star
        for d in branch.delta_star
    ]
    error, bar = np.abs(branch.P_star / np.array(reference) - 1.0), branch.error_P_star / branch.P_star
    assert np.all(bar <= tolerance) and np.median(bar) < 0.6 * tolerance  # no wider than the tolerance takes
    assert np.all(error <= bar + unsure)
    assert result.budget.total == pytest.approx(result.curve.error_P_star)
    assert np.all(result.budget.roughness > 0.0) or surface.feature_size > 0.1
    json.dumps(result.to_dict(), allow_nan=False)


def test_unloading_follows_an_extrapolated_elastic_plastic_loading() -> None:
    """The finest curve is scaled as a whole at its greatest load, and keeps the bar it has there."""
    result = solve_contact(bump(), PLASTIC, tolerance=AccuracyTarget(0.2), delta_max=0.04, steps=3, unload_steps=2)
    curve, raw = result.curve, result.raw
    last = int(np.flatnonzero(curve.branch == "load")[-1])
    assert result.met and curve.branch[last + 1] == "unload"
    np.testing.assert_allclose(curve.P_star[last:] * raw.P_star[last], raw.P_star[last:] * curve.P_star[last])
    assert np.all(curve.error_P_star[last:] == curve.error_P_star[last])


@pytest.mark.mpi
@pytest.mark.usefixtures("several_ranks")
def test_a_run_with_a_tolerance_does_not_depend_on_the_ranks() -> None:
    solid = asp.Material(1.0, 0.3, 0.005, 0.1)
    together, alone = (
        solve_contact(SPHERE, solid, tolerance=AccuracyTarget(0.05), delta_max=0.01, steps=3, comm=comm)
        for comm in (world(), here())
    )
    assert len(together.levels) == 4  # the last mesh follows from a bar that rounding changes
    assert [level.dofs for level in together.levels] == [level.dofs for level in alone.levels]
    np.testing.assert_allclose(together.curve.P_star, alone.curve.P_star, rtol=1e-7)
    np.testing.assert_allclose(together.curve.error_P_star, alone.curve.error_P_star, rtol=1e-4)


def test_one_step_and_steps_without_force() -> None:
    one = Curve.from_rows([{"delta": 0.1, "force": 1.0, "delta_star": 0.1, "P_star": 2.0}])
    assert loading_force(one, np.array([0.1, 0.4])) == pytest.approx([2.0, 16.0])
    rows = [{"delta": d, "force": f, "delta_star": d, "P_star": f} for d, f in ((0.1, 0.0), (0.2, 0.2), (0.3, 0.3))]
    assert loading_force(Curve.from_rows(rows), np.array([0.25])) == pytest.approx([0.25])
    assert loading_force(Curve.from_rows(rows), np.array([0.05, 0.6])) == pytest.approx([0.025, 0.6])
    assert np.isnan(loading_force(Curve.from_rows(rows[:1]), np.array([0.1])))


@pytest.mark.parametrize(("steps", "solved"), [(1, 5), (2, 6), (3, 6), (4, 8), (5, 5), (12, 12)])
def test_few_planned_steps_are_divided_until_their_bars_support_each_other(steps: int, solved: int) -> None:
    """The difference of two meshes at one approach may vanish by chance, and with it the bar."""
    assert planned_steps(steps) == solved


def test_limit_ends_the_refinement_with_what_is_known() -> None:
    """No mesh is larger than allowed, not even by little; the last one uses what is left."""
    target = AccuracyTarget(0.05, max_dofs=30_000, area_tolerance=1e-4)
    result = solve_contact(SPHERE, ELASTIC, tolerance=target, delta_max=0.01, steps=5)
    assert not result.met and np.all(np.isfinite(result.curve.error_P_star))
    assert "the contact area is known to" in result.reason and "accuracy.max_dofs = 30000" in result.reason
    sizes = [level.dofs for level in result.levels]
    assert 30_000 / LEAST_STEP**DOFS_ORDER < sizes[-1] <= 30_000 and len(sizes) >= 3


def test_a_mesh_that_does_not_converge_leaves_the_curve_of_the_one_before(monkeypatch: pytest.MonkeyPatch) -> None:
    curves: list[Curve] = []
    results: list[ContactResult] = []

    def solve(*args: Any, **kwargs: Any) -> ContactResult:
        if curves:  # the second mesh is done; one mesh at a time has matrices
            assert "_values" not in vars(results[-1].solver.solid.tangent)
            raise PartialResult("no convergence", results[-1])
        results.append(solve_problem(*args, **kwargs))
        return results[-1]

    monkeypatch.setattr("asperity.adaptive.meshes.solve_problem", solve)
    target = AccuracyTarget(0.05, area_tolerance=1e-4)
    result = solve_contact(SPHERE, ELASTIC, tolerance=target, delta_max=0.01, steps=5, on_curve=curves.append)
    assert not result.met and len(result.levels) == 2 and len(curves) == 1
    np.testing.assert_array_equal(result.curve.error_P_star, curves[0].error_P_star)
    assert "no step converges beyond delta/L = 0.01, use more loading.steps" in result.reason
    assert (
        result.contact.solver is results[1].solver and results[1].solver.step(0.011).converged
    )  # its state is not lost


def test_a_tolerance_of_the_area_refines_until_its_bar_holds_it_too() -> None:
    """Of a sphere, whose force is known to 5 % on a mesh that leaves 5 % of its area open."""
    sphere = asp.Surface.from_spec(kind="sphere", L=1.0, radius=3.0, centre=(0.5, 0.5))
    force_only, both = (
        solve_contact(sphere, ELASTIC, tolerance=AccuracyTarget(0.05, area_tolerance=area), delta_max=0.004, steps=5)
        for area in (None, 0.03)
    )
    assert force_only.met and force_only.verdict.area > 0.05 and both.met and both.verdict.area <= 0.03
    curve = both.curve.loading()
    quarter = asp.Surface.from_spec(kind="sphere", L=0.5, radius=3.0, centre=(0.0, 0.0))  # by its planes of symmetry
    exact = [half_space_contact(quarter, 270, delta_star=2.0 * d, height=1.0, tolerance=1e-5) for d in curve.delta_star]
    assert np.all(np.abs(curve.area_fraction - [found.area_fraction for found in exact]) <= curve.error_area_fraction)
    with pytest.raises(asp.InputError, match=r"accuracy\.area_tolerance = 1\.5 is out of range"):
        AccuracyTarget(0.05, area_tolerance=1.5)


def test_a_contact_of_one_node_meets_no_tolerance() -> None:
    """Its force is that of the size of the elements, and the difference of two meshes no error."""
    sphere = asp.Surface.from_spec(kind="sphere", L=1.0, radius=1.0, centre=(0.31, 0.47))
    result = solve_contact(sphere, ELASTIC, tolerance=AccuracyTarget(0.9, max_dofs=15_000), delta_max=1e-7, steps=5)
    assert not result.met and "the force has no error bar, the contact touches a few facets only" in result.reason


@pytest.mark.usefixtures("blank_figures")
def test_a_case_of_a_rough_surface_that_meets_no_tolerance_names_a_cut_off(tmp_path: Path) -> None:
    """Exit code 3, because the bar is wider than the tolerance; the curve is complete, with figures and report."""
    fractal = {"kind": "weierstrass-mandelbrot", "L": 1.0, "D": 2.4, "G": 2.6e-7, "f_max": 8}
    case = Case.from_dict({
        "units": "other", "surface": fractal, "material": {"E": 1.0, "nu": 0.3},
        "loading": {"delta_max": 0.006, "steps": 5}, "accuracy": {"tolerance": 0.01, "max_dofs": 15_000},
        "output": {"figures": True, "report": True},
    })  # fmt: skip
    with pytest.raises(asp.ConvergenceError, match="the force is known to") as caught:
        asp.run(case, tmp_path)
    assert caught.value.exit_code == 3
    results = Results.read(tmp_path)
    summary, bars = results.summary, results.curve.error_P_star / results.curve.P_star
    assert summary["accuracy"]["met"] is summary["finished"] is False
    assert summary["accuracy"]["worst_relative_bar"] == pytest.approx(bars.max()) and bars.min() > 0.0
    assert max(summary["error_budget"]["roughness"]) > 0.0 and "cut them off" in summary["exit_reason"]
    assert [*(tmp_path / "figures").glob("*.svg")] and "the tolerance is not met" in Page(tmp_path / "report.html").text


def test_waves_shorter_than_one_and_a_half_elements_are_missed_where_the_flat_feels_them() -> None:
    for f_max in (7, 8):
        surface, wave = rough(f_max, 0), 1.5**-f_max
        for elements, missed in ((0.9, True), (1.4, False)):
            h = wave / (elements * ELEMENTS)
            assert bool(doubt_of_waves(surface, h, 0.006)) is missed
        assert not doubt_of_waves(surface, 0.07, 0.9)
    assert not doubt_of_waves(bump(), 0.07, 0.03)


def test_one_mesh_that_misses_waves_is_told() -> None:
    surface = rough(8, 0)
    with pytest.warns(ResolutionWarning, match=r"shorter than 1\.5 elements of mesh\.h_contact = 0\.2 "):
        asp.solve_contact(surface, ELASTIC, delta_max=0.006, steps=1, size=asp.MeshSize(0.2))
    with warnings.catch_warnings():
        warnings.simplefilter("error", ResolutionWarning)
        asp.solve_contact(bump(), ELASTIC, delta_max=0.006, steps=1, size=asp.MeshSize(0.2))
    assert doubt_of_waves(surface, 0.1, 0.006) and not doubt_of_waves(surface, 0.02, 0.006)


def test_no_room_for_more_than_the_first_mesh_leaves_its_curve() -> None:
    """The coarsest mesh of the block is all that max_dofs allows: others of other scales are nearly the same."""
    with pytest.raises(asp.InputError, match="too small") as refused:
        solve_contact(SPHERE, ELASTIC, tolerance=AccuracyTarget(0.1, max_dofs=1000), delta_max=0.01, steps=5)
    dofs = int(re.findall(r"has (\d+) dofs", str(refused.value))[0])
    with pytest.raises(PartialResult, match=r"the force has no error bar: accuracy\.max_dofs") as caught:
        solve_contact(SPHERE, ELASTIC, tolerance=AccuracyTarget(0.1, max_dofs=dofs), delta_max=0.01, steps=5)
    assert len(caught.value.result.curve) == 5
