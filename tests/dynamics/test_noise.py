# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

"""Motion under noise and frequency response function: linear limits, the stationary density, an independent ODE."""

from __future__ import annotations

import csv
import json
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.integrate import quad, solve_ivp
from scipy.interpolate import CubicSpline

from asperity.dynamics import ContactOscillator, LoopDamping, PowerLaw, run_dynamics
from asperity.dynamics.motion.noise import Noise, integrate_noise
from asperity.errors import InputError


def test_the_spectrum_of_the_linear_contact_is_that_of_the_force_times_h_squared() -> None:
    zeta, rms, band = 0.05, 0.02, (0.1, 4.0)
    r = ContactOscillator(PowerLaw(1.0), zeta=zeta).random(rms, band, records=2)
    H2 = 1.0 / ((1.0 - r.Omega**2) ** 2 + (2.0 * zeta * r.Omega) ** 2)
    inside = (r.Omega > 1.02 * band[0]) & (r.Omega < 0.99 * band[1])
    S = rms**2 / (band[1] - band[0])
    np.testing.assert_allclose(r.psd_force[inside], S, rtol=4e-3)  # a whole number of lines in the band
    # means over two neighbouring lines bend by a share of the peak
    np.testing.assert_allclose(r.psd[inside], H2[inside] * r.psd_force[inside], rtol=2e-2)
    np.testing.assert_allclose(r.psd[inside], r.psd_linear[inside], rtol=2e-4)
    assert r.lost == 0.0 and r.scatter < 1e-6
    spacing = r.Omega[1] - r.Omega[0]
    assert np.sum(r.psd) * spacing == pytest.approx(r.rms**2, rel=1e-6)
    assert r.rms**2 == pytest.approx(np.sum(H2[inside]) * S * spacing, rel=2e-2)


@pytest.mark.parametrize("n", [1.0, 1.5, 2.5])
def test_wide_noise_has_the_stationary_density_of_the_fokker_planck_equation(n: float) -> None:
    """p(u) ~ exp(-V(u)/s^2) with s^2 = pi S/(4 zeta): mean, rms and share out of contact."""
    zeta, rms, band = 0.05, 0.4, (0.05, 8.0)
    o = ContactOscillator(PowerLaw(n), zeta=zeta)
    r = o.random(rms, band, records=24)
    s2 = np.pi * rms**2 / (band[1] - band[0]) / (4.0 * zeta)
    u = np.linspace(-40.0, 6.0, 200001)
    p = np.exp(-o.restoring.potential(u) / s2)
    p /= p.sum()
    mean = float(p @ u)
    expected = float(np.sqrt(p @ (u - mean) ** 2))
    assert r.rms == pytest.approx(expected, rel=0.02, abs=4 * r.scatter)
    assert r.mean == pytest.approx(mean, abs=0.06 * expected)
    assert r.lost == pytest.approx(float(p[u < -1.0].sum()), rel=0.15) and r.lost > 0.04


@pytest.mark.parametrize("damping", ["always", "contact", "hunt-crossley"])
def test_motion_under_noise_agrees_with_an_independent_integration(damping: str) -> None:
    n, zeta, rms = 1.5, 0.1, 0.4
    o = ContactOscillator(PowerLaw(n), zeta=zeta, damping=damping)
    noise = Noise.of(rms, (0.05, 3.0), zeta / 4, np.random.default_rng(3))
    period = 2 * np.pi / noise.spacing
    count = 4096
    times = np.linspace(0.0, period, count + 1)
    values = noise.sampled(count)
    assert noise.at(times[17]) == pytest.approx(values[17], abs=1e-12)
    force = CubicSpline(times, np.append(values, values[0]), bc_type="periodic")

    def field(t: float, y: np.ndarray) -> list[float]:
        s = 1.0 + y[0]
        p = s**n if s > 0 else 0.0
        g = {"always": 1.0, "contact": float(s > 0), "hunt-crossley": p}[damping]
        return [y[1], float(force(t % period)) - (p - 1.0) / n - 2 * zeta * g * y[1]]

    start = -100.0 + period  # rest, ten decay times before the record, as in the program
    grid = np.linspace(0.0, period, 20001)
    run = solve_ivp(
        field, (start, 2 * period), [0.0, 0.0], method="RK45", rtol=1e-7, atol=1e-9, max_step=0.05,
        t_eval=period + grid,
    )  # fmt: skip
    u = run.y[0]
    record = integrate_noise(o.balance(), noise, step=0.02)
    own = np.interp(grid, np.linspace(0.0, period, record.steps + 1), np.append(record.u, record.u[0]))
    assert record.u.std() == pytest.approx(float(u.std()), rel=2e-3)
    assert np.abs(own - u).max() < 0.02 * np.abs(u).max()
    assert record.lost / period == pytest.approx(float(np.mean(u < -1.0)), abs=1e-3) and record.lost > 0.01 * period
    assert record.separations == int(np.sum((u[:-1] >= -1.0) & (u[1:] < -1.0)))


