# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

"""Yield strength and exponent of a smooth surface pressed far beyond full contact, which a case file refuses.

    ./run python3 benchmarks/full_contact.py out/full_contact.csv

D = 2.6, E_t = 2 GPa, rollers, range 0.05 L; what the file has already is not repeated.
"""

from __future__ import annotations

import csv
import sys
import warnings
from collections.abc import Iterator
from pathlib import Path

from mpi4py import MPI

import asperity as asp
from asperity.surface import WeierstrassMandelbrot

STRENGTHS = (0.02e9, 0.2e9, 1e9, 2e9, 4e9)
SEEDS = (0, 2, 3, 4, 5, 8, 9, 10, 11, 12)
COLUMNS = ("yield_strength", "seed", "n", "n_log", "r2", "full_at", "block_load")
FULL = 0.9  # contact area over the patch
Row = dict[str, float]


def press(strength: float, seed: int) -> Row:
    """Exponent of a surface, share of the range at which contact is practically full, and load of the block."""
    surface = WeierstrassMandelbrot(L=1e-6, D=2.6, G=1.36e-11, M=10, gamma=1.5, f_max=5, seed=seed)
    material = asp.Material(E=200e9, nu=0.3, yield_strength=strength, tangent_modulus=2e9)
    size = asp.MeshSize(h_contact=0.14e-6, growth=0.4)
    curve = asp.solve_contact(surface, material, delta_max=50e-9, steps=10, size=size, comm=MPI.COMM_SELF).curve
    fit, full = curve.fit(), curve.delta[curve.area_fraction >= FULL]
    return {
        "yield_strength": strength, "seed": float(seed), "n": fit.n, "n_log": curve.fit("log").n, "r2": fit.r2,
        "full_at": float(full[0] / curve.delta[-1]) if len(full) else float("nan"),
        "block_load": float(curve.force[-1]) / surface.L**2 / material.yield_pressure("rollers"),
    }  # fmt: skip


def rows_of(path: Path) -> Iterator[Row]:
    """Rows of a file; none where there is no file."""
    if path.is_file():
        with path.open(newline="", encoding="utf-8") as file:
            yield from ({name: float(value) for name, value in row.items()} for row in csv.DictReader(file))


def full_contact(path: Path) -> list[Row]:
    """Rows of all strengths and seeds; computes those that the file does not have."""
    path.parent.mkdir(parents=True, exist_ok=True)
    rows = list(rows_of(path))
    known = {(row["yield_strength"], row["seed"]) for row in rows}
    for strength in STRENGTHS:
        for seed in SEEDS:
            if (strength, float(seed)) not in known:
                rows.append(press(strength, seed))
                print(", ".join(f"{name} {value:.4g}" for name, value in rows[-1].items()), flush=True)
                with path.open("w", newline="", encoding="utf-8") as file:
                    writer = csv.DictWriter(file, COLUMNS)
                    writer.writeheader()
                    writer.writerows(rows)
    return rows


if __name__ == "__main__":
    warnings.simplefilter("ignore")
    full_contact(Path(sys.argv[1]))
