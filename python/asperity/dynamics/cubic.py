"""Hermite cubics over [0, 1]: between points of a branch, and between times."""

from __future__ import annotations

from typing import Any

import numpy as np

from asperity.arrays import Array


def hermite(start: Any, chord: Any, out: Any, into: Any) -> Array:
    """Coefficients (4, ...), lowest first, of the cubic over [0, 1] with the given slopes at its ends."""
    return np.array([start, out, 3.0 * chord - 2.0 * out - into, out + into - 2.0 * chord])


def value(cubic: Array, s: Any) -> Array:
    """Value of a cubic at the fraction s."""
    return np.asarray(cubic[0] + s * (cubic[1] + s * (cubic[2] + s * cubic[3])))
