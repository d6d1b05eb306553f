# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

"""A rough height map at full resolution, pressed to one per cent of contact area: time, memory, dofs, error bar.

    mpirun -n 2 python3 benchmarks/scan.py [1024] [elastic | plastic] [nominal pressure, MPa, instead of the area]

The map is self-affine with H = 0.8 from a quarter of the side to five pixels, rms slope 0.46, on 2 um, as of a scan
of an atomic force microscope. Ten steps and unloading, with a tolerance of 5 % and nothing about the mesh. Prints one
line; processor time is that of the busiest rank.
"""

from __future__ import annotations

import sys
import tempfile
import warnings
from pathlib import Path
from time import perf_counter, process_time

import numpy as np
from mpi4py import MPI

import asperity as asp
from asperity.reference import RoughHalfSpace
from asperity.surface import HeightMap, SelfAffine

L, AREA, TOLERANCE = 2e-6, 0.01, 0.05
MATERIALS = {"elastic": asp.Material(100e9, 0.3), "plastic": asp.Material(100e9, 0.3, 2e9, 1e9)}


def approach(surface: asp.Surface, material: asp.Material) -> float:
    """Approach at which a half-space has the contact area AREA [length]."""
    hardness = 3.0 * (material.yield_strength or np.inf) / material.reduced_modulus
    layer = RoughHalfSpace(512, 1.0, material.nu, hardness=hardness)
    curve = layer.curve(layer.heights(surface), surface.maximum()[2] / L, np.linspace(0.001, 0.02, 20))
    return float(np.interp(AREA, curve.area_fraction, curve.delta_star)) * L


def rough(n: int) -> SelfAffine:
    """The surface whose n x n heights are the map."""
    return SelfAffine(L=L, H=0.8, slope=0.46, lambda_roll=L / 4, lambda_short=5 * L / n, seed=1)


def main(n: int, name: str, pressure: float | None) -> None:
    """Run the map of n x n heights, to that nominal pressure [MPa] or to AREA."""
    comm, material = MPI.COMM_WORLD, MATERIALS[name]
    with tempfile.TemporaryDirectory() as folder:
        path = Path(comm.bcast(folder)) / "map.npz"
        if comm.rank == 0:
            np.savez(path, z=rough(n).grid(n), L=L)
        comm.barrier()
        start = perf_counter()
        surface = HeightMap(path=path)
        comm.barrier()
    load: dict[str, float]
    if pressure is None:
        load = {"delta_max": comm.bcast(approach(surface, material) if comm.rank == 0 else None)}
    else:
        load = {"pressure_max": 1e6 * pressure}
    target = asp.AccuracyTarget(TOLERANCE, max_dofs=2_000_000)
    found = asp.solve_to_tolerance(surface, material, target, steps=10, unload_steps=10, **load)
    busiest = comm.allreduce(process_time(), MPI.MAX)
    if comm.rank == 0:
        last = found.curve.loading()
        time = f"{perf_counter() - start:.0f} s, {busiest:.0f} s of processor time"
        cost = f"{time}, {found.contact.memory / 2**30:.1f} GiB, {found.contact.dofs} dofs"
        state = f"contact area {last.area_fraction[-1]:.2%} at {last.delta_star[-1]:.4f} L"
        result = f"met {found.met}, bar {found.worst:.1%}, {state}"
        print(f"{n} x {n}, {name}, {comm.size} ranks: {cost}, {result}")


if __name__ == "__main__":
    warnings.simplefilter("ignore")
    given = dict(enumerate(sys.argv))
    main(int(given.get(1, 1024)), given.get(2, "elastic"), float(given[3]) if 3 in given else None)
