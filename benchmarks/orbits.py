# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

"""Completeness of the frequency response: random windows against wide ones, and against random starts in time.

    python3 benchmarks/orbits.py [--windows 200] [--seed 0]

Each case has a random exponent (0.6 to 4), damping ratio (0.002 to 0.1), forcing F^ (0.005 to 1.5) and window. At two
frequencies inside, every orbit of period 1 and 2 must be one of a response over a window twice as wide on both sides,
and the reverse. Then motions from random states are integrated until they settle, by a Runge-Kutta method written
here, for u'' = F^ cos(Omega tau) - f(u) - 2 zeta u'. Every motion of period 1 or 2 must be an orbit of the response.
"""

from __future__ import annotations

import argparse
import os
import time
from dataclasses import dataclass

os.environ.setdefault("OMP_NUM_THREADS", "1")

import numpy as np
from numpy.typing import NDArray

from asperity.dynamics import ContactOscillator, FrequencyResponse, PowerLaw, Solution
from asperity.errors import AsperityError

Array = NDArray[np.float64]
CLOSE = 1e-2  # relative distance within which two orbits are the same


@dataclass(frozen=True)
class Window:
    """One random case, with the frequencies at which its orbits are compared."""

    n: float
    zeta: float
    forcing: float
    omega: tuple[float, float]
    at: tuple[float, ...]


def random_windows(count: int, seed: int, frequencies: int = 2) -> list[Window]:
    """Draw cases: the low end 0.25 to 2, the width 0.05 to 1."""
    random = np.random.default_rng(seed)
    out = []
    for _ in range(count):
        n = random.uniform(0.6, 4.0)
        zeta, forcing = np.exp(random.uniform(np.log([0.002, 0.005]), np.log([0.1, 1.5])))
        low = random.uniform(0.25, 2.0)
        high = low + np.exp(random.uniform(np.log(0.05), 0.0))
        at = tuple(float(w) for w in low + (high - low) * random.uniform(0.02, 0.98, frequencies))
        out.append(Window(float(n), float(zeta), float(forcing), (float(low), float(high)), at))
    return out


def response(case: Window, omega: tuple[float, float]) -> FrequencyResponse:
    """Compute the response of a case over any window."""
    return ContactOscillator(PowerLaw(case.n), zeta=case.zeta).response(case.forcing, omega)


def states(orbits: tuple[Solution, ...]) -> list[Array]:
    """Return the states (order, 2) of each orbit at forcing phase 0."""
    out = []
    for s in orbits:
        k = np.arange(s.coefficients.size)
        c = s.coefficients * np.exp(2j * np.pi / s.order * np.outer(np.arange(s.order), k))
        out.append(np.stack([c.sum(1).real, (1j * k * c).sum(1).real * s.Omega / s.order], axis=1))
    return out


def missing(orbits: list[Array], known: list[Array]) -> list[Array]:
    """Return the orbits (states of one period) that are not among the known ones."""

    def is_known(a: Array) -> bool:
        return any(np.hypot(*(b - a[0]).T).min() < CLOSE * (0.1 + np.abs(a[0]).sum()) for b in known)

    return [a for a in orbits if not is_known(a)]


