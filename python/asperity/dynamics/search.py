"""Search for all branches of periodic orbits in a window of frequencies.

The branch of order 1 starts where its orbit is unique and known: above the resonance, or from rest. Every branch is
traced beyond the window, with a larger tolerance there, and then cut, so a window has the orbits of a wide one.
Branches of twice the period start at period doublings, others at orbits of the period map.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import replace
from itertools import pairwise, product

import numpy as np

from asperity.arrays import Array
from asperity.dynamics.branch import Branch, Event, doublings, locate_events
from asperity.dynamics.continuation import (
    MIN_HARMONICS,
    Equations,
    Path,
    Point,
    Tracing,
    crossings,
    in_omega,
    locate,
    start,
    trace,
)
from asperity.dynamics.harmonic_balance import Balance, resize, stack, tail, unstack
from asperity.dynamics.initial_orbits import (
    backbone_chart,
    free_starts,
    has_one_resonance,
    orbit_from_rest,
    periodic_orbits,
    random_starts,
    states,
)
from asperity.dynamics.settings import MIN_ZETA
from asperity.dynamics.stability import floquet
from asperity.errors import ConvergenceError
from asperity.force_law.damping import only_in_contact

_STARTS = 240  # on the period map, and as many on free orbits
_OUTSIDE = 1e-3  # truncation error allowed outside the window
_OF_DAMPING = 0.03  # the same over zeta: a larger error of the forces passes the peak of a resonance by
_BEYOND = 1.2  # frequency over that of a resonance, beyond which the orbit is unique
_BELOW = 0.5  # lowest frequency outside the window, over its low end
_RESONANCES = 6  # main and superharmonic ones, at Omega = 1/k, between which an undamped branch starts
_SAME = 1e-3  # relative distance below which two orbits are identical


class Search:
    """Traces every branch of order 1 from where it is known, and those through further orbits.

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
        if self.balance.zeta < MIN_ZETA:  # resonances so high that between each two there is a branch of its own
            for omega in (1.0 / np.sqrt(k * (k + 1.0)) for k in range(1, _RESONANCES)):
                if below < omega < above:
                    self._from_rest(omega)
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
        self.notes += [
            f"at the end Omega = {edge:g} of the window at least one orbit of period {order} is missing: "
            "give another window, which ends between the resonances"
            for order, edge in product(self.orders, self.how.window)
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
        periods, tried = (" and ".join(map(str, orders)) for orders in (self.orders, self._searched_orders()))
        origins = f"rest and up to {2 * _STARTS} starts of period {tried}" if tried else "rest"
        left = "that start from none of these states" if tried else "that so weak a forcing is not expected to sustain"
        return (
            f"searched: orbits of period {periods}, from {origins}; not searched: longer periods, which period "
            f"doublings of the last one may lead to, and loops {left}"
        )

    def _limits(self, order: int) -> tuple[float, float]:
        """Frequencies up to which branches of an order are followed outside the window.

        Those of period 1 are followed as far as their period doublings bear orbits in the window.
        """
        (low, high), chart = self.how.window, self.chart
        above = max([order, *self._searched_orders()]) * _BEYOND * chart.highest * (1.0 + self.forcing)
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
                path = subharmonic(self.balance, self.forcing, flip, self._tracing(2), self._known(2))
                if len(path.points) > 2:
                    self._paths.append(("sub2", 2, self._joined(path)))
            else:
                return

    def _joined(self, path: Path) -> Path:
        """Path of twice the period up to the period doubling at which it ends, from which it is not traced again."""
        before, end = path.points[-2:]
        ends = [replace(p, x=_doubled(p.x), t=resize(end.t, p.x.size - 1), t_parameter=0.0) for p in self._doublings]
        gaps = [_gap(p, end) for p in ends]
        if path.end != "period doubling" or min(gaps, default=np.inf) > _gap(before, end):  # outside the window
            return path
        i = int(np.argmin(gaps))
        del self._doublings[i]
        return replace(path, points=(*path.points[:-1], ends[i]))

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
            if reason not in ("window", "closed", "period doubling") and not self.how.is_inside(end.parameter):
                self.notes.append(
                    f"a branch of period {order} is lost outside the window at {end.parameter:.6g}, where it may "
                    f"return: {reason}"
                )

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


def subharmonic(balance: Balance, forcing: float, flip: Point, how: Tracing, known: Sequence[Path]) -> Path:
    """Trace the branch of twice the period from a period doubling until it leaves the window or ends at another one.

    The balance has the order of the branch that doubles its period.
    """
    double = replace(balance, order=2 * balance.order)
    equations = in_omega(double, forcing)
    x = _doubled(flip.x)
    odd = np.flatnonzero(_odd(np.ones(x.size)))
    jacobian = equations(x, flip.parameter)[1][np.ix_(odd, odd)]
    null = np.zeros(x.size)
    null[odd] = np.linalg.svd(jacobian)[2][-1]
    first = Point(x, flip.parameter, null, 0.0, tail(x))
    return trace(equations, first, how, lambda p: _doubling(equations, p) or _met(p[-1], known, double.order))


def _doubling(equations: Equations, points: list[Point]) -> str | None:
    """Replace the last point of a branch of twice the period by the period doubling that its last step passes."""
    a, b = points[-2], points[-1]
    m = min(a.x.size, b.x.size) // 2
    odd_a = _odd(resize(a.x, m))

    def side(p: Point) -> float:
        return float(_odd(resize(p.x, m)) @ odd_a)

    if len(points) < 3 or side(b) > 0:
        return None
    points.pop()  # it repeats an orbit of the branch, shifted by half of its period
    with suppress(ConvergenceError):
        p = locate(equations, a, b, side, side(a), side(b))
        odd = resize(odd_a, p.x.size // 2)
        points.append(Point(p.x - _odd(p.x), p.parameter, -odd / np.linalg.norm(odd), 0.0, p.error))
    return "period doubling"


def _doubled(x: Array) -> Array:
    """Orbit as one of twice the order."""
    count = x.size // 2
    out = np.zeros(4 * count + 1)
    out[0] = x[0]
    out[2 : 2 * count + 1 : 2] = x[1 : count + 1]
    out[2 * count + 2 :: 2] = x[count + 1 :]
    return out


def _gap(a: Point, b: Point) -> float:
    count = max(a.x.size, b.x.size) // 2
    return float(np.linalg.norm(resize(a.x, count) - resize(b.x, count))) + abs(a.parameter - b.parameter)


def _odd(x: Array) -> Array:
    """Odd harmonics of an orbit, which one of half the order lacks; the others are 0."""
    out = x.copy()
    m = x.size // 2
    out[0] = out[2 : m + 1 : 2] = out[m + 2 :: 2] = 0.0
    return out


def through(
    balance: Balance, forcing: float, x: Array, omega: float, how: Tracing, known: Sequence[Path]
) -> Path | None:
    """Trace the branch through an orbit x (2 K + 1) in both directions, unless one of the known paths contains it.

    The result is None if its true period is shorter. A `ConvergenceError` says that there is no orbit near.
    """
    equations, order = in_omega(balance, forcing), balance.order
    first = start(equations, x, omega, -1.0, how)
    c = stack([first.x])[0]
    if order > 1 and np.abs(np.delete(c, slice(None, None, order))).max() < 1e-3 * np.abs(c).max():
        return None  # its true period is shorter
    if any(is_same(q, first, order) for path in known for q in crossings(equations, path.points, omega)):
        return None
    copies = [
        replace(first, x=unstack(a, a.size - 1), t=unstack(b, b.size - 1))
        for a, b in zip(shifts(c, order), shifts(stack([first.t])[0], order), strict=True)
    ]

    def closed(points: list[Point]) -> str | None:
        if order == 2 and (doubling := _doubling(equations, points)):
            return doubling
        if met := _met(points[-1], known, order):
            return met
        if len(points) < 6:
            return None
        a, b = points[-2], points[-1]
        m = first.x.size // 2
        chord = np.append(b.resized(m).x - a.resized(m).x, b.parameter - a.parameter)
        for f in copies:
            to = np.append(f.x - a.resized(m).x, f.parameter - a.parameter)
            s = float(to @ chord) / float(chord @ chord)
            if 0 <= s <= 1 and np.linalg.norm(to - s * chord) < 0.1 * np.linalg.norm(chord):
                points[-1] = f
                return "closed"
        return None

    forward = trace(equations, first, how, closed)
    if forward.end == "closed":
        edge = next((p for p in forward.points if p.parameter in how.window), None)
        if edge is None or first.parameter in how.window:
            return replace(forward, begin="closed")
        return through(balance, forcing, edge.x, edge.parameter, how, ())  # so that no piece begins in the window
    backward = trace(equations, first.turned(), how, closed)
    turned = tuple(p.turned() for p in reversed(backward.points[1:]))
    return Path(turned + forward.points, forward.end, backward.end)


def _met(point: Point, known: Sequence[Path], order: int) -> str | None:
    """Reason to end a path at an orbit on an edge of the window that a known path has, which leads on from there."""
    same = (q for path in known for q in path.points if q.parameter == point.parameter)
    return "window" if any(is_same(q, point, order) for q in same) else None


def is_same(a: Point, b: Point, order: int) -> bool:
    """Whether two points are one orbit, up to a shift by whole forcing periods."""
    if abs(a.parameter - b.parameter) > 1e-9:
        return False
    gap = distance(stack([a.x])[0], stack([b.x])[0], order)
    return gap < max(_SAME, 10.0 * max(a.error, b.error))


def distance(a: Array, b: Array, order: int) -> float:
    """Relative distance of two orbits of complex coefficients, up to a shift by whole forcing periods."""
    count = min(a.size, b.size)
    return float(np.abs(a[:count] - shifts(b[:count], order)).max(axis=1).min() / np.abs(b).max())


def shifts(c: Array, order: int) -> Array:
    """Complex coefficients (order, K + 1) of an orbit and of its copies shifted by forcing periods."""
    return c * np.exp(2j * np.pi / order * np.outer(np.arange(order), np.arange(c.size)))
