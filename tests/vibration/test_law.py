"""Static laws: closed forms, derivatives against differences and integrals, continuations, sides, bars that hold."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from operator import methodcaller
from typing import Any

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.optimize import brentq

from asperity.errors import RangeError
from asperity.vibration import ContactOscillator, CurveLaw, Equation, Law, PowerLaw, TaylorLaw
from asperity.vibration.curve_law import Bars
from asperity.vibration.law import bar_of
from asperity.vibration.oscillator import Numbers

Z = np.linspace(0.0, 1.0, 61)[1:]
MIXED = CurveLaw(Z, Z**1.5 + 0.3 * Z**2)


class Cubic(Law):
    """x + x^3 of x = z/size, with force and slope only."""

    def __init__(self, size: float) -> None:
        self.size = size

    def force(self, z: Any) -> Any:
        x = np.maximum(z, 0.0) / self.size
        return x + x**3

    def slope(self, z: Any) -> Any:
        return (1.0 + 3.0 * (np.maximum(z, 0.0) / self.size) ** 2) / self.size


# --- closed forms ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize("n", [0.6, 1.0, 1.5, 3.7])
def test_a_power_law_and_points_of_it_have_the_closed_forms(n: float) -> None:
    load, z = 2.5, np.linspace(1e-4, 1.0, 200)
    for law, near in ((PowerLaw(n, 3.0), 1e-14), (CurveLaw(Z, 3.0 * Z**n), 1e-8)):
        r = Equation(law, load)
        assert r.z_s == pytest.approx((load / 3.0) ** (1 / n), rel=near)
        assert r.n_loc == pytest.approx(n, rel=near) and r.a2 == pytest.approx((n - 1) / 2, abs=10 * near)
        assert r.kappa == pytest.approx(-(n - 1) * (2 * n + 1) / 48, abs=10 * near)
        assert r.f(-3.0) == pytest.approx(-1 / n, rel=near) and law.force(-0.1) == 0.0
        np.testing.assert_allclose(law.force(z), 3.0 * z**n, rtol=1e-11)
        np.testing.assert_allclose(law.slope(z), 3.0 * n * z ** (n - 1), rtol=1e-10)
        np.testing.assert_allclose(law.potential(z), 3.0 * z ** (n + 1) / (n + 1), rtol=1e-10)


def test_beyond_its_last_point_a_law_is_a_power_for_motion_only() -> None:
    law = CurveLaw(Z, Z**1.5)
    assert law.force(1.2) == pytest.approx(1.2**1.5, rel=1e-9)
    with pytest.raises(RangeError, match="load = 2 lies outside the law, which ends at force 1"):
        ContactOscillator(law, load=2.0)
    power = ContactOscillator(PowerLaw(1.5), load=0.5)
    np.testing.assert_allclose(ContactOscillator(law).free([0.9]).omega_ratio, power.free([0.9]).omega_ratio, rtol=1e-9)


@pytest.mark.parametrize("law", [PowerLaw(1.5), PowerLaw(0.8, 2.0), TaylorLaw.about(PowerLaw(1.5), 0.4), MIXED])
def test_force_is_the_derivative_of_the_potential_and_slope_that_of_the_force(law: Law) -> None:
    r = Equation(law, 0.4)
    for u in (-0.8, -0.3, -1e-3, 1e-5, 0.04, 0.06, 0.5):
        z = r.z_s * (1.0 + u)
        value, _ = quad(lambda z: law.force(z), r.z_s, z, epsabs=1e-13, epsrel=1e-13, limit=400)
        assert float(law.potential(z) - law.potential(r.z_s)) == pytest.approx(value, rel=1e-8, abs=1e-15)
        slope = (r.f(u + 1e-6) - r.f(u - 1e-6)) / 2e-6
        assert float(law.slope(z)) * r.z_s / r.scale == pytest.approx(float(slope), rel=1e-6)


@pytest.mark.parametrize(("n", "rim"), [(1.2, -4.529), (1.5, -2.7446), (2.0, -2.0), (2.4, -1.9202)])
def test_taylor_rim(n: float, rim: float) -> None:
    assert TaylorLaw.about(PowerLaw(n), 1.0).rims()[0] == pytest.approx(rim, abs=5e-4)


@pytest.mark.parametrize("size", [1e-9, 1.0, 1e5])
def test_an_own_law_needs_force_and_slope_only(size: float) -> None:
    """Deflection, derivatives and energy in closed form, for any size of the approach."""
    law = Cubic(size)
    for x in (1e-3, 0.7, 20.0):
        z = x * size
        assert law.deflection(x + x**3) == pytest.approx(z, rel=1e-13)
        exact = (1.0 + 3.0 * x**2) / size, 6.0 * x / size**2, 6.0 / size**3
        assert law.derivatives(z) == pytest.approx(exact, rel=1e-7 + 1e-11 / x**2)
        assert float(law.potential(z)) == pytest.approx(size * (x**2 / 2 + x**4 / 4), rel=1e-13)


def test_small_motion_does_not_feel_a_kink_above_the_preload_and_softens_with_a_light_one() -> None:
    """F = z, three times as steep beyond 1.025: small motion about F = 1 is linear."""
    z = np.linspace(0.0, 2.0, 601)[1:]
    r = ContactOscillator(CurveLaw(z, np.where(z < 1.025, z, 1.025 + 3.0 * (z - 1.025))), load=1.0)
    assert r.scale / r.z_s == pytest.approx(1.0, rel=1e-12) and abs(r.kappa) < 1e-4
    law = CurveLaw(z[30::30], z[30::30] ** 1.5 + 0.1 * z[30::30] ** 3)
    stiffness = [law.derivatives(law.deflection(load))[0] for load in np.geomspace(1e-9, float(law.F[0]), 9)]
    assert np.all(np.diff(stiffness) > 0)


@pytest.mark.parametrize(
    ("force", "load", "kappa", "softening"),
    [
        (lambda z: z**1.5, 0.4, -1 / 24, "softening"),
        (np.expm1, float(np.expm1(1.0)), -2 / 48, "softening"),  # z^2/48 (3 - 5) at z = 1
        (lambda z: (5 * z - 3 * z**2 + z**3) / 3, 1.0, 0.1875, "hardening"),  # at z = 1: 2/3, 0 and 2
        (lambda z: z, 0.7, 0.0, "linear"),
    ],
)
def test_exact_points_decide(force: Callable[[Any], Any], load: float, kappa: float, softening: str) -> None:
    z = np.linspace(0.0, 2.2, 201)[1:]
    found = Numbers.of(CurveLaw(z, force(z)).about(load), load, 1.0, 0.01)
    assert found.softening in (softening, "curvature not resolved" if softening == "linear" else softening)
    assert found.kappa == pytest.approx(kappa, abs=max(1e-6, min(2e-3, found.bars[2])))


# --- sides and bars -------------------------------------------------------------------------------------------


def test_the_sides_have_the_bars_of_their_law() -> None:
    """A pair for each error: the load keeps its stiffness, or its kappa, but for the bar; each side is a law itself."""
    law = replace(CurveLaw(Z, Z**1.5), bars=Bars(0.4, 0.02, 0.01, 0.05, 0.03))
    pairs = law.sides()
    level, contact, tilt, bent = (np.array([side.at_load(0.4) for side in pair]) for pair in pairs)
    z, k, n, kappa = law.at_load(0.4)
    np.testing.assert_allclose(tilt[:, 1] / k - 1.0, [-0.05, 0.05], rtol=1e-9)
    np.testing.assert_allclose(tilt[:, 3], [-(n - 1) * (2 * n + 1) / 48 for n in (1.5 * 0.95, 1.5 * 1.05)], rtol=1e-6)
    np.testing.assert_allclose(bent[:, 3] - kappa, [-0.03, 0.03], rtol=1e-4)
    np.testing.assert_allclose(contact[:, 0] - z, [-0.01, 0.01], rtol=1e-9)
    np.testing.assert_allclose(level[:, 0] / z, [0.98 ** (-1 / 1.5), 1.02 ** (-1 / 1.5)], rtol=1e-6)
    total = bar_of(law, lambda side: side.at_load(0.4))
    changes = [np.abs(pair - [z, k, n, kappa]).max(axis=0) for pair in (level, contact, tilt, bent)]
    np.testing.assert_allclose(total, np.sqrt(np.sum(np.square(changes), axis=0)))
    assert np.isnan(bar_of(PowerLaw(1.5), lambda side: side.at_load(0.4))).all()
    tilt, bent = replace(law, bars=Bars(0.4, stiffness=50.0, kappa=5.0)).sides()  # of what is hardly known
    assert tilt[1].at_load(0.4)[1] > 9.0 * k
    assert [side.at_load(0.4)[3] - kappa for side in bent] == pytest.approx([-5.0, 5.0])
    fine = np.linspace(0.05, 0.99, 400)
    for side in (side for pair in pairs for side in pair):
        assert np.all(np.diff(side.force(fine)) > 0.0)
        at, h = side.deflection(0.4), 2e-3
        third = np.array([-1, 2, 0, -2, 1]) @ side.force(at + h * np.arange(-2, 3)) / (2 * h**3)
        assert side.derivatives(at)[2] == pytest.approx(third, abs=0.5)


def test_scatter_leaves_the_curvature_open() -> None:
    z = np.geomspace(0.05, 1.0, 6)
    law = CurveLaw(z, z**1.5 * (1 + 0.03 * np.array([0, 1, -1, 1, -1, 0]))).about(0.4)
    found = Numbers.of(law, 0.4, 1.0, 0.01)
    assert found.softening == "curvature not resolved" and "kappa" not in found.sentence("SI")


Curve = tuple[Callable[[float], float], np.ndarray]


def smooth(rng: np.random.Generator) -> Curve:
    n, c, rows = rng.uniform(1, 3), rng.uniform(0.2, 2), int(rng.integers(8, 61))
    curves: list[Callable[[float], float]] = [
        lambda z: z**n + c * z ** (n + 1), lambda z: np.expm1(3 * c * z), lambda z: z**n / (1 + c * z),
        lambda z: z**n * np.exp(0.5 * c * z * (1 - z)),
    ]  # fmt: skip
    even = np.linspace(0, 1, rows + 1)[1:]
    return curves[rng.integers(4)], even if rng.random() < 0.6 else np.sort(rng.uniform(0.01, 1, rows))


def dense(rng: np.random.Generator) -> Curve:
    return smooth(rng)[0], np.linspace(0, 1, rng.integers(101, 201))[1:]


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


def exact(f: Callable[[float], float], z: float, h: float = 1e-3) -> np.ndarray:
    """z, stiffness, n and kappa by differences of ln F over ln z."""
    ln = [float(np.log(f(z * np.exp(k * h)))) for k in range(-2, 3)]
    a, b = (ln[3] - ln[1]) / (2 * h), (ln[3] - 2 * ln[2] + ln[1]) / h**2
    c = (ln[4] - 2 * ln[3] + 2 * ln[1] - ln[0]) / (2 * h**3)
    second, third = (a * a - a + b) / a, (a**3 - 3 * a * a + 2 * a + 3 * b * (a - 1) + c) / a
    return np.array([z, a * f(z) / z, a, (3 * third - 5 * second**2) / 48])


@pytest.mark.slow
@pytest.mark.parametrize(("curve", "least"), [(smooth, 0.9), (apart, 0.9), (summits, 0.8), (dense, 0.9)])
def test_the_bars_of_computed_points_hold(curve: Callable[[np.random.Generator], Curve], least: float) -> None:
    """Of n, kappa and stiffness, for 90 % of curves; less where summits touch between the points."""
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
        found, bars = law.at_load(load), bar_of(law, methodcaller("at_load", load))
        inside.append((np.abs(found - values) <= bars)[1:])
        size.append(bars[1] / found[1])
        assert found[0] == pytest.approx(values[0], rel=0.05)
    assert np.all(np.mean(inside, axis=0) >= least), np.mean(inside, axis=0)
    assert np.median(size) < 0.05
