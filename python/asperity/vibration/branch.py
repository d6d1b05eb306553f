"""Main branch of periodic orbits by arc length, with its folds, onsets of contact loss and period doublings.

Lengths along the branch are relative: to the amplitude, and to the frequency. The branch is followed from far above
resonance, where the motion is small, and from rest at the low end of the window, beyond which it may return. The cubic
through two orbits and their tangents predicts the next one, and is the guess for orbits between them. Near a
resonance, however narrow, a Floquet multiplier comes close to 1 or -1: a step changes its phase by at most half of the
distance, and so shrinks geometrically instead of jumping over the resonance.
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
from asperity.vibration.orbit import Collocation, Orbit

_SMALLEST, _LONGEST = 1e-8, 0.4  # steps, relative to amplitude and frequency
_MISS, _FAR = 0.005, 4.0  # distance of an orbit from its prediction that a step aims at, over the amplitude; at most
_CUT, _GROWTH = 0.4, (0.3, 2.0)  # change of a step that fails, and of one that succeeds
_STRIDE = 0.1  # longest step of the frequency, relative
_TURNED = 1e-5  # step that is taken though the branch seems to turn: at a corner of the branch
_WEAK = 1e-3  # relative amplitude of a resonance that steps may jump over
_MOST, _CLOSED = 3000, "it closes"  # orbits on a path, and its end where it began
_TOUCH = 1e-9  # share of a step within which an orbit is at a frequency
_PARTS = (1, 8, 64)  # of the forcing, by which motion grows from rest
_SAME = 1e-4  # relative distance below which two orbits are identical
_ROUNDS, _DIP = 6, 0.7  # of the search of a pair of events, and share of a number left at its extremum from where it is

#: What is zero at an event, and at the largest displacement.
TESTS: dict[str, Callable[[Orbit], float]] = {
    "fold": lambda p: p.rate,
    "grazing": lambda p: p.u_min + 1.0,
    "period doubling": lambda p: p.polynomial(-1.0),
    "largest u_max": lambda p: p.rise,
}


def main_branch(col: Collocation, window: tuple[float, float]) -> tuple[list[list[Orbit]], list[str]]:
    """Paths of the main branch around a window, and notes on what could not be followed."""
    low, high = window
    strong = col.equation.forcing(max(high, 1.0))
    limits = 0.5 * low, max(1.5 * high, 2.0, (50.0 * strong) ** 0.5)  # above, the amplitude is about F^/Omega^2
    paths: list[list[Orbit]] = []
    notes: list[str] = []
    for omega in (limits[1], low):
        known = [p for path in paths for p in crossings(col, path, omega)]
        if (first := _from_rest(col, omega)) is None:
            if len(known) % 2 == 0:  # the number of orbits is odd: they appear in pairs
                notes.append(f"no orbit at Omega = {omega:g} is reached from rest")
            continue
        if any(abs(p.u_max - first.u_max) < _SAME * first.size for p in known):
            continue
        down, end = _trace(col, turned(first, -first.rate), limits)
        if end == _CLOSED:  # apart from the main branch
            continue
        up, other = _trace(col, turned(first, first.rate), limits)
        if paths and up[-1].Omega >= limits[1]:  # the whole branch
            paths, notes = [], []
        paths.append([*(turned(p, -1.0) for p in reversed(up[1:])), *down])
        notes += [f"the branch ends early: {reason}" for reason in (other, end) if reason]
    return paths, notes


def _from_rest(col: Collocation, omega: float) -> Orbit | None:
    """Orbit at a frequency by growing the forcing from rest, None where that fails."""
    for parts in _PARTS:
        found = Orbit.rest(omega)
        with suppress(ConvergenceError):
            for part in np.arange(1, parts + 1) / parts:
                weaker = replace(col.equation, F_hat=part * col.equation.F_hat)
                found = Collocation(weaker, col.tol).correct(found, fixed=True)
            return found
    return None


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
        if abs(new.u_max - first.u_max) <= abs(new.u_max - here.u_max) and new.rate * first.rate > 0.0:
            if (here.Omega - first.Omega) * (new.Omega - first.Omega) < 0.0:
                return orbits, _CLOSED
        h *= float(np.clip((_MISS / max(new.moved, 1e-9)) ** (1.0 / 3.0), *_GROWTH))
    return orbits, ""


def _step(col: Collocation, last: Sequence[Orbit], h: float) -> Orbit | None:
    """Orbit a step further along the branch, None where the corrector fails or finds another part of it."""
    here = last[-1]
    with suppress(ConvergenceError):
        guess = ahead(here, h) if len(last) == 1 else cubic(last[0], here, 1.0 + h / _chord(last[0], here)[0])
        found = col.correct(guess, limit=min(_FAR * _MISS, 3.0 * h))
        # Omega turns where a multiplier passes 1, or else the step has jumped to where the branch comes back
        same = here.polynomial(1.0) * here.rate * found.polynomial(1.0) * found.rate > 0.0
        return found if same or h < _TURNED else None
    return None


def ahead(p: Orbit, h: float) -> Orbit:
    """Guess at a distance along the tangent."""
    return replace(p, c=p.c + h * p.c[..., 1:] * (1.0, 0.0), Omega=p.Omega + h * p.rate)


def turned(p: Orbit, sign: float) -> Orbit:
    """The same orbit with the tangent times a sign."""
    return p if sign > 0 else replace(p, c=p.c * (1.0, -1.0), rate=-p.rate)


def _resonance(p: Orbit) -> float:
    """Longest step near a resonance, by the phase of the multipliers."""
    if p.determinant < 1e-200:
        return np.inf
    decay, turn = -0.5 * np.log(p.determinant), TURN / p.Omega**2
    half = 0.5 * abs(p.trace) / np.sqrt(p.determinant)
    near = float(np.arccos(half) if half <= 1.0 else np.arccosh(half))
    rate, grows = max(abs(p.rate), 1e-9), max(0.0, 1.0 - (p.rate / p.Omega) ** 2) ** 0.5
    if grows * abs(p.polynomial(1.0)) < _WEAK * max(decay, 1e-6) * turn * rate:
        return np.inf
    return float((0.5 * near + max(0.5 * decay, 1e-3)) / (turn * rate))


def _chord(a: Orbit, b: Orbit) -> tuple[float, float]:
    """Length of the chord between two orbits in the scale of the second, and over the length of the first tangent."""
    before = a.on(b.nodes, b.corners)
    along, step = before.c[..., 1], b.c[..., 0] - before.c[..., 0]
    length = b.product(step, b.Omega - a.Omega, step, b.Omega - a.Omega) ** 0.5
    return length, length / b.product(along, a.rate, along, a.rate) ** 0.5


def cubic(a: Orbit, b: Orbit, s: float) -> Orbit:
    """Guess by the Hermite cubic through two orbits, which has them at s = 0 and 1."""
    into, out = _chord(a, b)
    weights = np.array([
        ((1 + 2 * s) * (1 - s) ** 2, s * s * (3 - 2 * s), s * (1 - s) ** 2 * out, -s * s * (1 - s) * into),
        (6 * s * (s - 1), 6 * s * (1 - s), (1 - s) * (1 - 3 * s) * out, s * (3 * s - 2) * into),
    ])  # fmt: skip
    known = np.concatenate([a.on(b.nodes, b.corners).c, b.c], axis=2)[..., [0, 2, 1, 3]]
    omega, rate = weights @ (a.Omega, b.Omega, a.rate, b.rate)
    return replace(b, c=known @ weights.T, Omega=float(omega), rate=float(rate))


def _frequencies(a: Orbit, b: Orbit) -> Array:
    """Coefficients, highest first, of Omega on that cubic."""
    into, out = _chord(a, b)
    chord, out, into = b.Omega - a.Omega, a.rate * out, b.rate * into
    return np.array([out + into - 2.0 * chord, 3.0 * chord - 2.0 * out - into, out, a.Omega])


def between(col: Collocation, a: Orbit, b: Orbit, fraction: float) -> Orbit:
    """Orbit at a fraction of the way between neighbours, corrected from the cubic through them."""
    return col.correct(cubic(a, b, fraction), limit=1.0)


def crossings(col: Collocation, orbits: Sequence[Orbit], omega: float) -> list[Orbit]:
    """Orbits of a path at a frequency, in order along it; a `ConvergenceError` where one cannot be corrected."""
    found = []
    for a, b in pairwise(orbits):
        reach = 2.0 * abs(b.Omega - a.Omega) + 1e-3 * omega
        if min(a.Omega, b.Omega) - reach > omega or max(a.Omega, b.Omega) + reach < omega:
            continue
        roots = np.roots(_frequencies(a, b) - (0.0, 0.0, 0.0, omega))
        for s in np.sort(roots[np.abs(roots.imag) < 1e-12].real):
            if -_TOUCH <= s < 1.0 - _TOUCH or (b is orbits[-1] and abs(s - 1.0) <= _TOUCH):
                guess = cubic(a, b, float(s))
                orbit = col.correct(replace(guess, Omega=omega), fixed=True, limit=1.0)
                found.append(turned(orbit, guess.rate * orbit.rate))
    return found


def located(col: Collocation, orbits: list[Orbit]) -> tuple[list[Orbit], list[tuple[str, Orbit]], list[str]]:
    """Orbits with those added where a test is zero, these with its name, and notes on those that are not found."""
    orbits = _with_pairs(col, orbits)
    out, named, notes = orbits[:1], [], []
    for a, b in pairwise(orbits):
        inside: list[tuple[float, Orbit, str]] = []
        for name, value in TESTS.items():
            if (value(a) > 0) != (value(b) > 0):
                try:
                    inside.append((*_zero(col, a, b, value), name))
                except ConvergenceError:
                    notes.append(f"a {name} between Omega = {a.Omega:.6g} and {b.Omega:.6g} could not be located")
        inside.sort(key=lambda item: item[0])
        named += [(name, p) for _, p, name in inside]
        out += [*(p for _, p, _ in inside), b]
    return out, named, notes


def _with_pairs(col: Collocation, orbits: list[Orbit]) -> list[Orbit]:
    """Orbits with one more between each pair of zeros of a test that lies between neighbours.

    The cubic of Omega shows a pair of folds. Of another test the parabola through three neighbours leads to its
    extremum, as long as it promises a value much closer to zero.
    """
    added: dict[int, Orbit] = {}

    def add(k: int, s: float) -> None:
        with suppress(ConvergenceError):
            added[k] = between(col, orbits[k], orbits[k + 1], s)

    for k, (a, b) in enumerate(pairwise(orbits)):
        turns = np.roots(np.polyder(_frequencies(a, b)))
        if a.rate * b.rate > 0 and np.isreal(turns).all() and np.all((turns > 0) & (turns < 1)):
            add(k, float(turns.real.mean()))
    for value in TESTS.values():
        for _ in range(_ROUNDS):
            orbits = [p for k, one in enumerate(orbits) for p in ([one, added[k]] if k in added else [one])]
            added.clear()
            y = np.array([value(p) for p in orbits])
            dips = (np.abs(y[1:-1]) <= np.minimum(np.abs(y[:-2]), np.abs(y[2:]))) & (y[:-2] * y[1:-1] > 0)
            for i in np.flatnonzero(dips & (y[1:-1] * y[2:] > 0)) + 1:
                before, after = (_chord(orbits[k], orbits[k + 1])[0] for k in (i - 1, i))
                curve = np.polyfit([-before, 0.0, after], y[i - 1 : i + 2] / y[i], 2)
                at = -0.5 * curve[1] / curve[0]
                if np.polyval(curve, at) < _DIP:
                    add(*((i - 1, 1.0 + at / before) if at < 0 else (i, at / after)))
            if not added:
                break
    return orbits


def _zero(col: Collocation, a: Orbit, b: Orbit, value: Callable[[Orbit], float]) -> tuple[float, Orbit]:
    """Fraction and orbit between neighbours at which a test, of opposite signs there, is zero."""
    last = [a]

    def at(s: float) -> float:
        last.append(a if s == 0.0 else b if s == 1.0 else between(col, a, b, s))
        return value(last[-1])

    s = float(brentq(at, 0.0, 1.0, xtol=1e-6, rtol=1e-6))
    return s, min(last[1:], key=lambda p: abs(value(p)))
