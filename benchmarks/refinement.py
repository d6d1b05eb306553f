# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

"""Meshes that the ranks refine, against those that gmsh makes whole on rank 0: error against dofs, time and memory.

    ./run python3 benchmarks/refinement.py error                            two tables, sphere and rough surface
    ./run python3 benchmarks/refinement.py cost H N mesh | step RANKS...    each number of ranks by a mpirun of its own
    ./run python3 benchmarks/refinement.py checkpoint H N RANKS...          likewise

Errors are relative root mean squares over five load steps, elastic. Reference of the sphere: layer theory
(`asperity.verification.hertz`); of the rough surface: the extrapolated force of two finer meshes, by gmsh alone.

The cost of N refinements is in processor seconds of the busiest rank, and in the greatest memory, start of the process
included, of rank 0 and of any other: gmsh on rank 0, the rest of the mesh (distribution, refinement, lift) or, for a
load step, all that comes before it, and the step.

The checkpoint is that of a solid with flow in every cell, the greatest there is. Seconds are of the clock, memory is
the peak of a process while it saves, restores or writes the fields of one state for ParaView above what it held before.
"""

from __future__ import annotations

import ctypes
import resource
import shutil
import subprocess
import sys
import tempfile
import warnings
from collections.abc import Callable
from pathlib import Path
from time import perf_counter, process_time
from types import SimpleNamespace
from typing import cast

import numpy as np
from mpi4py import MPI

import asperity as asp
from asperity.adaptive.mesh_plan import extrapolate
from asperity.arrays import Floats
from asperity.fem.kernels import History
from asperity.mesh.distribute import distribute
from asperity.output.fields import write_vtkhdf
from asperity.quasistatic.checkpoint import Checkpoint
from asperity.quasistatic.make import make_block, make_contact_solver
from asperity.quasistatic.measures import snapshot
from asperity.quasistatic.stepping import Position, Record
from asperity.surface import SelfAffine, Surface, WeierstrassMandelbrot
from asperity.verification.hertz import CONTACT, RADIUS, SPHERE, layer_force

ELASTIC, PLASTIC = asp.Material(1.0, 0.3), asp.Material(1.0, 0.3, 0.005, 0.05)
ROUGH = SelfAffine(L=1.0, H=0.8, slope=0.05, lambda_roll=0.5, lambda_short=0.125, seed=3)
DEMO = WeierstrassMandelbrot(L=1.0, D=2.4, G=1.36e-5)
STEPS, HEIGHT = 5, 1.0
SIZES: dict[str, dict[int, tuple[float, ...]]] = {
    "sphere": {
        0: (0.08, 0.056, 0.04, 0.028, 0.02, 0.014),
        1: (0.08, 0.056, 0.04, 0.028),
        2: (0.08, 0.056, 0.04, 0.028),
    },
    "rough": {0: (0.08, 0.056, 0.04, 0.028), 1: (0.08, 0.056, 0.04, 0.028), 2: (0.08, 0.056, 0.04, 0.028)},
}
FINE = (0.024, 0.017)  # of the reference of the rough surface
GROWTH = 6.0  # of the sizes per unit of distance, over h_contact: meshes of one family are alike


def size_of(h: float, refinements: int = 0) -> asp.MeshSize:
    return asp.MeshSize(h, GROWTH * h, h_max=min(GROWTH * h, 0.5), refinements=refinements)


def press(surface: Surface, delta: float, h: float, refinements: int = 0) -> tuple[Floats, int]:
    """Force at the load steps, and dofs."""
    result = asp.solve_contact(
        surface, ELASTIC, delta_max=delta, steps=STEPS, height=HEIGHT, size=size_of(h, refinements)
    )
    assert result.complete and not result.checks.violated
    at = result.curve.loading()
    return np.interp(delta * np.arange(1, STEPS + 1) / STEPS, at.delta, at.force), result.dofs


def error() -> None:
    """Print both tables."""
    contact = CONTACT**2 / RADIUS
    scenes: dict[str, tuple[Surface, float]] = {"sphere": (SPHERE, contact), "rough": (ROUGH, 0.01)}
    exact = {"sphere": layer_force(contact * np.arange(1, STEPS + 1) / STEPS, 1024)[0] * ELASTIC.reduced_modulus}
    coarser, finest = (press(*scenes["rough"], h)[0] for h in FINE)
    exact["rough"], doubt = extrapolate(coarser, finest, FINE[0] / FINE[1], 1.8)
    print(f"the reference of the rough surface is {100 * np.max(np.abs(doubt / finest)):.2g} % from its finest mesh")
    for name, (surface, delta) in scenes.items():
        print("\n| scene | refinements | h_contact/L | dofs | rms error % | last step % |\n|" + "---|" * 6)
        for refinements, sizes in SIZES[name].items():
            for h in sizes:
                force, dofs = press(surface, delta, h, refinements)
                off = 100.0 * (force / exact[name] - 1.0)
                rms = np.sqrt(np.mean(off**2))
                print(f"| {name} | {refinements} | {h:g} | {dofs} | {rms:.2f} | {off[-1]:.2f} |", flush=True)


