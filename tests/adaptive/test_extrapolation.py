"""Curves of the limit of two meshes whose errors are known, at an approach and at a force that is given."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from asperity.adaptive.extrapolation import (
    FLOWING,
    SCATTER,
    Budget,
    Pair,
    PressedMesh,
    at_given_forces,
    correct,
    with_measure,
    without_omission,
)
from asperity.adaptive.guide import Omission
from asperity.adaptive.limits import GREATEST_STEP, LEAST_STEP, MARGIN, next_step, partner, shares
from asperity.adaptive.loading import loading_force, scaled, shifted
from asperity.curve import Curve


def rows(factor: float, error: float) -> Curve:
    at = np.array([0.002, 0.004, 0.006])
    return Curve.from_rows([
        {"delta": d, "delta_star": d, "force": factor * d, "P_star": factor * d, "area_fraction": 0.01,
         "error_area_fraction": error}
        for d in at
    ])  # fmt: skip


def omission(force: float = 0.0, singular: float = 0.0) -> Omission:
    return Omission(rows(1.0, 0.0).delta_star, np.full(3, force), np.zeros(3), *2 * [np.full(3, singular)])


def corrected(fine: PressedMesh, coarse: PressedMesh, flows: bool = False) -> tuple[Curve, Budget]:
    return correct(Pair(fine, coarse, np.ones(3, dtype=bool), 0.0, flows), fine.curve, np.zeros(3), 0.0)


@pytest.mark.parametrize(("flows", "part"), [(False, SCATTER), (True, FLOWING)])
def test_few_elements_in_the_spots_have_a_wider_bar(flows: bool, part: float) -> None:
    """Two meshes that agree by chance: what the edges of their contact leave open is the bar."""
    fine, coarse = (PressedMesh(scale, 1, rows(1.0, 0.002 * scale), omission()) for scale in (1.0, 2.0))
    _, budget = corrected(fine, coarse, flows)
    weight, _ = shares(2.0)
    both = np.hypot((1.0 + weight) * 0.2, weight * 0.4)  # the limit is that of the fine one and of their change
    assert budget.mesh / fine.curve.P_star == pytest.approx(part * both)


@pytest.mark.parametrize("excess", [1.3, 1.6, 2.6, 5.0])
@pytest.mark.parametrize(("order", "singular", "left"), [(2.0, 0.0, 0.0), (2.0, 0.0, 0.1), (1.0, 1.0, 0.02)])
def test_the_next_mesh_has_the_bar_that_is_planned(excess: float, order: float, singular: float, left: float) -> None:
    """With elements too stiff, facets cut at random and waves left out, whose errors have the usual orders."""

    def mesh(scale: float) -> PressedMesh:
        curve = rows(np.exp(0.02 * scale**order), 0.0004 * scale**1.5)
        return PressedMesh(scale, 1, curve, omission(left * scale**order, singular))

    def bar(scales: list[float]) -> float:
        curve, budget = corrected(mesh(scales[-1]), mesh(scales[partner(scales)]))
        return float(np.max(budget.total / curve.P_star))

    scales, every = [2.0, 1.0], np.ones(3, dtype=bool)
    pair, wanted = Pair(mesh(1.0), mesh(2.0), every), bar(scales) / excess
    expected = pair.expected([mesh(2.0), mesh(1.0)])
    finer = next_step(lambda by: float(np.max(expected(by))), wanted)
    found = bar([*scales, 1.0 / finer])
    close = 0.85 < found / (MARGIN * wanted) < 1.05
    assert close or (found < MARGIN * wanted and finer < 1.01 * LEAST_STEP) or finer == GREATEST_STEP


@pytest.mark.parametrize("true", [0.0, 0.5, 1.0])
def test_the_bar_holds_whatever_part_of_what_the_tops_leave_out_is_true(true: float) -> None:
    """Meshes too stiff by 20 and 5 %, whose tops leave out up to 25 and 2 %: with all of it both look alike."""
    at, meshes = rows(1.0, 0.0).delta_star, []
    for scale, stiff, left in ((2.0, 1.2, 0.25), (1.0, 1.05, 0.02)):
        curve = without_omission(rows(stiff / (1.0 + true * left), 0.0), omission(left), 0.0)
        meshes.append(PressedMesh(scale, 1, curve, omission(left)))
    found, budget = corrected(meshes[1], meshes[0])
    error = np.abs(found.P_star / at - 1.0)
    assert np.all(error < budget.total / at) and np.all(error < 0.035) and np.all(budget.total / at < 0.06)
    assert np.all(budget.roughness > 0.0)


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


def test_after_the_loading_a_gap_is_moved_and_an_area_multiplied_as_at_its_end() -> None:
    values, by = np.array([1.0, 2.0, 3.0, 2.5, 2.2, 1.0]), np.array([1.0, 1.2, 1.3, 1.3, 1.3, 1.3])
    curve = replace(power(2.0, ("load", "unload"), error_P_star=0.0), mean_gap=values, area_fraction=values)
    limits = (by * values)[:3], np.full(3, 0.001)
    gap, area = (with_measure(curve, name, *limits) for name in ("mean_gap", "area_fraction"))
    np.testing.assert_allclose(gap.mean_gap[2:], values[2:] + 0.3 * values[2])
    np.testing.assert_allclose(area.area_fraction, by * values)
    np.testing.assert_allclose([gap.error_mean_gap[:3], area.error_area_fraction[:3]], 0.001)


def test_on_unloading_the_bar_of_a_measure_holds_that_of_the_force() -> None:
    """The force keeps its bar while it vanishes: where it is as small as its bar, nothing is known of the stiffness.

    The gap does not vanish with the contact: its bar stays that of the force times its slope.
    """
    P = np.array([1.0, 2.0, 3.0, 2.0, 1.0, 0.05, 0.0])
    rows = [
        {"delta": d, "delta_star": d, "force": p, "P_star": p, "branch": "load" if k < 3 else "unload"}
        for k, (d, p) in enumerate(zip([1.0, 2.0, 3.0, 2.5, 2.2, 2.1, 2.0], P, strict=True))
    ]
    stiffness = P ** (1.0 / 3.0)
    found = shifted(Curve.from_rows(rows), np.full(7, 0.1), stiffness)
    assert np.all(found[:3] == 0.0) and found[5] == pytest.approx(stiffness[5])
    part = found[3:6] / stiffness[3:6]
    assert np.all(np.diff(part) > 0.0) and part[0] == pytest.approx(0.1 / 3.0 / 2.0, rel=0.35)
    gap = shifted(Curve.from_rows(rows), np.full(7, 0.1), 5.0 - P, vanishes=False)
    np.testing.assert_allclose(gap[3:], 0.1)


def test_one_step_and_steps_without_force() -> None:
    one = Curve.from_rows([{"delta": 0.1, "force": 1.0, "delta_star": 0.1, "P_star": 2.0}])
    assert loading_force(one, np.array([0.1, 0.4])) == pytest.approx([2.0, 16.0])
    rows = [{"delta": d, "force": f, "delta_star": d, "P_star": f} for d, f in ((0.1, 0.0), (0.2, 0.2), (0.3, 0.3))]
    assert loading_force(Curve.from_rows(rows), np.array([0.25])) == pytest.approx([0.25])
    assert loading_force(Curve.from_rows(rows), np.array([0.05, 0.6])) == pytest.approx([0.025, 0.6])
    assert np.isnan(loading_force(Curve.from_rows(rows[:1]), np.array([0.1])))


def test_no_more_flows_than_at_a_step_before() -> None:
    """A contact that nearly fills the patch: near the last channel the bar of the area says nothing of the flow."""

    def pressed(scale: float) -> PressedMesh:
        curve, area = rows(1.0, 0.0), np.array([0.6, 0.9, 0.9001])
        curve = replace(curve, area_fraction=area, error_area_fraction=0.02 * area, edge_fraction=0.1 * area)
        curve = replace(curve, transmissivity_x=np.array([1e-9, 1e-12, 0.0]))
        return PressedMesh(scale, 1, curve, omission())

    curve, _ = corrected(pressed(1.0), pressed(2.0))
    value, bar = curve.transmissivity_x, curve.error_transmissivity_x
    assert value[2] == 0.0 < bar[2] and np.all(bar[1:] <= (value + bar)[:-1])


def test_a_flow_at_one_step_alone_has_a_bar() -> None:
    """The meshes close between the first steps: no law of the flow over the force is known."""

    def pressed(scale: float, flow: list[float]) -> PressedMesh:
        return PressedMesh(scale, 1, replace(rows(1.0, 0.0), transmissivity_x=np.array(flow)), omission())

    curve, _ = corrected(pressed(1.0, [2e-12, 0.0, 0.0]), pressed(2.0, [5e-12, 1e-12, 0.0]))
    assert curve.transmissivity_x == pytest.approx([2e-12, 0.0, 0.0])
    assert curve.error_transmissivity_x == pytest.approx([5e-12, 5e-12, 1e-12])
