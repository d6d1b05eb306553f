"""Motion in time, thresholds and refusals: closed forms of a linear contact and SciPy's integration."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from asperity.errors import InputError, RangeError
from asperity.vibration.law import PowerLaw
from asperity.vibration.oscillator import ContactOscillator

LINEAR = ContactOscillator(PowerLaw(1.0), zeta=0.05)


def test_simulate_flight_is_a_parabola() -> None:
    o = ContactOscillator(PowerLaw(1.5), zeta=0.0)
    path = o.simulate(1.0, 0.0, u=2.0, periods=3.0)
    r = o
    energy = 0.5 * path.v**2 + o.law.potential(r.z_s * (1.0 + path.u)) / (r.scale * r.z_s) - path.u / r.n_loc
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


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda o: o.response("much"), "forcing = 'much'"),
        (lambda o: o.response(0.1, tol=0.0), "tol = 0"),
        (lambda o: o.simulate(1.0, 0.1, u=np.nan), "state u = nan"),
        (lambda o: o.free(np.nan), "u0 = nan"),
        (lambda o: o.free([]), "u0 is empty"),
        (lambda o: o.response(-0.1), "forcing = -0.1"),
        (lambda o: o.response(0.1, (1.3, 0.5)), "omega"),
        (lambda o: o.response(0.1, (0.5,)), "omega"),
        (lambda o: o.response(0.05, (0.9, 0.91)).at(2.0), "outside the computed window"),
        (lambda o: replace(o, zeta=0.0).response(0.1), "zeta of forced motion = 0.* is not legal"),
        (lambda o: o.simulate(1e-9, 0.1), "omega = 1e-09"),
        (lambda o: o.simulate(1.0, 1e300), r"forcing = 1e\+300"),
    ],
)
def test_bad_calls_are_refused_in_one_sentence(call, words) -> None:
    with pytest.raises(InputError, match=words):
        call(ContactOscillator(PowerLaw(1.5)))
