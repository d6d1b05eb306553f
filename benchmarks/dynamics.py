"""Frequency response: completeness in random windows, and work over precision against pyHarm-os.

    ./run python3 benchmarks/dynamics.py orbits [WINDOWS SEED]      default 200 0
    ./run python3 benchmarks/dynamics.py speed

`orbits`: random exponents (0.6 to 4), damping ratios (0.002 to 0.1), forcings F^ (0.005 to 1.5) and windows. At random
frequencies inside, every orbit of period 1 and 2 of a response over a window twice as wide on both sides must
be one of the response. Every orbit of period 1 and 2 that is found from random states must be one too: by a Runge-Kutta
method written here, first until most of the transient has decayed, then by Newton's method on the period map.

`speed`: n = 1.5, zeta = 0.01, F^ = 0.05, Omega from 0.5 to 1.3. Times are CPU seconds of a warm run on one core. The
error is that of u_max, relative, against orbits at 1e-9 at the same Omega; points within 1e-3 of a fold are left
out, where the amplitude is singular in Omega. Needs `./run pip install pyHarm-os==1.2.2`.
"""

from __future__ import annotations

import os
import runpy
import sys
import time
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

os.environ.setdefault("OMP_NUM_THREADS", "1")

import numpy as np
from numpy.typing import NDArray

from asperity.vibration import ContactOscillator, FrequencyResponse, PowerLaw, Solution
from asperity.errors import AsperityError

Array = NDArray[np.float64]
CLOSE = 1e-2  # relative distance within which two orbits are the same
STEP, COARSE = 0.05, 0.1  # of the Runge-Kutta method, for orbits and for transients, over 1/omega_s
N, ZETA, FORCING, WINDOW = 1.5, 0.01, 0.05, (0.5, 1.3)


@dataclass(frozen=True)
class Window:
    """One random case, with the frequencies at which its orbits are compared."""

    n: float
    zeta: float
    forcing: float
    omega: tuple[float, float]
    at: tuple[float, ...]


def random_windows(count: int, seed: int, frequencies: int = 1) -> list[Window]:
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
    return [s.states for s in orbits]


def missing(orbits: list[Array], known: list[Array], close: float = CLOSE) -> list[Array]:
    """Return the orbits (states of one period) that are not among the known ones."""

    def is_known(a: Array) -> bool:
        return any(np.hypot(*(b - a[0]).T).min() < close * (0.1 + np.abs(a[0]).sum()) for b in known)

    return [a for a in orbits if not is_known(a)]


def integrate(case: Window, omega: float, y: Array, periods: int, step: float = STEP) -> Array:
    """Return the states (2, lanes) after forcing periods, for u'' = F^ cos(Omega tau) - f(u) - 2 zeta u'."""
    steps = int(np.ceil(2.0 * np.pi / omega / step))
    h = 2.0 * np.pi / omega / steps
    push = (case.forcing * np.cos(np.pi / steps * np.arange(2 * steps + 1)) + 1.0 / case.n).tolist()

    def pull(u: Array, v: Array) -> Array:
        return np.maximum(1.0 + u, 0.0) ** case.n / case.n + 2.0 * case.zeta * v

    u, v = y
    for _ in range(periods):
        for j in range(0, 2 * steps, 2):
            a = push[j] - pull(u, v)
            v1 = v + 0.5 * h * a
            b = push[j + 1] - pull(u + 0.5 * h * v, v1)
            v2 = v + 0.5 * h * b
            c = push[j + 1] - pull(u + 0.5 * h * v1, v2)
            v3 = v + h * c
            d = push[j + 2] - pull(u + h * v2, v3)
            u, v = u + h / 6.0 * (v + 2.0 * (v1 + v2) + v3), v + h / 6.0 * (a + 2.0 * (b + c) + d)
    return np.stack([u, v])


