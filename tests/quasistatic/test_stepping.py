"""The load path: roll-back, cutback, must-points, unloading, force control, cycles, predictor, memory."""

from __future__ import annotations

import dataclasses
import gc
import warnings
import weakref
from collections.abc import Callable
from dataclasses import asdict, replace
from itertools import pairwise
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from conftest import ELASTIC, PLASTIC, here, make_contact_solver, world
from j2_path import confined_stress

from asperity.adaptive.solve_contact import solve_contact
from asperity.curve.slope import legs
from asperity.errors import AsperityWarning, ConvergenceError
from asperity.fem.history import History, extrapolate
from asperity.mesh.block import BlockMesh
from asperity.model.load_path import MIDPOINT, Schedule
from asperity.model.material import Material
from asperity.model.settings import Formulation, MeshSize, SolverOptions
from asperity.quasistatic import measures, solve_problem
from asperity.quasistatic.contact_solver import ContactSolver
from asperity.quasistatic.legs import GROWTH, SMALLEST_CUT
from asperity.quasistatic.measures import Record
from asperity.quasistatic.newton import NewtonSolver, StepStats
from asperity.quasistatic.stepping import follow
from asperity.surface import Flat, Surface
from asperity.vibration import law_from

Array = npt.NDArray[np.float64]

NU = 0.3
DELTA = 0.03
EACH = pytest.mark.parametrize("material", [ELASTIC, PLASTIC], ids=["elastic", "plastic"])


@pytest.fixture
def press_of(rough: Surface, coarse: BlockMesh | None) -> Callable[..., ContactSolver]:
    def make(material: Material, **options: Any) -> ContactSolver:
        return make_contact_solver(world(), rough, coarse, material, options=SolverOptions(**options))

    return make


def drive(solver: ContactSolver, **schedule: Any) -> Record:
    record = Record(1.0, solver.solid.material.E, solver.solid.material.reduced_modulus)
    follow(solver, Schedule(**schedule), record)
    return record


def fail(monkeypatch: pytest.MonkeyPatch, when: Callable[[int], bool]) -> list[int]:
    """Make solves fail after they have done their work on displacement and history; the numbers of the failed."""
    true_solve = NewtonSolver.solve
    calls, failed = [0], []

    def solve(self: NewtonSolver, start: Any, scale: float) -> StepStats:
        stats = true_solve(self, start, scale)
        calls[0] += 1
        if when(calls[0]):
            failed.append(calls[0])
            stats = dataclasses.replace(stats, converged=False, reason="forced")
        return stats

    monkeypatch.setattr(NewtonSolver, "solve", solve)
    return failed


def state(solver: ContactSolver) -> dict[str, Any]:
    """All that the next step starts from."""
    return {
        "u": solver.solid.u.x.array.copy(),
        "history": solver.solid.kernels.history().copy().arrays(),
        "solver": asdict(replace(solver.state(), counts=None)),  # type: ignore[arg-type]
        "nodal force": solver.nodal_force.copy(),
        "pressure": solver.pressure.copy(),
    }


# --- failed attempts ------------------------------------------------------------------------------------------


@pytest.mark.mpi
def test_a_failed_attempt_leaves_every_bit_as_it_was(
    press_of: Callable[..., ContactSolver], monkeypatch: pytest.MonkeyPatch
) -> None:
    solver, twin = press_of(PLASTIC), press_of(PLASTIC)
    for p in (solver, twin):
        assert p.step(0.01).converged and p.step(0.02).converged
    before = state(solver)
    fail(monkeypatch, lambda call: True)
    assert not solver.step(0.04).converged
    np.testing.assert_equal(state(solver), before)
    monkeypatch.undo()
    for p in (solver, twin):
        assert p.step(0.03).converged
    # sums over ranks are not repeatable to the last bit
    assert solver.force == pytest.approx(twin.force, rel=1e-9)
    row, expected = measures.row(solver), measures.row(twin)
    for key, value in expected.items():
        assert row[key] == pytest.approx(value, rel=1e-7), key


