"""Search for all branches of periodic orbits in a window of frequencies.

The branch of order 1 starts where its orbit is unique and known: above the resonance, or from rest. Every branch is
traced beyond the window, with a larger tolerance there, until it is beyond the resonances, and then cut. A window has
therefore the orbits of a wide one.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise

import numpy as np

from asperity.arrays import Array
from asperity.dynamics.branch import Branch, Event, doublings, locate_events
from asperity.dynamics.branch_switching import subharmonic, through
from asperity.dynamics.continuation import MIN_HARMONICS, Path, Point, Tracing
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
        self._paths: list[tuple[str, int, Path]] = []  # kind, order and path, in and outside the window
        self._measured = 0  # number of them whose pieces are branches
        self._ends: list[tuple[int, Point]] = []  # of branches, with their order
        self._states: list[Array] = []  # of the branches, see `initial_orbits.states`
        self._doublings: list[Point] = []

    def run(self) -> None:
        """Trace branches until nothing is left."""
        (low, high), (below, above) = self.how.window, self._limits(1)
        self._from_rest(above)
        unique = below <= self.chart.lowest / _BEYOND or low >= _BEYOND * self.chart.highest
        lowest = min((p.parameter for _, _, path in self._paths for p in path.points), default=np.inf)
        if not unique or lowest > below:
            self._from_rest(low)
        self._finish()
        orders = self._searched_orders()
        random = random_starts(self.balance, self.forcing, self.how.window, _STARTS) if orders else np.empty((3, 0))
        for order in orders:
            free = free_starts(self.balance, self.chart, self.how.window, order, _STARTS)
            lanes = np.concatenate([free, random], axis=1)
            for omega, x in periodic_orbits(self.balance, self.forcing, lanes, order, self._states):
                self._through("detached", order, x, omega)
                self._finish()
        if not self.branches:
            raise ConvergenceError(
                f"no periodic orbit found for Omega = {low:g} to {high:g} with F^ = {self.forcing:g}"
            )
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

    def _tracing(self, order: int) -> Tracing:
        """How branches of an order are traced."""
        loose = max(self.how.tol, min(_OUTSIDE, _OF_DAMPING * self.balance.zeta))
        return replace(self.how, limits=self._limits(order), loose=loose, min_harmonics=order * MIN_HARMONICS)

    def _from_rest(self, omega: float) -> None:
        """Trace the branch from rest at a frequency in the window or above it."""
        try:
            x = orbit_from_rest(self.balance, omega, self.forcing, self._tracing(1).tol_at(omega))
        except ConvergenceError as error:
            self.notes.append(f"the orbit from rest at Omega = {omega:.6g} was not found: {error}")
        else:
            self._through("main", 1, x, omega)

    def _through(self, kind: str, order: int, x: Array, omega: float) -> None:
        """Trace the branch through an orbit, if it is new."""
        balance = replace(self.balance, order=order)
        try:
            path = through(balance, self.forcing, x, omega, self._tracing(order), self._known(order))
        except (ConvergenceError, np.linalg.LinAlgError) as error:
            self.notes.append(f"an orbit at Omega = {omega:.6g} is on no branch and could not be continued: {error}")
        else:
            self._paths += [(kind, order, path)] if path is not None else []

    def _known(self, order: int) -> list[Path]:
        return [path for _, other, path in self._paths if other == order]

    def _finish(self) -> None:
        """Measure the branches traced so far, and trace those that leave them at period doublings."""
        while True:
            if self._measured < len(self._paths):
                self._measured += 1
                self._measure(*self._paths[self._measured - 1])
            elif self._doublings:
                flip = self._doublings.pop(0)
                path, end = subharmonic(
                    self.balance, self.forcing, flip, self._tracing(2), self._doublings, self._known(2)
                )
                if path is not None:
                    self._paths.append(("sub2", 2, path))
                    self._doublings = [p for p in self._doublings if p is not end]  # traced from one end only
            else:
                return

    def _measure(self, kind: str, order: int, path: Path) -> None:
        """Make branches of the pieces of a path in the window, with their events and period doublings."""
        balance = replace(self.balance, order=order)
        for piece, inside in self._pieces(path):
            if not inside:
                if balance.zeta > 0 and 2 * order in self.orders:
                    self._doublings += doublings(balance, self.forcing, piece.points, self._tracing(order).loose)
                continue
            branch, events, flips = locate_events(balance, self.forcing, piece, kind, len(self.branches), self.how.tol)
            self.branches.append(branch)
            self._ends += [(order, piece.points[0]), (order, piece.points[-1])]
            self._states.append(states(branch))
            self.events.extend(events)
            if 2 * order in self.orders:
                self._doublings.extend(flips)
        for end, reason in ((path.points[0], path.begin), (path.points[-1], path.end)):
            if reason not in ("window", "closed", "known", "period doubling") and not self._is_inside(end):
                self.notes.append(
                    f"a branch of period {order} that leaves the window is lost at {end.parameter:.6g}, where it may "
                    f"return: {reason}"
                )

    def _is_inside(self, point: Point) -> bool:
        low, high = self.how.window
        return low <= point.parameter <= high

    def _pieces(self, path: Path) -> Iterator[tuple[Path, bool]]:
        """Pieces of a path, which end at points on the edges of the window, and whether they are in it."""
        at = np.array([p.parameter for p in path.points])
        low, high = self.how.window
        edge = (at == low) | (at == high)
        inside = (low <= at) & (at <= high)
        within = inside[1:] & inside[:-1] & ~(edge[1:] & edge[:-1] & (at[1:] == at[:-1]))  # it turns back outside
        ends = np.unique([0, *(np.flatnonzero(within[1:] != within[:-1]) + 1), at.size - 1])
        for first, last in pairwise(ends):
            begin, end = path.begin if first == 0 else "window", path.end if last == at.size - 1 else "window"
            piece = Path(path.points[first : last + 1], end if begin in ("window", "closed") else begin)
            yield piece, bool(within[first])

    def _excess(self, order: int, edge: float) -> int:
        """By how much the signs of the orbits at an edge exceed 1.

        The period map moves every distant state inwards, so its fixed points have the degree 1: those with a positive
        determinant of (identity less monodromy) are one more than those with a negative one.
        """
        b = self.balance
        if not b.restoring.contact or only_in_contact(b.damping) or b.zeta == 0:
            return 0
        total = -1
        for other, p in self._ends:
            if other <= order and p.parameter == edge:
                f = floquet(replace(b, order=other), stack([p.x]), np.array([edge]))
                total += other * int(np.sign(f.fold[0] * (f.flip[0] if other < order else 1.0)))
        return total