def polished(case: Window, omega: float, y: Array, order: int, step: float = STEP) -> list[tuple[Array, bool]]:
    """Return periodic orbits near the states (2, lanes), as states of one period (order, 2), with their stability."""
    for _ in range(9):
        size = 0.1 + np.abs(y).sum(axis=0)
        h = 1e-6 * size
        near = np.stack([y, y + np.array([h, 0 * h]), y + np.array([0 * h, h])], axis=1)
        end = integrate(case, omega, near.reshape(2, -1), order, step).reshape(2, 3, -1)
        flow = np.moveaxis((end[:, 1:] - end[:, :1]) / h, -1, 0)
        good = np.isfinite(flow).all(axis=(1, 2)) & (np.abs(np.linalg.det(flow - np.eye(2))) > 1e-12)
        y, flow, size, defect = y[:, good], flow[good], size[good], (end[:, 0] - y)[:, good]
        move = np.linalg.solve(np.eye(2) - flow, defect.T[..., None])[..., 0].T
        length = np.hypot(*move)
        y = y + move * np.minimum(1.0, 0.3 * size / np.maximum(length, 1e-300))
    found: list[tuple[Array, bool]] = []
    radius = np.abs(np.linalg.eigvals(flow)).max(axis=1)
    for i in np.flatnonzero(length < 1e-6 * size):
        path = np.array([y[:, i], *(integrate(case, omega, y[:, i : i + 1], k, step)[:, 0] for k in range(1, order))])
        repeats = order > 1 and not missing([path[:1]], [path[1:]], 1e-4)
        if not repeats and missing([path], [orbit for orbit, _ in found]):
            found.append((path, bool(radius[i] < 1.0)))
    return found


def reached(case: Window, omega: float, starts: int, random: np.random.Generator) -> list[tuple[Array, bool]]:
    """Return the orbits of period 1 and 2 near what random states come to, with their stability.

    The transient decays by exp(-3).
    """
    spread = min(1.5 * case.forcing / (2.0 * case.zeta) + 2.0 * case.forcing, 4.0)
    y = spread * random.uniform(-1.0, 1.0, (2, starts))
    y = integrate(case, omega, y, int(np.ceil(3.0 * omega / (2.0 * np.pi * case.zeta))), COARSE)
    return [orbit for order in (1, 2) for orbit in polished(case, omega, y, order)]


def compare(case: Window, own: FrequencyResponse, starts: int, random: np.random.Generator) -> tuple[Counter[str], str]:
    """Compare a response with the wide one and with random starts; return counts and a description of misses."""
    counts: Counter[str] = Counter()
    words = ""
    wide = response(case, (0.5 * case.omega[0], 2.0 * case.omega[1]))
    for omega in case.at:
        here = states(own.at(omega))
        orbits = [(a, s.stable, "the wide window") for s in wide.at(omega) for a in states((s,))]
        orbits += [(a, stable, "random starts") for a, stable in reached(case, omega, starts, random)]
        for orbit, stable, source in orbits:
            name = f"{'stable' if stable else 'unstable'} of period {len(orbit)}, {source}"
            counts[name] += 1
            if missing([orbit], here):
                if source == "random starts":  # an orbit of the steps alone, next to a fold, moves or vanishes
                    finer = polished(case, omega, orbit[:1].T, len(orbit), 0.25 * STEP)
                    if not missing([a for a, _ in finer], here):
                        continue
                counts[name + ": missing"] += 1
                words += f"    Omega = {omega:.6g}: {name}, state {orbit[0]}\n"
    return counts, words


def completeness(windows: int, seed: int) -> None:
    """Compare the responses of random windows, and print what is missing and the counts."""
    random = np.random.default_rng(seed + 1)
    counts: Counter[str] = Counter()
    for case in random_windows(windows, seed):
        try:
            own = response(case, case.omega)
            more, words = compare(case, own, 24, random)
        except AsperityError as error:
            more, words = Counter({"windows without a result": 1}), f"    {error}\n"
        else:
            more["windows with a note"] += bool(own.notes)
        counts += more
        if words:
            print(f"{case}\n{words}", flush=True)
    print("| orbits | number |\n|---|---|")
    for name in sorted(counts):
        print(f"| {name} | {counts[name]} |")


