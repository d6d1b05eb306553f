"""Frequency response: pieces of the main branch in a window, its events, the jumps of slow sweeps, and its numbers."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import chain, groupby, pairwise
from typing import Any

import numpy as np

from asperity.arrays import Array
from asperity.errors import ConvergenceError, InputError
from asperity.runtime.display import short_repr
from asperity.vibration.branch import TESTS, ahead, between, crossings, cubic, located, main_branch
from asperity.vibration.equation import Equation
from asperity.vibration.law import Law, bar_of
from asperity.vibration.orbit import Collocation, Orbit

_PER_TOL = 0.3  # tolerance of the collocation over that of the orbits
_STRAIGHT = 1e-3  # relative error in the middle of u_max on a straight line between rows
_BEYOND = 1e-4  # relative distance beyond a fold at which the motion after a jump is sought
_STEPS, _CLOSE = 12, 1e-5  # towards a special orbit on another law, the last one
_CUTS = ("fold", "period doubling")  # events at which stability changes
OTHERS = (
    "the main branch alone: other motions may exist, of twice the forcing period from a period doubling on, or apart "
    "from the branch; simulate shows them"
)


def finite(value: float) -> float | None:
    """A number, None for NaN."""
    return float(value) if math.isfinite(value) else None


def _column(name: str, words: str) -> property:
    """Array of an attribute of the orbits of a piece."""
    return property(lambda self: np.array([getattr(o, name) for o in self.orbits]), doc=f"{words}, shape (orbits,).")


@dataclass(frozen=True)
class Piece:
    """A part of the main branch: between folds, changes of stability and ends of the window, in order along it.

    Attributes:
        number: in order along the branch, from 1
        orbits: in order; neighbouring pieces share the orbit at which they meet
        stable: linear stability
        valid: False where the law is unphysical (a Taylor law with u_min < -1)
    """

    number: int
    orbits: tuple[Orbit, ...]
    stable: bool
    valid: bool = field(repr=False)

    __repr__ = short_repr

    Omega = _column("Omega", "Forcing frequencies over omega_s")
    u_max = _column("u_max", "Largest displacements")
    u_min = _column("u_min", "Smallest displacements; contact is lost where they are below -1")


@dataclass(frozen=True)
class Event:
    """A special orbit: "fold", "period doubling" or "grazing" (u_min = -1), and the number of a piece that has it."""

    kind: str
    orbit: Orbit
    piece: int

    Omega = property(lambda self: self.orbit.Omega, doc="Forcing frequency over omega_s.")
    u_max = property(lambda self: self.orbit.u_max, doc="Largest displacement.")
    u_min = property(lambda self: self.orbit.u_min, doc="Smallest displacement.")


@dataclass(frozen=True)
class FrequencyResponse:
    """Main branch of a frequency response.

    Attributes:
        omega: lowest and highest Omega
        pieces, events: see `Piece`, `Event`
        tolerance: largest estimated error of an orbit
        notes: limits of the result (unphysical parts, ends of the branch, table limits), one sentence each
        col: equation of motion and its orbits

    Examples:
        >>> response = asp.ContactOscillator(asp.PowerLaw(1.5)).response(0.02, (0.85, 1.05), tol=1e-3)
        >>> len(response["fold"]), [piece.stable for piece in response.pieces]
        (2, [True, False, True])
        >>> [(round(orbit.u_max, 2), orbit.stable) for orbit in response.at(0.95)]
        [(0.21, True), (0.83, False), (0.87, True)]
    """

    omega: tuple[float, float]
    pieces: tuple[Piece, ...]
    events: tuple[Event, ...]
    tolerance: float
    notes: tuple[str, ...]
    col: Collocation = field(repr=False)

    __repr__ = short_repr

    @property
    def equation(self) -> Equation:
        """Equation of motion with its forcing."""
        return self.col.equation

    def __getitem__(self, kind: str) -> tuple[Event, ...]:
        """Events of one kind: "fold", "period doubling" or "grazing"."""
        return tuple(e for e in self.events if e.kind == kind)

    @property
    def valid(self) -> bool:
        """Whether every orbit is physical."""
        return all(piece.valid for piece in self.pieces)

    @cached_property
    def top(self) -> Orbit:
        """Orbit with the largest displacement."""
        return max((p for piece in self.pieces for p in piece.orbits), key=lambda p: p.u_max)

    @property
    def peak(self) -> tuple[float, float]:
        """Omega and u_max of the largest displacement."""
        return self.top.Omega, self.top.u_max

    @property
    def has_peak(self) -> bool:
        """Whether `peak` is inside the window, not at one of its ends."""
        return self.peak[0] not in self.omega

    def at(self, omega: float) -> tuple[Orbit, ...]:
        """All orbits of the branch at this Omega, lowest u_max first.

        Raises:
            ConvergenceError: the correction of an orbit fails
            InputError: omega lies outside the window
        """
        if not self.omega[0] <= omega <= self.omega[1]:
            raise InputError(f"Omega = {omega:g} lies outside the computed window {self.omega}")
        try:
            found = [p for piece in self.pieces for p in crossings(self.col, piece.orbits, omega)]
        except ConvergenceError as error:
            raise ConvergenceError(f"an orbit at Omega = {omega:g} fails: {error}; use a smaller tol") from error
        return tuple(sorted(found, key=lambda p: p.u_max))

    @cached_property
    def jumps(self) -> tuple[dict[str, Any], ...]:
        """Folds at which a stable piece ends, where a slow sweep "up" or "down" jumps.

        The mappings have the largest displacement before, `u_max`, and after the jump on the one other stable piece,
        `u_max_after`. Where there is none, or several, that is None, and `note` says why.
        """
        found = []
        stable = [piece for piece in self.pieces if piece.stable and piece.valid]
        ends = {piece.orbits[i]: piece.orbits[k] for piece in stable for i, k in ((0, 1), (-1, -2))}
        for fold in (e for e in self["fold"] if e.orbit in ends):
            up, after = ends[fold.orbit].Omega < fold.Omega, []
            try:
                beyond = self.at(fold.Omega * (1.0 + (_BEYOND if up else -_BEYOND)))
                after = [p.u_max for p in beyond if p.stable]
                note = ("not on the branch", "", "several stable orbits")[min(len(after), 2)]
            except (ConvergenceError, InputError) as error:
                note = "outside the window" if isinstance(error, InputError) else "not on the branch"
            found.append({
                "sweep": "up" if up else "down", "Omega": fold.Omega, "u_max": fold.u_max,
                "u_max_after": None if note else after[0], "note": note,
            })  # fmt: skip
        return tuple(found)

    def to_dict(self) -> dict[str, Any]:
        """Section of thresholds.json."""
        bars = [dict(zip(("Omega_bar", "u_max_bar"), map(finite, bar), strict=True)) for bar in self.bars]
        of_folds = dict(zip(self["fold"], bars[1:], strict=True))
        return {
            "F_hat": self.equation.F_hat,
            "zeta": self.equation.zeta,
            "peak": {"Omega": self.peak[0], "u_max": self.peak[1]} | bars[0],
            "events": [
                {"kind": e.kind, "Omega": e.Omega, "u_max": e.u_max, "u_min": e.u_min, "branch": e.piece}
                | of_folds.get(e, {})
                for e in self.events
            ],
            "tolerance": self.tolerance,
            "valid": self.valid,
            "notes": list(self.notes),
            "searched": OTHERS,
        }

    @cached_property
    def _table(self) -> list[dict[str, Any]]:
        equation, found = self.equation, []
        for piece in self.pieces:
            for p in chain(piece.orbits[:1], *(_dense(self.col, a, b) for a, b in pairwise(piece.orbits))):
                found.append({
                    "model": equation.model, "F_hat": equation.F_hat, "zeta": equation.zeta,
                    "Omega": p.Omega, "u_max": p.u_max, "u_min": p.u_min, "a1": p.a1, "stable": piece.stable,
                    "branch": piece.number, "contact_loss": p.u_min < -1.0, "phase": p.phase,
                    "transmissibility": equation.transmissibility(p.Omega, p.first),
                })  # fmt: skip
        return found

    def rows(self) -> Iterator[dict[str, Any]]:
        """Rows of response.csv, in order along each piece, so dense that straight lines are accurate to 2e-3."""
        return iter(self._table)

    @cached_property
    def bars(self) -> Array:
        """Bars of frequency over omega_s and largest u, of the peak and of each fold: by the sides of the law.

        Shape (1 + folds, 2), NaN where nothing bounds the law, or where a side has no peak or fold nearby.
        """
        return bar_of(self.equation.law, self.numbers)

    def numbers(self, law: Law) -> Array:
        """Frequency over omega_s and largest u of the peak and of each fold on another law, in units of this law.

        Shape (1 + folds, 2), under the same forces in newton on the same mass, or the same motion of the base.
        """
        own = self.equation
        other = Equation(law, own.load, own.zeta, own.damping, excitation=own.excitation)
        # a force, or mass times an acceleration, in newton; a displacement of the base, on which F^ is b Omega^2 / z_s
        part = own.z_s / other.z_s if own.excitation == "base" else own.scale / other.scale
        col = Collocation(replace(other, F_hat=part * own.F_hat), self.col.tol)
        tests = [(self.top, TESTS["largest u_max"]), *((e.orbit, TESTS["fold"]) for e in self["fold"])]
        slower = np.sqrt(other.scale / other.z_s * own.z_s / own.scale)
        return np.array([_moved(col, orbit, test) for orbit, test in tests]) * (slower, other.z_s / own.z_s)


def _moved(col: Collocation, orbit: Orbit, value: Callable[[Orbit], float]) -> tuple[float, float]:
    """Omega and u_max of the special orbit near that of another equation, by secants along the branch, or NaN."""
    h = 1e-3
    with suppress(ConvergenceError, ZeroDivisionError):
        a = col.correct(orbit)
        for _ in range(_STEPS):
            b = col.correct(ahead(a, h))
            if abs(h) < _CLOSE:
                return b.Omega, b.u_max
            a, h = b, float(np.clip(-value(b) * h / (value(b) - value(a)), -0.1, 0.1))
    return np.nan, np.nan


def frequency_response(equation: Equation, window: tuple[float, float], tol: float) -> FrequencyResponse:
    """Follow the main branch in a window; arguments and errors as in `ContactOscillator.response`."""
    col, (low, high) = Collocation(equation, _PER_TOL * tol), window
    paths, notes = main_branch(col, window)
    pieces: list[Piece] = []
    events: list[Event] = []
    for run in (run for path in paths for run in _inside(col, path, window)):
        orbits, named, missed = located(col, run)
        notes += missed
        cut = {p for name, p in named if name in _CUTS} | {p for p in orbits if p.Omega in window}
        ends = [0, *(i for i in range(1, len(orbits) - 1) if orbits[i] in cut), len(orbits) - 1]
        parts = (tuple(orbits[first : last + 1]) for first, last in pairwise(ends))
        for part in (part for part in parts if all(low <= p.Omega <= high for p in part)):
            middle = max(part, key=lambda p: abs(p.radius - 1.0)) if len(part) == 2 else part[len(part) // 2]
            valid = equation.contact or all(p.u_min >= -1.0 for p in part)
            pieces.append(Piece(len(pieces) + 1, part, middle.stable, valid))
        owners = [next((piece.number for piece in pieces if p in piece.orbits), None) for _, p in named]
        kinds = (*_CUTS, "grazing")
        events += [Event(*e, n) for e, n in zip(named, owners, strict=True) if n is not None and e[0] in kinds]
    if not pieces:
        raise ConvergenceError(f"no periodic orbit found for Omega = {low:g} to {high:g}: {'; '.join(notes)}")
    error = max(p.error for piece in pieces for p in piece.orbits)
    notes += _limitations(pieces, equation.known_to)
    return FrequencyResponse(window, tuple(pieces), tuple(events), error, tuple(notes), col)


def _inside(col: Collocation, path: Sequence[Orbit], window: tuple[float, float]) -> Iterator[list[Orbit]]:
    """Runs of a path in the window, with orbits exactly at its ends, beyond which it may turn between neighbours."""
    cut = list(path[:1])
    for a, b in pairwise(path):
        passed: list[Orbit] = []
        for edge in window:
            with suppress(ConvergenceError):  # the cubic passes it, the branch turns before
                passed += [] if edge in (a.Omega, b.Omega) else crossings(col, (a, b), edge)
        cut += [*sorted(passed, key=lambda p: abs(p.Omega - a.Omega)), b]
    runs = (list(run) for near, run in groupby(cut, lambda p: window[0] <= p.Omega <= window[1]) if near)
    return (run for run in runs if len(run) > 1)


def _dense(col: Collocation, a: Orbit, b: Orbit) -> Iterator[Orbit]:
    """Orbits after one up to the next, so dense that u_max and Omega lie on straight lines."""
    middle, step = cubic(a, b, 0.5), b.Omega - a.Omega
    line = a.u_max + (b.u_max - a.u_max) * np.clip((middle.Omega - a.Omega) / (step or 1.0), 0.0, 1.0)
    count = math.ceil(math.sqrt(abs(line - middle.u_max) / (_STRAIGHT * abs(middle.u_max))))
    for i in range(1, count):
        with suppress(ConvergenceError):
            yield between(col, a, b, i / count)
    yield b


def _limitations(pieces: Sequence[Piece], known_to: float) -> Iterator[str]:
    """Notes on orbits beyond the points of the law, and unphysical orbits."""
    top, known = max(float(piece.u_max.max()) for piece in pieces), round(known_to, 9)
    if known < top:
        yield (
            f"the response reaches u = {top:.4g}, the curve that the law was fitted to ends at u = "
            f"{max(known, 0.0):.4g}: beyond it the law is extrapolated, and a contact that has yielded yields again; "
            "lower the forcing, or compute the curve further"
        )
    if not all(piece.valid for piece in pieces):
        yield "the Taylor law is unphysical where u_min < -1: contact is lost there"
