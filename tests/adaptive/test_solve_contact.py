"""Runs with a tolerance: their bars against independent solutions, their limits, and what ends them."""

from __future__ import annotations

import json
import re
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import ELASTIC, PLASTIC, here, world
from html_page import Page

import asperity as asp
from asperity.adaptive.guide import guide_of
from asperity.adaptive.limits import LEAST_RATIO, LEAST_STEP
from asperity.adaptive.meshes import DOFS_ORDER, MeshFamily
from asperity.adaptive.solve_contact import refine, solve_contact
from asperity.case import Case
from asperity.curve import WITH_ERRORS, Curve
from asperity.errors import Interrupted, ResolutionWarning
from asperity.mesh.resolution import ELEMENTS, doubt_of_waves
from asperity.mesh.size_field import SizeField, size_field
from asperity.model.material import Material
from asperity.model.problem import Problem
from asperity.model.settings import AccuracyTarget
from asperity.output.results import Results
from asperity.quasistatic.contact_result import ContactResult, PartialResult
from asperity.quasistatic.solve_problem import Callbacks, solve_problem
from asperity.reference import RoughHalfSpace, half_space_contact
from asperity.surface import SelfAffine, SurfaceWarning

SPHERE = asp.Surface.from_spec(kind="sphere", L=1.0, radius=3.0, centre=(0.3, 0.4))
FLATTER = asp.Surface.from_spec(kind="sphere", L=1.0, radius=30.0, centre=(0.3, 0.4), shape="paraboloid")


def bump() -> asp.Surface:
    """A quarter of a bump, its summit on a corner of the patch."""
    return asp.Surface.from_spec(kind="sphere", L=1.0, radius=1.0, centre=(0.0, 0.0), shape="paraboloid")


def wave(amplitude: float = 0.01) -> asp.Surface:
    """A gentle wave in both directions."""
    return asp.Surface.from_spec(kind="sinusoid", L=1.0, amplitude=amplitude, dims=2)


def rough(f_max: int, seed: int, slope: float = 0.05) -> asp.Surface:
    """A fractal of a given rms slope, whose shortest waves are 1.5^-f_max long."""
    kind: dict[str, Any] = dict(kind="weierstrass-mandelbrot", L=1.0, D=2.4, f_max=f_max, seed=seed)
    guess = asp.Surface.from_spec(G=1e-8, **kind)
    return asp.Surface.from_spec(G=1e-8 * (slope / guess.rms_slope()) ** 2.5, **kind)


def surface_of(seed: int = 1, **changes: Any) -> SelfAffine:
    keys: dict[str, Any] = {"L": 1.0, "H": 0.8, "slope": 0.2, "lambda_roll": 0.4, "lambda_short": 0.05}
    return SelfAffine(**{**keys, **changes}, seed=seed)


@pytest.mark.parametrize(
    ("surface", "depth", "steps", "tolerance", "unsure", "measured"),
    [
        (wave(0.001), 0.0012, 3, 0.03, 1e-4, False),
        (rough(6, 2), 0.006, 5, 0.05, 5e-3, False),  # slopes of 0.05 are not small to the last digit
        (rough(5, 0, slope=0.01), 0.0012, 10, 0.05, 1e-3, False),
        (surface_of(5, slope=0.03, lambda_roll=0.5, lambda_short=0.25), 0.004, 5, 0.05, 3e-3, True),
    ],
    ids=["wave", "waves shorter than the elements", "spots of a few facets", "with stiffness and flow"],
)
def test_all_bars_hold_against_a_half_space_that_knows_of_no_mesh(
    surface: asp.Surface, depth: float, steps: int, tolerance: float, unsure: float, measured: bool
) -> None:
    """Two coarse meshes may miss the same waves, or agree by chance in the middle of the loading."""
    asked: dict[str, Any] = {"delta_max": depth, "steps": steps, "stiffness": measured, "flow": measured}
    result = solve_contact(surface, ELASTIC, tolerance=AccuracyTarget(tolerance), **asked)
    assert result.met and result.reason == "done"
    curve, layer, summit = result.curve.loading(), RoughHalfSpace(256, 1.0, ELASTIC.nu), surface.maximum()[2]
    at = np.outer(curve.delta_star, (0.98, 1.0, 1.02))
    exact = layer.curve(layer.heights(surface), summit, np.unique(at), tolerance=1e-6)
    before, P, after = np.interp(at, exact.delta_star, exact.P_star).T
    bar = curve.error_P_star / curve.P_star
    assert np.all(bar <= tolerance) and np.median(bar) < 0.6 * tolerance  # no wider than the tolerance takes
    assert np.all(np.abs(curve.P_star / P - 1.0) <= bar + unsure)
    # the identity of a layer between rollers: the mean plane sinks by the approach, less the compression of the block
    gap = summit - surface.mean() - curve.delta_star + P * ELASTIC.reduced_modulus / ELASTIC.confined_modulus
    assert np.all(np.abs(curve.mean_gap - gap) <= curve.error_mean_gap + unsure * gap)
    slope = (after - before) / (0.04 * curve.delta_star) * ELASTIC.reduced_modulus
    assert np.all(np.abs(curve.k_n - slope) <= curve.error_k_n + 0.02 * slope)
    if measured:
        assert np.all(curve.error_k_n < 0.15 * curve.k_n) and np.all(curve.error_mean_gap < 0.02 * gap)
    for name in WITH_ERRORS:  # bars of what was computed
        bars = getattr(result.curve, f"error_{name}")
        if measured or name in ("mean_gap", "k_n"):
            assert np.all(np.isfinite(bars) & (bars > 0.0)), name
        else:
            assert np.isnan(bars).all() and np.isnan(getattr(curve, name)).all()
    assert result.budget.total == pytest.approx(result.curve.error_P_star)
    assert np.all(result.budget.roughness > 0.0) or surface.feature_size > 0.1
    json.dumps(result.to_dict(), allow_nan=False)


