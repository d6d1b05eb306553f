# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

"""Frequency response: all periodic orbits under harmonic forcing in a window of frequencies."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from asperity.arrays import Array
from asperity.dynamics.branch import Branch, Event, Solution, measure, within_law
from asperity.dynamics.branch_switching import detached, is_traced, shifts, subharmonic
from asperity.dynamics.continuation import MIN_HARMONICS, Path, Point, Tracing, in_omega, start, trace
from asperity.dynamics.crossing import crossings
from asperity.dynamics.dense import Line, dense
from asperity.dynamics.events import locate_events
from asperity.dynamics.forcing import MIN_ZETA, Setting
from asperity.dynamics.harmonic_balance import Balance
from asperity.dynamics.initial_orbits import backbone_chart, edge_orbits, orbit_from_rest, subharmonic_orbits
from asperity.dynamics.law.damping import only_in_contact
from asperity.dynamics.search import is_weak, periodic_orbits, starts, states
from asperity.dynamics.stability import floquet, stack
from asperity.errors import ConvergenceError, InputError
from asperity.runtime.display import short_repr

_SAME = 1e-6  # relative distance, in addition to their errors, within which two orbits may be identical
_LONGEST = 4  # longest period of branches from period doublings, in forcing periods
_OUTSIDE = 1e-3  # truncation error allowed outside the window
_BEYOND = 1.2  # frequency over that of a resonance, from which the branch comes from rest
STARTS = 240  # of the search by integration, for each period
_UNRELIABLE = 1e-3  # deviation of the determinant from Liouville's above which stability is unreliable


@dataclass(frozen=True)
class FrequencyResponse:
    """Branches, events and accuracy of a frequency response.

    Attributes:
        setting: law, damping and forcing.
        omega: lowest and highest Omega.
        branches: see `Branch`.
        events: see `Event`.
        tolerance: largest truncation estimate on any branch, relative to the amplitude.
        det_error: largest deviation from Liouville's determinant.
        valid: whether every orbit is physical.
        notes: limits of the result (unphysical parts, ends of branches, table limits), one sentence each.
        searched: which orbits were searched and which were not, one sentence.
        balance: equations of the orbits.

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
    events: tuple[Event, ...]
    tolerance: float
    det_error: float
    valid: bool
    notes: tuple[str, ...]
    searched: str
    balance: Balance = field(repr=False)

    __repr__ = short_repr

    def __getitem__(self, kind: str) -> tuple[Event, ...]:
        """Return the events of one kind: "fold", "period doubling" or "grazing"."""
        return tuple(e for e in self.events if e.kind == kind)

    @property
    def peak(self) -> tuple[float, float]:
        """Omega and u_max of the largest displacement on any branch."""
        best = max(self.branches, key=lambda b: float(b.u_max.max()))
        j = int(best.u_max.argmax())
        return float(best.Omega[j]), float(best.u_max[j])

    def at(self, omega: float) -> tuple[Solution, ...]:
        """Return every orbit of the branches at exactly this Omega, lowest u_max first.

        Raises:
            ConvergenceError: the correction of an orbit at this Omega fails.
            InputError: omega lies outside the window.
        """
        if not self.omega[0] <= omega <= self.omega[1]:
            raise InputError(f"Omega = {omega:g} lies outside the computed window {self.omega}")
        found: list[Solution] = []
        senses: list[bool] = []
        for number, branch in enumerate(self.branches):
            balance = replace(self.balance, order=branch.order)
            try:
                points = list(crossings(in_omega(balance, self.setting.F_hat), branch.points(), omega))
            except ConvergenceError as error:
                raise ConvergenceError(
                    f"an orbit at Omega = {omega:g} on branch {number} ({branch.kind}) could not be corrected: "
                    f"{error}; use a smaller tol"
                ) from error
            if not points:
                continue
            multipliers = floquet(balance, stack([p.x for p in points]), np.full(len(points), omega))
            data = measure(balance, points, branch.kind, "", multipliers)
            for i, point in enumerate(points):
                s = Solution(
                    number,
                    branch.kind,
                    branch.order,
                    omega,
                    float(data.u_max[i]),
                    float(data.u_min[i]),
                    float(data.a1[i]),
                    bool(data.stable[i]),
                    point.error,
                    data.coefficients[i],
                )
                sense = bool(multipliers.fold[i] > 0)  # differs on the two sides of a fold, however close
                if not any(sense == other and _same(s, o) for other, o in zip(senses, found, strict=True)):
                    found.append(s)
                    senses.append(sense)
        return tuple(sorted(found, key=lambda solution: solution.u_max))

    def lines(self) -> tuple[Line, ...]:
        """Return each branch as dense rows; straight lines between them have errors below 1e-3."""
        return tuple(dense(self.balance, b) for b in self.branches)

    def rows(self) -> Iterator[dict[str, Any]]:
        """Yield the rows of response.csv, in order along each branch, as dense as in `lines`."""
        s = self.setting
        for branch, line in zip(self.branches, self.lines(), strict=True):
            for omega, u_max, u_min, a1, phase, stable in zip(
                line.Omega, line.u_max, line.u_min, line.a1, line.phase, line.stable, strict=True
            ):
                yield {
                    "model": s.model,
                    "F_hat": s.F_hat,
                    "zeta": s.zeta,
                    "Omega": float(omega),
                    "u_max": float(u_max),
                    "u_min": float(u_min),
                    "a1": float(a1),
                    "stable": bool(stable),
                    "branch": branch.kind,
                    "contact_loss": bool(u_min < -1.0),
                    "phase": float(phase),
                }


