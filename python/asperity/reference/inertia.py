# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

"""Inertia that a quasi-static contact leaves out: first frequency of the block, damping by radiation."""

from __future__ import annotations

from math import pi, sqrt

LYSMER = 3.4  # of the dashpot c = 3.4 a^2 sqrt(rho mu)/(1 - nu) of a disc on a half-space


def first_frequency(modulus: float, density: float, height: float) -> float:
    """Return the first frequency of a block on a fixed base, sqrt(M/rho)/(4 h) (1/time): a quarter wave.

    Args:
        modulus: mean pressure over strain of the block (force/length^2).
        density: of the solid (mass/length^3).
        height: of the block (length).

    Examples:
        >>> round(asp.reference.first_frequency(modulus=200e9, density=8000.0, height=1e-3))
        1250000
    """
    return sqrt(modulus / density) / (4.0 * height)


def radiation_damping(stiffness: float, frequency: float, density: float, E: float, nu: float) -> float:
    """Return the damping ratio that the waves in a half-space below a vibrating contact give.

    Lysmer's analogue of a rigid disc of radius a: stiffness k = 4 mu a/(1 - nu), dashpot
    c = 3.4 a^2 sqrt(rho mu)/(1 - nu), damping ratio c omega/(2 k) (Lysmer & Richart, J. Soil Mech. Found. Div. ASCE 92
    (1966) 65; Richart, Hall & Woods, Vibrations of Soils and Foundations, 1970). Waves much longer than the contact
    know its force alone: a rough contact radiates as the disc of equal stiffness does, however many spots it has. Where
    they are not, this is an upper estimate. Lamb's point force has a dashpot that is smaller by 8 % at nu = 0.3 and
    equal within 1 % at nu = 0.

    Args:
        stiffness: k of the contact (force/length).
        frequency: of the vibration (1/time).
        density: of the solid (mass/length^3).
        E: Young's modulus (force/length^2).
        nu: Poisson's ratio.

    Examples:
        >>> f"{asp.reference.radiation_damping(stiffness=1e5, frequency=1e5, density=7800.0, E=200e9, nu=0.3):.2e}"
        '1.81e-08'
    """
    mu = 0.5 * E / (1.0 + nu)
    radius = 0.25 * stiffness * (1.0 - nu) / mu
    dashpot = LYSMER * radius**2 * sqrt(density * mu) / (1.0 - nu)
    return dashpot * pi * frequency / stiffness