@pytest.mark.parametrize(
    ("at", "of_area", "rows"), [("half-space estimate, roughness of mesh", 1e-3, 5), ("mesh 2: rest of the", None, 5)]
)
def test_a_stop_while_a_mesh_is_judged_keeps_its_curve(at: str, of_area: float | None, rows: int) -> None:
    """It takes effect before the next mesh, or before the unloading."""

    def stage(name: str) -> None:
        if name.startswith(at):
            stopped.append(name)
        if stopped:
            raise Interrupted(f"stopped by the test before the load path (next: {name})")

    stopped: list[str] = []
    problem = Problem.of(surface_of(4, lambda_short=0.1), ELASTIC, delta_max=0.02, steps=5, unload=True)
    with pytest.raises(PartialResult, match="stopped by the test") as e:
        refine(problem, asp.AccuracyTarget(0.1, area_tolerance=of_area), hooks=Callbacks(on_stage=stage))
    assert isinstance(e.value.__cause__, Interrupted)
    error = e.value.result.curve.error_P_star
    assert len(stopped) == 1 and len(error) == rows and np.isfinite(error).all()


def test_coarse_meshes_that_are_not_touched_lead_to_finer_ones() -> None:
    """Their smoothed summits of a steep surface are below the flat: no reason to refuse the case."""
    steep = surface_of(5, H=0.7, slope=10.0, lambda_roll=0.25, lambda_short=0.05)
    goal = asp.AccuracyTarget(0.05, max_dofs=12_000)
    with pytest.warns(SurfaceWarning):
        found = asp.solve_contact(steep, ELASTIC, tolerance=goal, delta_max=0.005, steps=5)
    assert not found.met and found.levels[-1].dofs > 1.5 * found.levels[0].dofs
    assert "the next mesh has about" in found.reason and not found.verdict.force <= 0.05


@pytest.mark.parametrize(
    "material",
    [ELASTIC, pytest.param(Material(1.0, 0.3, 0.02, 0.05), marks=pytest.mark.slow)],
    ids=["elastic", "plastic"],
)
def test_the_bar_of_an_unresolved_surface_holds(material: Material) -> None:
    """Shortest waves of 0.1 L; the reference resolves them with elements of 0.024 L everywhere in the contact.

    A bar holds 95 % of the steps: one of the twelve may be outside, by as much again.
    """
    surface, depth = surface_of(4, lambda_roll=0.5, lambda_short=0.1), 0.03
    found = asp.solve_contact(surface, material, tolerance=asp.AccuracyTarget(0.08), delta_max=depth, steps=5)
    assert found.met
    size = asp.MeshSize(0.024, growth=0.2)
    fine = asp.solve_contact(surface, material, delta_max=depth, steps=10 if material.plastic else 5, size=size)
    loading = found.curve.loading()
    judged = loading.delta_star >= 0.999 * depth / 5
    P = np.interp(loading.delta_star, fine.curve.delta_star, fine.curve.P_star)
    beyond = (np.abs(loading.P_star - P) - 0.01 * P)[judged] / loading.error_P_star[judged]
    assert np.count_nonzero(beyond > 1.0) <= 1 and np.all(beyond < 2.0)
    A = np.interp(loading.delta_star, fine.curve.delta_star, fine.curve.area_fraction)
    e = np.interp(loading.delta_star, fine.curve.delta_star, fine.curve.error_area_fraction)
    assert np.mean(np.abs(loading.area_fraction - A)[judged] <= (loading.error_area_fraction + e)[judged]) >= 0.8
    assert np.all(found.budget.roughness[found.curve.branch == "load"][judged] > 0.0)


