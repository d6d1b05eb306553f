"""Search for all branches of periodic orbits in a window of frequencies.

The branch of order 1 starts where its orbit is unique and known: above the resonance, or from rest. Every branch is
traced beyond the window and then cut, so a window has the orbits of a wide one.
Branches of twice the period start at period doublings, others at orbits of the period map.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import pairwise, product

import numpy as np

from asperity.arrays import Array
from asperity.dynamics.branch import Branch, Event, doublings, locate_events
from asperity.dynamics.equation import Equation, Forcing
from asperity.dynamics.orbits import Orbits
from asperity.dynamics.period_map import TURN
from asperity.dynamics.point import PIECES, TOO_MUCH, Path, Point, Tracing, root, value
from asperity.dynamics.settings import MIN_ZETA
from asperity.dynamics.starts import (
    backbone_chart,
    free_starts,
    has_one_resonance,
    orbit_from_rest,
    periodic_orbits,
    random_starts,
    states,
)
from asperity.errors import ConvergenceError
from asperity.force_law.damping import only_in_contact

_STARTS = 240  # on the period map, and as many on free orbits
_SLOW = 0.2  # Omega below which there are fewer, because each takes longer
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

    def __init__(self, equation: Equation, forcing: Forcing, how: Tracing, subharmonics: bool, rtol: float) -> None:
        self.equation, self.forcing, self.how = equation, forcing, how
        self.orders = (1, 2) if subharmonics else (1,)
        self.orbits = {order: Orbits(equation, forcing, order, rtol=rtol) for order in (1, 2)}
        self.strong = float(forcing.at(max(1.0, how.window[1])))  # F^, the greatest in the window and at the resonance
        self.starts = int(_STARTS * min(1.0, how.window[0] / _SLOW) ** 2)
        self.chart = backbone_chart(equation, self.strong)
        self.alone = has_one_resonance(equation, self.strong)  # below the main resonance the orbit is unique
        self.branches: list[Branch] = []
        self.events: list[Event] = []
        self.notes: list[str] = []
        self._paths: list[tuple[str, int, Path]] = []  # kind, order and path, in and outside the window
        self._measured = 0  # number of them whose pieces are branches
        self._ends: list[tuple[int, Point]] = []  # of branches, with their order
        self._states: list[Array] = []  # of the branches, see `starts.states`
        self._doublings: list[Point] = []
        self._lost: list[str] = []  # notes on orbits from rest, of no interest where the others add up

    def run(self) -> None:
        """Trace branches until nothing is left."""
        (low, high), (below, above) = self.how.window, self._limits(1)
        self._from_rest(above)
        unique = below <= self.chart.lowest / _BEYOND or low >= _BEYOND * self.chart.highest
        lowest = min((p.parameter for _, _, path in self._paths for p in path.points), default=np.inf)
        if not unique or lowest > below:
            self._from_rest(low)
        if self.equation.zeta < MIN_ZETA:  # resonances so high that between each two there is a branch of its own
            for omega in (1.0 / np.sqrt(k * (k + 1.0)) for k in range(1, _RESONANCES)):
                if below < omega < above:
                    self._from_rest(omega)
        self._finish()
        orders = self._searched_orders()
        random = random_starts(self.equation, self.strong, self.how.window, self.starts) if orders else np.empty((3, 0))
        for order in orders:
            free = free_starts(self.equation, self.chart, self.how.window, order, self.starts)
            lanes = np.concatenate([free, random], axis=1)
            for omega, x, amplitude in periodic_orbits(
                self.equation, self.forcing, lanes, order, self._states, self.notes
            ):
                self._through("detached", order, x, omega, amplitude)
                self._finish()
                if self._left < 0.0:
                    break
        if not self.branches:
            raise ConvergenceError(f"no periodic orbit found for Omega = {low:g} to {high:g} with F^ = {self.strong:g}")
        if self._left < 0.0:
            self.notes.append(
                "the search ended after too much work, and orbits may be missing: give a narrower window, or one of "
                "higher frequencies"
            )
        missing = [
            f"at the end Omega = {edge:g} of the window at least one orbit of period {order} is missing: "
            "give another window, which ends between the resonances"
            for order, edge in product(self.orders, self.how.window)
            if self._left >= 0.0 and self._excess(order, edge)
        ]
        self.notes += missing if self._adds_up() and not missing else [*self._lost, *missing]

    def _searched_orders(self) -> list[int]:
        """Orders of orbits that may be on branches that no other one leads to."""
        if self.equation.zeta < MIN_ZETA:
            return []
        needed = {1: not self.alone, 2: not self.alone or self.chart.may_double(self.how.window)}
        return [order for order in self.orders if needed[order]]

    def describe(self) -> str:
        """Sentence `FrequencyResponse.searched`."""
        periods, tried = (" and ".join(map(str, orders)) for orders in (self.orders, self._searched_orders()))
        origins = f"rest and up to {2 * self.starts} starts of period {tried}" if tried else "rest"
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
        above = max([order, *self._searched_orders()]) * _BEYOND * chart.highest * (1.0 + self.strong)
        below = chart.lowest / _BEYOND if order == 1 and self.alone else 0.0
        return max(_BELOW * low, below) if below < low < above else low, above if below < high < above else high

    def _tracing(self, order: int) -> Tracing:
        """How branches of an order are traced."""
        return replace(self.how, limits=self._limits(order), max_work=max(self._left, 0.0))

    @property
    def _left(self) -> float:
        """Work that is left, by that of the paths, or by the steps of the integrator for everything."""
        spent = max(sum(path.work for _, _, path in self._paths), sum(orbits.effort for orbits in self.orbits.values()))
        return self.how.max_work - spent

    def _from_rest(self, omega: float) -> None:
        """Trace the branch from rest at a frequency in the window or above it."""
        try:
            p = orbit_from_rest(self.equation, omega, float(self.forcing.at(omega)), self.orbits[1].rtol)
        except ConvergenceError as error:
            self._lost.append(f"the orbit from rest at Omega = {omega:.6g} was not found: {error}")
        else:
            self._through("main", 1, p.states, omega, p.amplitude)

    def _through(self, kind: str, order: int, rough: Array, omega: float, amplitude: float) -> None:
        """Trace the branch through an orbit near rough states (order, 2), if it is new."""
        orbits = self.orbits[order]
        try:
            first = orbits.at(orbits.through(rough, omega), amplitude, -1.0)
            path = through(orbits, first, self._tracing(order), self._known(order))
        except ConvergenceError as error:
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
            elif self._doublings and self._left > 0.0:
                flip = self._doublings.pop(0)
                path = subharmonic(self.orbits[2], flip, self._tracing(2), self._known(2))
                if len(path.points) > 2:
                    self._paths.append(("sub2", 2, self._joined(path)))
            else:
                return

    def _joined(self, path: Path) -> Path:
        """Path of twice the period up to the period doubling at which it ends, from which it is not traced again."""
        (before, end), orbits = path.points[-2:], self.orbits[2]
        ends = [doubled(orbits, p) for p in self._doublings]
        gaps = [orbits.gap(p, end) for p in ends]
        if path.end != "period doubling" or min(gaps, default=np.inf) > orbits.gap(before, end):
            return path
        i = int(np.argmin(gaps))
        del self._doublings[i]
        turn = np.sign(ends[i].tangent @ end.tangent) or 1.0
        last = replace(ends[i], tangent=turn * ends[i].tangent, slopes=-ends[i].slopes)
        return replace(path, points=(*path.points[:-1], last))

    def _measure(self, kind: str, order: int, path: Path) -> None:
        """Make branches of the pieces of a path in the window, with their events and period doublings."""
        orbits = self.orbits[order]
        for piece, inside in self._pieces(path):
            if not inside:
                if self.equation.zeta > 0 and 2 * order in self.orders:
                    self._doublings += doublings(orbits, piece.points)
                continue
            branch, events, flips = locate_events(orbits, piece, kind, len(self.branches))
            self.branches.append(branch)
            self._ends += [(order, piece.points[0]), (order, piece.points[-1])]
            self._states.append(states(branch.points))
            self.events.extend(events)
            if 2 * order in self.orders:
                self._doublings.extend(flips)
        for end, reason in ((path.points[0], path.begin), (path.points[-1], path.end)):
            said = ("window", "closed", "period doubling", TOO_MUCH)
            if reason not in said and not self.how.is_inside(end.parameter):
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

    def _adds_up(self) -> bool:
        """Whether the period map moves every distant state inwards."""
        e = self.equation
        return e.restoring.contact and not only_in_contact(e.damping) and e.zeta > 0

    def _excess(self, order: int, edge: float) -> int:
        """By how much the signs of the orbits at an edge exceed 1, the degree of such a map.

        A positive determinant of (identity less monodromy) counts 1, a negative one -1.
        """
        if not self._adds_up():
            return 0
        total = -1
        for other, p in self._ends:
            if other <= order and p.parameter == edge:
                total += other * int(np.sign(p.fold * (p.flip if other < order else 1.0)))
        return total


def doubled(orbits: Orbits, flip: Point) -> Point:
    """Period doubling as the first point of the branch of twice the period; `orbits` are those of that."""
    one = replace(orbits, order=1)
    m = one.map(flip.y[:-1].reshape(-1, 2), flip.parameter, TURN / PIECES * np.arange(PIECES), TURN / PIECES)
    monodromy = np.linalg.multi_dot(m.by_end[::-1, :, :2])
    directions = [np.linalg.svd(monodromy + np.eye(2))[2][-1]]
    for piece in m.by_end[:-1, :, :2]:
        directions.append(piece @ directions[-1])
    t = np.concatenate([*directions, *(-d for d in directions), [0.0]])
    t = t / np.linalg.norm(orbits.scales(flip.amplitude, flip.parameter) * t)
    top, low = int(m.high[:, 0].argmax()), int(m.low[:, 0].argmin())
    rise = abs(m.high[top, 1:3] @ t[2 * top : 2 * top + 2])
    fall = abs(m.low[low, 1:3] @ t[2 * low : 2 * low + 2])
    return replace(
        flip, y=np.concatenate([flip.y[:-1], flip.y]), tangent=t, slopes=np.array([rise, -fall, 0.0, 0.0]),
        trace=flip.trace**2 - 2.0 * flip.determinant, determinant=flip.determinant**2,
    )  # fmt: skip


def subharmonic(orbits: Orbits, flip: Point, how: Tracing, known: Sequence[Path]) -> Path:
    """Trace the branch of twice the period from a period doubling until it leaves the window or ends at another one."""
    return orbits.trace(
        doubled(orbits, flip), how, lambda p: _doubling(orbits, p) or _met(p[-1], known, orbits.order)
    )  # fmt: skip


def _doubling(orbits: Orbits, points: list[Point]) -> str | None:
    """Replace the last point of a branch of twice the period by the period doubling that its last step passes."""
    a, b = points[-2:]
    odd_a = _odd(a)

    def side(p: Point) -> float:
        return float(_odd(p) @ odd_a)

    if len(points) < 3 or side(b) > 0:
        return None
    points.pop()  # it repeats an orbit of the branch, shifted by half of its period
    cubic, w, _ = orbits.segment(a, b)
    at = root(lambda s: side(replace(a, y=value(cubic, s))), side(a), side(b))
    end = replace(a, y=value(cubic, at), tangent=-odd_a / np.linalg.norm(w * odd_a))
    points.append(replace(end, y=end.y - _odd(end)))
    return "period doubling"


def _odd(p: Point) -> Array:
    """Half of the difference of the two forcing periods of an orbit, 0 for the parameter."""
    x = p.y[:-1]
    return np.append(0.5 * (x - np.roll(x, x.size // 2)), 0.0)


def through(orbits: Orbits, first: Point, how: Tracing, known: Sequence[Path]) -> Path | None:
    """Trace the branch through an orbit in both directions, unless one of the known paths contains it.

    The result is None if its true period is shorter.
    """
    order = orbits.order
    if order > 1 and np.abs(_odd(first))[::2].max() < 1e-3 * first.amplitude:
        return None  # its true period is shorter
    if any(is_same(q, first, order) for path in known for q in orbits.crossings(path.points, first.parameter)):
        return None
    copies = []
    for k in range(order):  # the same orbit, seen from each forcing period
        y, t = (np.append(np.roll(x[:-1], 2 * PIECES * k), x[-1]) for x in (first.y, first.tangent))
        copies.append(replace(first, y=y, tangent=t))

    def closed(points: list[Point]) -> str | None:
        if order == 2 and (doubling := _doubling(orbits, points)):
            return doubling
        if met := _met(points[-1], known, order):
            return met
        if len(points) < 6:
            return None
        a, b = points[-2:]
        w = orbits.scales(a.amplitude, a.parameter)
        chord = w * (b.y - a.y)
        for f in copies:
            to = w * (f.y - a.y)
            s = float(to @ chord) / float(chord @ chord)
            if 0 <= s <= 1 and np.linalg.norm(to - s * chord) < 0.1 * np.linalg.norm(chord):
                points[-1] = f
                return "closed"
        return None

    forward = orbits.trace(first, how, closed)
    if forward.end == "closed":
        edge = next((p for p in forward.points if p.parameter in how.window), None)
        if edge is None or first.parameter in how.window:
            return replace(forward, begin="closed")
        again = orbits.at(edge.y, edge.amplitude, -1.0)
        return through(orbits, again, how, ())  # so that no piece begins in the window
    backward = orbits.trace(first.turned(), how, closed)
    turned = tuple(p.turned() for p in reversed(backward.points[1:]))
    return Path(turned + forward.points, forward.end, backward.end, forward.work + backward.work)


def _met(point: Point, known: Sequence[Path], order: int) -> str | None:
    """Reason to end a path at an orbit on an edge of the window that a known path has, which leads on from there."""
    same = (q for path in known for q in path.points if q.parameter == point.parameter)
    return "window" if any(is_same(q, point, order) for q in same) else None


def is_same(a: Point, b: Point, order: int) -> bool:
    """Whether two points are one orbit, up to a shift by whole forcing periods."""
    if abs(a.parameter - b.parameter) > 1e-9:
        return False
    close = max(_SAME, 10.0 * max(a.error, b.error)) * max(a.amplitude, 1e-300)
    return distance(a.states, b.states, order) < close


def distance(a: Array, b: Array, order: int) -> float:
    """Greatest difference of the states (order, 2) of two orbits, up to a shift by whole forcing periods."""
    return min(float(np.abs(a - np.roll(b, k, axis=0)).max()) for k in range(order))
