"""Search for all branches of periodic orbits in a window of frequencies.

The first branch starts where its orbit is unique and known: above the resonance, or near rest. Every branch is traced
beyond the window and then cut, so a window has the orbits of a wide one. Branches of twice the period start at period
doublings. Newton's method on the period map finds loops, and orbits of period 2 that no period doubling leads to: it
starts on the free orbits that are in resonance with the forcing.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise, product

import numpy as np

from asperity.arrays import Array
from asperity.dynamics.branch import Branch, Solution, doubled, located, subharmonic, through
from asperity.dynamics.equation import TURN, motions
from asperity.dynamics.free import FreeOrbit, free_orbits, largest_amplitude, resonance_peak
from asperity.dynamics.orbits import WORK, Orbits
from asperity.dynamics.point import TOO_MUCH, Path, Point
from asperity.errors import ConvergenceError
from asperity.vibration.damping import only_in_contact

_CYCLES = 5  # resonances: free orbits with 1, 2, ... cycles in a period of the forcing
_AMPLITUDES, _PHASES = 20, 8  # starts on the free orbits of each resonance, at most
_APART = 0.04  # distance of these amplitudes, in the logarithm of the frequency, or in that of the amplitude over
_FLAT = 0.1  # this, where the frequency hardly changes
_SLOW = 0.2  # Omega below which there are fewer, because each takes longer
_PART = 100  # of the starts, searched together
_ITERATIONS = 9  # of Newton's method on the period map
_ROUGH = 1e-6  # tolerance of the motions of the search, a tenth of that of their force; the orbits are corrected later
_CLOSE = 1e-4  # Newton step that ends the search, relative to the state
_KNOWN = 1e-2  # distance within which an orbit is identical to a known one, relative to the state
_SIZES = (0.05, 300.0)  # of free orbits: small ones, and those above which the mass flies all the time
_FINE = 2000  # amplitudes between them
_FAINT = 1e-4  # least of the largest amplitudes, far above round-off
_POINTS = 24  # amplitudes on the backbone
_BEYOND = 1.2  # frequency over that of a resonance, beyond which the orbit is unique
_BELOW = 0.5  # lowest frequency outside the window, over its low end


class Search:
    """Traces the branch from where it is known, and those through further orbits.

    Attributes:
        branches, events: the branches; one that leaves the window and returns is in several pieces
        notes: on what could not be found or continued
    """

    def __init__(self, orbits: Orbits, subharmonics: bool = True) -> None:
        self.orbits, self.equation, self.setting, self.window = orbits, orbits.equation, orbits.setting, orbits.window
        self.orders = (1, 2) if subharmonics else (1,)
        self.rough = replace(self.equation, rtol=10.0 * _ROUGH)
        # F^, the greatest in the window and at the resonance
        self.strong = float(self.setting.forcing(max(1.0, self.window[1])))
        share = min(1.0, self.window[0] / _SLOW)
        self.grid = int(np.ceil(_AMPLITUDES * share)), int(np.ceil(_PHASES * share))
        self.branches: list[Branch] = []
        self.events: list[Solution] = []
        self.notes: list[str] = []
        self._lost: list[str] = []  # orbits that could not be continued
        self._paths: list[Path] = []  # in and outside the window
        self._ends: list[Point] = []  # of branches
        self._known: list[Array] = []  # u, v, Omega (points, 3) along each path, at each of its forcing periods
        self._doublings: list[Point] = []  # from which no branch has been traced yet
        self._backbone()
        orbits.limits = self._limits()

    def _backbone(self) -> None:
        """Frequencies of free orbits up to the amplitude that the forcing sustains at phase resonance."""
        e, r = self.equation, self.equation.restoring
        top = largest_amplitude(r)
        if not only_in_contact(e.damping):
            peak = resonance_peak(e, replace(self.setting, F_hat=self.strong, excitation="force"))
            top = top if peak is None else min(peak.u0, top)
        top = min(max(top, _FAINT), _SIZES[1])
        free: tuple[FreeOrbit, ...] = ()
        while not free:
            self.amplitude = np.geomspace(min(_SIZES[0], 0.1 * top), top, _POINTS)
            try:
                free = free_orbits(r, self.amplitude, e.damping)
            except ConvergenceError:  # the law is too stiff at amplitudes far beyond any resonance
                if top < _FAINT:
                    raise
                top *= 0.5
        self.frequency = np.array([o.omega for o in free])

    def run(self) -> None:
        """Trace branches until nothing is left."""
        low, high = self.window
        for omega in (self.orbits.limits[1], low):
            self._near_rest(omega)
        for order in self.orders:
            for found in self._found(order, *self._lanes(order)):
                self._through("detached", *found)
        if self._lost:
            more = f" (and {len(self._lost) - 1} more)" if len(self._lost) > 1 else ""
            self.notes.append(f"an orbit at {self._lost[0]}{more}")
        if not self.branches:
            raise ConvergenceError(f"no periodic orbit found for Omega = {low:g} to {high:g} with F^ = {self.strong:g}")
        if self._left < 0.0:
            self.notes.append(
                "the search ended after too much work, and orbits may be missing: give a narrower window, one of "
                "higher frequencies, or a curve of fewer points"
            )
            return
        self.notes += [
            f"at the end Omega = {edge:g} of the window at least one orbit of period {order} is missing: "
            "give another window, which ends between the resonances"
            for order, edge in product(self.orders, self.window)
            if self._lacks(order, edge)
        ]

    def describe(self) -> str:
        """Sentence `FrequencyResponse.searched`."""
        periods = " and ".join(map(str, self.orders))
        return (
            f"searched: orbits of period {periods}, from rest and up to {_CYCLES * self.grid[0] * self.grid[1]} starts "
            "of each; not searched: longer periods, which period doublings of the last one may lead to, and loops that "
            "start from none of these states"
        )

    def _limits(self) -> tuple[float, float]:
        """Frequencies up to which branches are followed outside the window, in which they may return."""
        low, high = self.window
        strong = min(self.strong, 2.0 * self.strong**0.5)  # the amplitude is about F^/Omega^2
        above = self.orders[-1] * _BEYOND * max(1.0, *self.frequency) * (1.0 + strong)
        return _BELOW * low if low < above else low, max(above, high)

    @property
    def _left(self) -> float:
        """Work that is left."""
        return self.orbits.max_work - self.orbits.work

    def _lacks(self, order: int, edge: float) -> bool:
        """Whether the orbits of a period at an edge are too few, those of period 1 among them.

        Where the period map moves every distant state inwards its degree is 1: a positive determinant of (identity less
        monodromy) counts 1, a negative one -1. A map that may not do so is only expected to have an orbit.
        """
        e = self.equation
        at = [p for p in self._ends if p.order <= order and p.Omega == edge]
        if not e.restoring.contact or only_in_contact(e.damping):
            return order == 1 and not at
        return sum(p.order * int(np.sign(p.fold * (p.flip if p.order < order else 1.0))) for p in at) != 1

    def _near_rest(self, omega: float) -> None:
        """Trace the branch of the linear response at a frequency."""
        force = float(self.setting.forcing(omega))
        impedance = complex(1.0 - omega * omega, 2.0 * self.equation.zeta * omega)
        linear = force / max(abs(impedance), force) * impedance.conjugate() / (abs(impedance) or 1.0)
        rest = np.array([linear.real, -omega * linear.imag])  # of an amplitude of at most 1
        self._through("main", rest, omega, abs(linear) + 1e-12)

    def _lanes(self, order: int) -> tuple[Array, Array]:
        """Omega (starts,), and states (starts, 2): free orbits in resonance with `order` periods of the forcing.

        The forcing must do as much work on a resonant orbit as the damper takes, at some phase: so there are starts at
        all phases, of every amplitude whose resonance is in the window, or near it, up to the one that the forcing
        sustains. An orbit that is shifted by a forcing period has another phase, by a cycle over `order`.
        """
        (low, high), size = self.window, np.log(self.amplitude)
        log_u = np.linspace(size[0], size[-1], _FINE)
        own = np.interp(log_u, size, self.frequency)
        phases, found = np.arange(self.grid[1]) / self.grid[1], [np.empty((3, 0))]
        for omega in own * order / (1.0 + order * np.arange(_CYCLES))[:, None]:
            near = np.flatnonzero((omega > low / _BEYOND) & (omega < high * _BEYOND))
            if near.size:
                away = np.hypot(_FLAT * np.diff(log_u[near]), np.diff(np.log(own[near])))
                along = np.append(0.0, np.cumsum(away))
                count = min(self.grid[0], 1 + int(along[-1] / _APART))
                i = near[np.searchsorted(along, (np.arange(count) + 0.5) / count * along[-1])].repeat(phases.size)
                length = TURN / order / own[i] * np.resize(phases, i.size)
                found.append(np.stack([np.clip(omega[i], low, high), log_u[i], length]))
        omega, log_u, length = np.concatenate(found, axis=1)
        rest, free = np.column_stack([np.exp(log_u), 0.0 * log_u]), replace(self.rough, zeta=0.0)
        return omega, motions(free, rest, 1.0, 0.0, length=length, rtol=_ROUGH, derivatives=False).end

    def _found(self, order: int, omegas: Array, starts: Array) -> Iterator[tuple[Array, float, float, Array]]:
        """Rough states (order, 2), Omega, amplitude, normal of new orbits of `order` forcing periods near the starts.

        A step of Newton's method is the shortest one in state and Omega: so a branch is found also from frequencies
        beyond its folds. The search ends where no work is left.
        """
        parts = -(-len(starts) // _PART)
        for part in range(parts):
            omega, y = omegas[part::parts], starts[part::parts]
            for _ in range(_ITERATIONS):
                kept = np.isfinite(y).all(axis=1)
                omega, y = omega[kept], y[kept]
                if self._left < 0.0 or not y.size:
                    break
                force, grows = self.setting.forcing(omega), self.setting.growth(omega)
                m = motions(self.rough, y, omega, force, grows=grows, length=TURN * order, rtol=_ROUGH)
                self.orbits.work += m.steps / WORK
                scale = _scale(y, omega)
                matrix = (m.by_end - np.eye(2, 3)) * scale[:, None]
                with np.errstate(all="ignore"):
                    g, h, _, k = np.einsum("nik,njk->ijn", matrix, matrix).reshape(4, -1)
                    p, q = (y - m.end).T
                    step = np.einsum("nik,in->nk", matrix, np.array([k * p - h * q, g * q - h * p]) / (g * k - h * h))
                    length = np.linalg.norm(step, axis=1)
                    step *= scale * np.minimum(1.0, 0.3 / length)[:, None]
                y, omega = y + step[:, :2], np.clip(omega + step[:, 2], *self.window)
                for j in np.flatnonzero(length < _CLOSE):
                    found = self._new(order, y[j], float(omega[j]))
                    if found is not None:
                        normal = np.cross(*matrix[j]) / scale[j]
                        yield found, float(omega[j]), float(0.5 * (m.high[j, 0] - m.low[j, 0])), normal
                moving = length >= _CLOSE
                omega, y = omega[moving], y[moving]

    def _new(self, order: int, start: Array, omega: float) -> Array | None:
        """States (order, 2) of an orbit through a state, unless its period is shorter or a path has it."""
        scale, states = _scale(start[None], np.array([omega]))[0], [start]
        if order == 2:
            force = self.setting.forcing(omega)
            states.append(motions(self.rough, start, omega, force, rtol=_ROUGH, derivatives=False).end[0])
            if np.abs((states[1] - start) / scale[:2]).max() < _KNOWN:
                return None
        for line in self._known:
            off, chord = (np.append(start, omega) - line[:-1]) / scale, np.diff(line, axis=0) / scale
            s = np.clip(np.sum(off * chord, axis=1) / np.maximum(np.sum(chord**2, axis=1), 1e-300), 0.0, 1.0)
            if (np.linalg.norm(off - s[:, None] * chord, axis=1) < _KNOWN).any():
                return None
        return np.array(states)

    def _through(self, kind: str, rough: Array, omega: float, amplitude: float, normal: Array | None = None) -> None:
        """Trace the branch through an orbit near rough states (order, 2), if it is new, and those that leave it.

        The orbit is that of Omega, or in the plane with a normal in the first u, v and Omega.
        """
        orbits = self.orbits
        try:
            y = orbits.through(rough, omega)
            if normal is None:
                first = orbits.at(y, amplitude, -1.0)
            else:
                first = orbits.correct(y, np.concatenate([normal[:2], 0.0 * y[2:-1], normal[2:]]), amplitude)
            path = through(orbits, first, self._of(first.order))
        except ConvergenceError as error:
            if kind != "main":
                self._lost.append(f"Omega = {omega:.6g} is on no branch and could not be continued: {error}")
            return
        if path is not None:
            self._add(kind, path)
        while self._doublings and self._left > 0.0:
            path = subharmonic(orbits, self._doublings.pop(0), self._of(2))
            if len(path.points) > 2:
                self._add("sub2", self._joined(path))

    def _of(self, order: int) -> list[Path]:
        """Paths of an order."""
        return [path for path in self._paths if path.order == order]

    def _joined(self, path: Path) -> Path:
        """Path of twice the period up to the period doubling at which it ends, from which it is not traced again."""
        before, end = path.points[-2:]
        ends = [doubled(self.orbits, p) for p in self._doublings] if path.end == "period doubling" else []
        gaps = [self.orbits.segment(p, end)[2] for p in ends]
        if min(gaps, default=np.inf) > self.orbits.segment(before, end)[2]:
            return path
        i = int(np.argmin(gaps))
        del self._doublings[i]
        turn = np.sign(ends[i].tangent @ end.tangent) or 1.0
        last = replace(ends[i], tangent=turn * ends[i].tangent, slopes=-ends[i].slopes)
        return replace(path, points=(*path.points[:-1], last))

    def _add(self, kind: str, path: Path) -> None:
        """Make branches of the pieces of a path in the window, with their events and period doublings."""
        self._paths.append(path)
        points, found = located(self.orbits, path.points)
        self._known += [np.array([(*p.states[k], p.Omega) for p in points]) for k in range(path.order)]
        if 2 * path.order in self.orders:
            self._doublings += [p for name, p in found if name == "period doubling"]
        at = np.array([p.Omega for p in points])
        low, high = self.window
        edge, known = (at == low) | (at == high), (low <= at) & (at <= high)
        within = known[1:] & known[:-1] & ~(edge[1:] & edge[:-1] & (at[1:] == at[:-1]))  # it turns back outside
        cuts = np.unique([0, *(np.flatnonzero(within[1:] != within[:-1]) + 1), at.size - 1])
        for first, last in pairwise(cuts):
            if not within[first]:
                continue
            begin, end = path.begin if first == 0 else "window", path.end if last == at.size - 1 else "window"
            piece, number = points[first : last + 1], len(self.branches)
            reason = end if begin in ("window", "closed") else begin
            self.branches.append(Branch(kind, piece, reason, self.equation.restoring.contact))
            self._ends += [piece[0], piece[-1]]
            inside = [(name, p) for name, p in found if any(p is q for q in piece)]
            self.events += [Solution.at(name, number, p) for name, p in inside]
        for p, reason in ((points[0], path.begin), (points[-1], path.end)):
            if reason not in ("window", "closed", "period doubling", TOO_MUCH) and not self.orbits.is_inside(p.Omega):
                self.notes.append(
                    f"a branch of period {p.order} is lost outside the window at {p.Omega:.6g}, where it may return: "
                    f"{reason}"
                )


def _scale(y: Array, omega: Array) -> Array:
    """Scales of u, v and Omega (lanes, 3) in distances between orbits with the states (lanes, 2)."""
    size = 0.1 + np.abs(y).sum(axis=1)
    return np.column_stack([size, size * np.maximum(1.0, omega), omega])
