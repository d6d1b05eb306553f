"""Frequency response: all periodic orbits under harmonic forcing in a window of frequencies."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

from asperity.dynamics.branch import Branch, Solution, dense, distance
from asperity.dynamics.equation import Equation
from asperity.dynamics.orbits import Orbits
from asperity.dynamics.search import Search
from asperity.vibration.settings import Setting
from asperity.errors import ConvergenceError, InputError
from asperity.runtime.display import short_repr

_SAME = 1e-6  # relative distance, in addition to their errors, within which two orbits may be identical
_UNRELIABLE = 1e-3  # deviation of the determinant from Liouville's above which stability is unreliable


@dataclass(frozen=True)
class FrequencyResponse:
    """Branches, events and accuracy of a frequency response.

    Attributes:
        setting: law, damping and forcing
        omega: lowest and highest Omega
        branches, events: see `Branch`, `Solution`
        tolerance: largest error of an orbit, relative to its amplitude
        det_error: largest deviation from Liouville's determinant
        valid: whether every orbit is physical
        notes: limits of the result (unphysical parts, ends of branches, table limits), one sentence each
        searched: which orbits were searched and which were not, one sentence
        orbits: their equations

    Examples:
        >>> response = asp.ContactOscillator(asp.PowerLaw(1.5)).response(0.02, (0.85, 1.05), tol=1e-3)
        >>> len(response["fold"])
        2
        >>> [(round(orbit.u_max, 2), orbit.stable) for orbit in response.at(0.95)]
        [(0.21, True), (0.83, False), (0.87, True)]
    """

    setting: Setting
    omega: tuple[float, float]
    branches: tuple[Branch, ...]
    events: tuple[Solution, ...]
    tolerance: float
    det_error: float
    valid: bool
    notes: tuple[str, ...]
    searched: str
    orbits: Orbits = field(repr=False)

    __repr__ = short_repr

    def __getitem__(self, kind: str) -> tuple[Solution, ...]:
        """Events of one kind: "fold", "period doubling" or "grazing"."""
        return tuple(e for e in self.events if e.kind == kind)

    @property
    def peak(self) -> tuple[float, float]:
        """Omega and u_max of the largest displacement on any branch."""
        top, omega = max((float(b.u_max.max()), float(b.Omega[b.u_max.argmax()])) for b in self.branches)
        return omega, top

    def at(self, omega: float) -> tuple[Solution, ...]:
        """All orbits of the branches at this Omega, lowest u_max first.

        Raises:
            ConvergenceError: the correction of an orbit fails
            InputError: omega lies outside the window
        """
        if not self.omega[0] <= omega <= self.omega[1]:
            raise InputError(f"Omega = {omega:g} lies outside the computed window {self.omega}")
        found: list[Solution] = []
        for number, branch in enumerate(self.branches):
            try:
                points = list(self.orbits.crossings(branch.points, omega))
            except ConvergenceError as error:
                raise ConvergenceError(
                    f"an orbit at Omega = {omega:g} on branch {number} ({branch.kind}) could not be corrected: "
                    f"{error}; use a smaller tol"
                ) from error
            for p in points:
                # the sense differs on the two sides of a fold, however close
                if not any(
                    (p.fold > 0) == (q.fold > 0)
                    and distance(p, q) < (_SAME + 10.0 * max(p.error, q.error)) * p.amplitude
                    for q in found
                ):
                    found.append(Solution.at(branch.kind, number, p))
        return tuple(sorted(found, key=lambda s: s.u_max))

    @property
    def has_peak(self) -> bool:
        """Whether `peak` is inside the window, not at one of its ends."""
        return self.peak[0] not in self.omega

    @cached_property
    def jumps(self) -> tuple[tuple[float, bool, float, float | None], ...]:
        """Folds at which a stable branch ends: Omega, whether a rising frequency passes it, u_max before and after.

        After the jump the motion is on the other stable orbit; None where there is none, or several.
        """
        found: list[tuple[float, bool, float, float | None]] = []
        for e in self["fold"]:
            b = self.branches[e.branch]
            i = int(np.abs(b.Omega - e.Omega).argmin())
            sides = [j for j in (i - 1, i + 1) if 0 <= j < len(b)]
            if not any(b.stable[j] for j in sides) or not (b.valid[i] and sides):
                continue
            upwards = bool(b.Omega[sides[0]] < e.Omega)
            beyond = e.Omega * (1.0 + (1e-4 if upwards else -1e-4))
            after: list[float] = []
            if self.omega[0] <= beyond <= self.omega[1]:
                with suppress(ConvergenceError):
                    after = [s.u_max for s in self.at(beyond) if s.stable]
            found.append((e.Omega, upwards, e.u_max, after[0] if len(after) == 1 else None))
        return tuple(found)

    @cached_property
    def lines(self) -> tuple[Branch, ...]:
        """Each branch with more orbits; straight lines between them have errors below 1e-3."""
        return tuple(replace(b, points=dense(self.orbits, b.points)) for b in self.branches)

    @property
    def equation(self) -> Equation:
        """Equation of motion."""
        return self.orbits.equation

    def to_dict(self) -> dict[str, Any]:
        """Section of thresholds.json."""
        named = ("kind", "Omega", "u_max", "u_min")
        return {
            "F_hat": self.setting.F_hat,
            "F_over_mg": self.setting.F_over_mg,
            "peak": dict(zip(("Omega", "u_max"), self.peak, strict=True)),
            "events": [
                {n: getattr(e, n) for n in named} | {"branch": self.branches[e.branch].kind} for e in self.events
            ],
            "tolerance": self.tolerance,
            "determinant_error": self.det_error,
            "valid": self.valid,
            "notes": list(self.notes),
            "searched": self.searched,
        }

    def rows(self) -> Iterator[dict[str, Any]]:
        """Rows of response.csv, in order along each branch, as dense as in `lines`."""
        for line in self.lines:
            for p in line.points:
                yield self.setting.row(line.kind, p.Omega, p.u_max, p.u_min, p.a1, p.stable, p.phase)


def frequency_response(orbits: Orbits, subharmonics: bool = True) -> FrequencyResponse:
    """Compute all branches in a window; arguments and errors as in `ContactOscillator.response`."""
    search = Search(orbits, subharmonics)
    search.run()
    branches, restoring = search.branches, orbits.equation.restoring
    return FrequencyResponse(
        orbits.setting, orbits.window, tuple(branches), tuple(search.events),
        max(float(b.error.max()) for b in branches), max(float(b.det_error.max()) for b in branches),
        all(bool(b.valid.all()) for b in branches),
        (*search.notes, *_limitations(branches, restoring.known_to)), search.describe(), orbits,
    )  # fmt: skip


def _limitations(branches: Sequence[Branch], known_to: float) -> Iterator[str]:
    """Notes on orbits beyond the points of the law, ends of branches, unreliable stability, and unphysical orbits."""
    top, known = max(float(b.u_max.max()) for b in branches), round(known_to, 9)
    if known < top:
        yield (
            f"the response reaches u = {top:.4g}, the curve that the law was fitted to ends at u = "
            f"{max(known, 0.0):.4g}: beyond it the law is extrapolated, and a contact that has yielded yields again; "
            "lower the forcing, or compute the curve further"
        )
    for number, b in enumerate(branches):
        if b.end not in ("window", "closed", "period doubling"):
            yield f"branch {number} ({b.kind}) ends early: {b.end}"
    unreliable = sum(int((b.det_error > _UNRELIABLE).sum()) for b in branches)
    if unreliable:
        yield (
            f"the stability of {unreliable} orbits is unreliable: the relative error of their multipliers is "
            f"{_UNRELIABLE:g} or more"
        )
    if not all(bool(b.valid.all()) for b in branches):
        yield "the Taylor law is unphysical where u_min < -1: contact is lost there"
