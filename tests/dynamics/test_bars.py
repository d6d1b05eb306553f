"""Error bars of exponent, curvature, deflection and stiffness against the exact curve behind the points of a table."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress

import numpy as np
import pytest
from scipy.optimize import brentq

from asperity.dynamics import TableLaw
from asperity.errors import InputError
from asperity.force_law.intervals import intervals

Curve = tuple[Callable[[float], float], np.ndarray]


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


@pytest.mark.parametrize("curve", [smooth, apart, summits])
def test_the_bars_hold(curve: Callable[[np.random.Generator], Curve]) -> None:
    """For 95 % of 200 curves, though points show no summit that has just been touched."""
    inside = []
    for seed in range(200):
        rng = np.random.default_rng(7000 + seed)
        f, z = curve(rng)
        law = TableLaw(z, np.array([f(x) for x in z]))
        load = law.top * rng.uniform(0.05, 0.95)
        if load < law.F[0]:
            continue
        known = intervals(law, load)
        values = exact(f, brentq(lambda x, f=f, load=load: f(x) - load, 1e-9, 1.0))
        bars = (known.n_loc, known.kappa, known.z_s, known.k_n)
        inside.append([b.low - 1e-9 * abs(v) <= v <= b.high + 1e-9 * abs(v) for b, v in zip(bars, values, strict=True)])
    assert np.all(np.mean(inside, axis=0) >= 0.95), np.mean(inside, axis=0)


def test_the_bars_hold_for_points_that_scatter() -> None:
    """By 1 to 4 % of the force, through which the law is a smoothing spline: for 90 % of the curves."""
    inside = []
    for seed in range(150):
        rng = np.random.default_rng(9000 + seed)
        f, z = (smooth, apart, summits)[seed % 3](rng)
        share = rng.uniform(0.1, 0.9)
        noise = 1.0 + rng.uniform(0.01, 0.04) * rng.standard_normal(z.size)
        with suppress(InputError):  # points that fall
            law = TableLaw(z, np.array([f(x) for x in z]) * noise)
            if law.noise and (load := law.top * share) > law.F[0]:
                known = intervals(law, load)
                values = exact(f, brentq(lambda x, f=f, load=load: f(x) - load, 1e-9, 1.5))
                bars = (known.n_loc, known.kappa, known.z_s, known.k_n)
                inside.append([b.low <= v <= b.high for b, v in zip(bars, values, strict=True)])
    assert len(inside) > 80 and np.all(np.mean(inside, axis=0) >= 0.9), np.mean(inside, axis=0)


def test_slopes_that_are_unknown_have_the_bar_of_points_without_any() -> None:
    z = np.geomspace(0.05, 1.0, 9)
    without, unknown = (intervals(TableLaw(z, np.expm1(4.0 * z), k=k), 5.0) for k in (None, np.full(z.size, np.nan)))
    for name in ("n_loc", "z_s", "k_n"):
        assert getattr(unknown, name) == pytest.approx(getattr(without, name))
