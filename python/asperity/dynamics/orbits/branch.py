"""A branch of periodic orbits, measured point by point, and its special orbits."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from asperity.dynamics.law.law import Array
from asperity.dynamics.motion.shooting import state_at_phase_zero
from asperity.dynamics.orbits.continuation import Point
from asperity.dynamics.orbits.harmonic_balance import Balance
from asperity.dynamics.orbits.stability import Floquet, extrema, floquet, stack

_ROUND_OFF = 1e-15  # of the contact force


@dataclass(frozen=True)
class Event:
    """A special orbit on a branch: "fold", "period doubling" or "grazing" (u_min = -1)."""

    kind: str
    branch: int
    Omega: float
    u_max: float
    u_min: float
    a1: float


@dataclass(frozen=True)
class Branch:
    """Periodic orbits in order along a branch (arrays of shape (points,)).

    Attributes:
        kind: "main", "sub2" (grown from a period doubling) or "detached".
        order: periods of the forcing per period of the orbit.
        Omega: forcing frequency over omega_s.
        u_max, u_min: extreme deflections; contact is lost where u_min < -1.
        a1: amplitude of the harmonic at the forcing frequency.
        stable: linear stability.
        radius: largest modulus of a Floquet multiplier.
        error: truncation estimate, or what the round-off of the force leaves, relative to the amplitude.
        det_error: deviation of the monodromy determinant from Liouville's; 1 where the stability is a guess.
        harmonics: harmonics in use at each point.
        coefficients: complex Fourier coefficients (points, K + 1) in the angle Omega tau / order.
        valid: False where the law means nothing physically (a Taylor law with u_min < -1).
        end: why the branch ends.
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
    valid: Array
    end: str

    def __len__(self) -> int:
        return self.Omega.size

    @property
    def contact_loss(self) -> Array:
        """Whether the orbit leaves contact (for a Taylor law: passes u = -1)."""
        return self.u_min < -1.0


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

    @property
    def start(self) -> tuple[float, float]:
        """(u, v) at forcing phase 0, to hand to `ContactOscillator.simulate`."""
        return state_at_phase_zero(self.coefficients, self.Omega, self.order)


def measure(
    balance: Balance, points: Sequence[Point], kind: str, end: str, multipliers: Floquet | None = None
) -> Branch:
    c = stack([p.x for p in points])
    omega = np.array([p.parameter for p in points])
    u_min, u_max = extrema(c)
    f = multipliers or floquet(balance, c, omega)
    round_off = _ROUND_OFF / (balance.restoring.n_loc * 0.5 * (u_max - u_min))
    valid = np.ones(omega.size, bool) if balance.restoring.contact else u_min >= -1.0
    return Branch(
        kind,
        balance.order,
        omega,
        u_max,
        u_min,
        np.abs(c[:, balance.order]),
        f.stable,
        f.radius,
        np.maximum([p.error for p in points], round_off),
        f.error,
        np.array([p.x.size // 2 for p in points]),
        c,
        valid,
        end,
    )


def within_law(
    balance: Balance, branches: list[Branch], events: list[Event]
) -> tuple[list[Branch], list[Event], list[str]]:
    """Cut the branches where the orbit leaves the range the law is known on."""
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
                f"{high:.6g}); compute the curve further or ask for extrapolate=True"
            )
            edges = np.flatnonzero(np.diff(np.concatenate([[False], inside, [False]]).astype(int)))
            pieces = [slice(int(a), int(e)) for a, e in edges.reshape(-1, 2) if e - a > 1]
        renumber[number] = list(range(len(kept), len(kept) + len(pieces)))
        for piece in pieces:
            arrays = {
                name: getattr(b, name)[piece]
                for name in (
                    "Omega",
                    "u_max",
                    "u_min",
                    "a1",
                    "stable",
                    "radius",
                    "error",
                    "det_error",
                    "harmonics",
                    "coefficients",
                    "valid",
                )
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
