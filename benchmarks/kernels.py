# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

"""What the compiled kernels buy: internal force and tangent against FFCx's code of the UFL twin, and a tangent by half.

    ./run python3 benchmarks/kernels.py

One process, a block under the demo surface, three states. A row gives microseconds of CPU time a cell, medians over
repeats, and the largest difference of the two relative to the largest value.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from time import process_time

import numpy as np
import numpy.typing as npt
from mpi4py import MPI

import asperity as asp
from asperity.fem.solid import Solid
from asperity.mesh.distribute import distribute
from asperity.mesh.generate import build_block
from asperity.mesh.size_field import SizeField

DELTA = 0.03
REPEATS = 9
STEEL = asp.Material(E=1.0, nu=0.3, yield_strength=0.005, tangent_modulus=0.05)
STATES = {"elastic": 1e-3, "a part flows": 3e-3, "all flow": 0.3}  # compression of the block


def solids() -> tuple[Solid, Solid]:
    """The same block with compiled and with generated kernels."""
    surface = asp.Surface.from_spec(kind="weierstrass-mandelbrot", L=1.0, D=2.4, G=1.36e-5)
    block = build_block(surface, 1.0, SizeField.of(surface, DELTA, 0.05).at)
    mesh, tags = distribute(MPI.COMM_SELF, block, 1.0)
    return Solid(mesh, tags, STEEL, kernels="compiled"), Solid(mesh, tags, STEEL, kernels="ufl")


def median_time(work: Callable[[], object]) -> float:
    """Median CPU seconds of a call, after one to warm up."""
    work()
    times = []
    for _ in range(REPEATS):
        start = process_time()
        work()
        times.append(process_time() - start)
    return float(np.median(times))


def half_of(solid: Solid) -> npt.NDArray[np.float32]:
    """Upper half of the tangent in single precision, by way of the whole unless the solid is `halved`."""
    solid.assemble_tangent()
    return solid.half


def difference(a: npt.NDArray[np.float64], b: npt.NDArray[np.float64]) -> float:
    """Largest difference relative to the largest value."""
    return float(np.abs(a - b).max() / np.abs(b).max())


def main() -> None:
    """Print the table."""
    compiled, ufl = solids()
    cells = len(compiled.cell_nodes)
    z = compiled.points[:, 2]
    ripple = np.sin(7.0 * compiled.points[:, [1, 2, 0]]) * compiled.points[:, [2, 0, 1]]
    print(f"{cells} cells, {compiled.dofs} dofs")
    print(
        "| state | flowing | residual UFL | compiled | ratio | tangent UFL | compiled | ratio | difference |"
        " whole, then its half | half alone | ratio |"
    )
    print("|---|---|---|---|---|---|---|---|---|---|---|---|")
    for name, size in STATES.items():
        u = size * (np.stack([0 * z, 0 * z, -z], axis=1) + 0.3 * ripple)
        times, results = [], []
        for solid in (ufl, compiled):
            solid.u.x.array[:] = u.ravel()
            force = solid.internal_force().copy()
            tangent = np.empty_like(solid.values)
            work = partial(solid.kernels.tangent, u, tangent)
            times += [median_time(solid.internal_force), median_time(work)]
            results += [force, tangent]
        halves = []
        for compiled.halved in (False, True):
            halves.append(1e6 * median_time(partial(half_of, compiled)) / cells)
        share = compiled.kernels.plastic_points / compiled.kernels.volumes.size
        cost = 1e6 * np.array(times) / cells
        worst = max(difference(results[2], results[0]), difference(results[3], results[1]))
        tangent_ratio = f"{cost[1] / cost[3]:.1f}" if share else "kept"  # the elastic one is assembled once
        print(
            f"| {name} | {share:.0%} | {cost[0]:.2f} | {cost[2]:.2f} | {cost[0] / cost[2]:.1f} "
            f"| {cost[1]:.2f} | {cost[3]:.2f} | {tangent_ratio} | {worst:.1e} "
            f"| {halves[0]:.2f} | {halves[1]:.2f} | {halves[0] / halves[1]:.1f} |"
        )


if __name__ == "__main__":
    main()