def _same(a: Solution, b: Solution) -> bool:
    """Return whether two orbits are identical up to a shift by whole forcing periods."""
    if a.order != b.order:
        return False
    count = min(a.coefficients.size, b.coefficients.size)
    gap = np.abs(a.coefficients[:count] - shifts(b.coefficients[:count], b.order)).max(axis=1).min()
    return bool(gap < (_SAME + 10.0 * max(a.error, b.error)) * np.abs(b.coefficients).max())


def frequency_response(
    balance: Balance,
    setting: Setting,
    omega: tuple[float, float],
    *,
    tol: float = 1e-5,
    subharmonics: bool = True,
    starts: int = STARTS,
    max_points: int = 3000,
) -> FrequencyResponse:
    """Trace every branch reached from rest, from the backbone and from given orbits.

    Args:
        balance: equations of order 1.
        setting: law, damping and forcing.
        omega: lowest and highest Omega.
        tol: allowed truncation error, relative to the amplitude.
        subharmonics: also trace branches of period 2 and 4 from period doublings.
        starts: number of starts of the search by integration for orbits on no branch.
        max_points: limit of the work per branch, see `continuation.Tracing`.

    Raises:
        ConvergenceError: no orbit can be found at either end of the window.
    """
    low, high = omega
    how = Tracing(
        omega, tol, balance.zeta, (high - low) / 25.0, max_points=max_points, smooth=not balance.restoring.singular
    )
    search = _Search(balance, setting.F_hat, how, subharmonics, starts)
    search.run()
    branches, events, limits = within_law(balance, search.branches, search.events)
    return FrequencyResponse(
        setting,
        (low, high),
        tuple(branches),
        tuple(events),
        max(float(b.error.max()) for b in branches),
        max(float(b.det_error.max()) for b in branches),
        all(bool(b.valid.all()) for b in branches),
        (*search.notes, *limits, *_limitations(branches)),
        search.describe(),
        balance,
    )


