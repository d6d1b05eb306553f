"""Free vibration: closed forms, published values, direct integration, grazing, refusals."""

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

    def potential(self, z: Any) -> Any:
        return 0.5 * np.maximum(z, 0.0) ** 2 + 4.0 * np.maximum(np.asarray(z) - 1.0, 0.0) ** 2

    def derivatives(self, z: float) -> tuple[float, float, float]:
        return 1.0, 0.0, 0.0

    def describe(self) -> str:
        return "bilinear"


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
    r, (low,) = o, o.free([205.5]).u_min
    stored = float(r.law.potential(206.5 * r.z_s)) / (r.scale * r.z_s) - 206.5 / r.n_loc
    assert -1.0 - low == pytest.approx(r.n_loc * stored, rel=2e-6) and stored > 1e12  # as high as its energy


def test_an_amplitude_in_the_round_off_of_the_force_is_refused() -> None:
    with pytest.raises(ConvergenceError, match="lost in round-off"):
        ContactOscillator(PowerLaw(1.5)).free(1e-14)