def settled(case: Window, omega: float, starts: int, random: np.random.Generator) -> list[Array]:
    """Return the states of the motions of period 1 and 2 that random starts settle to, once each."""
    spread = min(1.5 * case.forcing / (2.0 * case.zeta) + 2.0 * case.forcing, 4.0)
    y = spread * random.uniform(-1.0, 1.0, (2, starts))
    steps = int(np.ceil(2.0 * np.pi / omega / 0.06))
    h = 2.0 * np.pi / omega / steps
    push = case.forcing * np.cos(np.pi / steps * np.arange(2 * steps + 1))

    def field(y: Array, force: float) -> Array:
        pull = (np.maximum(1.0 + y[0], 0.0) ** case.n - 1.0) / case.n
        return np.stack([y[1], force - pull - 2.0 * case.zeta * y[1]])

    def period(y: Array) -> Array:
        for j in range(steps):
            a = field(y, push[2 * j])
            b = field(y + 0.5 * h * a, push[2 * j + 1])
            c = field(y + 0.5 * h * b, push[2 * j + 1])
            d = field(y + h * c, push[2 * j + 2])
            y = y + h / 6.0 * (a + 2.0 * b + 2.0 * c + d)
        return y

    found: list[Array] = []
    for _ in range(25):
        for _ in range(max(8, int(0.06 * omega / case.zeta))):
            y = period(y)
        one = period(y)
        two = period(one)
        for size in (1, 2):
            shrink = 1.0 - np.exp(-2.0 * np.pi * size * case.zeta / omega)
            still = np.hypot(*((one, two)[size - 1] - y)) < 1e-3 * shrink * (0.1 + np.abs(y).sum(0))
            for a, b in zip(y[:, still].T, one[:, still].T, strict=True):
                orbit = np.stack([a, b])[:size]
                if missing([orbit], found):
                    found.append(orbit)
            y, one, two = y[:, ~still], one[:, ~still], two[:, ~still]
        if not y.size:
            break
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--windows", type=int, default=200)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--starts", type=int, default=24)
    parser.add_argument("--frequencies", type=int, default=2)
    parser.add_argument("--verbose", action="store_true")
    options = parser.parse_args()
    random = np.random.default_rng(options.seed + 1)
    counts: dict[str, int] = {}
    seconds = [0.0, 0.0]

    def count(name: str, more: int) -> None:
        counts[name] = counts.get(name, 0) + more

    for number, case in enumerate(random_windows(options.windows, options.seed, options.frequencies)):
        low, high = case.omega
        begin = time.process_time()
        try:
            own = response(case, case.omega)
        except AsperityError as error:
            count("windows without a result", 1)
            print(number, case, error)
            continue
        middle = time.process_time()
        wide = response(case, (0.5 * low, 2.0 * high))
        seconds[0] += middle - begin
        seconds[1] += time.process_time() - middle
        if options.verbose and time.process_time() - begin > 5.0:
            print(number, case, f"{middle - begin:.1f} s, wide {time.process_time() - middle:.1f} s", flush=True)
        count("windows with a note on missing orbits", any("missing" in note for note in own.notes))
        for omega in case.at:
            here, there = own.at(omega), wide.at(omega)
            motions = settled(case, omega, options.starts, random)
            for order in (1, 2):
                for stable in (True, False):
                    name = f"{'stable' if stable else 'unstable'} orbits of period {order}"
                    theirs = states(tuple(s for s in there if s.order == order and s.stable == stable))
                    ours = states(tuple(s for s in here if s.order == order and s.stable == stable))
                    lost = missing(theirs, states(here))
                    count(f"{name} of the wide window", len(theirs))
                    count(f"{name} missing in the window", len(lost))
                    count(f"{name} missing in the wide window", len(missing(ours, states(there))))
                    if options.verbose and lost:
                        print(number, case, omega, name, lost, own.notes, flush=True)
                reached = [m for m in motions if len(m) == order]
                off = missing(reached, states(here))
                count(f"motions of period {order} reached by random starts", len(reached))
                count(f"motions of period {order} off the response", len(off))
                if options.verbose and off:
                    print(number, case, omega, "off", off, own.notes, flush=True)
        if options.verbose and number % 10 == 9:
            show(counts, seconds)
    show(counts, seconds)


def show(counts: dict[str, int], seconds: list[float]) -> None:
    """Print the table."""
    print("| what | number |\n|---|---|")
    for name, value in counts.items():
        print(f"| {name} | {value} |")
    print(f"| CPU seconds of the windows, of the wide ones | {seconds[0]:.1f}, {seconds[1]:.1f} |", flush=True)


if __name__ == "__main__":
    main()