Result = tuple[str, str, float, float, float, int, str]  # method, setting, seconds, two errors, points, stability


def timed(function: Callable[[], Any], repeat: int) -> tuple[float, Any]:
    """Least CPU seconds of `repeat` runs after a first one, and the last result."""
    out = function()
    best = np.inf
    for _ in range(repeat):
        begin = time.process_time()
        out = function()
        best = min(best, time.process_time() - begin)
    return best, out


def errors(reference: FrequencyResponse, omega: np.ndarray, u_max: np.ndarray) -> tuple[float, float]:
    """Largest and median relative error of amplitudes."""
    folds = [e.Omega for e in reference["fold"]]
    found = []
    for w, u in zip(omega, u_max, strict=True):
        if not WINDOW[0] <= w <= WINDOW[1] or min(abs(w - f) for f in folds) < 1e-3:
            continue
        found.append(min(abs(s.u_max - u) / s.u_max for s in reference.at(float(w))))
    return float(np.max(found)), float(np.median(found))


def ours(reference: FrequencyResponse) -> list[Result]:
    """The response of this package at several tolerances."""
    o = ContactOscillator(PowerLaw(N), zeta=ZETA)
    rows = []
    for tol in (1e-5, 1e-7, 1e-9):
        seconds, r = timed(partial(o.response, FORCING, WINDOW, tol=tol), 5)
        b = r.branches[0]
        rows.append(("asperity", f"tol {tol:.0e}", seconds, *errors(reference, b.Omega, b.u_max), len(b), "yes"))
    return rows


def peer(reference: FrequencyResponse) -> list[Result]:
    """pyHarm-os with the contact as a plug-in element, alternating frequency-time with 16 samples a harmonic."""
    example = runpy.run_path(str(Path(__file__).parent.parent / "examples" / "harmonic_balance.py"))

    def spring(u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        s = np.maximum(1.0 + u, 0.0)
        return (s**N - 1.0) / N, s ** (N - 1.0)

    rows = []
    for harmonics, step in ((5, 0.1), (10, 0.1), (14, 0.1), (20, 0.1), (40, 0.05)):
        compute = example["pyharm_response"](spring, ZETA, FORCING, WINDOW, harmonics, step)
        seconds, (omega, coefficients) = timed(compute, 5)
        if omega.min() > WINDOW[0] + 1e-3:
            print(f"pyHarm-os with {harmonics} harmonics stops at Omega = {omega[-1]:.3f}")
        error = errors(reference, omega, example["largest"](coefficients))
        rows.append(("pyHarm-os", f"{harmonics} harmonics, step {step:g}", seconds, *error, len(omega), "no"))
    return rows


def speed() -> None:
    """Run all methods and print the table and the ratios."""
    reference = ContactOscillator(PowerLaw(N), zeta=ZETA).response(FORCING, WINDOW, tol=1e-9)
    rows = [*ours(reference), *peer(reference)]
    print("| method | setting | CPU s | largest error | median error | points | stability |")
    print("|---|---|---|---|---|---|---|")
    for method, setting, seconds, worst, median, points, stability in rows:
        print(f"| {method} | {setting} | {seconds:.3f} | {worst:.1e} | {median:.1e} | {points} | {stability} |")
    print("\nFastest response of this package that is more accurate than each rival:")
    for method, setting, seconds, worst, *_ in rows:
        better = [r for r in rows if r[0] == "asperity" and r[3] < worst]
        if better and method != "asperity":
            _, own, least, largest, *_ = min(better, key=lambda r: r[2])
            ratios = f"{seconds / least:.1f} times faster at {largest / worst:.2g} of its error"
            print(f"  {method} ({setting}): {ratios} ({own})")


if __name__ == "__main__":
    if sys.argv[1:] == ["speed"]:
        speed()
    else:
        completeness(*map(int, sys.argv[2:] or ("200", "0")))
