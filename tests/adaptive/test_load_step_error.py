"""Bars of the load steps against sequences whose limit is known."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from conftest import PLASTIC

import asperity as asp
from asperity.adaptive.load_step_error import STICK, LoadStepError, choose_substeps, step_errors
from asperity.adaptive.loading import loading_force
from asperity.curve import Curve
from asperity.model.load_path import BACKWARD_EULER, MIDPOINT


def ridges() -> asp.Surface:
    """A fractal of two wavelengths, whose contact spreads in jumps."""
    return asp.Surface.from_spec(kind="weierstrass-mandelbrot", L=1.0, D=2.4, G=1.36e-5, f_max=1)


LIMIT = np.array([0.1, 0.3, 0.6, 1.0, 1.5])


def left_over_bar(forces: dict[int, np.ndarray], rule: str, measured: bool = False) -> float:
    """Greatest error of the corrected forces over their bar."""
    errors, bars = step_errors(forces, rule, measured)
    return max(float(np.max(np.abs(P / (1.0 + errors[n]) / LIMIT - 1.0) / bars[n])) for n, P in forces.items())


@pytest.mark.parametrize(
    ("rule", "order"),
    [(MIDPOINT, p) for p in (1.7, 2.0, 2.3)]
    + [(BACKWARD_EULER, p) for p in (0.7, 1.0, 1.5)]
    + [(STICK, p) for p in (0.5, 1.0, 2.0)],
)
@pytest.mark.parametrize("most", [2, 4])
def test_the_bar_holds_for_the_orders_of_the_rule(rule: str, order: float, most: int) -> None:
    error = 0.01 * np.array([1.0, 0.8, -0.3, 0.5, 0.4])
    forces = {n: LIMIT * (1.0 + error / n**order) for n in (1, 2, 4) if n <= most}
    assert left_over_bar(forces, rule) < 1.05


@pytest.mark.parametrize("rule", [MIDPOINT, BACKWARD_EULER])
@pytest.mark.parametrize("order", [0.5, 0.7, 1.0, 1.5, 2.0, 2.5])
def test_the_bar_holds_for_the_order_that_three_runs_measure(rule: str, order: float) -> None:
    """Whatever the rule is said to have; without the third run it does not."""
    error = 0.01 * np.array([1.0, 0.8, 0.9, 0.5, 0.4])
    forces = {n: LIMIT * (1.0 - error / n**order) for n in (1, 2, 4)}
    assert left_over_bar(forces, rule, measured=True) < 1.02
    assert order > 0.5 or left_over_bar(forces, rule) > 1.2


def test_a_curve_is_corrected_for_its_own_parts_and_after_the_loading_as_at_its_end() -> None:
    at, errors = np.array([1.0, 2.0, 4.0]), {1: np.array([0.04, 0.02, 0.01]), 2: np.zeros(3)}
    path = LoadStepError(2, at, errors, errors)
    delta, names = np.array([1.0, 3.0, 4.0, 3.0]), ["load", "load", "load", "unload"]
    rows = [
        {"delta": d, "delta_star": d, "force": f, "P_star": f, "branch": name}
        for d, f, name in zip(delta, [1.04, 1.015, 1.01, 0.505], names, strict=True)
    ]
    curve = Curve.from_rows(rows)
    np.testing.assert_allclose(path.removed(curve, 1).P_star, [1.0, 1.0, 1.0, 0.5])
    np.testing.assert_allclose(path.removed(curve, 2).force, curve.force)
    np.testing.assert_allclose(LoadStepError().removed(curve, 1).force, curve.force)
    np.testing.assert_allclose(path.left(delta, 1), [0.04, 0.015, 0.01, 0.015])


def test_runs_that_agree_by_chance_or_differ_more_and_more_have_a_bar() -> None:
    """Errors a/n - b/n^2 whose second and third runs agree; backward Euler before its order is seen, as of J2."""
    agree = {n: LIMIT * (1.0 - 0.02 / n + 0.026667 / n**2) for n in (1, 2, 4)}
    assert abs(agree[2][0] / agree[4][0] - 1.0) < 1e-5
    assert left_over_bar(agree, BACKWARD_EULER, measured=True) < 1.02 < left_over_bar(agree, BACKWARD_EULER)
    #: per cent, of a sphere and a rough surface in 5, 10 and 20 steps, against 80
    late = {1: [-4.51, -6.81, -7.03, -5.72, -4.30], 2: [-3.69, -3.99, -3.55, -2.59, -1.59],
            4: [-1.55, -1.70, -1.28, -1.20, -0.43]}  # fmt: skip
    forces = {n: LIMIT * (1.0 + 0.01 * np.array(values)) for n, values in late.items()}
    assert left_over_bar(forces, BACKWARD_EULER, measured=True) < 1.0
    assert left_over_bar({n: forces[n] for n in (1, 2)}, BACKWARD_EULER) > 1.2


def test_the_bar_of_stick_holds_where_the_correction_has_the_wrong_sign() -> None:
    """As on an egg-box: the second force is farther from the limit than the first."""
    forces = {1: LIMIT * (1.0 - 0.0007), 2: LIMIT * (1.0 - 0.0023)}
    assert left_over_bar(forces, STICK) < 1.0


@pytest.mark.parametrize(
    ("tolerance", "order", "parts", "most"),
    [
        (0.1, 2, 1, 2),
        (0.0134, 2, 1, 2),
        (0.01, 2, 2, 2),
        (1e-3, 2, 4, 4),
        (6e-4, 2, 8, 8),
        (2e-5, 2, 32, 32),
        (1e-6, 2, 2, 2),
        (1e-3, 0, 1, 4),
    ],
)
def test_load_steps_are_divided_until_their_bar_is_within_the_tolerance(
    tolerance: float, order: int, parts: int, most: int
) -> None:
    """Bars of 1.2 % of undivided steps. More than 32 parts, and runs that differ by chance, of order 0, are given up.

    Of the latter those of 1 and 4 parts agree: no more parts are taken for nothing.
    """
    solved = []

    def press(substeps: int = 1) -> Any:
        solved.append(substeps)
        error = 0.024 / substeps**2 if order else 0.01 * (-1.0) ** len(solved)
        rows = [{"delta": d, "delta_star": d, "force": d, "P_star": (1.0 + error) * d} for d in (0.01, 0.02)]
        return SimpleNamespace(curve=Curve.from_rows(rows))

    flat = asp.Surface.from_spec("flat", L=1.0)
    run: Any = SimpleNamespace(problem=asp.Problem.of(flat, PLASTIC, delta_max=0.02, steps=2), press=press)
    _, found = choose_substeps(run, tolerance)
    assert found.substeps == parts and solved == [2**k for k in range(most.bit_length())]


def test_load_steps_have_second_order_by_the_midpoint_rule_and_both_rules_one_limit() -> None:
    at = 0.04 * np.array([0.2, 0.4, 0.6, 0.8, 1.0])

    def force(rule: str, substeps: int) -> np.ndarray:
        result = asp.solve_contact(
            ridges(), PLASTIC, delta_max=0.04, steps=5, substeps=substeps, integrator=rule, size=asp.MeshSize(0.25)
        )
        return loading_force(result.curve, at)

    def size(error: np.ndarray) -> float:
        return float(np.sqrt(np.mean(error**2)))

    whole, half, quarter = (force("midpoint", n) for n in (1, 2, 4))
    limit = quarter + (quarter - half) / 3.0
    assert size(half / limit - 1.0) < 0.4 * size(whole / limit - 1.0)
    same, euler, finest = (force("backward-euler", n) for n in (4, 8, 16))
    other = 2.0 * finest - euler
    assert other == pytest.approx(limit, rel=2e-3)
    assert np.abs(quarter / limit - 1.0).max() < 0.25 * np.abs(same / limit - 1.0).max()
    assert size(whole / limit - 1.0) < size(euler / limit - 1.0)
