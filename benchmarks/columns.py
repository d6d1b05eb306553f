# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

"""Error bars of mean gap, stiffnesses and conductance against runs of a tolerance five times smaller.

    python3 benchmarks/columns.py

None of the surfaces was in view when the factors of the bars were chosen. Prints a table.
"""

from __future__ import annotations

import warnings

import numpy as np

import asperity as asp
from asperity.curve import WITH_ERRORS

DEPTH, TOLERANCES, REFERENCE = 0.012, (0.05, 0.02), 0.01
ELASTIC = asp.Material(1.0, 0.3)


def surfaces() -> dict[str, asp.Surface]:
    """Smooth and rough, side 1."""
    fractal = {
        f"fractal, seed {seed}": asp.Surface.from_spec("weierstrass-mandelbrot", L=1.0, D=2.4, G=1.36e-5, seed=seed)
        for seed in (20, 21)
    }
    rough = asp.Surface.from_spec("self-affine", L=1.0, H=0.8, rms_slope=0.1, lambda_short=0.15, seed=22)
    return fractal | {"self-affine, seed 22": rough}


def run(surface: asp.Surface, tolerance: float) -> asp.Curve:
    """First loading of a run with a tolerance."""
    target = asp.AccuracyTarget(tolerance, max_dofs=300_000)
    found = asp.solve_to_tolerance(surface, ELASTIC, target, delta_max=DEPTH, steps=5, stiffness=True, conductance=True)
    return found.curve.loading()


def main() -> None:
    """Compare and print."""
    print("| surface | tolerance | column | median error | median bar | greatest error over both bars | steps inside |")
    print("|---|---|---|---|---|---|---|")
    for name, surface in surfaces().items():
        reference = run(surface, REFERENCE)
        for tolerance in TOLERANCES:
            curve = run(surface, tolerance)
            for column in ("P_star", *WITH_ERRORS):
                exact, value = getattr(reference, column), getattr(curve, column)
                bar, rest = (getattr(c, f"error_{column}") for c in (curve, reference))
                error = np.abs(value - exact)
                worst, inside = float(np.max(error / (bar + rest))), int(np.sum(error <= bar + rest))
                parts = f"{np.median(error / exact):.2%} | {np.median(bar / exact):.2%} | {worst:.2f}"
                print(f"| {name} | {tolerance:.0%} | {column} | {parts} | {inside} of {len(error)} |", flush=True)


if __name__ == "__main__":
    warnings.simplefilter("ignore")
    main()
