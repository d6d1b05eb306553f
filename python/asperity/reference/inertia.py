# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

"""Inertia that a quasi-static contact leaves out: first frequency of the block."""

from __future__ import annotations

from math import sqrt


def first_frequency(modulus: float, density: float, height: float) -> float:
    """First frequency of a block of modulus M (pressure over strain) on a fixed base, sqrt(M/rho)/(4 h) [1/time]."""
    return sqrt(modulus / density) / (4.0 * height)
