"""Branches of periodic orbits with their extremes, stability and events, and dense rows along them.

Between two points the orbits follow the cubic through coefficients and tangents, the predictor of the continuation.
Rows are added until straight lines between them are accurate, in displacement at fixed frequency and in frequency
at fixed displacement. They are closer near folds and at the top of a resonance.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from asperity.arrays import Array
from asperity.dynamics.continuation import Point, hermite, value
from asperity.dynamics.harmonic_balance import Balance
from asperity.dynamics.stability import Floquet, extrema, floquet, stack, state_at_phase_zero
from asperity.runtime.display import short_repr

_ROUND_OFF = 1e-15  # relative round-off of the contact force
_RTOL = 3e-4  # relative error of a straight line between rows; the error of the cubic adds to it
_FLAT = (1e-9, 1e-4)  # relative changes of Omega and of u_max below which the other is not checked
_DEPTH = 12  # largest number of halvings of a segment
_NEUTRAL = 1e-4  # largest multipliers this close to 1 do not determine the stability next to the point


@dataclass(frozen=True)
class Event:
    """Special orbit on a branch: "fold", "period doubling" or "grazing" (u_min = -1).

    Attributes:
        kind: one of the three
        branch: index of its branch in the response
        Omega: forcing frequency over omega_s
        u_max, u_min: extreme displacements
        a1: amplitude at the forcing frequency
    """

    kind: str
    branch: int
    Omega: float
    u_max: float
    u_min: float
    a1: float

    __repr__ = short_repr


@dataclass(frozen=True)
class Branch:
    """Periodic orbits in order along a branch (arrays of shape (points,)).

    Attributes:
        kind: "main", "sub2" (of period 2, from a period doubling) or "detached"
        order: forcing periods per period of the orbit
        Omega: forcing frequency over omega_s
        u_max, u_min: extreme displacements; contact is lost where u_min < -1
        a1: amplitude at the forcing frequency
        stable: linear stability
        radius: largest modulus of a Floquet multiplier
        error: estimate of the truncation error, or of the round-off error if larger, relative to the amplitude
        det_error: deviation of the monodromy determinant from Liouville's; 1 where the stability is unreliable
        coefficients: complex Fourier coefficients (points, K + 1) in the angle Omega tau / order
        valid: False where the law is unphysical (a Taylor law with u_min < -1)
        points: points of the continuation, with their tangents
        end: reason why the branch ends
    """

    kind: str
    order: int
    Omega: Array
    u_max: Array
    u_min: Array
    a1: Array
    stable: Array
    radius: Array
    error: Array
    det_error: Array
    coefficients: Array
    valid: Array
    points: tuple[Point, ...]
    end: str

    __repr__ = short_repr

    def __len__(self) -> int:
        return self.Omega.size


@dataclass(frozen=True)
class Solution:
    """One periodic orbit at a given frequency; attributes as in `Branch`."""

    branch: int
    kind: str
    order: int
    Omega: float
    u_max: float
    u_min: float
    a1: float
    stable: bool
    error: float
    coefficients: Array

    __repr__ = short_repr

    @property
    def start(self) -> tuple[float, float]:
        """State (u, v) at forcing phase 0, for `ContactOscillator.simulate`."""
        return state_at_phase_zero(self.coefficients, self.Omega, self.order)


def measure(balance: Balance, points: Sequence[Point], kind: str, end: str, f: Floquet) -> Branch:
    """Compute extremes and errors of the corrected points of a branch, with their Floquet data."""
    c = stack([p.x for p in points])
    omega = np.array([p.parameter for p in points])
    u_min, u_max = extrema(c)
    round_off = _ROUND_OFF / (balance.restoring.n_loc * 0.5 * (u_max - u_min))
    valid = np.ones(omega.size, bool) if balance.restoring.contact else u_min >= -1.0
    return Branch(
        kind, balance.order, omega, u_max, u_min, np.abs(c[:, balance.order]), f.stable, f.radius,
        np.maximum([p.error for p in points], round_off), f.error, c, valid, tuple(points), end,
    )  # fmt: skip


@dataclass(frozen=True)
class Line:
    """Dense rows along a branch as in `Branch`, with the phase of u over the force at the forcing frequency (degrees).

    The phase is 0 to -180 in a linear contact.
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
    t = np.column_stack([[p.t_parameter for p in branch.points], stack([p.t for p in branch.points])])
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
