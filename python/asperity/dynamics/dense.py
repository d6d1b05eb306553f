# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

"""Dense rows along a branch, for files and figures.

Between two points the orbits follow the cubic through coefficients and tangents, the predictor of the continuation.
Rows are added until straight lines between them are accurate, in displacement at fixed frequency and in frequency
at fixed displacement. They are closer near folds and at the top of a resonance.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from asperity.arrays import Array
from asperity.dynamics.branch import Branch
from asperity.dynamics.continuation import hermite, value
from asperity.dynamics.harmonic_balance import Balance
from asperity.dynamics.stability import extrema, floquet

_RTOL = 3e-4  # relative error of a straight line between rows; the error of the cubic adds to it
_FLAT = (1e-9, 1e-4)  # relative changes of Omega and of u_max below which the other is not checked
_DEPTH = 12  # largest number of halvings of a segment
_NEUTRAL = 1e-4  # largest multipliers this close to 1 do not determine the stability next to the point


@dataclass(frozen=True)
class Line:
    """Rows along a branch, in order; arrays of shape (rows,) as in `Branch`.

    Attributes:
        phase: by which the displacement at the forcing frequency is ahead of the force (degrees), 0 to -180 in a
            linear contact
    """

    Omega: Array
    u_max: Array
    u_min: Array
    a1: Array
    phase: Array
    stable: NDArray[np.bool_]


def on_cubic(branch: Branch, place: Array) -> tuple[Array, Array]:
    """Omega (rows,) and complex coefficients (rows, K + 1) of the cubics at places along a branch.

    A place is the index of the point before it plus the fraction of the way to the next point.
    """
    i = np.minimum(place.astype(int), len(branch) - 2)
    y = np.column_stack([branch.Omega, branch.coefficients])
    t = np.column_stack([branch.tangent_omega, branch.tangent])
    chord = y[i + 1] - y[i]
    length = np.linalg.norm(chord, axis=1)[:, None]
    found = value(hermite(y[i], chord, length * t[i], length * t[i + 1]), (place - i)[:, None])
    return found[:, 0].real, found[:, 1:]


def dense(balance: Balance, branch: Branch, rtol: float = _RTOL) -> Line:
    """Compute rows along a branch, so close that straight lines between them deviate from the cubic by `rtol`."""
    places: Array = np.arange(len(branch), dtype=float)
    first = branch.coefficients[:, branch.order]
    values: Array = np.array([branch.Omega, branch.u_max, branch.u_min, branch.a1, _degrees(first)])
    done: NDArray[np.bool_] = np.zeros(len(branch) - 1, bool)
    for depth in range(_DEPTH):
        left = np.flatnonzero(~done)
        if not left.size:
            break
        middle = 0.5 * (places[left] + places[left + 1])
        between = _measured(branch, middle)
        # a cubic may cross its chord in the middle: the first halves are always kept
        off = (_deviation(values[:, left], values[:, left + 1], between) > rtol) | (depth == 0)
        done[left[~off]] = True
        done = np.insert(done, left[off], False)
        places = np.insert(places, left[off] + 1, middle[off])
        values = np.insert(values, left[off] + 1, between[:, off], axis=1)
    omega, u_max, u_min, a1, phase = values
    return Line(omega, u_max, u_min, a1, phase, _stability(balance, branch, places))


def _measured(branch: Branch, places: Array) -> Array:
    """Omega, u_max, u_min, a1 and phase (5, rows) of the cubics at the places."""
    omega, c = on_cubic(branch, places)
    u_min, u_max = extrema(c)
    return np.array([omega, u_max, u_min, np.abs(c[:, branch.order]), _degrees(c[:, branch.order])])


def _degrees(first: Array) -> Array:
    """Angle of complex first harmonics between -270 and 90 degrees, so that -180 is no edge."""
    return np.degrees((np.angle(first) + 1.5 * np.pi) % (2.0 * np.pi) - 1.5 * np.pi)


def _deviation(a: Array, b: Array, middle: Array) -> Array:
    """Relative distance of rows from the line between their neighbours, along u_max and Omega."""
    worst = np.zeros(middle.shape[1])
    for x, y, flat in ((0, 1, _FLAT[0]), (1, 0, _FLAT[1])):
        gap = b[x] - a[x]
        part = np.clip((middle[x] - a[x]) / np.where(gap == 0, np.inf, gap), 0.0, 1.0)
        off = np.abs(a[y] + part * (b[y] - a[y]) - middle[y]) / np.abs(middle[y])
        worst = np.maximum(worst, np.where(np.abs(gap) > flat * np.abs(middle[x]), off, 0.0))
    return worst


def _stability(balance: Balance, branch: Branch, places: Array) -> NDArray[np.bool_]:
    """Stability of the rows: it changes at points only, because special orbits are points."""
    if len(branch) == 1:
        return branch.stable
    neutral = np.abs(branch.radius - 1.0) < _NEUTRAL
    stable = branch.stable[:-1].copy()
    unclear = np.flatnonzero(neutral[:-1] | neutral[1:] | (branch.stable[:-1] != branch.stable[1:]))
    equations = replace(balance, order=branch.order)
    if unclear.size:
        omega, c = on_cubic(branch, unclear + 0.5)
        stable[unclear] = floquet(equations, c, omega).stable
    segment = np.minimum(places.astype(int), len(branch) - 2)
    at_point = places == np.round(places)
    return np.where(at_point, branch.stable[np.round(places).astype(int)], stable[segment])
