"""A force or pressure that a load path gives is met by the corrected curve, whose approaches are what is corrected."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from conftest import ELASTIC, PLASTIC, here

import asperity as asp
from asperity.adaptive.extrapolation import Budget, Pair, PressedMesh, at_given_forces, correct, without_omission
from asperity.adaptive.guide import Omission
from asperity.adaptive.loading import scaled
from asperity.case import Case
from asperity.curve import Curve
from asperity.reference import half_space_contact

PATCH = asp.Surface.from_spec(kind="sphere", L=1.0, radius=30.0, centre=(0.3, 0.4), shape="paraboloid")


def power(factor: float, branches: tuple[str, ...] = ("load",), **columns: Any) -> Curve:
    at = np.array([0.002, 0.004, 0.006])
    rows = [
        {"delta": d, "delta_star": d, "force": factor * d**1.5, "P_star": factor * d**1.5, "branch": branch, **columns}
        for branch in branches
        for d in (at if branch != "unload" else at[::-1])
    ]
    return Curve.from_rows(rows)


def twice(curve: Curve) -> Pair:
    """Two meshes with the same curve."""
    nothing = Omission(np.array([0.0]), *4 * [np.zeros(1)])
    fine, coarse = (PressedMesh(scale, 1, curve, nothing) for scale in (1.0, 2.0))
    return Pair(fine, coarse, np.ones(np.count_nonzero(curve.branch == "load"), dtype=bool))


@pytest.mark.parametrize("factor", [0.7, 0.98, 1.2])
def test_the_approach_of_a_power_law_is_exact(factor: float) -> None:
    """Area and gap are those of the force that is given, as powers of it on both meshes."""
    raw, pressed = (power(f, ("load", "unload")) for f in (2.0, 2.0 * factor))
    columns: dict[str, Any] = {"area_fraction": 3.0 * pressed.P_star**0.9, "mean_gap": 0.01 * pressed.P_star**-0.1}
    pressed = replace(pressed, error_area_fraction=np.zeros(6), **columns)
    found, bars = correct(twice(pressed), raw, np.full(3, 0.02), 0.01, float(raw.force[2]))
    np.testing.assert_allclose(found.force, raw.force, rtol=1e-14)
    np.testing.assert_allclose(found.force, 2.0 * factor * found.delta**1.5)
    np.testing.assert_allclose(bars.total, np.where(found.branch == "load", 0.03 * found.P_star, 0.03 * raw.P_star[2]))
    loading = found.loading()
    np.testing.assert_allclose(loading.area_fraction, 3.0 * loading.P_star**0.9)
    np.testing.assert_allclose(loading.mean_gap, 0.01 * loading.P_star**-0.1)


@pytest.mark.parametrize("factor", [0.9, 0.98, 1.1])
def test_the_bar_holds_what_a_bend_of_the_law_makes_of_a_force_that_is_given(factor: float) -> None:
    """From the power 1.5 to 1 at once, as of spots that all yield; where the exponent is steady the bar is small."""
    at = 0.001 * np.arange(1.0, 13.0)

    def law(d: np.ndarray) -> np.ndarray:
        return np.where(d < 0.006, d**1.5, 0.006**0.5 * d)

    rows = [{"delta": d, "delta_star": d, "force": P, "P_star": P} for d, P in zip(at, law(at), strict=True)]
    corrected, nothing = Curve.from_rows(rows), np.zeros(len(at))
    raw = scaled(corrected, np.full(len(at), factor))
    found, bars = at_given_forces(corrected, Budget(*4 * [nothing]), raw, float(raw.force[-1]))
    error = np.abs(found.P_star / law(found.delta_star) - 1.0)
    bar = bars.total / found.P_star
    assert error.max() > 0.002 and np.all(error <= bar + 1e-12)
    assert bar[:3].max() < 1e-12 and bar.max() < 0.05


def test_a_corrected_force_that_stands_still_or_falls_moves_no_approach_out_of_order() -> None:
    at = np.array([0.002, 0.004, 0.006, 0.008, 0.010])
    for third in (1.0, 1.0 + 1e-9, 1.0 + 1e-5, 0.95):  # over the force of the second step
        P = at**1.5
        P[2] = third * P[1]
        rows = [
            {"delta": d, "delta_star": d, "force": p, "P_star": p, "area_fraction": 0.1 * p, "error_area_fraction": 0.0}
            for d, p in zip(at, P, strict=True)
        ]
        pressed = Curve.from_rows(rows)
        raw = scaled(pressed, np.full(len(at), 1.05))
        found, bars = correct(twice(pressed), raw, np.zeros(len(at)), 0.0, float(raw.force[-1]))
        moved = np.log(found.delta / at) / np.log(1.05)
        assert np.all(moved > 0.3) and np.all(moved < 2.1) and np.all(np.diff(found.delta) > 0.0)
        np.testing.assert_allclose(found.area_fraction, 0.1 * raw.P_star)
        assert np.isfinite(bars.total).all() and bars.total[2] > 0.05 * found.P_star[2]


@pytest.mark.parametrize("sharp", [0.0, 1.0])
def test_half_of_what_a_top_leaves_out_is_taken(sharp: float) -> None:
    """The bar of the area holds half; sharp edges are not moved; a block pressed more has a wider gap."""
    curve = power(2.0, ("load", "unload"), area_fraction=0.1, mean_gap=0.01, error_area_fraction=0.002)
    missed = Omission(np.array([0.001, 0.01]), np.full(2, -0.2), np.full(2, 0.4), np.zeros(2), np.full(2, sharp))
    found = without_omission(curve, missed, 0.5)
    np.testing.assert_allclose(found.force, 0.9 * curve.force)
    np.testing.assert_allclose(found.P_star, 0.9 * curve.P_star)
    np.testing.assert_allclose(found.area_fraction, 0.12 if sharp == 0.0 else 0.1)
    np.testing.assert_allclose(found.error_area_fraction, np.hypot(0.02 * found.area_fraction, 0.02))
    np.testing.assert_allclose(found.mean_gap, 0.01 - 0.5 * 0.1 * curve.P_star)


def test_a_force_that_is_given_is_met_by_the_corrected_curve() -> None:
    """Three times, in elastic cycles; the approach is that of boundary elements, and unloading retraces loading."""
    force = 1.0e-4
    found = asp.solve_contact(
        PATCH,
        ELASTIC,
        tolerance=asp.AccuracyTarget(0.05),
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
        exact = half_space_contact(PATCH, 256, P_star=float(loading.P_star[k]), height=1.0).delta_star
        assert abs(loading.delta_star[k] / exact - 1.0) <= bar[k] / 1.5 + 2e-3
    back = curve.unloading()
    back = back.where(back.force > 0.0)
    same = np.interp(back.delta, loading.delta, loading.force)
    assert np.all(np.abs(back.force - same) <= 0.05 * force)


def test_a_pressure_that_is_given_is_met_after_yield() -> None:
    blunt = asp.Surface.from_spec(kind="sphere", L=1.0, radius=2.0, centre=(0.3, 0.4), shape="paraboloid")
    found = asp.solve_contact(
        blunt, PLASTIC, tolerance=asp.AccuracyTarget(0.2), pressure_max=2e-3, steps=5, unload_steps=2, comm=here()
    )
    curve, last = found.curve, int(np.argmax(found.curve.force))
    assert curve.force[last] == 2e-3 and curve.branch[last] == "load" and curve.force[-1] == 0.0
    assert 0.0 < curve.delta[-1] < curve.delta[last]
    np.testing.assert_allclose(curve.delta[last:] / curve.delta[last], found.raw.delta[last:] / found.raw.delta[last])


@pytest.mark.parametrize("law", ["auto", "paper"])
def test_joint_and_slip_may_stand_under_the_force_of_the_path(law: str, recwarn: pytest.WarningsRecorder) -> None:
    """The law through the last points, a fit, ends below the curve; it goes on to its force, and nothing is lowered."""
    case = {
        "surface": {"kind": "sphere", "L": 240e-6, "radius": 2.8e-3},
        "material": {"E": 192e9, "nu": 0.3},
        "loading": {"pressure_max": 0.69 / 240e-6**2, "steps": 5},
        "accuracy": {"tolerance": 0.05},
        "joint": {"nominal_area": 5.76e-8, "preload": 0.69, "mass": 1e-3},
        "dynamics": {"law": law, "model": ["exact"]},
        "slip": {"friction": 0.3, "preload": 0.69},
    }
    found = asp.run(Case.from_dict(case))
    assert found.dynamics is not None and found.dynamics.first.load == pytest.approx(0.69, rel=1e-12)
    assert found.summary["slip"]["preload"] == pytest.approx(0.69, rel=1e-12)
    assert not [w for w in recwarn if "exceeds the greatest force" in str(w.message)]
