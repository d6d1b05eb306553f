"""Time and memory of the surface of cases/single.toml: over the size, in two clones, by ways to solve linear systems.

    ./run python3 benchmarks/speed.py step [H ...]       one elastic-plastic step to 0.02 L, a process for each size
    ./run python3 benchmarks/speed.py path [H]           ten steps and an unloading; two clones are compared by turns:
                     for clone in A B A B A B; do $clone/run python3 benchmarks/speed.py path; done
    ./run python3 benchmarks/speed.py krylov [H ...]     tolerance of the Krylov solver, elastic and elastic-plastic
    ./run python3 benchmarks/speed.py coarse [H ...]     ways to solve the coarse problem, also under mpirun
    ./run mpirun -n N python3 benchmarks/speed.py ranks [H]                    four steps on N ranks, on as many cores

Paths of ten steps go to 0.03 L. H is the element size in the contact in units of L; seconds are CPU seconds.
"""

from __future__ import annotations

import subprocess
import sys
import warnings
from math import log
from time import perf_counter, process_time
from typing import Any

from mpi4py import MPI

import asperity as asp
from asperity.linear import coarse as coarse_problem
from asperity.quasistatic.contact_result import ContactResult
from asperity.quasistatic.make import make_block

L = 1e-6
SURFACE: dict[str, Any] = {"kind": "weierstrass-mandelbrot", "L": L, "D": 2.4, "G": 1.36e-11}
MATERIALS = {"elastic": asp.Material(200e9, 0.3), "plastic": asp.Material(200e9, 0.3, 1e9, 10e9)}


def press(material: str, h: float, depth: float = 0.03, steps: int = 10, **given: Any) -> tuple[ContactResult, float]:
    """Press the surface to a depth [L] in planned steps; the result and its CPU seconds."""
    warnings.simplefilter("ignore")
    surface, size = asp.Surface.from_spec(**SURFACE), asp.MeshSize(h * L)
    start = process_time()
    result = asp.solve_contact(surface, MATERIALS[material], delta_max=depth * L, steps=steps, size=size, **given)
    return result, process_time() - start


def out(*cells: object) -> None:
    """Print a row of a table on rank 0."""
    if MPI.COMM_WORLD.rank == 0:
        print("| " + " | ".join(f"{c:.3g}" if isinstance(c, float) else str(c) for c in cells) + " |", flush=True)


def head(names: str) -> None:
    """Print the first two rows of a table."""
    out(*names.split(", "))
    out(*["---"] * len(names.split(", ")))


def step(sizes: tuple[float, ...]) -> None:
    """A row for each size: one step of backward Euler, which does not depend on the path; orders are over the dofs."""
    if len(sizes) == 1:
        result, seconds = press("plastic", sizes[0], 0.02, steps=1, integrator="backward-euler")
        counts = result.counts
        print(result.dofs, counts.newton, counts.krylov, seconds, result.memory / 2**30)
        return
    head("dofs, Newton, Krylov, CPU s, order, CPU s a Newton iteration, order, GiB")
    before: list[float] = []
    for h in sizes:
        done = subprocess.run([sys.executable, __file__, "step", str(h)], check=True, capture_output=True, text=True)
        dofs, newton, krylov, seconds, memory = map(float, done.stdout.split())
        now = [log(dofs), log(seconds), log(seconds / newton)]
        orders = [f"{(now[i] - before[i]) / (now[0] - before[0]):.2f}" if before else "" for i in (1, 2)]
        out(int(dofs), int(newton), int(krylov), seconds, orders[0], seconds / newton, orders[1], memory)
        before = now


def path(sizes: tuple[float, ...]) -> None:
    """A row, without a head, of this environment."""
    for h in sizes:
        result, seconds = press("plastic", h, 0.02, unload_steps=5)
        out(asp.__file__, result.dofs, result.counts.newton, result.counts.krylov, seconds)


def krylov(sizes: tuple[float, ...]) -> None:
    """Iterations against the tolerance of the Krylov solver."""
    head("dofs, material, Krylov tolerance, Newton, Krylov, CPU s")
    for h in sizes:
        for name in MATERIALS:
            for rtol in (1e-3, 1e-2, 4e-2):
                result, seconds = press(name, h, options=asp.SolverOptions(krylov_rtol=rtol))
                out(result.dofs, name, rtol, result.counts.newton, result.counts.krylov, f"{seconds:.1f}")


def coarse(sizes: tuple[float, ...]) -> None:
    """Iterations and time with the ways to solve the coarse problem, elastic; also under mpirun."""
    from petsc4py import PETSc

    of_petsc = {
        "MUMPS": {"pc_type": "cholesky", "pc_factor_mat_solver_type": "mumps"},
        "CHOLMOD of PETSc": {"pc_type": "cholesky", "pc_factor_mat_solver_type": "cholmod"},
    }
    if MPI.COMM_WORLD.size > 1:
        del of_petsc["CHOLMOD of PETSc"]  # serial
    ways: dict[str, dict[str, str]] = {"factorised": {}} | of_petsc | {"algebraic multigrid": {"pc_type": "gamg"}}
    press("elastic", 0.2)  # imports
    head("ranks, dofs, coarse problem, Newton, Krylov, CPU s, MiB")
    for h in sizes:
        for name, options in ways.items():
            for option, value in options.items():
                PETSc.Options(coarse_problem.PREFIX)[option] = value
            result, seconds = press("elastic", h)
            for option in options:
                PETSc.Options(coarse_problem.PREFIX).delValue(option)
            counts, memory = result.counts, f"{result.memory / 2**20:.0f}"
            out(MPI.COMM_WORLD.size, result.dofs, name, counts.newton, counts.krylov, f"{seconds:.1f}", memory)


def ranks(sizes: tuple[float, ...]) -> None:
    """Four elastic-plastic steps to 0.02 L, without the mesh: seconds, those of parts on the slowest rank."""
    comm = MPI.COMM_WORLD
    parts = "set-up", "residual", "tangent", "preconditioner", "linear solve"
    head(f"ranks, dofs, Newton, Krylov, s, {', '.join(parts)}, GiB")
    for h in sizes:
        size = asp.MeshSize(h * L)
        problem = asp.Problem.of(asp.Surface.from_spec(**SURFACE), MATERIALS["plastic"], delta_max=0.02 * L, size=size)
        block = make_block(comm, problem, 0.02 * L)
        start = perf_counter()
        result, _ = press("plastic", h, 0.02, 4, block=block)
        seconds = perf_counter() - start
        spent = comm.allgather(result.phases.seconds)
        slowest = (f"{max(s.get(part, 0.0) for s in spent):.1f}" for part in parts)
        counts = result.counts
        out(comm.size, result.dofs, counts.newton, counts.krylov, f"{seconds:.1f}", *slowest, result.memory / 2**30)


JOBS = {
    "step": (step, (0.03, 0.0125, 0.0066, 0.0053)), "path": (path, (0.06,)), "krylov": (krylov, (0.05,)),
    "coarse": (coarse, (0.1, 0.05, 0.022)), "ranks": (ranks, (0.0125,)),
}  # fmt: skip

if __name__ == "__main__":
    job, default = JOBS[sys.argv[1]]
    job(tuple(map(float, sys.argv[2:])) or default)
