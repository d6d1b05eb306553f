# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

"""Branches of periodic orbits with their extremes, stability and events."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

from asperity.arrays import Array
from asperity.dynamics.continuation import Point
from asperity.dynamics.harmonic_balance import Balance
from asperity.dynamics.law.law import EXTRAPOLATE
from asperity.dynamics.stability import Floquet, extrema, stack, state_at_phase_zero, unstack
from asperity.runtime.display import short_repr

_ROUND_OFF = 1e-15  # relative round-off of the contact force


@dataclass(frozen=True)
class Event:
    """Special orbit on a branch: "fold", "period doubling" or "grazing" (u_min = -1).

    Attributes:
        kind: one of the three
        branch: index of its branch in the response
        Omega: forcing frequency over omega_s
        u_max, u_min: extreme displacements
        a1: amplitude at the forcing frequency

    Examples:
        >>> response = asp.ContactOscillator(asp.PowerLaw(1.5)).response(0.02, (0.85, 1.05), tol=1e-3)
        >>> [(event.kind, round(event.Omega, 3)) for event in response.events]
        [('grazing', 0.958), ('fold', 0.926), ('grazing', 0.948), ('fold', 0.971)]
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
        kind: "main", "sub2" or "sub4" (of period 2 or 4, from a period doubling) or "detached"
        order: forcing periods per period of the orbit
        Omega: forcing frequency over omega_s
        u_max, u_min: extreme displacements; contact is lost where u_min < -1
        a1: amplitude at the forcing frequency
        stable: linear stability
        radius: largest modulus of a Floquet multiplier
        error: estimate of the truncation error, or of the round-off error if larger, relative to the amplitude
        det_error: deviation of the monodromy determinant from Liouville's; 1 where the stability is unreliable
        harmonics: number of harmonics at each point
        coefficients: complex Fourier coefficients (points, K + 1) in the angle Omega tau / order
        tangent: derivative of the coefficients along the branch (points, K + 1)
        tangent_omega: derivative of Omega along the branch; with `tangent` it has length 1
        valid: False where the law is unphysical (a Taylor law with u_min < -1)
        end: reason why the branch ends

    Examples:
        >>> response = asp.ContactOscillator(asp.PowerLaw(1.5), zeta=0.1).response(0.01, (0.9, 1.1), tol=1e-3)
        >>> branch = response.branches[0]
        >>> branch.kind, branch.end, bool(branch.stable.all())
        ('main', 'window', True)
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
    harmonics: Array
    coefficients: Array
    tangent: Array
    tangent_omega: Array
    valid: Array
    end: str

    __repr__ = short_repr

    def __len__(self) -> int:
        return self.Omega.size

    def points(self) -> Iterator[Point]:
        """Points of the continuation."""
        for i, count in enumerate(self.harmonics):
            x, t = (unstack(c[i], int(count)) for c in (self.coefficients, self.tangent))
            yield Point(x, float(self.Omega[i]), t, float(self.tangent_omega[i]), float(self.error[i]))

    @property
    def contact_loss(self) -> Array:
        """Whether each orbit leaves contact (for a Taylor law: passes u = -1)."""
        return self.u_min < -1.0


@dataclass(frozen=True)
class Solution:
    """One periodic orbit at a given frequency; attributes as in `Branch`.

    Examples:
        >>> oscillator = asp.ContactOscillator(asp.PowerLaw(1.5), zeta=0.1)
        >>> (orbit,) = oscillator.response(0.01, (0.9, 1.1), tol=1e-3).at(1.0)
        >>> orbit.kind, orbit.stable, round(orbit.u_max, 3)
        ('main', True, 0.05)
    """

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
        np.maximum([p.error for p in points], round_off), f.error, np.array([p.x.size // 2 for p in points]),
        c, stack([p.t for p in points]), np.array([p.t_parameter for p in points]), valid, end,
    )  # fmt: skip


def within_law(
    balance: Balance, branches: list[Branch], events: list[Event]
) -> tuple[list[Branch], list[Event], list[str]]:
    """Cut the branches where the orbit leaves the range of the law.

    Returns:
        The remaining branches, their events, and notes on the cuts

    Raises:
        RangeError: no part of any branch lies within the law
    """
    low, high = balance.restoring.u_range
    if np.isinf(low) and np.isinf(high):
        return branches, events, []
    kept: list[Branch] = []
    renumber: dict[int, list[int]] = {}
    notes = []
    for number, b in enumerate(branches):
        inside = (b.u_max <= high) & (b.u_min >= low)
        if inside.all():
            pieces = [slice(0, len(b))]
        else:
            notes.append(
                f"branch {number} ({b.kind}) is cut where it leaves the law (known up to u = "
                f"{high:.6g}); compute the curve further, or {EXTRAPOLATE}"
            )
            edges = np.flatnonzero(np.diff(np.concatenate([[False], inside, [False]]).astype(int)))
            pieces = [slice(int(a), int(e)) for a, e in edges.reshape(-1, 2) if e - a > 1]
        renumber[number] = list(range(len(kept), len(kept) + len(pieces)))
        for piece in pieces:
            columns = {f.name: getattr(b, f.name) for f in fields(b)}
            arrays: dict[str, Any] = {
                name: column[piece] for name, column in columns.items() if isinstance(column, np.ndarray)
            }
            kept.append(replace(b, **arrays, end=b.end if inside.all() else "range of the law"))
    if not kept:
        balance.restoring.check_range(
            min(float(b.u_min.min()) for b in branches), max(float(b.u_max.max()) for b in branches)
        )
    moved = []
    for e in events:
        if low <= e.u_min and e.u_max <= high:
            for new in renumber[e.branch]:
                if kept[new].Omega.size and np.isclose(kept[new].Omega, e.Omega, rtol=1e-12).any():
                    moved.append(replace(e, branch=new))
    return kept, moved, notes
