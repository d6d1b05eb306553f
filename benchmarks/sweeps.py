# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

"""Time of frequency sweeps by kind of law, and their share of a vibration analysis.

    python3 benchmarks/sweeps.py

The same contact, F = z^1.5, as a power law, as a table of 40 points, as a tangent law, and as a table below a yielding
branch. CPU seconds of a warm run on one core; the sweeps go up and down at 41 frequencies, Omega from 0.5 to 1.3, with
zeta = 0.01 and F^ = 0.02. The last column is the largest difference of u_max from the sweep of the power law, where
both are settled.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from functools import partial
from typing import Any

os.environ.setdefault("OMP_NUM_THREADS", "1")

import numpy as np

from asperity.dynamics import ContactOscillator, Law, PowerLaw, Sweep, TableLaw, TangentLaw, TwoBranchLaw, response_band

ZETA, FORCING, WINDOW, POINTS = 0.01, 0.02, (0.5, 1.3), 41


def laws() -> dict[str, Law]:
    """The same contact as four kinds of law."""
    z = np.geomspace(0.02, 4.0, 40)
    table = TableLaw(z, z**1.5, extrapolate=True)
    return {
        "power law": PowerLaw(1.5),
        "table": table,
        "tangent law": TangentLaw.of(z**1.5, 1.5 * z**0.5, extrapolate=True),
        "two branches": TwoBranchLaw(table, PowerLaw(1.5), 6.0),
    }


def timed(function: Callable[[], Any]) -> tuple[float, Any]:
    """Least CPU seconds of three runs after a first one, and the last result."""
    out = function()
    seconds = []
    for _ in range(3):
        begin = time.process_time()
        out = function()
        seconds.append(time.process_time() - begin)
    return min(seconds), out


def differ(sweeps: tuple[Sweep, ...], others: tuple[Sweep, ...]) -> float:
    """Largest relative difference of u_max where both are settled."""
    worst = 0.0
    for a, b in zip(sweeps, others, strict=True):
        both = np.array([s == t == "settled" for s, t in zip(a.status, b.status, strict=True)])
        worst = max(worst, float(np.abs(a.u_max[both] / b.u_max[both] - 1).max()))
    return worst


def main() -> None:
    """Print both tables."""
    reference: tuple[Sweep, ...] = ()
    print("| law | sweeps up and down, CPU s | over that of the power law | response, CPU s | difference |")
    print("|---|---|---|---|---|")
    first = 0.0
    for name, law in laws().items():
        o = ContactOscillator(law, load=1.0, zeta=ZETA)
        seconds, sweeps = timed(partial(o.sweep, FORCING, WINDOW, points=POINTS))
        balance, _ = timed(partial(o.response, FORCING, WINDOW))
        first, reference = first or seconds, reference or sweeps
        print(f"| {name} | {seconds:.2f} | {seconds / first:.1f} | {balance:.2f} | {differ(sweeps, reference):.1e} |")
    o = ContactOscillator(laws()["table"], load=1.0, zeta=ZETA)
    parts = {
        "free vibration and thresholds": lambda: (o.free(), o.thresholds(FORCING)),
        "response": lambda: o.response(FORCING, WINDOW),
        "band of two laws": lambda: response_band(o, FORCING, WINDOW, members=[PowerLaw(1.5), PowerLaw(1.52)]),
        "sweeps": lambda: o.sweep(FORCING, WINDOW, points=POINTS),
    }
    seconds_of = {name: timed(part)[0] for name, part in parts.items()}
    print("\nParts of an analysis with the table, exact law:\n\n| part | CPU s | share |\n|---|---|---|")
    for name, seconds in seconds_of.items():
        print(f"| {name} | {seconds:.2f} | {seconds / sum(seconds_of.values()):.0%} |")


if __name__ == "__main__":
    main()
