"""Reference solutions against independent identities, textbook values and each other."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.linalg import expm
from scipy.optimize import brentq

from asperity import reference as ref
from asperity.errors import ConvergenceError, InputError
from asperity.reference.halfspace import compliance_of_waves
from asperity.surface import Flat, Sinusoid, Sphere, WeierstrassMandelbrot

# --- elastic closed forms ---------------------------------------------------------------------


def test_moduli():
    assert ref.reduced_modulus(200.0, 0.3) == pytest.approx(219.7802, rel=1e-6)
    assert ref.patch_test_slope(0.3) == pytest.approx(1.2250, abs=5e-5)
    assert ref.patch_test_slope(0.3, aspect=2.0) == pytest.approx(1.2250 / 2, abs=5e-5)
    assert ref.patch_test_slope(0.3, sides="free") == pytest.approx(0.91)
    with pytest.raises(InputError, match="sides must be"):
        ref.block_modulus(1.0, 0.3, "glued")  # type: ignore[arg-type]


def test_hertz_is_consistent():
    hertz, delta = ref.Hertz(R=2.0, E_prime=3.0), 0.01
    a = float(hertz.radius(delta))
    total, _ = quad(lambda r: 2 * math.pi * r * float(hertz.pressure(r, delta)), 0, a)
    assert hertz.force(delta) == pytest.approx(total, rel=1e-6)
    assert hertz.peak_pressure(delta) == pytest.approx(1.5 * total / (math.pi * a**2), rel=1e-6)
    assert hertz.approach(hertz.force(delta)) == pytest.approx(delta)
    h = 1e-6  # a rigid punch of the contact's radius has stiffness 2 E' a
    stiffness = (hertz.force(delta + h) - hertz.force(delta - h)) / (2 * h)
    assert stiffness == pytest.approx(2 * 3.0 * a, rel=1e-6)
    # displacement at the centre of a half-space: (1/(pi E')) times the integral of p/r
    centre, _ = quad(lambda r: 2 * float(hertz.pressure(r, delta)) / 3.0, 0, a)
    assert centre == pytest.approx(delta, rel=1e-6)
    assert hertz.pressure(1.01 * a, delta) == 0


def test_westergaard_is_consistent():
    wave = ref.Westergaard(A=0.01, lam=2.0, E_prime=5.0)
    mean = 0.3 * wave.full_pressure
    half = float(wave.area_fraction(mean)) * wave.lam / 2
    total, _ = quad(lambda x: float(wave.pressure(x, mean)), -half, half)
    assert total / wave.lam == pytest.approx(mean, rel=1e-6)
    assert wave.pressure(1.001 * half, mean) == 0
    assert wave.mean_pressure(wave.area_fraction(mean)) == pytest.approx(mean)
    assert wave.approach(0.0) == 0
    assert wave.approach(wave.full_pressure) == pytest.approx(wave.A)


def test_similarity_law_against_computation():
    """Heights times s at loads times s: approach times s, the same area."""
    low, high = (WeierstrassMandelbrot(L=1e-6, G=G, D=2.5, seed=2) for G in (1e-12, 4e-12))
    s = 4**0.5
    a = ref.half_space_contact(low, 64, P_star=1e-4)
    b = ref.half_space_contact(high, 64, P_star=s * 1e-4)
    assert b.delta_star == pytest.approx(s * a.delta_star, rel=1e-6)
    assert b.area_fraction == pytest.approx(a.area_fraction)


# --- half-space solver ------------------------------------------------------------------------


def test_half_space_on_westergaard():
    wave = ref.Westergaard(A=0.01, lam=1.0, E_prime=1.0)
    surface = Sinusoid(L=1.0, amplitude=0.01)
    for r, bar in ((0.1, 1.2e-4), (0.5, 4e-5), (0.9, 4e-5)):
        pressure = r * wave.full_pressure
        computed = ref.half_space_contact(surface, 256, P_star=pressure)
        assert computed.delta_star == pytest.approx(float(wave.approach(pressure)), rel=bar)
        assert computed.P_star == pytest.approx(pressure)
        row = computed.pressure[7]
        assert row.mean() == pytest.approx(pressure)
        x = (np.arange(256) + 0.5) / 256 - 0.5
        assert abs(row - wave.pressure(x, pressure)).max() < 0.09 * row.max()


def test_half_space_on_hertz():
    """The contact radius is 5 % of the patch, so the images hardly change the peak."""
    surface = Sphere(L=1.0, radius=1.0, centre=(0.0, 0.0), shape="paraboloid")
    hertz = ref.Hertz(R=1.0, E_prime=1.0)
    delta = 0.1**2
    quarter = float(hertz.force(delta)) / 4
    computed = ref.half_space_contact(surface, 256, P_star=quarter)
    assert computed.pressure.max() == pytest.approx(float(hertz.peak_pressure(delta)), rel=0.01)
    assert computed.area_fraction == pytest.approx(math.pi * delta / 4, rel=0.02)


def layer_compliance(q: float, height: float, nu: float) -> float:
    """Return E' u/p for a wave cos(qx) on a bonded layer, by the exponential of its ODE.

    State (U, W, S, T): u_x = U sin, u_z = W cos, sigma_zz = S cos, sigma_xz = T sin (E = 1).
    """
    mu, lam = 1 / (2 * (1 + nu)), nu / ((1 + nu) * (1 - 2 * nu))
    M = lam + 2 * mu
    rate = np.array(
        [
            [0, q, 0, 1 / mu],
            [-lam * q / M, 0, 1 / M, 0],
            [0, 0, 0, -q],
            [q * q * (M - lam**2 / M), 0, q * lam / M, 0],
        ]
    )
    top = expm(rate * height)[:, 2:]  # from U = W = 0 at the base
    base = np.linalg.solve(top[2:], [-1.0, 0.0])
    return float(-(top[1] @ base)) / (1 - nu**2)


@pytest.mark.parametrize("nu", [0.0, 0.3, 0.45])
@pytest.mark.parametrize("height", [0.1, 1.0])
def test_layer_compliance_against_its_differential_equation(nu, height):
    table = compliance_of_waves(4, height, nu)
    for i, j in [(0, 1), (1, 0), (1, 1), (0, 3)]:
        q = math.pi * math.hypot(i, j)
        assert table[i, j] == pytest.approx(layer_compliance(q, height, nu), rel=1e-9)
    # confined compression h/M, E' = 1
    assert table[0, 0] == pytest.approx(height / ref.patch_test_slope(nu))


def test_layer_under_approach_and_load_control():
    surface = WeierstrassMandelbrot(L=1e-6, D=2.5, G=1.36e-11)
    load = ref.half_space_contact(surface, 64, P_star=0.004, height=1e-6)
    driven = ref.half_space_contact(surface, 64, delta_star=load.delta_star, height=1e-6)
    assert driven.P_star == pytest.approx(0.004, rel=1e-6)
    half_space = ref.half_space_contact(surface, 64, P_star=0.004)
    block = 0.004 / ref.patch_test_slope(0.3)
    assert load.delta_star == pytest.approx(half_space.delta_star + block, rel=0.02)


def test_a_flat_layer_is_the_patch_test():
    contact = ref.half_space_contact(Flat(L=1.0), 16, delta_star=0.01, height=0.5)
    assert contact.P_star == pytest.approx(0.01 * ref.patch_test_slope(0.3, aspect=0.5))
    assert contact.area_fraction == 1.0


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({}, "exactly one"),
        ({"P_star": 1e-3, "delta_star": 1e-3}, "exactly one"),
        ({"P_star": -1.0}, "P_star = -1.0 must be positive"),
        ({"delta_star": 0.01}, "needs the height"),
        ({"P_star": 1e-3, "height": 0.0}, "height = 0.0 must be positive"),
    ],
)
def test_bad_loads_are_refused(options, message):
    with pytest.raises(InputError, match=message):
        ref.half_space_contact(Flat(L=1.0), 8, **options)


def test_too_few_iterations_are_reported():
    with pytest.raises(ConvergenceError, match="after 3 iterations"):
        ref.half_space_contact(WeierstrassMandelbrot(L=1e-6, D=2.4, G=1.36e-11), 32, P_star=0.01, max_iterations=3)


@pytest.mark.parametrize(("nu", "above"), [(0.0, -0.01), (0.3, 0.08), (0.49, 0.03)])
def test_radiation_against_lambs_half_space_and_lysmers_analogue(nu, above):
    """Lysmer's is used. The dashpot of a contact of stiffness k is k^2 Im C/omega, C that of Lamb's point force.

    C = 1/(2 pi mu) int k k_s^2 a/R dk with a^2 = k^2 - k_p^2, b^2 = k^2 - k_s^2, R = (2 k^2 - k_s^2)^2 - 4 k^2 a b; its
    imaginary part is that of the body waves below k_s, and the residue of the Rayleigh wave at the root of R.
    """
    slow = math.sqrt((1 - 2 * nu) / (2 - 2 * nu))  # k_p/k_s

    def terms(k):
        a, b = (1j ** (k < limit) * math.sqrt(abs(k**2 - limit**2)) for limit in (slow, 1.0))
        return a, (2 * k**2 - 1) ** 2 - 4 * k**2 * a * b

    body = sum(quad(lambda k: (k * terms(k)[0] / terms(k)[1]).imag, *ends)[0] for ends in ((0, slow), (slow, 1)))
    k = brentq(lambda k: terms(k)[1].real, 1 + 1e-9, 1.5)
    derivative = (terms(k + 1e-6)[1] - terms(k - 1e-6)[1]).real / 2e-6
    surface = math.pi * abs(k * terms(k)[0] / derivative)
    loss = (abs(body) + surface) / (2 * math.pi)  # Im C mu/k_s
    E, density, stiffness, omega = 2.0, 3.0, 0.01, 0.6
    mu = 0.5 * E / (1 + nu)
    found = ref.radiation_loss(stiffness, omega, E=E, nu=nu, density=density)
    lamb = stiffness * loss / mu * omega / math.sqrt(mu / density)
    radius = (
        0.25 * stiffness * (1 - nu) / mu
    )  # of the disc of this stiffness, with the dashpot 3.4 a^2 sqrt(rho mu)/(1 - nu)
    lysmer = 3.4 * radius**2 * math.sqrt(density * mu) / (1 - nu) * omega / stiffness
    assert found == pytest.approx(lysmer, rel=1e-9) and lysmer / lamb - 1 == pytest.approx(above, abs=0.01)
