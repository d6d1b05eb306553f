"""Slope of a curve: closed forms on each branch, and what it is of few or odd steps."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from asperity.curve import Curve
from asperity.curve.slope import slopes

CURVES = Path(__file__).parent / "curves"


def test_hertz() -> None:
    """2 E* a of a sphere, a^2 = R delta, at steps of any length and at their change from one branch to the next."""
    E, R = 0.55, 10.0
    delta = np.array([0.001, 0.002, 0.003, 0.01, 0.012])
    slope, change = slopes(delta, 4.0 / 3.0 * E * np.sqrt(R) * delta**1.5, ["load"] * 5)
    np.testing.assert_allclose(slope, 2.0 * E * np.sqrt(R * delta), rtol=1e-12)
    np.testing.assert_allclose(change, 0.0, atol=1e-12)


def test_branches() -> None:
    """Each has its own power law, from where it has no force; the last step of one begins the next."""
    up, left = np.linspace(0.1, 1.0, 10), 0.4  # left: after unloading
    down = np.array([0.9, 0.8, 0.6, left])
    again = np.array([0.5, 0.8, 1.0])

    def elastic(x: np.ndarray) -> np.ndarray:
        return ((x - left) / (1.0 - left)) ** 1.4

    delta, force = np.concatenate([up, down, again]), np.concatenate([up**1.2, elastic(down), elastic(again)])
    names = ["load"] * 10 + ["unload"] * 4 + ["reload"] * 3
    slope, _ = slopes(delta, force, names)
    expected = np.concatenate(
        [1.2 * up**0.2, 1.4 / (1.0 - left) * np.append(elastic(down), elastic(again)) ** (0.4 / 1.4)]
    )
    np.testing.assert_allclose(slope, expected, rtol=1e-12)
    # without the last step the force at which the unloading ends is not known
    open_ended, change = slopes(delta[:13], force[:13], names[:13])
    assert np.all(np.abs(open_ended / expected[:13] - 1.0)[10:] < 0.2) and np.isfinite(change).all()


def test_few_steps_and_odd_ones() -> None:
    nan = np.nan
    one = slopes([2.0], [4.0], ["load"])
    np.testing.assert_array_equal(one, [[nan], [nan]])
    slope, change = slopes([1.0, 4.0], [1.0, 8.0], ["load"] * 2)
    np.testing.assert_allclose(slope, [1.5, 3.0])
    np.testing.assert_allclose(change, 0.0, atol=1e-12)  # as a single contact
    late, _ = slopes([0.1, 0.2, 0.3, 0.4], [0.0, 0.0, 1.0, 2.0], ["load"] * 4)  # the mesh is touched late
    np.testing.assert_allclose(late, [0.0, 0.0, 10.0, 10.0])
    measured, _ = slopes([-0.1, 0.0, 0.2], [1.0, 2.0, 4.0], ["load"] * 3)  # counted from elsewhere
    np.testing.assert_allclose(measured, 10.0)
    assert np.isnan(slopes([1.0, 1.0, 2.0], [1.0, 1.0, 2.0], ["load"] * 3)[0]).all()
    assert slopes([], [], [])[0].size == 0


@pytest.mark.parametrize("name", ["elastic", "plastic"])
def test_slopes_lie_between_those_before_and_after(name: str) -> None:
    """Of computed curves, at every step; to one per cent, where the bend changes its sign."""
    curve = Curve.read(CURVES / f"{name}.csv")
    load = curve.loading()
    before_and_after = np.diff(np.append(0.0, load.force)) / np.diff(np.append(0.0, load.delta))
    low, high = (f(before_and_after[:-1], before_and_after[1:]) for f in (np.minimum, np.maximum))
    assert np.all((0.99 * low <= load.k_n[:-1]) & (load.k_n[:-1] <= 1.01 * high))


def test_a_curve_has_the_slopes_of_its_forces() -> None:
    rows = [{"delta": d, "force": 2.0 * d**2} for d in (1.0, 2.0, 3.0)]
    curve = Curve.from_rows(rows)
    np.testing.assert_allclose(curve.k_n, 4.0 * curve.delta)
    np.testing.assert_allclose(curve.with_force(3.0 * curve.force).k_n, 12.0 * curve.delta)
    known = Curve.from_rows([row | {"k_n": 7.0} for row in rows])
    np.testing.assert_array_equal(known.k_n, 7.0)
