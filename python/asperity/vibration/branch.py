"""Main branch of periodic orbits by arc length, with its folds, onsets of contact loss and period doublings.

Lengths along the branch are relative: to the amplitude, and to the frequency. The branch starts far above resonance,
where the motion is small, and once more from rest at the low end of the window; it is followed beyond the window, from
where it may return. Near a resonance, however narrow, a Floquet multiplier comes close to 1 or -1: a step changes its
phase by at most half of the distance, and so shrinks geometrically instead of jumping over the resonance.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.optimize import brentq, minimize_scalar

from asperity.arrays import Array
from asperity.errors import ConvergenceError
from asperity.vibration.equation import TURN
from asperity.vibration.orbit import Collocation, Mesh, Orbit, Wave

_SMALLEST, _LONGEST = 1e-8, 0.4  # steps, relative to amplitude and frequency
_CUT = 0.4  # of a step that fails
_MISS = (0.005, 0.03)  # allowed distance of an orbit from its prediction over the amplitude, in the window and outside
_ACROSS = 25.0  # steps through the window, at least
_STRIDE = 0.1  # longest step outside it, over the frequency
_TURNED = 1e-5  # step that is taken though the branch seems to turn: at a corner of the branch
_WEAK = 1e-3  # relative amplitude of a resonance that steps may jump over
_MOST = 3000  # orbits on a path
_WINDOW, _CLOSED = "window", "closed"  # reasons to end: it leaves the frequencies in question, it returns to its start
_TOP = "largest u_max"  # a special orbit, but no event
_TRIALS, _DIP = 12, 2.5  # orbits at which a pair of doublings is sought, angle of multipliers below which it is
_SAME = 1e-4  # relative distance below which two orbits are identical


@dataclass(frozen=True)
class Path:
    """Orbits in order along a branch, and why it ends."""

    orbits: tuple[Orbit, ...]
    end: str


def main_branch(col: Collocation, window: tuple[float, float]) -> tuple[list[Path], list[str]]:
    """Paths of the main branch, in and outside the window, and notes on what could not be followed."""
    low, high = window
    strong = col.forcing(max(high, 1.0))[0]
    above = max(1.5 * high, 2.0, (50.0 * strong) ** 0.5)  # there the amplitude is about F^/Omega^2
    limits = 0.5 * low, above * (1.0 + 1e-9)
    paths: list[Path] = []
    notes: list[str] = []
    for omega in (above, low):
        try:
            first = near_rest(col, omega)
        except ConvergenceError as error:
            notes.append(str(error))
            continue
        known = [q for path in paths for q in _at(col, path.orbits, omega)]
        if any(abs(q.u_max - first.u_max) + abs(q.u_min - first.u_min) < _SAME * first.amplitude for q in known):
            continue
        path = trace(col, first, -1.0, window, limits)
        if path.end == _CLOSED:  # a loop apart from the main branch
            continue
        if omega < above:
            up = trace(col, first, 1.0, window, limits)
            end = path.end if up.end == _WINDOW else up.end
            path = Path((*(p.turned(-1.0) for p in reversed(up.orbits[1:])), *path.orbits), end)
            if paths and paths[0].end != _WINDOW and up.end == _WINDOW and up.orbits[-1].Omega > above:
                paths.clear()  # it is a part of this one
                notes.clear()
        paths.append(path)
        if path.end != _WINDOW:
            notes.append(f"the branch ends early: {path.end}")
    if not paths:
        raise ConvergenceError(f"no periodic orbit found for Omega = {low:g} to {high:g}: {'; '.join(notes)}")
    notes = [note for note in notes if "reached from rest" not in note]
    return paths, notes


def _at(col: Collocation, orbits: Sequence[Orbit], omega: float) -> list[Orbit]:
    """Orbits of a path at a frequency, without those that cannot be corrected."""
    with suppress(ConvergenceError):
        return crossings(col, orbits, omega)
    return []


def near_rest(col: Collocation, omega: float) -> Orbit:
    """Orbit at a frequency by growing the forcing from small motion; a `ConvergenceError` where none is reached."""
    (force, grows), zeta = col.forcing(omega), col.equation.zeta
    linear = Wave.harmonic(Mesh.even(int(8.0 / omega)), force / complex(1.0 - omega**2, 2.0 * zeta * omega))
    found, grown, share = None, 0.0, 1.0
    while grown < 1.0:
        part = min(1.0, grown + share)
        weaker = Collocation(col.equation, lambda w, part=part: (part * force, part * grows), col.tol)  # type: ignore[misc]
        guess = linear.times(part) if found is None else found.wave.times(part / grown)
        try:
            found = weaker.correct(guess, omega, limit=np.inf if found is None else 1.0)
            grown, share = part, 1.5 * share
        except ConvergenceError:
            share *= 0.3
            if share < 1e-4:
                raise ConvergenceError(f"no orbit at Omega = {omega:g} is reached from rest") from None
    assert found is not None
    return col.correct(found.wave, omega)


def trace(
    col: Collocation, first: Orbit, sense: float, window: tuple[float, float], limits: tuple[float, float]
) -> Path:
    """Follow the branch from an orbit, at first with Omega changing in the sense (+-1), until it leaves the limits."""
    orbits, h, before = [first.turned(sense * first.rate)], 0.05, 0.0
    while True:
        here = orbits[-1]
        inside = window[0] <= here.Omega <= window[1]
        longest = (window[1] - window[0]) / _ACROSS if inside else _STRIDE * here.Omega
        h = min(h, _LONGEST, longest / max(abs(here.rate), 1e-9), _resonance(here))
        h = max(h, 2.0 * _SMALLEST)
        curved, bend, miss = here.along.times(0.0), 0.0, _MISS[0 if inside else 1]
        if before:
            curved = here.along.plus((-1.0, orbits[-2].along.on(here.wave.mesh)))
            bend = here.rate - orbits[-2].rate
        new = None
        while new is None and h > _SMALLEST:
            second = 0.5 * h * h / before if before else 0.0
            guess = here.wave.plus((h, here.along), (second, curved))
            with suppress(ConvergenceError):
                found = col.correct(
                    guess, here.Omega + h * here.rate + second * bend, here.along, here.rate, limit=3.0 * h
                )
                # Omega turns where a multiplier passes 1, or else the step has jumped to where the branch comes back
                turned = h > _TURNED and here.fold * here.rate * found.fold * found.rate < 0
                if found.moved < 2.0 * miss and not turned and _cosine(here, found) > 0.5:
                    new = found
                    continue
            h *= _CUT
        if new is None:
            return Path(tuple(orbits), f"no orbit follows at Omega = {here.Omega:.6g}, u_max = {here.u_max:.4g}")
        orbits.append(new)
        before, h = h, h * min(2.0, max(0.3, (0.5 * miss / max(new.moved, 1e-6)) ** (1.0 / 3.0)))
        if not limits[0] <= new.Omega <= limits[1]:
            return Path(tuple(orbits), _WINDOW)
        if len(orbits) > 6 and _passes(here, new, first):
            return Path(tuple(orbits), _CLOSED)
        if len(orbits) > _MOST:
            return Path(tuple(orbits), f"{_MOST} orbits, at Omega = {new.Omega:.6g}, u_max = {new.u_max:.4g}")


def _passes(a: Orbit, b: Orbit, first: Orbit) -> bool:
    """Whether the step from a to b passes the first orbit."""
    points = np.array([
        (np.log(p.Omega), *np.array([p.u_max, p.u_min, p.first.real, p.first.imag]) / a.amplitude)
        for p in (a, b, first)
    ])  # fmt: skip
    chord, to = points[1:] - points[0]
    share = float(to @ chord) / float(chord @ chord)
    return 0.0 <= share <= 1.0 and bool(np.linalg.norm(to - share * chord) < 0.1 * np.linalg.norm(chord))


def _cosine(a: Orbit, b: Orbit) -> float:
    """Cosine of the angle between the tangents at two orbits."""
    one, other, scale = a.along, b.along.on(a.wave.mesh), a.wave.amplitude**2

    def dot(x: Wave, p: float, y: Wave, q: float) -> float:
        return x.dot(y) / scale + p * q / a.Omega**2

    size = dot(one, a.rate, one, a.rate) * dot(other, b.rate, other, b.rate)
    return float(dot(one, a.rate, other, b.rate) / np.sqrt(size))


def _resonance(p: Orbit) -> float:
    """Longest step near a resonance, by the phase of the multipliers."""
    if p.determinant < 1e-200:
        return np.inf
    decay, turn = -0.5 * np.log(p.determinant), TURN / p.Omega**2
    half = 0.5 * p.trace / np.sqrt(p.determinant)
    near = min(float(np.arccos(max(x, -1.0)) if x <= 1.0 else np.arccosh(x)) for x in (half, -half))
    drift = np.sqrt(p.along.dot(p.along)) / p.wave.amplitude / max(abs(p.rate), 1e-9)
    if drift * abs(p.fold) / turn < _WEAK * max(decay, 1e-6):
        return np.inf
    return float((0.5 * near + max(0.5 * decay, 1e-3)) / (turn * max(abs(p.rate), 1e-9)))


def _chord(a: Orbit, b: Orbit) -> tuple[float, float, float]:
    """Length of the chord between two orbits in the scales of the first, and over the lengths of both tangents."""
    scale = a.wave.amplitude**2

    def size(wave: Wave, number: float) -> float:
        return float(np.sqrt(wave.dot(wave) / scale + (number / a.Omega) ** 2))

    length = size(b.wave.on(a.wave.mesh).plus((-1.0, a.wave)), b.Omega - a.Omega)
    return length, length / size(a.along, a.rate), length / size(b.along, b.rate)


def cubic(a: Orbit, b: Orbit, s: float) -> tuple[Wave, float, Wave, float]:
    """Hermite cubic between two orbits at the fraction s, and its derivative: u over the phase, and Omega."""
    mesh, (_, out, into) = a.wave.mesh if s < 0.5 else b.wave.mesh, _chord(a, b)
    waves = [wave.on(mesh) for wave in (a.wave, b.wave, a.along, b.along)]
    numbers = np.array([a.Omega, b.Omega, a.rate, b.rate])
    zero, found = waves[0].times(0.0), []
    for x in (
        ((1 + 2 * s) * (1 - s) ** 2, s * s * (3 - 2 * s), s * (1 - s) ** 2 * out, -s * s * (1 - s) * into),
        (6 * s * (s - 1), 6 * s * (1 - s), (1 - s) * (1 - 3 * s) * out, s * (3 * s - 2) * into),
    ):
        found += [zero.plus(*zip(x, waves, strict=True)), float(np.dot(x, numbers))]
    return tuple(found)  # type: ignore[return-value]


def _frequencies(a: Orbit, b: Orbit) -> Array:
    """Coefficients, highest first, of the cubic of Omega between two orbits over [0, 1]."""
    _, out, into = _chord(a, b)
    chord, out, into = b.Omega - a.Omega, a.rate * out, b.rate * into
    return np.array([out + into - 2.0 * chord, 3.0 * chord - 2.0 * out - into, out, a.Omega])


def between(col: Collocation, a: Orbit, b: Orbit, fraction: float) -> Orbit:
    """Orbit at a fraction of the way between neighbours, corrected from the cubic through them."""
    guess, omega, along, rate = cubic(a, b, fraction)
    found = col.correct(guess, omega, along, rate, limit=1.0)
    return found.turned(_cosine(found, a))


def crossings(col: Collocation, orbits: Sequence[Orbit], omega: float) -> list[Orbit]:
    """Orbits of a path at a frequency, in order along it; a `ConvergenceError` where one cannot be corrected."""
    found = []
    for a, b in pairwise(orbits):
        reach = 2.0 * abs(b.Omega - a.Omega) + 1e-3 * omega
        if min(a.Omega, b.Omega) - reach > omega or max(a.Omega, b.Omega) + reach < omega:
            continue
        roots = np.roots(_frequencies(a, b) - [0.0, 0.0, 0.0, omega])
        for s in np.sort(roots[np.abs(roots.imag) < 1e-12].real):
            if 0.0 <= s < 1.0 or (b is orbits[-1] and s == 1.0):
                guess, _, _, rate = cubic(a, b, float(s))
                orbit = col.correct(guess, omega, limit=1.0)
                found.append(orbit.turned(rate * orbit.rate))
    return found


def located(col: Collocation, path: Sequence[Orbit]) -> tuple[list[Orbit], list[tuple[str, Orbit]], list[str]]:
    """Path with its special orbits added, these with their names, and notes on those that could not be located."""
    orbits = list(path[:1])
    for a, b in pairwise(path):
        turns = np.roots(np.polyder(_frequencies(a, b)))
        if a.rate * b.rate > 0 and turns.size == 2 and np.isreal(turns).all() and np.all((turns > 0) & (turns < 1)):
            with suppress(ConvergenceError):  # a pair of folds between two orbits
                orbits.append(between(col, a, b, float(turns.real.mean())))
        orbits.append(b)
    orbits = _with_doublings(col, orbits)
    tests: dict[str, Callable[[Orbit], float]] = {
        "fold": lambda p: p.rate,
        "grazing": lambda p: p.u_min + 1.0,
        "period doubling": lambda p: p.flip,
        _TOP: lambda p: p.rise,
    }
    out, named, notes = orbits[:1], [], []
    for a, b in pairwise(orbits):
        inside: list[tuple[float, Orbit, str]] = []
        for name, value in tests.items():
            x, y = value(a), value(b)
            if (x > 0) != (y > 0) and not (name == _TOP and x < 0):
                try:
                    inside.append((*_located(col, a, b, value), name))
                except ConvergenceError:
                    notes.append(f"a {name} between Omega = {a.Omega:.6g} and {b.Omega:.6g} could not be located")
        for _, p, name in sorted(inside, key=lambda item: item[0]):
            out.append(p)
            named.append((name, p))
        out.append(b)
    return out, named, notes


def _with_doublings(col: Collocation, orbits: list[Orbit]) -> list[Orbit]:
    """Orbits with one more inside each pair of period doublings that lies between neighbours.

    The square of the angle of the multipliers from -1 is smooth along the branch, and negative between two doublings.
    """
    square = np.array([_angle_square(p) for p in orbits])
    dips = (square[1:-1] < square[:-2]) & (square[1:-1] <= square[2:]) & (square[1:-1] < _DIP)
    added: dict[int, Orbit] = {}
    for i in np.flatnonzero(dips) + 1:
        if min(p.flip for p in orbits[i - 1 : i + 2]) < 0:
            continue

        def at(s: float, i: int = int(i)) -> float:
            left = i - 1 + (s >= 1.0)
            p = between(col, orbits[left], orbits[left + 1], s % 1.0)
            if p.flip < 0:
                added[left] = p
                raise StopIteration
            return _angle_square(p)

        with suppress(StopIteration, ConvergenceError):
            minimize_scalar(
                at, bounds=(1e-6, 2.0 - 1e-6), method="bounded", options={"maxiter": _TRIALS, "xatol": 1e-6}
            )
    return [p for i, one in enumerate(orbits) for p in ([one, added[i]] if i in added else [one])]


def _angle_square(p: Orbit) -> float:
    """Square of the angle between the multipliers and -1, negative where they are real and negative."""
    h = -0.5 * p.trace / np.sqrt(max(p.determinant, 1e-200))
    return float(np.arccos(np.clip(h, -1.0, 1.0)) ** 2 if h <= 1.0 else -(np.arccosh(h) ** 2))


def _located(col: Collocation, a: Orbit, b: Orbit, value: Callable[[Orbit], float]) -> tuple[float, Orbit]:
    """Fraction and orbit between neighbours at which a number, of opposite signs there, is zero."""
    last = [a]

    def at(s: float) -> float:
        last.append(a if s == 0.0 else b if s == 1.0 else between(col, a, b, s))
        return value(last[-1])

    s = float(brentq(at, 0.0, 1.0, xtol=1e-7, rtol=1e-7))
    return s, min(last[1:], key=lambda p: abs(value(p)))
