# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

"""A rough contact cycled twenty times: what isotropic and kinematic hardening dissipate in each cycle.

    ./run python3 benchmarks/cycles.py                                     all
    ./run python3 benchmarks/cycles.py "about a preload" kinematic         one run, kept in out/cycles

The demo surface is loaded to 0.02 L and then cycled: about a preload, with the flat between 0.02 and 0.016 L, and with
full release. Energies are those of the audit of every step, the loop is the work of the flat (trapezoidal rule), and
the loss factor the dissipation over 2 pi times (F_max - F_min)(delta_max - delta_min)/8. Prints docs/tables/cycles.csv
and writes it. A step that violates a balance ends the command.
"""

from __future__ import annotations

import sys
import warnings
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from mpi4py import MPI
from tables import csv_text, versions

import asperity as asp
from asperity.arrays import Floats
from asperity.quasistatic.make import make_block, make_contact_solver

ROOT = Path(__file__).parent.parent
TOP, CYCLES, STEPS = 0.02, 20, 5  # greatest approach [L], cycles, steps down and up
BOTTOMS = {"about a preload": 0.016, "full release": 0.0}
RUNS = [("about a preload", name) for name in ("isotropic", "kinematic", "kinematic, finite strain")]
RUNS += [("full release", name) for name in ("isotropic", "kinematic")]
SHOWN = (1, 2, 3, 5, 10, 20)
LAWS = {
    "isotropic": {"hardening": "isotropic"},
    "kinematic": {"hardening": "kinematic"},
    "kinematic, finite strain": {"hardening": "kinematic", "kinematics": "finite"},
}
HEADER = (
    "path", "hardening", "cycle", "greatest force / E L^2", "dissipated / E L^3", "loop / E L^3", "loss factor",
    "energy of the run, ratio",
)  # fmt: skip


def cycled(material: asp.Material, bottom: float) -> Iterator[tuple[Floats, float, float]]:
    """For each cycle approach and force (m, 2) [L], [E L^2], its dissipation [E L^3], and the ratio of energies so far.

    Raises:
        SystemExit: a step does not converge or violates a balance
    """
    surface = asp.Surface.from_spec("weierstrass-mandelbrot", L=1.0, D=2.4, G=1.36e-5)
    block = make_block(MPI.COMM_SELF, surface, 1.0, TOP, asp.MeshSize(0.12, growth=0.6, h_max=0.4))
    solver = make_contact_solver(MPI.COMM_SELF, surface, block, material)
    down = np.linspace(TOP, bottom, STEPS + 1)
    loading = np.linspace(0.0, TOP, 11)[1:]
    for path in (loading, *[np.concatenate([down[1:], down[-2::-1]])] * CYCLES):
        before, points = solver.checks.dissipated, [(solver.delta, solver.force)]
        for delta in path:
            if not solver.step(float(delta)).converged or solver.checks.violated:
                raise SystemExit(f"{material} at {delta:g} L: {solver.checks.violated or 'no convergence'}")
            points.append((solver.delta, solver.force))
        if path is not loading:
            yield np.array(points), solver.checks.dissipated - before, solver.checks.energy_ratio


def rows(found: dict[tuple[str, str], list[tuple[Floats, float, float]]]) -> Iterator[tuple[str, ...]]:
    """Rows of the table."""
    for (path, name), cycles in found.items():
        for number in SHOWN:
            points, lost, ratio = cycles[number - 1]
            delta, force = points.T
            loop = float(np.trapezoid(force, delta))
            factor = 4.0 * lost / (np.pi * np.ptp(force) * np.ptp(delta))
            yield (
                path, name, str(number), f"{force.max():.5f}", f"{lost:.2e}", f"{loop:.2e}", f"{factor:.4f}",
                f"{ratio:.3f}",
            )  # fmt: skip


def kept(path: str, name: str) -> list[tuple[Floats, float, float]]:
    """The cycles of a run, from out/cycles where an earlier command has kept them."""
    file = Path(f"out/cycles/{path}-{name}.npz".replace(", ", "-").replace(" ", "-"))
    if not file.exists():
        found = list(cycled(asp.Material(1.0, 0.3, 0.005, 0.05, **LAWS[name]), BOTTOMS[path]))
        points, lost, ratio = zip(*found, strict=True)
        file.parent.mkdir(parents=True, exist_ok=True)
        np.savez(file, points=points, lost=lost, ratio=ratio)
    with np.load(file) as arrays:
        return list(zip(arrays["points"], arrays["lost"], arrays["ratio"], strict=True))


def main() -> None:
    """Run the cycles of the paths and laws named, of all without; then print and store the table."""
    warnings.simplefilter("ignore")
    if sys.argv[1:]:
        kept(*sys.argv[1:])
        return
    found = {(path, name): kept(path, name) for path, name in RUNS}
    text = csv_text("./run python3 benchmarks/cycles.py", versions(), [HEADER, *rows(found)])
    print(text, end="")
    (ROOT / "docs/tables/cycles.csv").write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