def test_noise_damped_by_loops_agrees_with_an_independent_integration() -> None:
    """The coefficient is linear between 0, a and b, and constant beyond; its nodes follow from two mean values.

    A harmonic motion of amplitude a has the damping ratio (4/pi) int_0^(pi/2) c(a cos t) sin(t)^2 dt: 4/(3 pi) times
    the coefficient of a where that is linear from zero.
    """
    n, zeta, rms, a, b = 1.5, 0.05, 0.1, 0.2, 0.5
    zeta_a, c_b = 0.08, 0.6
    c_a = 0.75 * np.pi * zeta_a

    def coefficient(z: float) -> float:
        return c_a * z / a if z < a else c_a + (c_b - c_a) * (z - a) / (b - a) if z < b else c_b

    zeta_b = 4 / np.pi * quad(lambda t: coefficient(b * np.cos(t)) * np.sin(t) ** 2, 0.0, np.pi / 2, limit=200)[0]
    o = ContactOscillator(PowerLaw(n), zeta=zeta, damping=LoopDamping((a, b), (zeta_a, zeta_b)))
    noise = Noise.of(rms, (0.05, 3.0), zeta / 4, np.random.default_rng(5))
    period, z_s = 2 * np.pi / noise.spacing, o.restoring.z_s

    def field(t: float, y: np.ndarray) -> list[float]:
        height = 1.0 + y[0]
        p = height**n if height > 0 else 0.0
        damper = zeta + coefficient(z_s * abs(y[0])) if height > 0 else 0.0
        return [y[1], noise.at(t) - (p - 1.0) / n - 2 * damper * y[1]]

    grid = np.linspace(0.0, period, 4001)
    run = solve_ivp(field, (period - 200.0, 2 * period), [0.0, 0.0], rtol=1e-6, atol=1e-8, t_eval=period + grid)
    record = integrate_noise(o.balance(), noise, step=0.05)
    own = np.interp(grid, np.linspace(0.0, period, record.steps + 1), np.append(record.u, record.u[0]))
    assert record.u.std() == pytest.approx(float(run.y[0].std()), rel=2e-3)
    assert np.abs(own - run.y[0]).max() < 0.02 * np.abs(own).max()
    without = integrate_noise(replace(o, damping="contact").balance(), noise, step=0.05)
    assert record.u.std() < 0.9 * without.u.std()


def test_light_noise_keeps_contact() -> None:
    o = ContactOscillator(PowerLaw(1.5), zeta=0.05)
    shares = [o.random(level, records=3).lost for level in (0.8, 0.4, 0.2, 0.1, 0.05)]
    assert all(a > b or a == b == 0.0 for a, b in pairwise(shares))
    assert shares[0] > 0.3 and shares[-1] == 0.0


def test_a_run_writes_spectra_and_receptance(tmp_path: Path) -> None:
    """In units, with a joint; the receptance of light forcing is that of the linear oscillator."""
    zeta, K = 0.02, 3e6
    law = PowerLaw(1.5, K)
    result = run_dynamics(
        law, zeta=zeta, forcing=1e-5, random=[0.02, 0.3], load=40.0, gravity=9.81, units="SI", models=["exact"],
        omega=(0.6, 1.4), out_dir=tmp_path,
    )  # fmt: skip
    numbers = result.numbers
    k, m = numbers.stiffness, numbers.mass
    assert k == pytest.approx(1.5 * K ** (2 / 3) * 40.0 ** (1 / 3), rel=1e-9)
    with (tmp_path / "response.csv").open() as file:
        rows = list(csv.DictReader(file))
    w = 2 * np.pi * np.array([float(row["frequency"]) for row in rows])
    H = 1.0 / (k - m * w**2 + 2j * zeta * np.sqrt(k * m) * w)
    np.testing.assert_allclose([float(row["receptance"]) for row in rows], np.abs(H), rtol=5e-4)
    np.testing.assert_allclose([float(row["phase"]) for row in rows], np.degrees(np.angle(H)), atol=0.05)
    with (tmp_path / "random.csv").open() as file:
        spectra = [row for row in csv.DictReader(file) if row["F_hat_rms"] == "0.02"]
    f, S = (np.array([float(row[name]) for row in spectra]) for name in ("frequency", "psd_force"))
    force = 0.02 * result.first.restoring.scale
    assert np.sum(S) * (f[1] - f[0]) == pytest.approx(force**2, rel=1e-9)
    x = np.array([float(row["psd_x"]) for row in spectra])
    r = result.random["exact"][0]
    assert np.sum(x) * (f[1] - f[0]) == pytest.approx((r.rms * numbers.approach) ** 2, rel=1e-6)
    written = json.loads((tmp_path / "thresholds.json").read_text())["exact"]["random"]
    assert [s["F_hat_rms"] for s in written] == [0.02, 0.3] and written[0]["lost"] == 0.0 < written[1]["lost"]
    run_dynamics(law, models=["exact"], omega=(0.9, 0.91), bands=False, units="SI", out_dir=tmp_path)
    assert not (tmp_path / "random.csv").exists()


