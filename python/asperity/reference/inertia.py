# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

"""Inertia that a quasi-static contact leaves out: first frequency of the block."""

from __future__ import annotations

from math import sqrt


def first_frequency(modulus: float, density: float, height: float) -> float:
    """First frequency of a block on a fixed base, sqrt(M/rho)/(4 h) (1/time): a quarter wave.

    Args:
        modulus: mean pressure over strain of the block (force/length^2)
        density: of the solid (mass/length^3)
        height: of the block (length)

    Examples:
        >>> round(asp.reference.first_frequency(modulus=200e9, density=8000.0, height=1e-3))
        1250000
    """
    return sqrt(modulus / density) / (4.0 * height)
