"""Laws with time: closed forms, limits, cut steps, holds, and a restart inside a hold."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import here, world

import asperity as asp
from asperity.errors import CheckError, Interrupted
from asperity.fem.law_check import OneCell, check_law
from asperity.laws.definition import law_of_function
from asperity.mesh.block import BlockMesh
from asperity.quasistatic.checkpoint import Checkpoint
from asperity.quasistatic.contact_result import PartialResult
from asperity.quasistatic.newton import NewtonSolver

NU, TAU, SHARE = 0.3, 5.0, 0.7
MU, BULK = 1.0 / (2.0 * (1.0 + NU)), 1.0 / (3.0 * (1.0 - 2.0 * NU))
MAXWELL = asp.Material.of_law("maxwell", E=1.0, nu=NU, relaxation_time=TAU, share=SHARE)
FLOW: dict[str, Any] = {"E": 1.0, "nu": NU, "yield_strength": 0.005, "tangent_modulus": 0.05}
CREEP: dict[str, Any] = {"steps": 2, "duration": 1.0, "hold": 40.0, "hold_steps": 4}


def perzyna(viscosity: float, **more: float) -> asp.Material:
    return asp.Material.of_law("perzyna", **FLOW | {"viscosity": viscosity} | more)


def relaxed(t: float, duration: float) -> float:
    """Modulus of a confined block of MAXWELL, strained at a constant rate until `duration`, at the time t."""
    done = min(t, duration)
    branch = TAU / duration * (math.exp((done - t) / TAU) - math.exp(-t / TAU))
    return (BULK + 4.0 / 3.0 * MU * (1.0 - SHARE)) * done / duration + 4.0 / 3.0 * MU * SHARE * branch


def test_a_confined_block_relaxes_exponentially_through_steps_that_are_cut(
    cube: BlockMesh, monkeypatch: pytest.MonkeyPatch
) -> None:
    solve, calls = NewtonSolver.solve, iter(range(1000))

    def failing(self: NewtonSolver, start: Any, scale: float) -> Any:
        found = solve(self, start, scale)
        return replace(found, converged=next(calls) not in (1, 5))

    monkeypatch.setattr(NewtonSolver, "solve", failing)
    flat = asp.Surface.from_spec("flat", L=1.0)
    found = asp.solve_contact(flat, MAXWELL, delta_max=0.01, steps=3, duration=2.0, hold=20.0, hold_steps=4, block=cube)
    curve = found.curve
    assert found.counts.cutbacks == 2 and not found.checks.violated
    assert {0.0 + t for t in (2 / 3, 4 / 3, 2.0, 3.25, 7.0, 13.25, 22.0)} < set(curve.time.tolist())
    assert list(curve.branch).count("hold") == 5 and set(curve.delta[curve.branch == "hold"]) == {0.01}
    expected = [0.01 * relaxed(t, 2.0) for t in curve.time]
    print(f"confined Maxwell block: {np.abs(curve.force / expected - 1.0).max():.1e}")
    np.testing.assert_allclose(curve.force, expected, rtol=1e-9)


def test_overstress_at_a_constant_rate() -> None:
    """In shear q - Y rises to viscosity times rate as 1 - exp(-3 mu t/viscosity); of a power, in large steps."""
    rate, K, Y = 0.02, 0.4, 0.005

    def excess(exponent: float, times: Any) -> Any:
        given = FLOW | {"tangent_modulus": 0.0, "viscosity": K, "exponent": exponent}
        cell, state, found, before = OneCell(law_of_function(asp.laws.perzyna, given)), None, [], 0.0
        for t in times:
            shear = np.zeros((3, 3))
            shear[0, 1] = shear[1, 0] = 0.5 * math.sqrt(3.0) * rate * t
            answer = cell(shear, state, others={"dt": t - before})
            state, before = answer.state, t
            found.append(math.sqrt(3.0) * answer.stress[0, 1] - Y)
        return np.array(found)

    begins, time = Y / (3.0 * MU * rate), K / (3.0 * MU)
    after = np.linspace(0.0, 4.0 * time, 4001)
    expected = K * rate * -np.expm1(-after / time)
    found = excess(1.0, begins + after)
    errors = np.abs(found[100:] / expected[100:] - 1.0)
    print(f"overstress: {errors.max():.1e}")
    assert errors.max() < 1e-3  # of first order in the step
    steady = excess(5.0, begins + np.linspace(10.0, 1e5, 20) * time)[-1]
    assert steady == pytest.approx(K * rate ** (1.0 / 5.0), rel=1e-9)


def test_fast_and_slow_limits_on_a_rough_surface(rough: asp.Surface, coarse: BlockMesh) -> None:
    def force(material: asp.Material, **time: Any) -> float:
        more: dict[str, Any] = {"integrator": "backward-euler"} if material.yield_strength and not time else {}
        found = asp.solve_contact(rough, material, delta_max=0.02, steps=4, block=coarse, **time, **more)
        return float(found.curve.force[-1])

    elastic, j2 = force(asp.Material(1.0, NU)), force(asp.Material(1.0, NU, 0.005, 0.05))
    fast, slow = (force(perzyna(1.0), duration=duration) for duration in (1e-4, 1e6))
    print(f"fast {fast / elastic - 1:.1e}, slow {slow / j2 - 1:.1e}, elastic over J2 {elastic / j2:.2f}")
    assert elastic > 1.2 * j2
    assert fast == pytest.approx(elastic, rel=0.01) and slow == pytest.approx(j2, rel=1e-4)


def test_a_rough_surface_relaxes_to_the_slow_limit(rough: asp.Surface, coarse: BlockMesh) -> None:
    """The elastic solid of the moduli that are left."""
    left = MU * (1.0 - SHARE)
    nu = (3.0 * BULK - 2.0 * left) / (6.0 * BULK + 2.0 * left)
    soft = asp.Material(2.0 * left * (1.0 + nu), nu)
    expected = asp.solve_contact(rough, soft, delta_max=0.02, steps=2, block=coarse).curve
    long: dict[str, Any] = CREEP | {"hold": 500.0, "hold_steps": 10}
    found = asp.solve_contact(rough, MAXWELL, delta_max=0.02, block=coarse, **long).curve
    hold = found.branch == "hold"
    assert np.all(np.diff(found.force[hold]) < 0.0) and found.force[~hold][-1] > 1.5 * found.force[-1]
    print(f"slow limit: {found.force[-1] / expected.force[-1] - 1:.1e}")
    assert found.force[-1] == pytest.approx(expected.force[-1], rel=1e-6)
    assert found.area_fraction[-1] == pytest.approx(expected.area_fraction[-1], rel=1e-3)


def test_a_solid_that_returns_more_work_than_was_put_in_is_refused(cube: BlockMesh) -> None:
    """No step of such a law is balanced, which is said; a stiffness that grows with time gains energy in a cycle."""

    @asp.law(state={"age": ()}, time=True, symmetric=True)
    def grows(strain: Any, state: Any, dt: Any, E: float, nu: float, rate: float) -> Any:
        age = state.age + dt
        return (1.0 + rate * age) * asp.laws.hooke(strain, E, nu), {"age": age}

    def press(material: asp.Material) -> Any:
        path: dict[str, Any] = {"steps": 4, "unload_steps": 4, "duration": 1.0, "hold": 1.0}
        flat = asp.Surface.from_spec("flat", L=1.0)
        return asp.solve_contact(flat, material, delta_max=0.01, block=cube, **path)

    checks = press(MAXWELL).checks
    assert "only the work of the flat" in checks.not_balanced and checks.physical(1.0, 1.0)["energy_ratio"] is None
    assert 0.0 < checks.work < checks.work_at_peak
    with pytest.raises(CheckError, match="returned more work than was put in"):
        press(asp.Material.of_law(grows, E=1.0, nu=NU, rate=2.0))


def test_a_held_force_creeps_and_unloads(rough: asp.Surface, coarse: BlockMesh) -> None:
    found = asp.solve_contact(rough, MAXWELL, force_max=0.004, unload_steps=2, block=coarse, **CREEP)
    curve, hold = found.curve, found.curve.branch == "hold"
    assert not found.checks.violated
    assert list(curve.branch) == ["load"] * 2 + ["hold"] * 4 + ["unload"] * 2
    np.testing.assert_allclose(curve.time, [0.5, 1.0, 3.5, 11.0, 23.5, 41.0, 41.5, 42.0], rtol=1e-12)
    np.testing.assert_allclose(curve.force, 0.004 * np.array([0.5, 1, 1, 1, 1, 1, 0.5, 0]), rtol=1e-5, atol=1e-9)
    assert np.all(np.diff(curve.delta[hold]) > 0.0) and np.all(np.diff(curve.area_fraction[hold]) > 0.0)
    assert 0.0 < curve.delta[-1] < curve.delta[hold][0]


@pytest.mark.mpi
@pytest.mark.parametrize(
    ("material", "load"),
    [(MAXWELL, {"force_max": 0.004}), (perzyna(0.5, exponent=3.0), {"delta_max": 0.02})],
    ids=["maxwell to a force", "perzyna to an approach"],
)
def test_a_restart_inside_a_hold_changes_nothing_on_any_ranks(
    rough: asp.Surface, coarse: BlockMesh | None, shared_path: Path, material: asp.Material, load: dict[str, Any]
) -> None:
    """On one rank to the last bit; on two the curve of one rank too."""
    whole = world().bcast(coarse)

    def press(comm: Any, block: BlockMesh | None, **more: Any) -> Any:
        return asp.solve_contact(rough, material, block=block, comm=comm, **load, **CREEP, **more).curve

    alone, left = press(here(), whole), iter([""] * 5 + ["the test"])
    with pytest.raises(PartialResult) as stopped:
        press(world(), coarse, checkpoint=Checkpoint(shared_path, {}, world()), stop=lambda: next(left))
    assert isinstance(stopped.value.__cause__, Interrupted)
    found = press(world(), coarse, checkpoint=Checkpoint(shared_path, {}, world()))
    worst = {}
    for name in ("time", "delta", "force", "area_fraction", "max_pressure", "max_plastic_strain", "mean_gap"):
        one, two = getattr(alone, name), getattr(found, name)
        if world().size == 1:
            np.testing.assert_array_equal(one, two, err_msg=name)
        tolerance = 1e-8 if name in ("time", "delta", "force", "area_fraction") else 1e-6
        worst[name] = float(np.abs(one - two).max() / (np.abs(one).max() or 1.0))
        assert worst[name] <= tolerance, (name, worst)
    print({name: f"{value:.0e}" for name, value in worst.items()})


@pytest.mark.parametrize(
    ("loading", "material", "said"),
    [
        ({"hold": 1.0}, None, "loading.hold = 1 needs loading.duration"),
        ({"duration": 1.0, "hold_steps": 3}, None, "hold_steps = 3 needs loading.hold"),
        ({"duration": 1.0, "hold": 1.0, "hold_steps": 0}, None, "is no hold"),
        ({"duration": 0.0}, None, "loading.duration = 0"),
        ({"duration": 1.0}, asp.Material(1.0, NU), "needs a material.law with time"),
        ({"duration": 1.0}, asp.Material.of_law("hooke", E=1.0, nu=NU), "needs a material.law with time"),
        ({}, MAXWELL, "takes time: give loading.duration"),
        ({"duration": 1.0, "integrator": "midpoint"}, MAXWELL, "would extrapolate"),
    ],
)
def test_time_that_does_not_fit_is_refused(loading: dict[str, Any], material: asp.Material | None, said: str) -> None:
    with pytest.raises(asp.InputError, match=said):
        asp.Problem.of(asp.Surface.from_spec("flat", L=1.0), material or MAXWELL, delta_max=0.01, **loading)


def test_a_law_that_integrates_nothing_in_no_time_is_refused() -> None:
    """With dt = 0 a second application must change nothing, and a time needs an argument."""

    @asp.law(state={"a": ()}, time=True)
    def counts(strain: Any, state: Any, dt: Any, E: float, nu: float) -> Any:
        return asp.laws.hooke(strain, E, nu), {"a": state.a + dt + 1.0}

    @asp.law(state={"a": ()}, time=True)
    def without(strain: Any, state: Any, E: float, nu: float) -> Any:
        return asp.laws.hooke(strain, E, nu), {"a": state.a}

    with pytest.raises(asp.InputError, match=r"a second time at the same strain of .* with dt = 0"):
        check_law(law_of_function(counts, {"E": 1.0, "nu": NU}))
    with pytest.raises(asp.InputError, match="has the arguments"):
        law_of_function(without, {"E": 1.0, "nu": NU})