def test_noise_that_cannot_be_computed_is_refused() -> None:
    law = PowerLaw(1.5)
    with pytest.raises(InputError, match=r"zeta = 0.0001 is not legal under noise"):
        ContactOscillator(law, zeta=1e-4).random(0.1)
    with pytest.raises(InputError, match="noise is for the exact law"):
        ContactOscillator(law).taylor().random(0.1)
    with pytest.raises(InputError, match="records = 0"):
        ContactOscillator(law).random(0.1, records=0)
    notes = run_dynamics(law, zeta=1e-4, random=0.1, models=["exact"], omega=(0.9, 0.91), bands=False).notes
    assert any(note.startswith("no random excitation: zeta = 0.0001") for note in notes)


@pytest.mark.parametrize(
    ("zeta", "band", "records", "words"),
    [
        (0.1, (0.8, 1.2), 8, r"band = \[0.8, 1.2\] is too narrow for zeta = 0.1: .* at least 0.5 wide"),
        (0.001, (0.05, 100.0), 8, r"band = \[0.05, 100.0\] with zeta = 0.001 takes too long: 8 records have 7.7e\+07"),
        (0.01, (0.05, 3.0), 1000, r"1000 records have 2.9e\+07 time steps, and at most 2e\+07 are legal"),
    ],
)
def test_bands_without_lines_and_endless_records_are_refused(
    zeta: float, band: tuple[float, float], records: int, words: str
) -> None:
    with pytest.raises(InputError, match=words):
        ContactOscillator(PowerLaw(1.5), zeta=zeta).random(0.1, band, records=records)


def test_the_narrowest_band_is_computed() -> None:
    """Its width is five times zeta: 20 lines."""
    r = ContactOscillator(PowerLaw(1.0), zeta=0.1).random(0.01, (0.8, 1.3), records=1)
    assert np.sum(r.psd_force) * (r.Omega[1] - r.Omega[0]) == pytest.approx(1e-4, rel=1e-9)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"random": 0.0}, "random = 0.0 is not legal: it must be finite and greater than 0"),
        ({"random": [0.1, 1e7]}, r"random = 1e\+07 is not legal: it must lie between"),
        ({"band": (1e-3, 3.0)}, "band = 0.001 is not legal: it must lie between 0.01 and 100"),
        ({"band": (3.0, 0.05)}, r"band = \[3.0, 0.05\] is not legal: give two frequencies"),
        ({"omega": (1.3, 0.5)}, r"omega = \[1.3, 0.5\] is not legal: give two frequencies"),
    ],
)
def test_wrong_input_is_reported_under_its_own_name(options: dict[str, Any], words: str) -> None:
    with pytest.raises(InputError, match=f"^{words}"):
        run_dynamics(PowerLaw(1.5), **options)
    if "band" in options:
        with pytest.raises(InputError, match=f"^{words}"):
            ContactOscillator(PowerLaw(1.5)).random(0.1, **options)


QUICK: dict[str, Any] = {"zeta": 0.05, "forcing": 1e-3, "omega": (0.9, 0.91), "bands": False, "units": "other"}


def test_noise_beyond_what_the_law_knows_is_noted() -> None:
    z = np.linspace(0.1, 1.0, 10)
    options = {**QUICK, "models": ["exact"], "random": [1e-3, 0.4]}
    result = run_dynamics({"delta": z, "force": z**1.5}, **options)
    (note,) = (note for note in result.notes if "beyond it the law is extrapolated" in note)
    u_max = result.random["exact"][1].u_max
    assert note.startswith(f"exact, noise of rms F^ = 0.4: the motion reaches u = {u_max:.4g}, the curve")


def test_noise_without_the_exact_law_is_noted() -> None:
    notes = run_dynamics(PowerLaw(1.5), models=["taylor"], random=0.1, **QUICK).notes
    assert notes.count("no random excitation: noise is for the exact law, and model has taylor only") == 1
    notes = run_dynamics(PowerLaw(1.5), models=["taylor", "exact"], random=0.1, **QUICK).notes
    assert not any("no random excitation" in note for note in notes)


def test_an_analysis_without_noise_keeps_no_old_figure(tmp_path: Path) -> None:
    from asperity.plot.oscillator import plot_dynamics

    figures = {"random.png", "random.svg"}
    result = run_dynamics(PowerLaw(1.5), models=["exact"], random=0.1, **QUICK)
    assert figures <= {path.name for path in plot_dynamics(result, tmp_path)}
    plot_dynamics(replace(result, random={}), tmp_path)
    left = {path.name for path in tmp_path.iterdir()}
    assert not figures & left and "response.png" in left
