"""Main branch of periodic orbits by arc length, with its folds, onsets of contact loss and period doublings.

Lengths along the branch are relative: to the amplitude, and to the frequency. The branch starts far above resonance,
where the motion is small, and is followed down beyond the window, from where it may return. The cubic through two
orbits and their tangents predicts the next one, and is the guess for orbits between them. Near a resonance, however
narrow, a Floquet multiplier comes close to 1 or -1: a step changes its phase by at most half of the distance, and so
shrinks geometrically instead of jumping over the resonance.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import replace
from itertools import pairwise

import numpy as np
from scipy.optimize import brentq

from asperity.arrays import Array
from asperity.errors import ConvergenceError
from asperity.vibration.equation import TURN
from asperity.vibration.orbit import Collocation, Orbit, Wave

_SMALLEST, _LONGEST = 1e-8, 0.4  # steps, relative to amplitude and frequency
_MISS = 0.005  # distance of an orbit from its prediction that a step aims at, over the amplitude
_CUT, _GROWTH = 0.4, (0.3, 2.0)  # change of a step that fails, and of one that succeeds
_STRIDE = 0.1  # longest step of the frequency, relative
_TURNED = 1e-5  # step that is taken though the branch seems to turn: at a corner of the branch
_WEAK = 1e-3  # relative amplitude of a resonance that steps may jump over
_MOST = 3000  # orbits on a path
_LEAST = 1e-4  # part of the forcing by which that is grown
_SAME = 1e-4  # relative distance below which two orbits are identical
_ROUNDS, _DIP = 6, 0.7  # of the search of a pair of events, share of a number left at its extremum from where it is

Test = Callable[[Orbit], float]
#: What is zero at an event.
EVENTS: dict[str, Test] = {
    "fold": lambda p: p.rate,
    "grazing": lambda p: p.u_min + 1.0,
    "period doubling": lambda p: p.flip,
}


def main_branch(col: Collocation, window: tuple[float, float]) -> tuple[list[list[Orbit]], list[str]]:
    """Parts of the main branch from far above to far below a window, and notes on what could not be followed.

    The branch is followed down, and once more up from rest below the window, where that motion is another one.
    """
    low, high = window
    strong = col.forcing(max(high, 1.0))[0]
    limits = 0.5 * low, max(1.5 * high, 2.0, (50.0 * strong) ** 0.5)  # above, the amplitude is about F^/Omega^2
    paths: list[list[Orbit]] = []
    notes: list[str] = []
    for sense, starts in ((-1.0, limits[1:]), (1.0, (limits[0], low))):
        first = next((p for p in (_from_rest(col, omega) for omega in starts) if p is not None), None)
        if first is None:
            if notes or not paths:  # or else the branch from above has been followed through the window
                notes.append(f"no orbit at Omega = {starts[-1]:g} is reached from rest")
            continue
        known = (p for path in paths for p in crossings(col, path, first.Omega))
        if any(abs(p.u_max - first.u_max) < _SAME * first.amplitude for p in known):
            continue
        path, end = _trace(col, turned(first, sense * first.rate), limits)
        if paths and path[-1].Omega >= limits[1]:  # the whole branch
            paths, notes = [], []
        paths.append(path)
        notes += [f"the branch ends early: {end}"] if end else []
    return paths, notes


def _from_rest(col: Collocation, omega: float) -> Orbit | None:
    """Orbit at a frequency by growing the forcing from small motion, None where that fails."""
    (force, grows), zeta = col.forcing(omega), col.equation.zeta
    wave, grown, share = Wave.harmonic(force / complex(1.0 - omega**2, 2.0 * zeta * omega), omega), 1.0, 1.0
    found: Orbit | None = None
    while found is None or grown < 1.0:
        part = min(1.0, (found is not None) * grown + share)
        weaker = Collocation(col.equation, lambda w, part=part: (part * force, part * grows), col.tol)  # type: ignore[misc]
        guess = replace(wave, c=wave.c * part / grown)
        try:
            found = weaker.correct(guess, omega, fixed=True, limit=1.0 if found else np.inf)
            wave, grown, share = found.wave, part, 1.5 * share
        except ConvergenceError:
            share *= 0.3
            if share < _LEAST:
                return None
    return found


def _trace(col: Collocation, first: Orbit, limits: tuple[float, float]) -> tuple[list[Orbit], str]:
    """Orbits from one on along its tangent until they leave the limits of Omega, and why they end before, or ""."""
    orbits, h = [first], 0.05
    while limits[0] <= orbits[-1].Omega <= limits[1]:
        here = orbits[-1]
        where = f"Omega = {here.Omega:.6g}, u_max = {here.u_max:.4g}"
        if len(orbits) > _MOST:
            return orbits, f"{_MOST} orbits, at {where}"
        h = min(h, _LONGEST, _STRIDE * here.Omega / max(abs(here.rate), 1e-9), _resonance(here))
        h = max(h, 2.0 * _SMALLEST)
        while (new := _step(col, orbits[-2:], h)) is None:
            h *= _CUT
            if h < _SMALLEST:
                return orbits, f"no orbit follows at {where}"
        orbits.append(new)
        h *= float(np.clip((_MISS / max(new.moved, 1e-9)) ** (1.0 / 3.0), *_GROWTH))
    return orbits, ""


def _step(col: Collocation, last: Sequence[Orbit], h: float) -> Orbit | None:
    """Orbit a step further along the branch, None where the corrector fails or finds another part of it."""
    here = last[-1]
    if len(last) == 1:
        guess, omega, rate = ahead(here, h)
    else:
        guess, omega, rate = cubic(*last, 1.0 + h / _chord(*last)[0])
    try:
        found = col.correct(guess, omega, rate, limit=3.0 * h)
    except ConvergenceError:
        return None
    # Omega turns where a multiplier passes 1, or else the step has jumped to where the branch comes back
    jumped = h > _TURNED and here.fold * here.rate * found.fold * found.rate < 0
    return None if jumped or found.moved > 4.0 * _MISS or _cosine(here, found) < 0.5 else found


def ahead(p: Orbit, h: float) -> tuple[Wave, float, float]:
    """Guess at a distance along the tangent: u and the tangent, Omega, its rate."""
    c = p.wave.c + h * p.wave.c[..., 1:] * (1.0, 0.0)
    return replace(p.wave, c=c), p.Omega + h * p.rate, p.rate


def turned(p: Orbit, sign: float) -> Orbit:
    """The same orbit with the tangent times a sign."""
    return p if sign > 0 else replace(p, wave=replace(p.wave, c=p.wave.c * (1.0, -1.0)), rate=-p.rate)


def _dot(p: Orbit, one: Array, a: float, other: Array, b: float) -> float:
    """Product of directions, u on the mesh of an orbit and Omega, in the scales of the orbit."""
    return p.wave.mean(one, other) / p.wave.size**2 + a * b / p.Omega**2


def _cosine(a: Orbit, b: Orbit) -> float:
    """Cosine of the angle between the tangents at two orbits."""
    one, other = a.wave.c[..., 1], b.wave.on(a.wave.nodes, a.wave.corners).c[..., 1]
    size = _dot(a, one, a.rate, one, a.rate) * _dot(a, other, b.rate, other, b.rate)
    return _dot(a, one, a.rate, other, b.rate) / float(np.sqrt(size))


def _resonance(p: Orbit) -> float:
    """Longest step near a resonance, by the phase of the multipliers."""
    if p.determinant < 1e-200:
        return np.inf
    decay, turn = -0.5 * np.log(p.determinant), TURN / p.Omega**2
    half = 0.5 * abs(p.trace) / np.sqrt(p.determinant)
    near = float(np.arccos(half) if half <= 1.0 else np.arccosh(half))
    rate, tangent = max(abs(p.rate), 1e-9), p.wave.c[..., 1]
    drift = np.sqrt(p.wave.mean(tangent, tangent)) / p.wave.size / rate
    if drift * abs(p.fold) / turn < _WEAK * max(decay, 1e-6):
        return np.inf
    return float((0.5 * near + max(0.5 * decay, 1e-3)) / (turn * rate))


def _chord(a: Orbit, b: Orbit) -> tuple[float, float]:
    """Length of the chord between two orbits in the scale of the second, and over the length of the first tangent."""
    before = a.wave.on(b.wave.nodes, b.wave.corners).c
    along, step = before[..., 1], b.wave.c[..., 0] - before[..., 0]
    length = _dot(b, step, b.Omega - a.Omega, step, b.Omega - a.Omega) ** 0.5
    return length, length / _dot(b, along, a.rate, along, a.rate) ** 0.5


def cubic(a: Orbit, b: Orbit, s: float) -> tuple[Wave, float, float]:
    """Hermite cubic through orbits at the fractions s = 0 and 1, as u and its derivative, Omega, its derivative."""
    into, out = _chord(a, b)
    before = a.wave.on(b.wave.nodes, b.wave.corners).c
    weights = np.array([
        ((1 + 2 * s) * (1 - s) ** 2, s * s * (3 - 2 * s), s * (1 - s) ** 2 * out, -s * s * (1 - s) * into),
        (6 * s * (s - 1), 6 * s * (1 - s), (1 - s) * (1 - 3 * s) * out, s * (3 * s - 2) * into),
    ])  # fmt: skip
    known = np.stack([before[..., 0], b.wave.c[..., 0], before[..., 1], b.wave.c[..., 1]], axis=2)
    omega, rate = weights @ (a.Omega, b.Omega, a.rate, b.rate)
    return replace(b.wave, c=known @ weights.T), float(omega), float(rate)


def between(col: Collocation, a: Orbit, b: Orbit, fraction: float) -> Orbit:
    """Orbit at a fraction of the way between neighbours, corrected from the cubic through them."""
    return col.correct(*cubic(a, b, fraction), limit=1.0)


def crossings(col: Collocation, orbits: Sequence[Orbit], omega: float) -> list[Orbit]:
    """Orbits of a path at a frequency, in order along it; a `ConvergenceError` where one cannot be corrected."""
    found = []
    for a, b in pairwise(orbits):
        reach = 2.0 * abs(b.Omega - a.Omega) + 1e-3 * omega
        if min(a.Omega, b.Omega) - reach > omega or max(a.Omega, b.Omega) + reach < omega:
            continue
        into, out = _chord(a, b)
        chord, out, into = b.Omega - a.Omega, a.rate * out, b.rate * into
        roots = np.roots([out + into - 2.0 * chord, 3.0 * chord - 2.0 * out - into, out, a.Omega - omega])
        for s in np.sort(roots[np.abs(roots.imag) < 1e-12].real):
            if 0.0 <= s < 1.0 or (b is orbits[-1] and s == 1.0):
                guess, _, rate = cubic(a, b, float(s))
                orbit = col.correct(guess, omega, fixed=True, limit=1.0)
                found.append(turned(orbit, rate * orbit.rate))
    return found


def located(
    col: Collocation, orbits: Sequence[Orbit], tests: dict[str, Test]
) -> tuple[list[Orbit], list[tuple[str, Orbit]], list[str]]:
    """Orbits with those added where a test is zero, these with its name, and notes on those that are not found."""
    for value in tests.values():
        orbits = _with_pairs(col, orbits, value)
    out, named, notes = list(orbits[:1]), [], []
    for a, b in pairwise(orbits):
        inside: list[tuple[float, Orbit, str]] = []
        for name, value in tests.items():
            if (value(a) > 0) != (value(b) > 0):
                try:
                    inside.append((*_zero(col, a, b, value), name))
                except ConvergenceError:
                    notes.append(f"a {name} between Omega = {a.Omega:.6g} and {b.Omega:.6g} could not be located")
        for _, p, name in sorted(inside, key=lambda item: item[0]):
            out.append(p)
            named.append((name, p))
        out.append(b)
    return out, named, notes


def _with_pairs(col: Collocation, orbits: Sequence[Orbit], value: Test) -> list[Orbit]:
    """Orbits with one more between each pair of zeros of a test that lies between neighbours.

    The parabola through three neighbours leads to its extremum, as long as it promises a value much closer to zero.
    """
    done = list(orbits)
    for i in range(len(orbits) - 2):
        three = list(orbits[i : i + 3])
        for _ in range(_ROUNDS):
            y = np.array([value(p) for p in three])
            y = y * np.sign(y[1])
            if y.min() <= 0.0 or y[1] > min(y[0], y[2]):
                break
            x = np.cumsum([0.0, *(_chord(a, b)[0] for a, b in pairwise(three))])
            curve = np.polyfit(x - x[1], y, 2)
            at = -0.5 * curve[1] / curve[0]
            if not np.polyval(curve, at) < _DIP * y[1]:
                break
            k = int(at > 0.0)
            with suppress(ConvergenceError):
                new = between(col, three[k], three[k + 1], (at + x[1] - x[k]) / (x[k + 1] - x[k]))
                done.insert(done.index(three[k]) + 1, new)
                three = [*three[: k + 1], new, *three[k + 1 :]]
                best = min(range(1, 3), key=lambda j: abs(value(three[j])))
                three = three[best - 1 : best + 2]
                continue
            break
    return done


def _zero(col: Collocation, a: Orbit, b: Orbit, value: Test) -> tuple[float, Orbit]:
    """Fraction and orbit between neighbours at which a test, of opposite signs there, is zero."""
    last = [a]

    def at(s: float) -> float:
        last.append(a if s == 0.0 else b if s == 1.0 else between(col, a, b, s))
        return value(last[-1])

    s = float(brentq(at, 0.0, 1.0, xtol=1e-6, rtol=1e-6))
    return s, min(last[1:], key=lambda p: abs(value(p)))