def test_a_cut_step_is_halved_grows_again_and_hits_the_planned_points(
    press_of: Callable[..., ContactSolver], monkeypatch: pytest.MonkeyPatch
) -> None:
    planned = DELTA / 5
    smooth = drive(press_of(ELASTIC), delta_max=DELTA, steps=5).curve()
    failed = fail(monkeypatch, lambda call: call in (2, 3))
    solver = press_of(ELASTIC)
    cut = drive(solver, delta_max=DELTA, steps=5).curve()
    assert failed == [2, 3] and solver.counts.cutbacks == 2
    np.testing.assert_array_equal(smooth.delta, DELTA * np.arange(1, 6) / 5)
    assert set(smooth.delta) <= set(cut.delta)
    moves = np.diff(cut.delta, prepend=0.0)
    np.testing.assert_allclose(moves[:3], [planned, planned / 4, planned / 4 * GROWTH], rtol=1e-12)
    assert np.all(moves <= planned * 1.0011)
    np.testing.assert_allclose(cut.force[np.isin(cut.delta, smooth.delta)], smooth.force, rtol=1e-7)


def test_a_cut_step_does_not_unload_from_a_history_ahead(
    press_of: Callable[..., ContactSolver], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The midpoint rule extrapolates the history; the force of a step that ends before must be that of the path."""
    soft = Material(1.0, NU, 1e-3, 0.0)
    smooth = drive(press_of(soft), delta_max=DELTA, steps=5, integrator="midpoint").curve()
    fail(monkeypatch, lambda call: call in (6, 7, 8))
    cut = drive(press_of(soft), delta_max=DELTA, steps=5, integrator="midpoint").curve()
    assert len(cut) > len(smooth)
    np.testing.assert_allclose(cut.force, np.interp(cut.delta, smooth.delta, smooth.force), rtol=0.15)


def test_a_step_that_never_converges_ends_the_run_with_the_curve_so_far(
    press_of: Callable[..., ContactSolver], monkeypatch: pytest.MonkeyPatch
) -> None:
    solver = press_of(PLASTIC)
    record = Record(1.0, 1.0, PLASTIC.reduced_modulus)
    fail(monkeypatch, lambda call: call > 2)
    with pytest.raises(ConvergenceError, match=r"no convergence at delta/L = 0\.0120\d+ \(forced .* 0\.012 is kept"):
        follow(solver, Schedule(delta_max=DELTA, steps=5), record)
    assert len(record.curve()) == 2
    assert solver.delta == record.curve().delta[-1] == 2 * DELTA / 5
    assert solver.counts.cutbacks - np.log2(1 / SMALLEST_CUT) in (0, 1)
    solver.newton.linear.lacks = "take more memory"  # a finer mesh would not help
    with pytest.raises(ConvergenceError, match=r"on the way to the greatest force \(forced .*: take more memory"):
        follow(solver, Schedule(force_max=0.01, steps=5), record)
    assert len(record.curve()) == 2


# --- unloading ------------------------------------------------------------------------------------------------


def test_unloading_ends_at_zero_force(press_of: Callable[..., ContactSolver]) -> None:
    solver = press_of(PLASTIC)
    curve = drive(solver, delta_max=DELTA, steps=5, unload_steps=6).curve()
    assert list(curve.branch[:5]) == ["load"] * 5 and set(curve.branch[5:]) == {"unload"}
    down = curve.where(curve.branch == "unload")
    assert down.force[-1] == 0.0
    assert down.area_fraction[-1] == 0.0 and down.max_pressure[-1] == 0.0
    assert np.all(np.diff(down.force) < 0)
    assert np.all(np.diff(down.delta) < 0)
    steps = -np.diff(np.append(curve.force[4], down.force)) / curve.force[4]
    assert steps.max() < 2 / 6  # about equal steps of force
    # what is left of the approach is how much lower the flat touches
    summit = world().allreduce(float(solver._highest()))
    residual = solver.summit - summit
    assert down.delta[-1] == pytest.approx(residual, abs=1e-12)
    assert 0.3 * DELTA < residual < DELTA
    assert not solver.checks.violated


# --- force control and cycles ---------------------------------------------------------------------------------


@pytest.mark.parametrize(("material", "steps"), [(PLASTIC, 1), (ELASTIC, 4)])
def test_force_control_hits_its_force(press_of: Callable[..., ContactSolver], material: Material, steps: int) -> None:
    force_star = 0.004
    curve = drive(press_of(material), force_max=force_star, steps=steps, unload_steps=2, cycles=1 + (steps > 1)).curve()
    force_max = force_star * material.reduced_modulus
    for branch in sorted({"load", "reload"} & set(curve.branch)):
        part = curve.where(curve.branch == branch)
        assert part.force[-1] == pytest.approx(force_max, rel=1e-6)
        assert np.all(np.diff(part.force) > 0)
        assert np.all(part.force <= force_max * (1 + 1e-6))
        assert len(part) >= steps
    # the position found is the one that control of the approach needs for that force
    again = press_of(material)
    for delta in curve.loading().delta:
        assert again.step(delta).converged
    assert again.force == pytest.approx(force_max, rel=1.1e-6)  # found to 1e-6, and solved twice to 1e-8


def test_an_estimate_of_the_approach_that_takes_long_is_ended(rough: Surface, monkeypatch: pytest.MonkeyPatch) -> None:
    """And the run goes on with what it has."""
    monkeypatch.setattr(solve_problem, "ESTIMATE_STEPS", 1)
    size = MeshSize(h_contact=0.2, h_max=0.5)
    curve = solve_contact(rough, ELASTIC, force_max=1e-3, steps=2, size=size, comm=here()).curve
    assert curve.force[-1] == pytest.approx(1e-3, rel=1e-6)


@EACH
def test_cycles(press_of: Callable[..., ContactSolver], material: Material) -> None:
    solver = press_of(material)
    curve = drive(solver, delta_max=DELTA, steps=4, unload_steps=4, cycles=3).curve()
    np.testing.assert_array_equal(curve.step, np.arange(1, len(curve) + 1))
    branches = [curve.branch[0], *(b for a, b in zip(curve.branch, curve.branch[1:], strict=False) if a != b)]
    assert branches == ["load", "unload", "reload", "unload", "reload", "unload"]
    tops = curve.force[curve.delta == DELTA]
    assert len(tops) == 3
    assert np.all(np.diff(curve.max_plastic_strain) >= 0)
    assert np.all(np.diff(curve.plastic_fraction) >= 0)
    ends = curve.where(curve.force == 0.0)
    assert len(ends) == 3
    # reloading from the residual indentation meets the loading curve again: shakedown, except for a little flow
    near: dict[str, Any] = {"rtol": 0.02} if material.plastic else {"rtol": 1e-7, "atol": 1e-12}
    np.testing.assert_allclose(tops, tops[0], **near)
    np.testing.assert_allclose(ends.delta, ends.delta[0], **near)
    if not material.plastic:
        np.testing.assert_allclose(curve.where(curve.branch == "reload").force[:4], curve.loading().force, rtol=1e-7)
    assert not solver.checks.violated


@pytest.mark.parametrize("load", [{"delta_max": DELTA}, {"force_max": 0.004}], ids=["approach", "force"])
def test_an_elastic_solid_retraces_its_loading_in_contact(press_of: Callable[..., ContactSolver], load: Any) -> None:
    """Every step of cycles that stay in contact has the force of a flat that went there directly."""
    curve = drive(press_of(ELASTIC), steps=4, unload_steps=3, unload_to=0.4, cycles=2, **load).curve()
    top = curve.loading().force[-1]
    legs = curve.legs()
    assert [leg.branch[-1] for leg in legs] == ["load", "unload", "reload", "unload"]
    np.testing.assert_allclose([leg.force[-1] / top for leg in legs], [1.0, 0.4, 1.0, 0.4], rtol=2e-6)
    assert all(3 <= len(leg) - 1 <= 8 for leg in legs[1:])
    order = np.argsort(curve.delta, kind="stable")
    once = press_of(ELASTIC)
    for delta, force in zip(curve.delta[order], curve.force[order], strict=True):
        assert once.step(delta).converged
        assert force == pytest.approx(once.force, rel=1e-6, abs=1e-7 * top)


@pytest.mark.parametrize("hardening", ["isotropic", "kinematic"])
def test_the_loss_of_a_cycle_in_contact(cube: BlockMesh, hardening: str) -> None:
    """A confined column in closed form: stresses, the area of each loop by the trapezoidal rule, the plastic work."""
    strength, tangent, depth, steps = 0.001, 0.05, 0.01, 40
    material = Material(1.0, NU, strength, tangent, hardening)
    solver = make_contact_solver(here(), Flat(L=1.0), cube, material)
    record, dissipated = Record(1.0, 1.0, material.reduced_modulus), []
    schedule = Schedule(delta_max=depth, steps=steps, unload_steps=steps, unload_to=0.3, cycles=4)
    follow(solver, schedule, record, on_step=lambda *_: dissipated.append(solver.checks.dissipated))
    curve = record.curve()
    stress, _, accumulated = confined_stress(curve.delta, 1.0, NU, strength, tangent, material.kinematic_share)
    np.testing.assert_allclose(curve.force, stress, rtol=1e-8)
    np.testing.assert_allclose(curve.max_plastic_strain, accumulated, rtol=1e-8)
    ends = [end - 1 for _, end in legs(curve.branch)]
    np.testing.assert_allclose(curve.force[ends[1::2]], 0.3 * curve.force[ends[0::2]], rtol=2e-6)
    for low, high in pairwise(ends[1::2]):
        area = np.trapezoid(curve.force[low : high + 1], curve.delta[low : high + 1])
        flow, lost = accumulated[high] - accumulated[low], dissipated[high] - dissipated[low]
        growth = 0.5 * (1.0 - material.kinematic_share) * material.plastic_modulus
        assert lost == pytest.approx(strength * flow + growth * flow * (accumulated[low] + accumulated[high]), rel=1e-6)
        if hardening == "kinematic":  # a steady loop, whose back stress ends where it began
            assert flow > 1e-3 and area == pytest.approx(lost, rel=0.02)
    assert solver.release().converged  # to the strain without stress
    left = confined_stress([*curve.delta, solver.delta], 1.0, NU, strength, tangent, material.kinematic_share)[0][-1]
    assert left == pytest.approx(0.0, abs=1e-10)


def test_a_leg_to_the_force_that_is_there_already(cube: BlockMesh) -> None:
    """One step each, and no division by its way."""
    solver = make_contact_solver(here(), Flat(L=1.0), cube, ELASTIC)
    curve = drive(solver, force_max=0.01, steps=3, unload_steps=1, unload_to=1.0 - 1e-8, cycles=2).curve()
    assert list(curve.branch[-3:]) == ["unload", "reload", "unload"]
    np.testing.assert_allclose(curve.force[-4:], 0.01 * ELASTIC.reduced_modulus, rtol=1.1e-6)


@pytest.mark.parametrize("steps", [3, 6])
def test_an_unloading_aims_at_planned_forces(press_of: Callable[..., ContactSolver], steps: int) -> None:
    """After the first step, whose slope is a guess, each is next to a force that is planned."""
    for end in (0.0, 0.05):
        curve = drive(press_of(ELASTIC), delta_max=DELTA, steps=4, unload_steps=steps, unload_to=end).curve()
        top, down = curve.loading().force[-1], curve.where(curve.branch == "unload").force
        assert down[-1] == pytest.approx(end * top, abs=1.1e-6 * top)
        away = (top - down[1 : steps - 1]) / ((1.0 - end) * top / steps)
        np.testing.assert_allclose(away, np.round(away), atol=0.25)


def test_a_loading_that_was_not_felt_is_lifted_off(rough: Surface, coarse: BlockMesh | None) -> None:
    """A penalty reaches no quadrature point yet: zero force, and nothing to share among the steps of the unloading."""
    solver = make_contact_solver(world(), rough, coarse, ELASTIC, formulation=Formulation("penalty"))
    curve = drive(solver, delta_max=1e-7, steps=2, unload_steps=3).curve()
    assert np.all(curve.force == 0.0) and curve.branch[-1] == "unload"


def test_midpoint_rule_under_force_control_stops_at_the_force(press_of: Callable[..., ContactSolver]) -> None:
    """The history must not be extrapolated beyond the last position, which the force decides."""
    exact = drive(press_of(PLASTIC), force_max=0.01, steps=20, integrator=MIDPOINT).curve()
    for steps in (1, 4):
        solver = press_of(PLASTIC)
        curve = drive(solver, force_max=0.01, steps=steps, integrator=MIDPOINT).curve()
        assert not solver.checks.violated
        assert curve.delta[-1] == pytest.approx(exact.delta[-1], rel=0.15 / steps)


@pytest.mark.parametrize(
    ("material", "load", "count"),
    [
        (PLASTIC, {"delta_max": DELTA, "steps": 6, "integrator": MIDPOINT}, 3),
        (ELASTIC, {"force_max": 2e-3, "steps": 8}, 4),
    ],
    ids=["approach", "force"],
)
def test_snapshots_are_spread_over_the_loading(
    press_of: Callable[..., ContactSolver], material: Material, load: dict[str, Any], count: int
) -> None:
    """As many as requested, each at the first step at or beyond its part of approach or force, the last at the end."""
    solver, record = press_of(material), Record(1.0, 1.0, material.reduced_modulus)
    follow(solver, Schedule(**load, unload_steps=2), record, snapshots=count)
    curve, part = record.curve(), np.arange(1, count + 1) / count * (1.0 - 2e-6)
    driven = curve.loading().delta if "delta_max" in load else curve.loading().P_star
    expected = [int(np.argmax(driven >= x * driven[-1])) for x in part]
    assert [s.step - 1 for s in record.snapshots] == expected and len(set(expected)) == count
    for row, snapshot in zip(expected, record.snapshots, strict=True):
        assert snapshot.delta == curve.delta[row] and snapshot.branch == "load"
        assert snapshot.pressure.max() == pytest.approx(curve.max_pressure[row])
        assert np.max(snapshot.plastic_strain, initial=0.0) == curve.max_plastic_strain[row]


# --- memory ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("linear", ["lu", "cg"])
def test_a_press_gives_its_memory_back(press_of: Callable[..., ContactSolver], linear: str) -> None:
    """PETSc's references to Python are hidden from the garbage collector: a cycle through them stays for ever."""
    solver = press_of(PLASTIC, linear=linear)
    assert solver.step(0.01).converged
    left = [weakref.ref(x) for x in (solver, solver.newton, solver.solid, solver.newton.linear)]
    del solver
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        gc.collect()
    assert [x() for x in left] == [None] * 4


@pytest.mark.mpi
def test_matrices_that_are_dropped_are_made_again(press_of: Callable[..., ContactSolver]) -> None:
    """The state stays: later steps, roll-back and unloading are those of a solver that kept its matrices."""
    kept, dropped = press_of(PLASTIC), press_of(PLASTIC)
    for delta in (0.01, 0.02, 0.015):
        for solver in (kept, dropped):
            assert solver.step(delta).converged
        left = weakref.ref(dropped.newton.linear)
        dropped.drop_matrices()
        assert "_values" not in vars(dropped.solid.tangent) and left() is None
    # equations are solved to 1e-8, and sums over ranks are not repeatable to the last bit
    assert dropped.force == pytest.approx(kept.force, rel=1e-7)
    found, expected = (measures.row(solver) for solver in (dropped, kept))
    for name in ("max_pressure", "area_fraction", "mean_gap", "max_plastic_strain"):
        assert found[name] == pytest.approx(expected[name], rel=1e-6, abs=1e-12)
    for solver in (kept, dropped):
        assert solver.release().converged
    assert dropped.delta == pytest.approx(kept.delta, abs=1e-9)


@pytest.mark.mpi
def test_the_solvers_of_dropped_matrices_are_destroyed(press_of: Callable[..., ContactSolver]) -> None:
    """On several ranks PETSc puts objects aside that are released, and their matrices with them."""
    solver = press_of(PLASTIC, linear="cg")
    assert solver.step(0.01).converged
    linear = solver.newton.linear
    multigrid = linear.multigrid
    assert multigrid is not None
    left = [weakref.ref(x) for x in (linear, multigrid, multigrid._tangent, multigrid._coarse)]
    del linear, multigrid
    solver.drop_matrices()
    assert [x() for x in left] == [None] * 4


@pytest.mark.mpi
@pytest.mark.usefixtures("several_ranks")
def test_a_new_solver_destroys_those_of_earlier_runs(press_of: Callable[..., ContactSolver]) -> None:
    """MPICH has 2048 communicators a process, and a run takes 33: a script on two ranks ended after 60 runs."""
    solver = press_of(PLASTIC, linear="cg")
    assert solver.step(0.01).converged
    left = weakref.ref(solver.newton.linear)
    del solver
    press_of(PLASTIC, linear="cg")
    assert left() is None


# --- rescues ----------------------------------------------------------------------------------------------------


@pytest.mark.mpi
@pytest.mark.parametrize(("linear", "material"), [("cg", PLASTIC), ("lu", ELASTIC)])
def test_systems_that_cg_or_cholesky_fails_on_are_factorised_by_lu(
    press_of: Callable[..., ContactSolver], material: Material, monkeypatch: pytest.MonkeyPatch, linear: str
) -> None:
    direct, rescued = press_of(material, linear="lu", rtol=1e-10), press_of(material, linear=linear, rtol=1e-10)
    monkeypatch.setattr(rescued.newton.linear, "_outcome", lambda: (7, False))
    monkeypatch.setattr("asperity.linear.solver.RESCUES", 2)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        for solver in (direct, rescued):
            for delta in (0.004, 0.008):
                assert solver.step(delta).converged
    told = [str(w.message) for w in caught if issubclass(w.category, AsperityWarning)]
    assert len(told) == (1 if rescued.solid.comm.rank == 0 else 0)
    assert all("LU solved them" in text for text in told)
    assert rescued.force == pytest.approx(direct.force, rel=1e-9)
    assert rescued.counts.direct == rescued.counts.newton > 0 and direct.counts.direct == 0
    assert rescued.counts.krylov == 14  # after a step that the solver requested is tried


@pytest.mark.mpi
@pytest.mark.parametrize("linear", ["lu", "cg"])
def test_a_force_next_to_nothing(press_of: Callable[..., ContactSolver], linear: str) -> None:
    """While one node is touched the force is proportional to the approach, to the digits coordinates have."""
    light, tiny = (drive(press_of(ELASTIC, linear=linear), force_max=force, steps=4).curve() for force in (1e-9, 1e-12))
    assert len(light.force) == len(tiny.force) == 4
    stiffness = light.force / light.delta
    np.testing.assert_allclose(stiffness, stiffness[0], rtol=1e-7)
    np.testing.assert_allclose(tiny.force / tiny.delta, stiffness[0], rtol=1e-4)


def test_the_midpoint_rule_does_not_ring_where_the_yield_strain_is_negligible(
    rough: Surface, coarse: BlockMesh | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Without hardening at sigma_y/E = 1e-4 the plain rule does work that no energy answers to."""
    soft = Material(1.0, NU, 1e-4, 0.0)

    def whole(before: History, after: History, extrapolation: float) -> History:
        begin = before.arrays()
        return History(**{name: end + extrapolation * (end - begin[name]) for name, end in after.arrays().items()})

    errors = []
    for rule in (extrapolate, whole):
        monkeypatch.setattr("asperity.quasistatic.contact_solver.extrapolate", rule)
        solver = make_contact_solver(world(), rough, coarse, soft)
        drive(solver, delta_max=0.015, steps=12, integrator="midpoint")
        errors.append(abs(1.0 - solver.checks.energy_ratio))
    assert errors[0] < 0.5 * errors[1]


def test_the_law_about_a_preload_is_that_of_the_last_loop(press_of: Callable[..., ContactSolver]) -> None:
    """Its stiffness is that of the solver itself when it takes a small step there."""
    solver = press_of(PLASTIC)
    curve = drive(solver, delta_max=DELTA, steps=10, unload_steps=6, cycles=3).curve()
    assert list(curve.branch).count("reload") >= 20
    load = 0.5 * float(curve.force.max())
    law = law_from(curve, "unload-reload", load)[0]
    last = [leg for leg in curve.legs() if leg.branch[-1] == "unload"][-1]
    origin = float(last.delta[last.force <= 0.0].max())  # where it separates
    last = last.where(last.force > 0)
    np.testing.assert_allclose(law.z + origin, last.delta[::-1], rtol=1e-12)
    np.testing.assert_array_equal(law.F, last.force[::-1])
    z = law.deflection(load)
    forces = []
    for away in (-0.5, 0.0, 0.1):
        assert solver.step(origin + z * (1.0 + away)).converged
        forces.append(solver.force)
    assert forces[1] == pytest.approx(load, rel=0.02)
    assert forces[2] == pytest.approx(float(law.force(1.1 * z)), rel=0.02)
    assert forces[2] - forces[1] == pytest.approx(0.1 * z * law.derivatives(z)[0], rel=0.15)
