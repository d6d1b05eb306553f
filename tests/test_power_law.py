"""Power-law fit and its confidence intervals."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.optimize import curve_fit
from scipy.stats import t as student

from asperity.curve import Curve
from asperity.curve.power_law import fit_power_law, interface_approach
from asperity.errors import InputError


@pytest.mark.parametrize(("k", "n"), [(2.0, 1.5), (1e6, 3.2), (1e-4, 0.8)])
def test_fit_recovers_an_exact_law(k, n):
    d = np.linspace(0.001, 0.03, 12)
    fit = fit_power_law(d, k * d**n)
    assert (fit.k, fit.n) == (pytest.approx(k, rel=1e-10), pytest.approx(n, rel=1e-10))
    assert fit.r2 == pytest.approx(1.0, abs=1e-14)
    assert fit.ci_n[0] <= fit.n <= fit.ci_n[1] and fit.ci_n[1] - fit.ci_n[0] < 1e-9
    assert fit.points == 12 and fit.range == (0.001, 0.03)
    np.testing.assert_allclose(fit([-1.0, 0.0, 0.01]), [0, 0, k * 0.01**n])


def bent_law() -> tuple[np.ndarray, np.ndarray]:
    """Return a curve that is not a power law: cubic at first, then stiff and straight."""
    d = np.linspace(0.002, 0.04, 25)
    return d, d**3 / (0.01 + d) ** 2 * (1 + 0.02 * np.sin(900 * d))


def test_linear_fit_against_curve_fit():
    d, p = bent_law()
    fit = fit_power_law(d, p)
    (k, n), covariance = curve_fit(lambda d, k, n: k * d**n, d, p, p0=(1.0, 1.5), ftol=1e-14, xtol=1e-14)
    assert (fit.k, fit.n) == pytest.approx((k, n), rel=1e-6)
    half = student.ppf(0.975, 23) * math.sqrt(covariance[1, 1])
    assert fit.ci_n == pytest.approx((n - half, n + half), rel=1e-4)
    relative = student.ppf(0.975, 23) * math.sqrt(covariance[0, 0]) / k  # delta method
    assert math.log(fit.ci_k[1] / fit.k) == pytest.approx(relative, rel=1e-3)
    residual = p - k * d**n
    assert fit.r2 == pytest.approx(1 - residual @ residual / np.sum((p - p.mean()) ** 2))


def test_intervals_cover_the_true_values_at_their_confidence():
    rng, hits = np.random.default_rng(0), 0
    d = np.linspace(0.002, 0.02, 8)
    for _ in range(400):
        fit = fit_power_law(d, 3.0 * d**1.5 + rng.normal(0, 1e-5, d.size))
        hits += fit.ci_n[0] <= 1.5 <= fit.ci_n[1]
    assert 0.92 < hits / 400 < 0.98


def test_fit_of_a_curve_takes_its_loading_branch():
    rows = [{"delta": d, "force": d**2, "branch": "load"} for d in (0.0, 0.01, 0.02, 0.03, 0.04)]
    rows += [{"delta": d, "force": 0.5 * d**3, "branch": "unload"} for d in (0.03, 0.02)]
    fit = Curve.from_rows([row | {"delta_star": row["delta"], "P_star": row["force"]} for row in rows]).fit()
    assert (fit.n, fit.points) == (pytest.approx(2.0), 4)
    assert set(fit.to_dict()) == {"k", "n", "range", "points", "r2", "ci"}


def test_stiffness_has_units():
    d = np.linspace(0.01, 0.05, 5)
    fit = fit_power_law(d, 2.0 * d**1.5)
    L, E_prime, delta = 1e-6, 2e11, 2e-8
    force = float(fit(delta / L)) * L**2 * E_prime
    assert fit.stiffness(E_prime, L) * delta**1.5 == pytest.approx(force)


@pytest.mark.parametrize(
    ("d", "p", "message"),
    [
        ([1, 1, 1, 2], [1, 1, 1, 2], "2 different approaches: a power law needs at least 3"),
        ([0, 1, 2], [0, 1, 2], r"delta\* = 0 at point 0"),
        ([1, 2, 3], [1, -2, 3], r"P\* = -2 at point 1"),
        ([1, 2, 3], [1, 2, math.nan], r"P\* = nan at point 2"),
        ([1, 2, 3], [1, 2], "two lists of equal length"),
        ([1e-300, 2e-300, 3e-300], [1, 8, 27], r"n = 3 and ln k = 2072.*beyond floating-point range"),
    ],
)
def test_impossible_fits_are_refused(d, p, message):
    with pytest.raises(InputError, match=message):
        fit_power_law(d, p)


def test_an_interval_without_an_upper_end_is_infinite() -> None:
    """Three points that scatter by hundreds of orders of magnitude."""
    fit = fit_power_law([0.99, 1.0, 1.01], [1e-200, 1.0, 1e-200])
    assert np.isfinite(fit.k) and fit.ci_k[1] == np.inf and fit.ci_k[0] < fit.k


def test_interface_approach_of_a_flat_block_is_zero():
    strain, M, L, height = np.array([0.001, 0.01]), 3.0, 2.0, 0.5
    force = M * strain * L**2
    rest = interface_approach(strain * height, force, height=height, area=L**2, modulus=M)
    np.testing.assert_allclose(rest, 0, atol=4 * np.finfo(float).eps * height * strain[1])
