"""Inertia of the solid: first frequency of the block, and what a contact that vibrates radiates into a half-space."""

from __future__ import annotations

import math

LONG_WAVES = 0.3  # greatest side of a patch over the length of shear waves for which it counts as a point


def first_frequency(modulus: float, density: float, height: float) -> float:
    """First frequency of a block of modulus M (pressure over strain) on a fixed base, sqrt(M/rho)/(4 h) [1/time]."""
    return math.sqrt(modulus / density) / (4.0 * height)


def radiation_compliance(nu: float) -> tuple[float, float]:
    """(imaginary part of u/F times G c_s/omega, share of Rayleigh's wave in the power) of a half-space.

    A harmonic normal force of low frequency on a patch far smaller than the waves moves it with a part in quadrature
    that is that of a point force, whatever the pressure: the integral of Lamb's problem over the waves that travel, and
    the residue of Rayleigh's. It is positive for waves that leave; c_s is the speed of shear waves. Miller & Pursey,
    Proc. R. Soc. Lond. A 223 (1954) 521 and 233 (1955) 55. Lysmer's analogue of a disc (Lysmer & Richart, J. Soil Mech.
    Found. Div. ASCE 92 (1966) 65), damping 0.85 K a/c_s, means 0.2125 (1 - nu).

    Examples:
        >>> value, rayleigh = asp.reference.radiation_compliance(0.25)
        >>> round(value, 4), round(0.2125 * (1 - 0.25), 4), round(rayleigh, 3)
        (0.1481, 0.1594, 0.674)
    """
    from scipy.integrate import quad
    from scipy.optimize import brentq

    gamma = math.sqrt((1.0 - 2.0 * nu) / (2.0 - 2.0 * nu))  # slowness of pressure over that of shear waves

    def both(x: float) -> float:
        one, two = math.sqrt(gamma**2 - x**2), math.sqrt(1.0 - x**2)
        return x * one / ((2.0 * x**2 - 1.0) ** 2 + 4.0 * x**2 * one * two)

    def shear(x: float) -> float:
        one, two = math.sqrt(x**2 - gamma**2), math.sqrt(1.0 - x**2)
        return 4.0 * x**3 * one**2 * two / ((2.0 * x**2 - 1.0) ** 4 + 16.0 * x**4 * one**2 * two**2)

    def secular(x: float) -> float:
        return (2.0 * x**2 - 1.0) ** 2 - 4.0 * x**2 * math.sqrt(x**2 - gamma**2) * math.sqrt(x**2 - 1.0)

    x = brentq(secular, 1.0, 2.0, xtol=1e-14)
    one, two = math.sqrt(x**2 - gamma**2), math.sqrt(x**2 - 1.0)
    slope = 8.0 * x * (2.0 * x**2 - 1.0) - 8.0 * x * one * two - 4.0 * x**3 * (two / one + one / two)
    surface = math.pi * x * one / abs(slope)
    body = quad(both, 0.0, gamma)[0] + quad(shear, gamma, 1.0)[0]
    return (surface + body) / (2.0 * math.pi), surface / (surface + body)


def radiation_loss(k: float, omega: float, *, E: float, nu: float, density: float) -> float:
    """Loss factor of a contact of stiffness k by radiation into a half-space, twice the damping ratio at resonance.

    Valid while the waves at the angular frequency omega are far longer than the patch.
    """
    shear_modulus = 0.5 * E / (1.0 + nu)
    speed = math.sqrt(shear_modulus / density)
    return k * omega * radiation_compliance(nu)[0] / (shear_modulus * speed)