def test_a_force_that_is_given_is_met_by_the_corrected_curve() -> None:
    """Three times, in elastic cycles; the approach is that of boundary elements, and unloading retraces loading."""
    force = 1.0e-4
    found = solve_contact(
        FLATTER,
        ELASTIC,
        tolerance=AccuracyTarget(0.05),
        force_max=force,
        steps=5,
        unload_steps=2,
        cycles=2,
        comm=here(),
    )
    curve = found.curve
    assert found.met and list(curve.force == force).count(True) == 2 and curve.force.max() == force
    assert np.any(np.abs(found.raw.delta / np.where(curve.delta > 0.0, curve.delta, 1.0) - 1.0) > 1e-3)
    assert np.all(found.budget.total == curve.error_P_star)
    loading = curve.loading()
    bar = loading.error_P_star / loading.P_star
    for k in (1, 3, -1):
        exact = half_space_contact(FLATTER, 256, P_star=float(loading.P_star[k]), height=1.0).delta_star
        assert abs(loading.delta_star[k] / exact - 1.0) <= bar[k] / 1.5 + 2e-3
    back = curve.where(curve.branch == "unload")
    back = back.where(back.force > 0.0)
    same = np.interp(back.delta, loading.delta, loading.force)
    assert np.all(np.abs(back.force - same) <= 0.05 * force)


def test_a_pressure_that_is_given_is_met_after_yield() -> None:
    blunt = asp.Surface.from_spec(kind="sphere", L=1.0, radius=2.0, centre=(0.3, 0.4), shape="paraboloid")
    found = solve_contact(
        blunt, PLASTIC, tolerance=AccuracyTarget(0.2), pressure_max=2e-3, steps=5, unload_steps=2, comm=here()
    )
    curve, last = found.curve, int(np.argmax(found.curve.force))
    assert curve.force[last] == 2e-3 and curve.branch[last] == "load" and curve.force[-1] == 0.0
    assert 0.0 < curve.delta[-1] < curve.delta[last]
    np.testing.assert_allclose(curve.delta[last:] / curve.delta[last], found.raw.delta[last:] / found.raw.delta[last])


def test_joint_and_slip_may_stand_under_the_force_of_the_path(recwarn: pytest.WarningsRecorder) -> None:
    """The law through the last points, a fit, ends below the curve; it goes on to its force, and nothing is lowered."""
    case = {
        "surface": {"kind": "sphere", "L": 240e-6, "radius": 2.8e-3},
        "material": {"E": 192e9, "nu": 0.3},
        "loading": {"pressure_max": 0.69 / 240e-6**2, "steps": 5},
        "accuracy": {"tolerance": 0.05},
        "joint": {"nominal_area": 5.76e-8, "preload": 0.69, "mass": 1e-3},
        "dynamics": {"law": "paper", "model": ["exact"]},
        "slip": {"friction": 0.3, "preload": 0.69},
    }
    found = asp.run(Case.from_dict(case))
    assert found.dynamics is not None and found.dynamics.first.load == pytest.approx(0.69, rel=1e-12)
    assert found.summary["slip"]["preload"] == pytest.approx(0.69, rel=1e-12)
    assert not [w for w in recwarn if "exceeds the greatest force" in str(w.message)]


