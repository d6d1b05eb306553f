# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

"""Search for all branches of periodic orbits in a window of frequencies.

The branch of order 1 starts where its orbit is unique and known: above the resonance, or from rest. A branch that
leaves the window is continued outside, with a larger tolerance, until it returns or is beyond the resonances. A window
has therefore the orbits of a wide one.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from asperity.arrays import Array
from asperity.dynamics.branch import Branch, Event
from asperity.dynamics.branch_switching import detached, is_same, subharmonic
from asperity.dynamics.continuation import MIN_HARMONICS, Path, Point, Tracing, in_omega, start, trace
from asperity.dynamics.events import locate_events
from asperity.dynamics.harmonic_balance import Balance
from asperity.dynamics.initial_orbits import (
    backbone_chart,
    free_starts,
    has_one_resonance,
    orbit_from_rest,
    periodic_orbits,
    random_starts,
    states,
)
from asperity.dynamics.law.damping import only_in_contact
from asperity.dynamics.settings import MIN_ZETA
from asperity.dynamics.stability import floquet, stack
from asperity.errors import ConvergenceError

_STARTS = 240  # on the period map, and as many on free orbits
_OUTSIDE = 1e-3  # truncation error allowed outside the window
_OF_DAMPING = 0.03  # the same over zeta: a larger error of the forces passes the peak of a resonance by
_BEYOND = 1.2  # frequency over that of a resonance, beyond which the orbit is unique
_BELOW = 0.5  # lowest frequency outside the window, over its low end
_AT_EDGE = 1e-9  # distance of a point from the edge at which its branch ends
_STRIDE = 0.03  # longest step outside the window, over the frequency


class Search:
    """Traces every branch of order 1 from where it is known, and those through further orbits.

    Args:
        balance, how: equations; window, accuracy and limits, for order 1
        subharmonics: whether branches of period 2 are traced too

    Attributes:
        branches, events: the branches; one that leaves the window and returns is in several pieces
        notes: on what could not be found or continued
    """

    def __init__(self, balance: Balance, forcing: float, how: Tracing, subharmonics: bool) -> None:
        self.balance, self.forcing, self.how = balance, forcing, how
        self.chart = backbone_chart(balance, forcing)
        self.orders = (1, 2) if subharmonics else (1,)
        self.alone = has_one_resonance(balance, forcing)  # below the main resonance the orbit is unique
        self.branches: list[Branch] = []
        self.events: list[Event] = []
        self.notes: list[str] = []
        self._paths: list[tuple[str, int, Path]] = []  # kind, order and path of each piece in the window
        self._measured = 0  # number of them that are branches
        self._ends: list[tuple[str, int, Point]] = []  # of pieces at the edges, headed outwards
        self._lowest = np.inf  # frequency to which a branch of order 1 was followed
        self._states: list[Array] = []  # of the branches, see `initial_orbits.states`
        self._lost: list[tuple[int, Point, str]] = []  # ends whose branch could not be followed, with the reason
        self._doublings: list[Point] = []

    def run(self) -> None:
        """Trace branches until nothing is left."""
        low, high = self.how.window
        below, above = self._limits(1)
        self._from_rest(above, -1.0)
        unique = below <= self.chart.lowest / _BEYOND or low >= _BEYOND * self.chart.highest
        if not unique or self._lowest > below:
            self._from_rest(low, 1.0)
        self._finish()
        orders = self._searched_orders()
        random = random_starts(self.balance, self.forcing, self.how.window, _STARTS) if orders else np.empty((3, 0))
        for order in orders:
            free = free_starts(self.balance, self.chart, self.how.window, order, _STARTS)
            lanes = np.concatenate([free, random], axis=1)
            for omega, x in periodic_orbits(self.balance, self.forcing, lanes, order, self._states):
                self._through(order, x, omega)
        if not self._paths:
            raise ConvergenceError(
                f"no periodic orbit found for Omega = {low:g} to {high:g} with F^ = {self.forcing:g}"
            )
        for order, end, reason in self._lost:
            self.notes.append(f"the branch of period {order} that leaves the window at {end.parameter:.6g} {reason}")
        for order in self.orders:
            self.notes += [
                f"at the end Omega = {edge:g} of the window at least one orbit of period {order} is missing: "
                "give another window, which ends between the resonances"
                for edge in self.how.window
                if self._excess(order, edge)
            ]

    def _searched_orders(self) -> list[int]:
        """Orders of orbits that may be on branches that no other one leads to."""
        if self.balance.zeta < MIN_ZETA:
            return []
        needed = {1: not self.alone, 2: not self.alone or self.chart.may_double(self.how.window)}
        return [order for order in self.orders if needed[order]]

    def describe(self) -> str:
        """Sentence `FrequencyResponse.searched`."""
        periods = " and ".join(str(order) for order in self.orders)
        tried = " and ".join(str(order) for order in self._searched_orders())
        origins = f"rest and up to {2 * _STARTS} starts of period {tried}" if tried else "rest"
        left = "that start from none of these states" if tried else "that so weak a forcing is not expected to sustain"
        return (
            f"searched: orbits of period {periods}, from {origins}; not searched: longer periods, which period "
            f"doublings of the last one may lead to, and loops {left}"
        )

    def _limits(self, order: int) -> tuple[float, float]:
        """Frequencies up to which branches of an order are followed outside the window."""
        (low, high), chart = self.how.window, self.chart
        above = order * _BEYOND * chart.highest * (1.0 + self.forcing)
        below = chart.lowest / _BEYOND if order == 1 and self.alone else 0.0
        return max(_BELOW * low, below) if below < low < above else low, above if below < high < above else high

    def _from_rest(self, omega: float, direction: float) -> None:
        """Trace the branch from rest at a frequency in the window or above it."""
        equations = in_omega(self.balance, self.forcing)
        how = self.how if omega <= self.how.window[1] else self._outside(1, omega)
        try:
            first = start(equations, orbit_from_rest(self.balance, omega, self.forcing, how.tol), omega, direction, how)
        except ConvergenceError as error:
            self.notes.append(f"the orbit from rest at Omega = {omega:.6g} was not found: {error}")
            return
        if how is self.how:
            self._enter("main", 1, first, known=omega == how.window[1])
        else:
            self._follow("main", 1, first)
        while self._ends:
            self._follow(*self._ends.pop(0))

    def _inside(self, order: int) -> Tracing:
        """How branches are traced in the window."""
        return replace(self.how, min_harmonics=order * MIN_HARMONICS)

    def _outside(self, order: int, omega: float) -> Tracing:
        """How branches are traced outside the window, on the side of a frequency."""
        (low, high), (below, above) = self.how.window, self._limits(order)
        return replace(
            self._inside(order), window=(below, low) if omega <= low else (high, above), max_step=_STRIDE * omega,
            tol=max(self.how.tol, min(_OUTSIDE, _OF_DAMPING * self.balance.zeta)),
            max_points=self.how.max_points // 10
        )  # fmt: skip

    def _follow(self, kind: str, order: int, point: Point) -> None:
        """Trace a branch outside the window; where it comes to an edge, trace it inside, unless it is known."""
        how = self._outside(order, point.parameter)
        if how.window[0] == how.window[1]:
            return
        path = trace(in_omega(replace(self.balance, order=order), self.forcing), point, how)
        last = path.points[-1]
        if path.end != "window":
            self._lost.append((order, point, f"is lost at {last.parameter:.6g}, where it may return: {path.end}"))
            return
        if order == 1:
            self._lowest = min(self._lowest, last.parameter)
        if self._is_at_edge(last):
            self._enter(kind, order, last, known=True)

    def _enter(self, kind: str, order: int, point: Point, known: bool) -> None:
        """Trace the branch that enters the window at a point, unless it is traced; `known` is what comes before."""
        self._ends = [e for e in self._ends if e[1] != order or not is_same(point, e[2], order)]
        self._lost = [e for e in self._lost if e[0] != order or not is_same(point, e[1], order)]
        for _, other, path in self._paths:
            if other == order and any(is_same(point, p, order) for p in (path.points[0], path.points[-1])):
                return
        equations = in_omega(replace(self.balance, order=order), self.forcing)
        how = self._inside(order)
        try:
            first = start(equations, point.x, point.parameter, point.t_parameter, how)
        except ConvergenceError as error:
            self.notes.append(f"the branch at Omega = {point.parameter:.6g} could not be followed: {error}")
            return
        self._keep(kind, order, trace(equations, first, how), known)

    def _keep(self, kind: str, order: int, path: Path, known: bool = False) -> None:
        """Take a path in the window, which is to be followed outside; `known` is what comes before."""
        self._paths.append((kind, order, path))
        first, last = path.points[0], path.points[-1]
        if order == 1:
            self._lowest = min(self._lowest, first.parameter, last.parameter)
        ends = [last] if known else [last, first.turned()]
        self._ends += [(kind, order, p) for p in ends if self._is_at_edge(p)]

    def _is_at_edge(self, point: Point) -> bool:
        return min(abs(point.parameter - edge) for edge in self.how.window) < _AT_EDGE

    def _finish(self) -> None:
        """Follow the branches traced so far, measure them, and trace those that leave them at period doublings."""
        while True:
            if self._ends:
                self._follow(*self._ends.pop(0))
            elif self._measured < len(self._paths):
                self._measured += 1
                self._measure(*self._paths[self._measured - 1])
            elif self._doublings:
                self._switch(self._doublings.pop(0))
            else:
                return

    def _measure(self, kind: str, order: int, path: Path) -> None:
        """Make a branch of a path, with its events and period doublings."""
        balance = replace(self.balance, order=order)
        equations = in_omega(balance, self.forcing)
        branch, events, flips = locate_events(balance, equations, path, kind, len(self.branches), self.how.tol)
        self.branches.append(branch)
        self._states.append(states(branch))
        self.events.extend(events)
        if 2 * order in self.orders:
            self._doublings.extend(flips)

    def _switch(self, flip: Point) -> None:
        """Trace the branch of period 2 from a period doubling of a branch of period 1."""
        path, end = subharmonic(self.balance, self.forcing, flip, self._inside(2), self._doublings)
        if path is not None:
            self._keep("sub2", 2, path, known=True)
            self._doublings = [p for p in self._doublings if p is not end]  # traced from one end only

    def _through(self, order: int, x: Array, omega: float) -> None:
        """Trace the branch through an orbit, if it is new, and all that leaves it."""
        balance = replace(self.balance, order=order)
        try:
            path = detached(balance, self.forcing, x, omega, self._inside(order), self._paths)
        except (ConvergenceError, np.linalg.LinAlgError) as error:
            self.notes.append(f"an orbit at Omega = {omega:.6g} is on no branch and could not be continued: {error}")
            return
        if path is not None:
            self._keep("detached", order, path)
            self._finish()

    def _excess(self, order: int, edge: float) -> int:
        """By how much the signs of the orbits at an edge exceed 1.

        The period map moves every distant state inwards, so its fixed points have the degree 1: those with a positive
        determinant of (identity less monodromy) are one more than those with a negative one.
        """
        b = self.balance
        if not b.restoring.contact or only_in_contact(b.damping) or b.zeta == 0:
            return 0
        total = -1
        for _, other, path in self._paths:
            for p in {id(q): q for q in (path.points[0], path.points[-1])}.values():
                if other <= order and abs(p.parameter - edge) < _AT_EDGE:
                    f = floquet(replace(b, order=other), stack([p.x]), np.array([edge]))
                    total += other * int(np.sign(f.fold[0] * (f.flip[0] if other < order else 1.0)))
        return total
