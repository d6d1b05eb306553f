"""The limit of two meshes and its bar against errors that are known, and the mesh that follows."""

from __future__ import annotations

import numpy as np
import pytest

from asperity.adaptive.guide import planned_steps
from asperity.adaptive.limits import (
    LEAST_RATIO,
    MESH_ORDERS,
    limit_of_area,
    limit_of_meshes,
    partner,
    shares,
    steady,
)
from asperity.curve.curve import EDGE


@pytest.mark.parametrize(
    ("order", "singular"), [*((p, 0.0) for p in (*MESH_ORDERS, 2.0)), *((p, 1.0) for p in (1.0, 1.5, 2.4))]
)
@pytest.mark.parametrize("ratio", [1.8, 2.5, 4.0])
def test_the_bar_holds_for_every_order_in_its_range(order: float, singular: float, ratio: float) -> None:
    """Where the pressure is singular from the first order on, by a bar more than twice as wide."""
    exact = np.array([1.0, 3.0, 4.0])
    for error in (0.4, -0.2):
        coarse, fine = (exact * np.exp(error * h**order) for h in (1.0, 1.0 / ratio))
        factor, bar = limit_of_meshes(coarse, fine, ratio, np.full(3, singular))
        assert np.all(np.abs(np.log(fine * factor / exact)) <= bar * (1.0 + 1e-9))
        weight, share = shares(ratio, singular)
        np.testing.assert_allclose(factor, np.exp(-weight * np.log(coarse / fine)))
        np.testing.assert_allclose(bar, share * np.abs(np.log(coarse / fine)))
    assert singular == 0.0 or share > 2.0 * shares(ratio)[1]


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


@pytest.mark.parametrize(("apart", "less"), [(0.0, 0.8), (1.0, 1.05)])
def test_the_place_of_the_edge_is_corrected_as_far_as_both_meshes_show_it(apart: float, less: float) -> None:
    """Parts of the crossed facets that are the same on both meshes, or not: 95 % are within the bar.

    Most of a common part is found; parts of their own do no harm.
    """
    rng, area, edges, chance = np.random.default_rng(2), 0.3, (0.2, 0.1), (0.03, 0.012)  # twice the deviations
    place, errors, inside = 0.5 * EDGE * (1.0 + area), [], []
    for _ in range(300):
        own = place * rng.standard_normal()
        parts = own + apart * place * rng.standard_normal(), own
        columns = list(zip(parts, edges, chance, strict=True))
        areas = [area * (1.0 + 0.5 * c * rng.standard_normal(9)) - part * x for part, x, c in columns]
        crossed, cut = ([np.full(9, v) for v in values] for values in (edges, chance))
        factor, bar = limit_of_area(areas, crossed, cut, np.zeros(9), np.ones(9, dtype=bool))
        errors.append([np.mean(areas[1] * by) - area for by in (1.0, factor)])
        inside.append(np.abs(areas[1] * factor - area) <= bar * areas[1])
    before, after = np.sqrt(np.mean(np.square(errors), axis=0))
    assert np.mean(inside) > 0.95 and after < less * before


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


@pytest.mark.parametrize(("steps", "solved"), [(1, 5), (2, 6), (3, 6), (4, 8), (5, 5), (12, 12)])
def test_few_planned_steps_are_divided_until_their_bars_support_each_other(steps: int, solved: int) -> None:
    """The difference of two meshes at one approach may vanish by chance, and with it the bar."""
    assert planned_steps(steps) == solved


def test_rows_that_are_not_judged_move_no_judged_one() -> None:
    fine, judged = np.full(9, 2.0), np.arange(9) > 1
    coarse = fine * np.where(judged, 1.02, 1.5)
    found, alone = (limit_of_meshes(coarse[of], fine[of], 2.0, judged=judged[of]) for of in (slice(None), judged))
    for with_others, without in zip(found, alone, strict=True):
        np.testing.assert_allclose(with_others[judged], without)
