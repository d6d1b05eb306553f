"""Frequency response: pieces of the main branch in a window, its events, the jumps of slow sweeps, and its numbers."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from functools import cached_property, partial
from itertools import pairwise
from typing import Any

import numpy as np

from asperity.arrays import Array
from asperity.errors import ConvergenceError, InputError
from asperity.runtime.display import short_repr
from asperity.vibration.branch import EVENTS, ahead, between, crossings, cubic, located, main_branch
from asperity.vibration.equation import Equation
from asperity.vibration.orbit import Collocation, Orbit
from asperity.vibration.settings import Setting

_PER_TOL = 0.3  # tolerance of the collocation over that of the orbits
_STRAIGHT = 5e-4  # relative error of u_max on a straight line between rows
_BEYOND = 1e-4  # relative distance beyond a fold at which the motion after a jump is sought
_STEPS = 12  # towards a special orbit on another law
_TOP = "largest u_max"  # a special orbit, but no event
OTHERS = (
    "the main branch alone: other motions may exist, of twice the forcing period from a period doubling on, or apart "
    "from the branch; simulate shows them"
)


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

    @property
    def Omega(self) -> Array:
        """Forcing frequencies over omega_s, shape (orbits,)."""
        return np.array([p.Omega for p in self.orbits])

    @property
    def u_max(self) -> Array:
        """Largest displacements, shape (orbits,)."""
        return np.array([p.u_max for p in self.orbits])

    @property
    def u_min(self) -> Array:
        """Smallest displacements; contact is lost where they are below -1, shape (orbits,)."""
        return np.array([p.u_min for p in self.orbits])


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
class Jump:
    """Where a slow sweep leaves the branch at a fold.

    Attributes:
        Omega: frequency of the fold
        direction: "up" or "down", of the sweep
        u_max: largest displacement before
        after: largest displacement after the jump, on the one other stable piece; None where there is none, or several
        note: why it is None, else ""
    """

    Omega: float
    direction: str
    u_max: float
    after: float | None
    note: str


@dataclass(frozen=True)
class FrequencyResponse:
    """Main branch of a frequency response.

    Attributes:
        setting: law, damping and forcing
        omega: lowest and highest Omega
        pieces, events: see `Piece`, `Event`
        tolerance: largest estimated error of an orbit
        notes: limits of the result (unphysical parts, ends of the branch, table limits), one sentence each
        paths: the branch in and beyond the window
        col: its equations

    Examples:
        >>> response = asp.ContactOscillator(asp.PowerLaw(1.5)).response(0.02, (0.85, 1.05), tol=1e-3)
        >>> len(response["fold"]), [piece.stable for piece in response.pieces]
        (2, [True, False, True])
        >>> [(round(orbit.u_max, 2), orbit.stable) for orbit in response.at(0.95)]
        [(0.21, True), (0.83, False), (0.87, True)]
    """

    setting: Setting
    omega: tuple[float, float]
    pieces: tuple[Piece, ...]
    events: tuple[Event, ...]
    tolerance: float
    notes: tuple[str, ...]
    paths: tuple[tuple[Orbit, ...], ...] = field(repr=False)
    col: Collocation = field(repr=False)

    __repr__ = short_repr

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
            found = [p for path in self.paths for p in crossings(self.col, path, omega)]
        except ConvergenceError as error:
            raise ConvergenceError(
                f"an orbit at Omega = {omega:g} could not be corrected: {error}; use a smaller tol"
            ) from error
        return tuple(sorted(found, key=lambda p: p.u_max))

    @cached_property
    def jumps(self) -> tuple[Jump, ...]:
        """Folds at which a stable piece ends, where a slow sweep jumps."""
        found = []
        ends = [(piece.orbits[i], piece.orbits[k]) for piece in self.pieces if piece.stable and piece.valid
                for i, k in ((0, 1), (-1, -2))]  # fmt: skip
        for fold, before in ((e, q) for e in self["fold"] for p, q in ends if p is e.orbit):
            up = before.Omega < fold.Omega
            beyond = fold.Omega * (1.0 + (_BEYOND if up else -_BEYOND))
            after: list[float] = []
            try:
                after = [p.u_max for p in self.at(beyond) if p.stable]
                note = "" if len(after) == 1 else "several stable orbits" if after else "not on the branch"
            except InputError:
                note = "outside the window"
            except ConvergenceError:
                note = "not on the branch"
            found.append(Jump(fold.Omega, "up" if up else "down", fold.u_max, None if note else after[0], note))
        return tuple(found)

    def to_dict(self) -> dict[str, Any]:
        """Section of thresholds.json."""
        return {
            "F_hat": self.setting.F_hat,
            "F_over_mg": self.setting.F_over_mg,
            "peak": dict(zip(("Omega", "u_max"), self.peak, strict=True)),
            "events": [
                {"kind": e.kind, "Omega": e.Omega, "u_max": e.u_max, "u_min": e.u_min, "branch": e.piece}
                for e in self.events
            ],
            "tolerance": self.tolerance,
            "valid": self.valid,
            "notes": list(self.notes),
            "searched": OTHERS,
        }

    def rows(self) -> Iterator[dict[str, Any]]:
        """Rows of response.csv, in order along each piece, so dense that straight lines are accurate to 1e-3."""
        for piece in self.pieces:
            for p in (piece.orbits[0], *(p for a, b in pairwise(piece.orbits) for p in _dense(self.col, a, b))):
                yield self.setting.row(piece.number, p.Omega, p.u_max, p.u_min, p.a1, piece.stable, p.phase)

    def numbers(self, equation: Equation) -> Array:
        """Numbers of the peak and of each fold on another law under the same force and mass.

        Args:
            equation: of the other law, with a load as heavy; the forcing is as large in the units of the law

        Returns:
            Frequency over omega_s and largest u of the peak and of each fold, in units of this law (1 + folds, 2), NaN
            where the other law has none nearby.
        """
        own, other = self.col.equation.restoring, equation.restoring
        slower = np.sqrt(other.scale / other.z_s * own.z_s / own.scale)
        setting = self.setting
        # a force, or mass times an acceleration, in newton; a displacement of the base, on which F^ is b Omega^2 / z_s
        part = own.z_s / other.z_s if setting.excitation == "base" else own.scale / other.scale
        col = Collocation(equation, partial(_excited, setting, part), self.col.tol)
        tests = [(self.top, lambda p: p.rise)] + [(e.orbit, lambda p: p.rate) for e in self["fold"]]
        scale = np.array([slower, other.z_s / own.z_s])
        return np.array([scale * _moved(col, orbit, test) for orbit, test in tests])


def _excited(setting: Setting, part: float, omega: Any) -> tuple[Any, Any]:
    """Forcing in the units of a law and its derivative by Omega; a function of the module, so that results are sent."""
    return part * setting.forcing(omega), part * setting.growth(omega)


def _moved(col: Collocation, orbit: Orbit, value: Any) -> Array:
    """Omega and u_max of the special orbit near that of another equation, by secants along the branch, or NaN."""
    try:
        a = col.correct(orbit.wave, orbit.Omega, orbit.rate)
        h, fa = 1e-3, value(a)
        for _ in range(_STEPS):
            b = col.correct(*ahead(a, h))
            fb, last = value(b), h
            h = float(np.clip(-fb * h / (fb - fa), -0.1, 0.1))
            a, fa = b, fb
            if abs(last) < 1e-5:
                return np.array([a.Omega, a.u_max])
    except (ConvergenceError, ZeroDivisionError):
        pass
    return np.full(2, np.nan)


def frequency_response(
    equation: Equation, setting: Setting, window: tuple[float, float], tol: float
) -> FrequencyResponse:
    """Follow the main branch in a window; arguments and errors as in `ContactOscillator.response`."""
    col, low, high = Collocation(equation, partial(_excited, setting, 1.0), _PER_TOL * tol), *window
    paths, notes = main_branch(col, window)
    pieces: list[Piece] = []
    events: dict[int, Event] = {}
    contact = equation.restoring.contact
    for run in (run for path in paths for run in _inside(col, path, window)):
        orbits, named, missed = located(col, run, EVENTS | {_TOP: lambda p: p.rise})
        notes += missed
        cut = {id(p) for name, p in named if name in ("fold", "period doubling")}
        ends = [0, *(i for i in range(1, len(orbits) - 1) if id(orbits[i]) in cut), len(orbits) - 1]
        for first, last in pairwise(ends):
            part = tuple(orbits[first : last + 1])
            middle = max(part, key=lambda p: abs(p.radius - 1.0)) if len(part) == 2 else part[len(part) // 2]
            valid = contact or all(p.u_min >= -1.0 for p in part)
            pieces.append(Piece(len(pieces) + 1, part, middle.stable, valid))
            owned = {id(p) for p in part}
            for name, p in named:
                if id(p) in owned and name != _TOP:
                    events.setdefault(id(p), Event(name, p, len(pieces)))
    if not pieces:
        raise ConvergenceError(f"no periodic orbit found for Omega = {low:g} to {high:g}: {'; '.join(notes)}")
    error = max(p.error for piece in pieces for p in piece.orbits)
    notes += _limitations(pieces, equation.restoring.known_to)
    return FrequencyResponse(
        setting, window, tuple(pieces), tuple(events.values()), error, tuple(notes), tuple(map(tuple, paths)), col
    )


def _inside(col: Collocation, path: Sequence[Orbit], window: tuple[float, float]) -> Iterator[list[Orbit]]:
    """Runs of a path in the window, with orbits exactly at its ends."""
    run = [p for p in path[:1] if window[0] <= p.Omega <= window[1]]
    for a, b in pairwise(path):
        passed = [p for edge in window for p in crossings(col, (a, b), edge)]
        for p in sorted(passed, key=lambda p: abs(p.Omega - a.Omega)):
            run.append(p)
            if len(run) > 1:
                yield run
                run = []
        if run:
            run.append(b)
    if len(run) > 1:
        yield run


def _dense(col: Collocation, a: Orbit, b: Orbit) -> Iterator[Orbit]:
    """Orbits after one up to the next, so dense that u_max and Omega lie on straight lines."""
    wave, omega, _ = cubic(a, b, 0.5)
    step, top = b.Omega - a.Omega, float(wave.samples[1].max())
    line = a.u_max + (b.u_max - a.u_max) * np.clip((omega - a.Omega) / (step or 1.0), 0.0, 1.0)
    count = math.ceil(math.sqrt(abs(line - top) / (_STRAIGHT * abs(top))))
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
