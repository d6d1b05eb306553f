"""Where the time of a run goes, how it grows with size, and what a second rank brings.

    ./run python3 benchmarks/speed.py profile [H ...]      phases of elastic-plastic runs, one process
    ./run python3 benchmarks/speed.py step [H ...]         a single load step of large problems: growth and memory
    ./run python3 benchmarks/speed.py scaling [H ...]      that step on one rank and on two (starts mpirun)
    ./run mpirun -n 2 python3 benchmarks/speed.py one H    one run

The surface of cases/single.toml with its material is pressed to 0.02 L in four planned steps. H is the element size in
the contact in units of L. Phases are seconds of the clock: on a busy machine compare shares and ratios.
"""

from __future__ import annotations

import json
import subprocess
import sys
import warnings
from collections.abc import Iterable
from concurrent.futures import ThreadPoolExecutor
from math import log
from time import perf_counter, process_time
from typing import Any

import asperity as asp

L = 1e-6
STEEL = asp.Material(200e9, 0.3, 1e9, 10e9)
DELTA, STEPS = 0.02, 4
SIZES = {
    "step": (0.03, 0.0125, 0.0066, 0.0053),
    "profile": (0.08, 0.04, 0.024, 0.0155, 0.0095),
    "scaling": (0.03, 0.0125),
}
PATHS: dict[str, dict[str, Any]] = {
    "one": {},
    "single": {"steps": 1, "integrator": "backward-euler"},
}
PHASES = ("residual", "tangent", "preconditioner", "linear solve")


def one(h: float, **path: Any) -> dict[str, Any]:
    """Facts of one run; collective."""
    from mpi4py import MPI

    comm = MPI.COMM_WORLD
    warnings.simplefilter("ignore")
    surface = asp.Surface.from_spec(kind="weierstrass-mandelbrot", L=L, D=2.4, G=1.36e-11)
    cpu, wall = process_time(), perf_counter()
    result = asp.solve_contact(
        surface, STEEL, size=asp.MeshSize(h * L), **{"steps": STEPS, "delta_max": DELTA * L} | path
    )
    owned = result.solver.contact_surface.owned_nodes
    spread = comm.gather((len(result.solver.solid.cell_nodes), len(owned)))
    spent = comm.allgather(result.phases.seconds)
    return {
        "h": h,
        "ranks": comm.size,
        "dofs": result.dofs,
        "steps": result.counts.steps,
        "newton": result.counts.newton,
        "krylov": result.counts.krylov,
        "cpu": process_time() - cpu,
        "wall": perf_counter() - wall,
        "seconds": {name: max(rank[name] for rank in spent) for name in result.phases.seconds},  # of the slowest rank
        "memory": result.memory,
        "spread": spread,
        "force": float(result.curve.force[-1]),
    }


def row(cells: Iterable[object]) -> None:
    """Print a row of a table."""
    print("| " + " | ".join(f"{c:.3g}" if isinstance(c, float) else str(c) for c in cells) + " |", flush=True)


def profile(sizes: tuple[float, ...]) -> None:
    """Phases against size, with the exponent of the growth of time."""
    row(("dofs", "steps", "Newton a step", "Krylov a solve", "mesh", "set-up", *PHASES, "sum", "s a step", "order",
         "bytes a dof"))  # fmt: skip
    row(["---"] * (11 + len(PHASES) - 1))
    before: tuple[int, float] | None = None
    for h in sizes:
        facts = run_apart(h, 1)
        seconds = facts["seconds"]
        spent = [seconds.get(name, 0.0) for name in PHASES]
        step = sum(spent) / facts["steps"]
        order = "" if before is None else f"{_slope(before, (facts['dofs'], step)):.2f}"
        before = facts["dofs"], step
        row((facts["dofs"], facts["steps"], facts["newton"] / facts["steps"], facts["krylov"] / facts["newton"],
             seconds["mesh"], seconds["set-up"], *spent, sum(seconds.values()), step, order,
             round(facts["memory"] / facts["dofs"])))  # fmt: skip


def step(sizes: tuple[float, ...]) -> None:
    """One step of backward Euler to the whole depth: what does not depend on the path."""
    row(("dofs", "Newton", "Krylov", "CPU s", "order", "CPU s a Newton iteration", "order", "GiB"))
    row(["---"] * 8)
    before: list[tuple[int, float]] = []
    for h in sizes:
        facts = run_apart(h, 1, "single")
        now = [(facts["dofs"], facts["cpu"]), (facts["dofs"], facts["cpu"] / facts["newton"])]
        orders = [f"{_slope(a, b):.2f}" for a, b in zip(before, now, strict=True)] if before else ["", ""]
        row((facts["dofs"], facts["newton"], facts["krylov"], now[0][1], orders[0], now[1][1], orders[1],
             facts["memory"] / 2**30))  # fmt: skip
        before = now


def _slope(a: tuple[int, float], b: tuple[int, float]) -> float:
    return log(b[1] / a[1]) / log(b[0] / a[0])


def run_apart(h: float, ranks: int, job: str = "one") -> dict[str, Any]:
    """A run in processes of its own, so that its memory is its own."""
    command = [sys.executable, __file__, job, str(h)]
    if ranks > 1:
        command = ["mpirun", "-n", str(ranks), *command]
    out = subprocess.run(command, check=True, capture_output=True, text=True).stdout
    facts: dict[str, Any] = json.loads(out.splitlines()[-1])
    return facts


def scaling(sizes: tuple[float, ...]) -> None:
    """One rank against two, and against two runs side by side, which share what the machine's cores share."""
    row(("dofs", "ranks", *PHASES, "load path", "efficiency", "Newton", "Krylov", "cells a rank",
         "contact nodes a rank", "GiB", "force"))  # fmt: skip
    row(["---"] * (10 + len(PHASES)))
    for h in sizes:
        base = 0.0
        for ranks in (1, 2):
            facts = run_apart(h, ranks, "single")
            spent = [facts["seconds"].get(name, 0.0) for name in PHASES]
            path = sum(spent)
            base = base or path
            cells, nodes = zip(*facts["spread"], strict=True)
            row((facts["dofs"], ranks, *spent, path, base / path / ranks, facts["newton"], facts["krylov"],
                 ", ".join(map(str, cells)), ", ".join(map(str, nodes)), facts["memory"] / 2**30,
                 f"{facts['force']:.9e}"))  # fmt: skip
        with ThreadPoolExecutor() as pool:
            both = list(pool.map(lambda h: run_apart(h, 1, "single"), (h, h)))
        path = max(sum(facts["seconds"].get(name, 0.0) for name in PHASES) for facts in both)
        print(f"\ntwo runs side by side: {path:.3g} s each, efficiency {base / path:.2f}")


if __name__ == "__main__":
    job, *numbers = sys.argv[1:] or ["profile"]
    if job in PATHS:
        facts = one(float(numbers[0]), **PATHS[job])
        from mpi4py import MPI

        if MPI.COMM_WORLD.rank == 0:
            print(json.dumps(facts))
    else:
        jobs = {"profile": profile, "step": step, "scaling": scaling}
        jobs[job](tuple(map(float, numbers)) or SIZES[job])
