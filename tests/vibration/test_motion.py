"""Free vibration, thresholds and motion in time: closed forms, published values, integration by SciPy."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.special import beta

from asperity.errors import ConvergenceError, RangeError
from asperity.vibration.curve_law import CurveLaw
from asperity.vibration.law import Law, PowerLaw
from asperity.vibration.oscillator import ContactOscillator


def omega_loss(n: float) -> float:
    return 2 * np.pi / (np.sqrt(2 / n) * (n + 1) ** (1 / (2 * n)) * beta(1 / (2 * n), 0.5))


# by round-off the orbit of 1.138, 1.793 or 2.314 turns just beyond the end of contact
@pytest.mark.parametrize("n", [0.6, 1.0, 1.01, 1.138, 1.5, 1.793, 2.314, 4.0])
def test_closed_forms_of_a_power_law(n: float) -> None:
    """The largest release in contact and its frequency, and the curvature of the backbone (Nayak's -1/24 for 3/2)."""
    o = ContactOscillator(PowerLaw(n))
    limit = (n + 1) ** (1 / n) - 1
    assert o.u_max == pytest.approx(limit, rel=1e-12)
    assert o.free(limit).omega_ratio[0] == pytest.approx(omega_loss(n), rel=1e-11)
    assert o.thresholds().omega_loss == pytest.approx(omega_loss(n), rel=1e-11)
    kappa = -(n - 1) * (2 * n + 1) / 48
    assert (o.free(1e-3).omega_ratio[0] - 1) * 1e6 == pytest.approx(kappa, rel=2e-3, abs=1e-6)


@pytest.mark.parametrize("n", [1.5, 2.5])
def test_grazing_from_both_sides(n: float) -> None:
    limit = (n + 1) ** (1 / n) - 1
    found = ContactOscillator(PowerLaw(n)).free([limit - 1e-10, limit + 1e-10])
    assert found.u_min[0] > -1.0 > found.u_min[1]
    # the frequency is smooth through grazing: its slope bounds the difference
    np.testing.assert_allclose(found.omega_ratio, omega_loss(n), atol=3e-10)
    assert found.omega_ratio[0] > found.omega_ratio[1]


@pytest.mark.parametrize(
    ("n", "published"),
    [
        (1.5, (0.999575, 0.998259, 0.995960, 0.992540, 0.987785, 0.981349)),
        (2.0, (0.998920, 0.995498, 0.989370, 0.980003, 0.966582, 0.947782)),
    ],
)
def test_published_frequencies(n: float, published: tuple[float, ...]) -> None:
    found = ContactOscillator(PowerLaw(n)).free(np.arange(1, 7) / 10).omega_ratio
    np.testing.assert_allclose(found, published, atol=5e-7)


@pytest.mark.parametrize(("n", "u0"), [(0.8, 0.5), (1.5, 2.0), (2.0, 5.0)])
def test_period_and_harmonic_against_time_integration(n: float, u0: float) -> None:
    def field(t, y):
        s = max(1 + y[0], 0.0)
        return [y[1], -(s**n - 1) / n, y[1] ** 2]

    def separate(t, y):
        return y[0] + 1

    def top(t, y):
        return y[1] if t > 1e-6 else 1.0

    events: list[Any] = [separate, top]
    events[0].terminal = events[1].terminal = True
    events[1].direction = 1.0
    t, y = 0.0, [u0, 0.0, 0.0]
    while True:  # integrate piecewise, so that no step straddles contact loss
        run = solve_ivp(field, (t, 200.0), y, method="DOP853", rtol=1e-13, atol=1e-15, events=events, max_step=0.1)
        t, y = run.t[-1], run.y[:, -1]
        if run.t_events[1].size:
            break
        y[0] += np.sign(y[1]) * 1e-15
    found = ContactOscillator(PowerLaw(n)).free(u0)
    assert found.omega_ratio[0] == pytest.approx(np.pi / t, rel=1e-10)
    assert found.u_min[0] == pytest.approx(y[0], rel=1e-9)
    assert found.drive[0] * np.pi * found.a1[0] == pytest.approx(2 * y[2], rel=1e-9)


def test_linear_contact_has_the_closed_form_with_flight() -> None:
    u0 = 2.0  # half a cosine cut at u = -1, then a parabola
    time = 2 * np.arccos(-1 / u0) + 2 * np.sqrt(u0**2 - 1)
    assert ContactOscillator(PowerLaw(1.0)).free(u0).omega_ratio[0] == pytest.approx(2 * np.pi / time, rel=1e-12)


class Bilinear(Law):
    """Stiffness 1 up to an approach of 1, and 9 beyond."""

    knots = np.array([1.0])

    def force(self, z: Any) -> Any:
        return np.maximum(z, 0.0) + 8.0 * np.maximum(np.asarray(z) - 1.0, 0.0)

    def slope(self, z: Any) -> Any:
        return 1.0 * (np.asarray(z) > 0) + 8.0 * (np.asarray(z) > 1.0)

    def derivatives(self, z: float) -> tuple[float, float, float]:
        return 1.0, 0.0, 0.0


def test_a_spring_whose_corner_is_the_preload() -> None:
    """Half a period on each side, of frequencies 1 and 3, up to three times as far on the soft one."""
    found = ContactOscillator(Bilinear(), load=1.0).free([1e-4, 1e-2, 0.3])
    np.testing.assert_allclose(found.omega_ratio, 1.5, rtol=1e-8)
    np.testing.assert_allclose(found.u_min, -3.0 * found.u0, rtol=1e-7)


@pytest.mark.parametrize("curvature", [0.0, 1e-12, 1e-7])
def test_a_curve_whose_points_lie_at_the_turning_points_is_integrated(curvature: float) -> None:
    z = np.linspace(0.0, 1.0, 41)  # a linear spring turns at a point of the table for each of these amplitudes
    found = ContactOscillator(CurveLaw(z, z * (1.0 + curvature * z)), load=0.5).free(np.arange(1, 40) / 40)
    np.testing.assert_allclose(found.omega_ratio, 1.0, atol=1e-11 + 0.1 * curvature)


def test_taylor_is_marked_unphysical_and_refused_beyond_the_rim() -> None:
    o = ContactOscillator(PowerLaw(1.5)).taylor()
    found = o.free([0.5, 1.2])
    assert found.valid.tolist() == [True, False]
    with pytest.raises(RangeError, match="rim"):
        o.free(1.7)
    inside = o.free()  # the default
    assert inside.u0[-1] < 1.7 and np.isfinite(inside.omega_ratio).all()


def test_a_law_whose_stiffness_is_infinite_at_contact_loss() -> None:
    """By the time integration of half a period, with the separation located."""
    o = ContactOscillator(PowerLaw(0.51), zeta=0.0)
    path = o.simulate(float(o.free(3.0).omega_ratio[0]), 0.0, u=3.0, periods=1.0)
    np.testing.assert_allclose([path.u[-1], path.v[-1]], [3.0, 0.0], atol=1e-8)


def test_the_period_of_a_curve_with_a_knot_beside_the_preload() -> None:
    table = json.loads((Path(__file__).parent / "tables.json").read_text(encoding="utf-8"))["knot beside the preload"]
    o = ContactOscillator(CurveLaw(table["z"], table["F"], k=table.get("k")), load=table["load"], zeta=0.01)
    omega = float(o.free([table["u0"]]).omega_ratio[0])
    assert omega == pytest.approx(table["own_omega"], rel=1e-9)

    def field(t: float, y: np.ndarray) -> list[float]:
        return [y[1], -float(o.f(y[:1])[0])]

    run = solve_ivp(
        field, (0, np.pi / omega), [table["u0"], 0.0], method="DOP853", rtol=1e-12, atol=1e-15, max_step=0.01
    )
    assert abs(run.y[1, -1]) < 1e-9 * table["u0"]  # at rest again


def test_a_flight_far_longer_than_the_contact_is_integrated() -> None:
    """Beyond its points a table may be so stiff that contact lasts 1e-11 of the period: the speed is that of energy."""
    z = np.linspace(0.05, 2.0, 40)
    o = ContactOscillator(CurveLaw(z, z**1.5 + 18.0 * np.maximum(z - 0.94, 0.0) ** 3), load=13.2, damping="contact")
    (low,) = o.free([205.5]).u_min
    stored = float(o.law.potential(206.5 * o.z_s)) / (o.scale * o.z_s) - 206.5 / o.n_loc
    assert -1.0 - low == pytest.approx(o.n_loc * stored, rel=2e-6) and stored > 1e12  # as high as its energy


def test_an_amplitude_in_the_round_off_of_the_force_is_refused() -> None:
    with pytest.raises(ConvergenceError, match="lost in round-off"):
        ContactOscillator(PowerLaw(1.5)).free(1e-14)


# --- motion in time and thresholds -------------------------------------------------------------------------

LINEAR = ContactOscillator(PowerLaw(1.0), zeta=0.05)


def test_simulate_flight_is_a_parabola() -> None:
    o = ContactOscillator(PowerLaw(1.5), zeta=0.0)
    path = o.simulate(1.0, 0.0, u=2.0, periods=3.0)
    energy = 0.5 * path.v**2 + o.law.potential(o.z_s * (1.0 + path.u)) / (o.scale * o.z_s) - path.u / o.n_loc
    assert np.ptp(energy) < 1e-9
    (low,) = o.free(2.0).u_min
    assert path.u.min() == pytest.approx(low, rel=1e-9)
    length = np.diff(path.flight[0])[0]
    assert length == pytest.approx(2.0 * np.sqrt(2.0 * 1.5 * (-1.0 - low)), rel=1e-9)
    assert np.all(path.u[(path.tau > path.flight[0, 0] + 1e-9) & (path.tau < path.flight[0, 1] - 1e-9)] < -1)


def test_free_decay_has_the_damping_ratio() -> None:
    zeta = 0.02
    path = ContactOscillator(PowerLaw(1.5), zeta=zeta).simulate(1.0, 0.0, u=0.01, periods=10.0, samples=256)
    peaks = path.u[1:-1][(path.u[1:-1] > path.u[:-2]) & (path.u[1:-1] > path.u[2:])]
    ratio = np.log(peaks[0] / peaks[5]) / 5
    assert ratio == pytest.approx(2 * np.pi * zeta / np.sqrt(1 - zeta**2), rel=1e-3)


@pytest.mark.parametrize(("n", "drive"), [(1.2, 0.94898), (1.5, 0.88652), (3.0, 0.70205)])
def test_onset_of_contact_loss(n: float, drive: float) -> None:
    t = ContactOscillator(PowerLaw(n), zeta=0.01).thresholds()
    assert t.contact_loss == pytest.approx(0.02 * drive, abs=1.2e-7)
    assert t.u_max == pytest.approx((n + 1) ** (1 / n) - 1, rel=1e-12)
    assert t.hysteresis == pytest.approx(np.sqrt(32e-6 / (3 * np.sqrt(3) * abs(t.kappa))), rel=1e-12)


def test_the_damping_model_determines_whether_resonance_is_limited() -> None:
    always, contact, force = (
        ContactOscillator(PowerLaw(1.5), damping=damping).free([0.5, 10.0, 1000.0]).drive
        for damping in ("always", "contact", "hunt-crossley")
    )
    assert np.all(np.diff(always) > 0.0) and contact[2] < contact[1]
    # proportional to the contact force: the same loss, since INT f u'^2 dtau vanishes on a free orbit
    np.testing.assert_allclose(force, always, rtol=1e-6)


def test_hardening_needs_n_below_one() -> None:
    words = [ContactOscillator(PowerLaw(n)).thresholds().softening for n in (0.9, 1.0, 1.1)]
    assert words == ["hardening", "linear", "softening"]
    omega = ContactOscillator(PowerLaw(0.8)).free(np.linspace(0.015, 3.0, 200)).omega_ratio
    assert np.sum(np.diff(np.sign(np.diff(omega))) != 0) == 1 and omega.max() > 1  # contact loss softens in the end


def test_a_step_overshoots_as_a_linear_oscillator_does() -> None:
    path = LINEAR.simulate(1.0, 1e-3, shape="step", periods=4)
    decay = np.exp(-np.pi * 0.05 / np.sqrt(1 - 0.05**2))
    assert path.u.max() == pytest.approx(1e-3 * (1.0 + decay), rel=1e-9)
    assert path.tau[path.u.argmax()] == pytest.approx(np.pi / np.sqrt(1 - 0.05**2), rel=1e-6)
    assert np.all(path.force == 1e-3) and np.all(np.diff(path.tau) > 0)


@pytest.mark.parametrize("omega", [0.4, 1.0, 2.5])
def test_the_shock_response_spectrum_of_a_half_sine(omega: float) -> None:
    """Of a linear oscillator without damping: largest displacement during and after the pulse."""
    path = ContactOscillator(PowerLaw(1.0), zeta=0.0).simulate(omega, 1e-3, shape="half-sine", periods=4)
    t = np.linspace(0, np.pi / omega, 100001)
    if omega == 1.0:
        during, after = 0.5 * (np.sin(t) - t * np.cos(t)), 0.5 * np.pi
    else:
        during = (np.sin(omega * t) - omega * np.sin(t)) / (1.0 - omega**2)
        after = abs(2.0 * omega * np.cos(0.5 * np.pi / omega) / (1.0 - omega**2))
    assert path.u[path.tau <= np.pi / omega].max() == pytest.approx(1e-3 * during.max(), rel=1e-7)
    assert path.u[path.tau >= np.pi / omega].max() == pytest.approx(1e-3 * after, rel=1e-8)


def test_a_chirp_with_loss_of_contact() -> None:
    o = ContactOscillator(PowerLaw(1.5), zeta=0.02)
    path = o.simulate((0.6, 1.3), 0.08, shape="chirp", periods=12)
    end = path.tau[-1]
    assert end == pytest.approx(24.0 * np.pi / 0.6) and len(path.flight) == 2

    def field(t: float, y: np.ndarray) -> list[float]:
        force = 0.08 * np.cos(0.6 * t + 0.5 * (1.3 - 0.6) / end * t**2)
        return [y[1], force - (max(1.0 + y[0], 0.0) ** 1.5 - 1.0) / 1.5 - 0.04 * y[1]]

    run = solve_ivp(field, (0, end), [0.0, 0.0], method="DOP853", rtol=1e-11, atol=1e-13, max_step=0.01)
    np.testing.assert_allclose([path.u[-1], path.v[-1]], run.y[:, -1], atol=1e-6)
    assert path.u.min() == pytest.approx(run.y[0].min(), rel=1e-4)


def test_a_motion_leaves_the_taylor_well_and_it_is_said() -> None:
    o = ContactOscillator(PowerLaw(1.5), zeta=0.02).taylor()
    with pytest.raises(RangeError, match="escapes"):
        o.simulate(1.0, 0.0, u=2.0, periods=20)
    assert o.simulate(1.0, 0.03).valid and not o.simulate(0.9, 0.3, periods=1.0, u=1.2).valid