class _Search:
    """Traces the branches that enter the window, those that leave them, and those through further orbits.

    Args:
        balance: equations of order 1.
        forcing: F^.
        how: window, accuracy and limits for order 1.
        subharmonics: whether branches of longer periods are traced too.
        starts: number of starts of the search by integration, see `search`.

    Attributes:
        paths: kind, order and path of each branch traced.
        branches: the paths measured, in their order.
        events: on the branches.
        notes: on orbits that could not be continued.
    """

    def __init__(self, balance: Balance, forcing: float, how: Tracing, subharmonics: bool, starts: int) -> None:
        self.balance, self.forcing, self.how, self.subharmonics = balance, forcing, how, subharmonics
        self.starts = 0 if balance.zeta < MIN_ZETA or is_weak(balance, forcing) else starts
        self.chart = backbone_chart(balance, forcing)
        self.paths: list[tuple[str, int, Path]] = []
        self.branches: list[Branch] = []
        self.events: list[Event] = []
        self.notes: list[str] = []
        self._states: list[Array] = []  # of the branches, see `search.states`
        self._doublings: list[tuple[int, Point]] = []  # with the order of their branch

    def run(self) -> None:
        """Trace branches until nothing is left."""
        for edge, direction in zip(reversed(self.how.window), (-1.0, 1.0), strict=True):
            for x in edge_orbits(self.balance, edge, self.forcing, self.how.tol, self.chart):
                self._enter(1, x, edge, direction)
        self._approach()
        if self.subharmonics:
            for x, omega in subharmonic_orbits(self.balance, self.how.window, self.forcing, self.chart):
                self._detach(2, x, omega)
        self._finish()
        for order in (1, 2) if self.subharmonics else (1,):
            for omega, x in self._further_orbits(order):
                self._detach(order, x, omega)
                self._finish()
        self._balance()
        if not self.paths:
            low, high = self.how.window
            raise ConvergenceError(
                f"no periodic orbit found for Omega = {low:g} to {high:g} with F^ = {self.forcing:g}"
            )

    def _finish(self) -> None:
        """Measure the paths traced so far, and trace the branches that leave them at period doublings."""
        while True:
            if len(self.branches) < len(self.paths):
                self._measure(*self.paths[len(self.branches)])
            elif self._doublings:
                self._switch(*self._doublings.pop(0))
            else:
                return

    def _enter(self, order: int, x: Array, edge: float, direction: float) -> None:
        """Trace the branch that enters the window at an edge with the orbit x, if it is new."""
        equations = in_omega(replace(self.balance, order=order), self.forcing)
        how = replace(self.how, min_harmonics=order * MIN_HARMONICS)
        try:
            first = start(equations, x, edge, direction, how)
            if not is_traced(self.paths, order, first.x, edge):
                self.paths.append(("main" if order == 1 else "detached", order, trace(equations, first, how)))
        except ConvergenceError as error:
            self.notes.append(f"the branch at Omega = {edge:.6g} could not be followed: {error}")

    def _approach(self) -> None:
        """Trace the branch from rest beyond the main resonance into a window that ends in the resonance."""
        (low, high), top = self.how.window, float(max([1.0, *self.chart[1]]))
        sides = ((_BEYOND * top, high, -1.0), (1.0 / _BEYOND, low, 1.0))
        hardens = top > 1.0 or self.balance.restoring.kappa > 0.0
        cut = (high < _BEYOND * top, hardens and 1.0 / _BEYOND < low < _BEYOND * top)
        for far, edge, inwards in (side for side, inside in zip(sides, cut, strict=True) if inside):
            try:
                x = orbit_from_rest(self.balance, far, self.forcing, _OUTSIDE)
                first = start(in_omega(self.balance, self.forcing), x, far, inwards, self.how)
            except ConvergenceError:  # beyond the resonance of a strong forcing: the other searches remain
                continue
            self._outside(1, first, edge, inwards)

    def _balance(self) -> None:
        """Continue branches outside the window until the orbits at its edges add up.

        The period map moves every distant state inwards, so its fixed points have the degree 1: those with a positive
        determinant of (identity less monodromy) are one more than those with a negative one. Where they are not, a
        branch that leaves the window comes back.
        """
        b = self.balance
        if not b.restoring.contact or only_in_contact(b.damping) or b.zeta == 0:
            return
        for order in (1, 2) if self.subharmonics else (1,):
            for edge, outwards in zip(self.how.window, (-1.0, 1.0), strict=True):
                tried: list[Point] = []
                while True:
                    excess, ends = self._ends(order, edge)
                    ends = [(sign, p) for sign, p in ends if sign * excess > 0 and not any(p is q for q in tried)]
                    if not excess or not ends:
                        break
                    point = max((p for _, p in ends), key=lambda p: float(np.linalg.norm(p.x)))
                    tried.append(point)
                    if point.t_parameter * outwards < 0:
                        point = replace(point, t=-point.t, t_parameter=-point.t_parameter)
                    self._outside(order, point, edge, -outwards)
                    self._finish()
                if excess:
                    self.notes.append(
                        f"at the end Omega = {edge:g} of the window at least one orbit of period {order} is missing: "
                        "give another window, which ends between the resonances"
                    )

    def _ends(self, order: int, edge: float) -> tuple[int, list[tuple[int, Point]]]:
        """Return by how much the signs of the orbits at an edge exceed 1, and those of the order with their signs."""
        total, ends = -1, []
        for _, other, path in self.paths:
            if other > order:
                continue
            for p in {id(q): q for q in (path.points[0], path.points[-1])}.values():
                if abs(p.parameter - edge) < 1e-9:
                    f = floquet(replace(self.balance, order=other), stack([p.x]), np.array([edge]))
                    sign = int(np.sign(f.fold[0] * (f.flip[0] if other < order else 1.0)))
                    total += other * sign
                    if other == order:
                        ends.append((sign, p))
        return total, ends

    def _outside(self, order: int, first: Point, edge: float, inwards: float) -> None:
        """Trace a branch outside the window; where it comes to an edge, trace it inside."""
        equations = in_omega(replace(self.balance, order=order), self.forcing)
        far = 0.4 * edge if inwards > 0 else max(1.6 * edge, 1.3 * order)
        how = replace(
            self.how, window=(min(edge, far), max(edge, far)), tol=max(self.how.tol, _OUTSIDE),
            min_harmonics=order * MIN_HARMONICS,
        )  # fmt: skip
        last = trace(equations, first, how).points[-1]
        if last is not first and abs(last.parameter - edge) < 1e-9:
            self._enter(order, last.x, edge, inwards)

    def _measure(self, kind: str, order: int, path: Path) -> None:
        """Make a branch of a path, with its events and period doublings."""
        balance = replace(self.balance, order=order)
        equations = in_omega(balance, self.forcing)
        branch, events, flips = locate_events(balance, equations, path, kind, len(self.branches), self.how.tol)
        self.branches.append(branch)
        self._states.append(states(branch))
        self.events.extend(events)
        if self.subharmonics and 2 * order <= _LONGEST:
            self._doublings.extend((order, flip) for flip in flips)

    def _switch(self, order: int, flip: Point) -> None:
        """Trace the branch of twice the period from a period doubling of a branch of an order."""
        rest = [p for other, p in self._doublings if other == order]
        path = subharmonic(replace(self.balance, order=order), self.forcing, flip, self.how, rest)
        if path is None:
            return
        self.paths.append((f"sub{2 * order}", 2 * order, path))
        if path.end == "period doubling" and rest:  # the branch must not be traced from its other end
            end = path.points[-1].parameter
            other = min(rest, key=lambda p: abs(p.parameter - end))
            self._doublings = [(n, p) for n, p in self._doublings if p is not other]

    def _detach(self, order: int, x: Array, omega: float) -> None:
        """Trace the branch through an orbit, if it is new."""
        balance = replace(self.balance, order=order)
        try:
            path = detached(balance, self.forcing, x, omega, self.how, self.paths)
        except (ConvergenceError, np.linalg.LinAlgError) as error:
            self.notes.append(f"an orbit at Omega = {omega:.6g} is on no branch and could not be continued: {error}")
            return
        if path is not None:
            self.paths.append(("detached", order, path))

    def _further_orbits(self, order: int) -> Iterator[tuple[float, Array]]:
        """Yield Omega and coefficients of orbits that may be on no branch."""
        if self.starts:
            lanes = starts(self.balance, self.forcing, self.how.window, self.starts)
            yield from periodic_orbits(self.balance, self.forcing, lanes, order, self._states)

    def describe(self) -> str:
        """Return the sentence `FrequencyResponse.searched`."""
        periods = "period 1 and 2, with period 4 from period doublings" if self.subharmonics else "period 1"
        origins = f"rest, the backbone and {self.starts} starts" if self.starts else "rest and the backbone"
        return (
            f"searched: orbits of {periods}, from {origins}; not searched: other periods, and loops "
            "in a range of frequencies narrower than the spacing of the starts"
        )


def _limitations(branches: Sequence[Branch]) -> Iterator[str]:
    """Yield notes on branches that end early, on unreliable stability and on unphysical orbits."""
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
