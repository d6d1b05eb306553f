# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

"""What the Newton solvers of the comparison programs share (hexahedra.py, sphere.py)."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from asperity.arrays import Floats


def without(values: Floats, *held: npt.NDArray[np.integer]) -> Floats:
    """Copy with zeros at the dofs that are held."""
    out = values.copy()
    for dofs in held:
        out[dofs] = 0.0
    return out


def step_length(first: float, slope: Callable[[float], float]) -> float:
    """Part of a Newton step after which the energy does not rise steeply along it.

    Args:
        first: slope of the energy along the step at its start
        slope: slope at a part of the step
    """
    length = 1.0
    while first < 0.0 and length > 0.1 and slope(length) >= -0.5 * first:
        length *= 0.6
    return length
