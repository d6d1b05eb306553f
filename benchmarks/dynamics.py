# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

"""Work and precision of the frequency response: this package, pyHarm-os, and solve_ivp sweeps.

    python3 benchmarks/dynamics.py [--points 81]

The case is the reference of the documentation: n = 1.5, zeta = 0.01, F^ = 0.05, Omega from 0.5 to 1.3. Times
are CPU seconds of a warm run on one core. The error is that of u_max, relative, against the balance at 1e-9
at the same Omega; points within 1e-3 of a fold are left out, where the amplitude is singular in Omega.
pyHarm-os comes from PyPI and is left out, with a word, when it is missing.
"""

from __future__ import annotations

import argparse
import os
import runpy
import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

os.environ.setdefault("OMP_NUM_THREADS", "1")

import numpy as np
from scipy.integrate import solve_ivp

from asperity.dynamics import ContactOscillator, FrequencyResponse, PowerLaw

N, ZETA, FORCING, WINDOW = 1.5, 0.01, 0.05, (0.5, 1.3)


@dataclass(frozen=True)
class Result:
    """One row of the table."""

    method: str
    setting: str
    seconds: float
    worst: float
    median: float
    points: int
    stability: str


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
    """The harmonic balance of this package at several tolerances."""
    o = ContactOscillator(PowerLaw(N), zeta=ZETA)
    rows = []
    for tol in (1e-3, 1e-4, 1e-5, 1e-6, 1e-7):
        seconds, r = timed(partial(o.response, FORCING, WINDOW, tol=tol), 5)
        b = r.branches[0]
        rows.append(
            Result(
                "asperity",
                f"tol {tol:.0e}, up to {b.harmonics.max()} harmonics",
                seconds,
                *errors(reference, b.Omega, b.u_max),
                len(b),
                "yes",
            )
        )
    return rows


def own_sweep(reference: FrequencyResponse, points: int) -> Result:
    """The Runge-Kutta sweeps of this package, up and down."""
    o = ContactOscillator(PowerLaw(N), zeta=ZETA)
    begin = time.process_time()
    sweeps = o.sweep(FORCING, WINDOW, points=points)
    seconds = time.process_time() - begin
    omega, u = (np.concatenate([getattr(s, name) for s in sweeps]) for name in ("Omega", "u_max"))
    return Result(
        "asperity sweep", "Runge-Kutta, up and down", seconds, *errors(reference, omega, u), omega.size, "stable only"
    )


def ivp_sweep(reference: FrequencyResponse, points: int, method: str, rtol: float) -> Result:
    """Sweeps up and down by solve_ivp: 2.2/zeta periods a frequency, amplitude from the last one."""

    def field(t: float, y: np.ndarray, omega: float) -> list[float]:
        s = 1.0 + y[0]
        force = (s**N if s > 0 else 0.0) - 1.0
        return [y[1], FORCING * np.cos(omega * t) - force / N - 2 * ZETA * y[1]]

    grid = np.linspace(*WINDOW, points)
    periods = int(np.ceil(2.2 / ZETA))
    omega, top = [], []
    begin = time.process_time()
    for path in (grid, grid[::-1]):
        y = np.zeros(2)
        for w in path:
            length = 2 * np.pi / w
            settle = solve_ivp(
                field, (0, (periods - 1) * length), y, method=method, rtol=rtol, atol=1e-3 * rtol, args=(w,)
            )
            last = solve_ivp(
                field,
                (0, length),
                settle.y[:, -1],
                method=method,
                rtol=rtol,
                atol=1e-3 * rtol,
                args=(w,),
                t_eval=np.linspace(0, length, 513),
            )
            y = last.y[:, -1]
            u = last.y[0]
            j = int(np.clip(u.argmax(), 1, u.size - 2))  # parabola through the three highest samples
            a, b, c = u[j - 1 : j + 2]
            top.append(b - (c - a) ** 2 / (8 * (a - 2 * b + c)))
            omega.append(w)
    seconds = time.process_time() - begin
    return Result(
        "solve_ivp sweep",
        f"{method} rtol {rtol:.0e}, {periods} periods",
        seconds,
        *errors(reference, np.array(omega), np.array(top)),
        len(omega),
        "stable only",
    )


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
        worst, median = errors(reference, omega, example["largest"](coefficients))
        rows.append(
            Result("pyHarm-os", f"{harmonics} harmonics, step {step:g}", seconds, worst, median, len(omega), "no")
        )
    return rows


def main() -> None:
    """Run all methods and print the table and the ratios."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--points", type=int, default=81, help="frequencies of the sweeps (default 81)")
    options = parser.parse_args()
    reference = ContactOscillator(PowerLaw(N), zeta=ZETA).response(FORCING, WINDOW, tol=1e-9)
    rows = ours(reference)
    try:
        rows += peer(reference)
    except ImportError as error:
        print(f"pyHarm-os is left out: {error} (pip install pyHarm-os==1.2.2)\n")
    rows.append(own_sweep(reference, options.points))
    rows.append(ivp_sweep(reference, options.points, "RK45", 1e-6))
    print("| method | setting | CPU s | largest error | median error | points | stability |")
    print("|---|---|---|---|---|---|---|")
    for r in rows:
        print(
            f"| {r.method} | {r.setting} | {r.seconds:.3f} | {r.worst:.1e} | {r.median:.1e} | {r.points} | "
            f"{r.stability} |"
        )
    print("\nFastest balance of this package that is more accurate than each rival:")
    for other in (r for r in rows if r.method != "asperity"):
        better = [r for r in rows if r.method == "asperity" and r.worst < other.worst]
        if better:
            best = min(better, key=lambda r: r.seconds)
            print(
                f"  {other.method} ({other.setting}): {other.seconds / best.seconds:.1f} times faster at "
                f"{best.worst / other.worst:.2g} of its error ({best.setting})"
            )


if __name__ == "__main__":
    main()