def test_unloading_follows_an_extrapolated_elastic_plastic_loading() -> None:
    """The finest curve is scaled as a whole at its greatest load, and keeps the bar it has there.

    The mesh goes on where it was judged: its path is one. No other mesh unloads.
    """
    branches: list[str] = []
    path: dict[str, Any] = {"delta_max": 0.02, "unload_steps": 2}
    result = solve_contact(
        bump(), PLASTIC, tolerance=AccuracyTarget(0.3), steps=3, **path,
        on_step=lambda rows, part: branches.append(rows[-1]["branch"]),
    )  # fmt: skip
    curve, raw = result.curve, result.raw
    assert len(result.levels) > 2 and branches.count("unload") == 2
    problem = Problem.of(bump(), PLASTIC, steps=6, substeps=result.levels[-1].substeps, **path)
    straight = solve_problem(problem, block=result.contact.block).curve
    np.testing.assert_allclose(raw.P_star, straight.P_star, rtol=1e-12)
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


def test_limit_ends_the_refinement_with_what_is_known() -> None:
    """No mesh is larger than allowed, not even by little; the last one uses what is left."""
    target = AccuracyTarget(0.05, max_dofs=15_000, area_tolerance=1e-4)
    result = solve_contact(SPHERE, ELASTIC, tolerance=target, delta_max=0.01, steps=5)
    assert not result.met and np.all(np.isfinite(result.curve.error_P_star))
    assert "the contact area is known to" in result.reason and "accuracy.max_dofs = 15000" in result.reason
    sizes = [level.dofs for level in result.levels]
    assert 15_000 / LEAST_STEP**DOFS_ORDER < sizes[-1] <= 15_000 and len(sizes) >= 3


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
    result = solve_contact(
        SPHERE, ELASTIC, tolerance=target, delta_max=0.01, steps=5, unload_steps=2, on_curve=curves.append
    )
    assert not result.met and len(result.levels) == 2 and len(curves) == 1 and result.contact.complete
    np.testing.assert_allclose(result.curve.error_P_star[:5], curves[0].error_P_star, rtol=1e-6)
    assert result.curve.branch[5:].tolist() == ["unload", "unload"]
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
        "loading": {"delta_max": 0.006, "steps": 5}, "accuracy": {"tolerance": 0.01, "max_dofs": 9_000},
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


def test_no_room_for_more_than_the_first_mesh_leaves_its_curve() -> None:
    """The coarsest mesh of the block is all that max_dofs allows: others of other scales are nearly the same."""
    with pytest.raises(asp.InputError, match="too small") as refused:
        solve_contact(SPHERE, ELASTIC, tolerance=AccuracyTarget(0.1, max_dofs=1000), delta_max=0.01, steps=5)
    dofs = int(re.findall(r"has (\d+) dofs", str(refused.value))[0])
    with pytest.raises(PartialResult, match=r"the force has no error bar: accuracy\.max_dofs") as caught:
        target = AccuracyTarget(0.1, max_dofs=dofs)
        solve_contact(SPHERE, ELASTIC, tolerance=target, delta_max=0.01, steps=5, unload_steps=2)
    assert caught.value.result.complete and len(caught.value.result.curve) == 5 + 2


def test_the_coarsest_mesh_is_found_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """In a tiny contact are few elements: fifty meshes from the wanted to the coarsest one have about the same dofs."""
    tried: list[int] = []

    def counted(*args: Any) -> SizeField:
        tried.append(1)
        return size_field(*args)

    monkeypatch.setattr("asperity.adaptive.meshes.size_field", counted)
    sphere = asp.Surface.from_spec(kind="sphere", L=1.0, radius=1.0, centre=(0.31, 0.47))
    problem = Problem.of(sphere, ELASTIC, delta_max=1e-7, steps=5)
    family = MeshFamily(problem, guide_of(problem), 5000)
    first = family.next([])
    assert len(tried) <= 3 and 5000 / LEAST_RATIO**DOFS_ORDER < first.dofs == 3 * len(family.block.points)


def test_one_mesh_that_misses_waves_is_told() -> None:
    surface = rough(8, 0)
    with pytest.warns(ResolutionWarning, match=r"shorter than 1\.5 elements of mesh\.h_contact = 0\.2 "):
        asp.solve_contact(surface, ELASTIC, delta_max=0.006, steps=1, size=asp.MeshSize(0.2))
    with warnings.catch_warnings():
        warnings.simplefilter("error", ResolutionWarning)
        asp.solve_contact(bump(), ELASTIC, delta_max=0.006, steps=1, size=asp.MeshSize(0.2))
    assert doubt_of_waves(surface, 0.1, 0.006) and not doubt_of_waves(surface, 0.02, 0.006)


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
