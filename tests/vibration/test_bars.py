"""Error bars of exponent, curvature, deflection and stiffness against the exact curve behind the points of a table."""

from __future__ import annotations

from collections.abc import Callable
from operator import methodcaller

import numpy as np
import pytest
from scipy.optimize import brentq

from asperity.vibration.curve_law import CurveLaw
from asperity.vibration.law import bar_of
from asperity.vibration.numbers import Numbers

Curve = tuple[Callable[[float], float], np.ndarray]
Maker = Callable[[np.random.Generator], Curve]


def smooth(rng: np.random.Generator) -> Curve:
    n, c, rows = rng.uniform(1, 3), rng.uniform(0.2, 2), int(rng.integers(8, 61))
    curves: list[Callable[[float], float]] = [
        lambda z: z**n + c * z ** (n + 1), lambda z: np.expm1(3 * c * z), lambda z: z**n / (1 + c * z),
        lambda z: z**n * np.exp(0.5 * c * z * (1 - z)),
    ]  # fmt: skip
    even = np.linspace(0, 1, rows + 1)[1:]
    return curves[rng.integers(4)], even if rng.random() < 0.6 else np.sort(rng.uniform(0.01, 1, rows))


def apart(rng: np.random.Generator) -> Curve:
    """Softening, stiffening and wavy curves at points of random distances."""
    c, w, p = rng.uniform(0.5, 5), rng.uniform(2, 8), rng.uniform(0, 2 * np.pi)
    curves: list[Callable[[float], float]] = [
        lambda z: np.log1p(c * z), lambda z: np.expm1((4 + 2 * c) * z), lambda z: (z + 0.05) ** 1.5 - 0.05**1.5,
        lambda z: z + 0.35 * (np.cos(p) - np.cos(w * z + p)) / w,
    ]  # fmt: skip
    return curves[rng.integers(4)], np.append(np.sort(rng.uniform(0.02, 1, rng.integers(7, 40))), 1.0)


def summits(rng: np.random.Generator) -> Curve:
    """5 to 60 summits after Hertz, that touch in turn."""
    count = int(rng.integers(5, 61))
    height = np.append(0.0, rng.beta(2, 2, count - 1) * rng.uniform(0.3, 0.95))
    stiffness = rng.uniform(0.5, 1.5, count)
    return lambda z: float(stiffness @ np.maximum(z - height, 0.0) ** 1.5), np.linspace(0, 1, rng.integers(9, 42))[1:]


def exact(f: Callable[[float], float], z: float, h: float = 1e-3) -> tuple[float, float, float, float]:
    """n, kappa, z and stiffness by differences of ln F over ln z."""
    ln = [float(np.log(f(z * np.exp(k * h)))) for k in range(-2, 3)]
    a, b = (ln[3] - ln[1]) / (2 * h), (ln[3] - 2 * ln[2] + ln[1]) / h**2
    c = (ln[4] - 2 * ln[3] + 2 * ln[1] - ln[0]) / (2 * h**3)
    second, third = (a * a - a + b) / a, (a**3 - 3 * a * a + 2 * a + 3 * b * (a - 1) + c) / a
    return a, (3 * third - 5 * second**2) / 48, z, a * f(z) / z


def dense(rng: np.random.Generator) -> Curve:
    return smooth(rng)[0], np.linspace(0, 1, rng.integers(101, 201))[1:]


@pytest.mark.slow
@pytest.mark.parametrize(("curve", "least"), [(smooth, 0.9), (apart, 0.9), (summits, 0.8), (dense, 0.9)])
def test_the_bars_of_computed_points_hold(curve: Maker, least: float) -> None:
    """Of n, kappa, z and stiffness, for 90 % of curves; less where summits touch between the points."""
    inside, size = [], []
    for seed in range(40):
        rng = np.random.default_rng(7000 + seed)
        f, z = curve(rng)
        law = CurveLaw(z, np.array([f(x) for x in z]))
        load = law.F[-1] * rng.uniform(0.05, 0.95)
        if load < law.F[0]:
            continue
        law = law.about(load)
        values = exact(f, brentq(lambda x, f=f, load=load: f(x) - load, 1e-9, 1.0))
        z_s, k, n, kappa = law.at_load(load)
        bars = bar_of(law, methodcaller("at_load", load))
        inside.append(np.abs(np.array([n, kappa, k]) - np.array(values)[[0, 1, 3]]) <= bars[[2, 3, 1]])
        size.append(bars[1] / k)
        assert z_s == pytest.approx(values[2], rel=0.05)
    assert np.all(np.mean(inside, axis=0) >= least), np.mean(inside, axis=0)
    assert np.median(size) < 0.05


def test_exact_points_decide() -> None:
    """F = z - z^2/2 + z^3/6 + ... of a smooth hardening and Hertz: kappa in closed form, within a bar below it."""
    z = np.linspace(0.0, 1.0, 31)[1:]
    law = CurveLaw(z, z**1.5).about(0.4)
    assert Numbers.of(law, 0.4, 1.0, 0.01).softening == "softening"
    assert law.kappa(law.deflection(0.4)) == pytest.approx(-1 / 24, abs=1e-6)
    z = np.linspace(0.0, 2.2, 201)[1:]
    law = CurveLaw(z, (5 * z - 3 * z**2 + z**3) / 3).about(1.0)  # at z = 1: slope 2/3, no second derivative, third 2
    found = Numbers.of(law, 1.0, 1.0, 0.01)
    assert found.softening == "hardening" and found.kappa == pytest.approx(0.1875, abs=min(2e-3, found.bars[2]))


def test_what_is_not_resolved_is_not_printed_as_a_result() -> None:
    z = np.geomspace(0.05, 1.0, 6)
    law = CurveLaw(z, z**1.5 * (1 + 0.03 * np.array([0, 1, -1, 1, -1, 0]))).about(0.4)
    found = Numbers.of(law, 0.4, 1.0, 0.01)
    assert found.softening == "curvature not resolved" in found.sentence("SI") and "kappa" not in found.sentence("SI")