def cost(h: float, refinements: int, what: str) -> None:
    """Print one row: a mesh alone, or with the solver on it and a load step."""
    comm, delta, seconds = MPI.COMM_WORLD, 0.03, [process_time()]

    def done() -> None:
        seconds.append(process_time())

    block = make_block(comm, DEMO, HEIGHT, delta, asp.MeshSize(h, h_max=max(h, 0.25), refinements=refinements))
    done()
    if what == "step":
        solver = make_contact_solver(comm, DEMO, block, ELASTIC)
        done()
        assert solver.step(delta / 10).converged
        cells = comm.allgather(len(solver.solid.cell_nodes))
        columns = [solver.solid.dofs, solver.counts.newton, solver.counts.krylov, f"{solver.force:.8e}"]
    else:
        mesh, _ = distribute(comm, block, 1.0, surface=DEMO)
        done()
        cells = comm.allgather(mesh.topology.index_map(3).size_local)
        counts = comm.bcast(None if block is None else block.counts(), root=0)
        columns = [3 * counts[0], "", "", ""]
    done()
    spent = [comm.allreduce(t, MPI.MAX) for t in np.diff(seconds)]
    peaks = comm.gather(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024)
    if peaks is not None:
        row = [comm.size, refinements, *columns, *(f"{t:.1f}" for t in spent)]
        row += [f"{min(cells)} to {max(cells)}", f"{peaks[0]:.0f}", f"{max(peaks[1:], default=0.0):.0f}"]
        print("| " + " | ".join(map(str, row)) + " |", flush=True)


def checkpoint(h: float, refinements: int) -> None:
    """Print one row: a state saved, and restored."""
    comm, delta = MPI.COMM_WORLD, 0.03
    block = make_block(comm, DEMO, HEIGHT, delta, asp.MeshSize(h, h_max=max(h, 0.25), refinements=refinements))
    solver = make_contact_solver(comm, DEMO, block, PLASTIC)
    kernels, random = solver.solid.kernels, np.random.default_rng(comm.rank)
    virgin = kernels.history().copy()
    flow = History(**{name: 1e-3 * random.random(values.shape) for name, values in virgin.arrays().items()})
    kernels.restore(flow)
    record = Record(1.0, 1.0, 1.0)
    folder = Path(comm.bcast(tempfile.mkdtemp(prefix="asperity-") if comm.rank == 0 else None))
    kept = Checkpoint(folder, {}, comm)
    kept.begin(block)
    columns: list[object] = []

    def cost_of(work: Callable[[], object]) -> None:
        ctypes.CDLL(None).malloc_trim(0)  # give back to the system what is free
        before = memory("VmRSS")
        Path("/proc/self/clear_refs").write_text("5")  # the peak starts again
        comm.Barrier()
        start = perf_counter()
        work()
        comm.Barrier()
        seconds, peaks = perf_counter() - start, comm.gather(memory("VmHWM") - before) or [0.0]
        columns.extend((f"{seconds:.2f}", f"{peaks[0]:.0f}", f"{max(peaks[1:], default=0.0):.0f}"))

    def restore() -> None:
        saved = Checkpoint(folder, {}, comm).load()
        assert saved is not None
        saved.restore(solver, record)

    cost_of(lambda: kept.save(solver, record, Position()))
    kernels.restore(virgin)
    cost_of(restore)
    for name, values in kernels.history().arrays().items():
        assert np.array_equal(values, getattr(flow, name))
    result = SimpleNamespace(solver=solver, snapshots=[snapshot(solver, 1, "load")])
    cost_of(lambda: write_vtkhdf(folder / "contact.vtkhdf", cast("asp.ContactResult", result), 1.0))
    if comm.rank == 0:
        size = sum(path.stat().st_size for path in folder.glob("state*")) / 2**20
        print("| " + " | ".join(map(str, (comm.size, solver.solid.dofs, f"{size:.0f}", *columns))) + " |", flush=True)
        shutil.rmtree(folder)


def memory(name: str) -> float:
    """Memory of this process by its name in Linux [MiB]."""
    lines = Path("/proc/self/status").read_text().splitlines()
    return next(int(line.split()[1]) for line in lines if line.startswith(f"{name}:")) / 1024


def main(arguments: list[str]) -> None:
    """Run what the command line names."""
    if arguments[0] == "error":
        error()
        return
    cases = 3 if arguments[0] == "checkpoint" else 4
    h, refinements = float(arguments[1]), int(arguments[2])
    if len(arguments) == cases:
        checkpoint(h, refinements) if cases == 3 else cost(h, refinements, arguments[3])
        return
    if cases == 3:
        print("| ranks | dofs | file MiB | save s | rank 0 MiB | other MiB | restore s | rank 0 MiB | other MiB |"
              " fields s | rank 0 MiB | other MiB |\n|" + "---|" * 12, flush=True)  # fmt: skip
    else:
        print("| ranks | refinements | dofs | Newton | Krylov | force | gmsh s | rest s | step s | cells a rank |"
              " rank 0 MiB | other MiB |\n|" + "---|" * 12, flush=True)  # fmt: skip
    for ranks in arguments[cases:]:
        subprocess.run(["mpirun", "-n", ranks, sys.executable, __file__, *arguments[:cases]], check=True)


if __name__ == "__main__":
    warnings.simplefilter("ignore")
    main(sys.argv[1:])
