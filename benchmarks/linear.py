"""Linear solvers on the elastic-plastic surface of cases/single.toml: direct, p-multigrid, algebraic multigrid.

    ./run python3 benchmarks/linear.py [H ...]            element sizes in the contact, in units of L
    ./run python3 benchmarks/linear.py parts [H ...]      time of each part of a load path, also under mpirun -n 2
    ./run python3 benchmarks/linear.py krylov [H ...]     tolerance of the Krylov solver, elastic and elastic-plastic
    ./run python3 benchmarks/linear.py coarse [H ...]     ways to solve the coarse problem, also under mpirun

Three large load steps to 0.03 L on one process. Seconds are CPU seconds of the load path; the part of the linear
systems (preconditioner, solution) is in seconds of the clock; memory is the peak of all runs so far.
"""

from __future__ import annotations

import resource
import sys
import warnings
from collections.abc import Callable
from contextlib import ExitStack
from time import perf_counter, process_time
from typing import Any
from unittest.mock import patch

import numpy as np
from mpi4py import MPI

import asperity as asp
from asperity.fem.solid import Solid
from asperity.linear import coarse as coarse_problem
from asperity.linear.matrix_free import TangentOperator
from asperity.linear.multigrid import PMultigrid
from asperity.quasistatic.contact_result import ContactResult

L = 1e-6
MATERIALS = {"elastic": asp.Material(200e9, 0.3), "plastic": asp.Material(200e9, 0.3, 1e9, 10e9)}
SIZES = (0.2, 0.12, 0.08, 0.056, 0.04)
KINDS = ("cg", "lu", "gamg")  # the first one always runs and gives the size
LARGEST = {"lu": 40_000, "gamg": 60_000}  # dofs beyond which there is nothing left to compare


def main(sizes: tuple[float, ...]) -> None:
    """Print the table."""
    print("| dofs | solver | Newton | Krylov | CPU s | linear s | memory MiB |")
    print("|---|---|---|---|---|---|---|")
    for h in sizes:
        dofs = 0
        for kind in KINDS:
            if dofs > LARGEST.get(kind, dofs):
                continue
            result, seconds = fractal(MATERIALS["plastic"], h, 3, linear=kind)
            dofs, counts, spent = result.dofs, result.counts, result.phases.seconds
            linear = sum(spent.get(name, 0.0) for name in ("preconditioner", "linear solve"))
            memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
            row = dofs, kind, counts.newton, counts.krylov, f"{seconds:.1f}", f"{linear:.1f}", f"{memory:.0f}"
            print("| " + " | ".join(map(str, row)) + " |", flush=True)


def parts(sizes: tuple[float, ...]) -> None:
    """Milliseconds a call of the parts of a load path; other jobs delay the shortest twentieth least."""
    names = {
        "residual": (Solid, "internal_force"),
        "tangent": (Solid, "_assemble"),
        "copy in single precision": (TangentOperator, "update"),
        "Galerkin's matrix": (PMultigrid, "_galerkin"),
        "coarse factors": (coarse_problem.Substructures, "update"),
        "greatest eigenvalue": (PMultigrid, "_greatest_eigenvalue"),
        "V-cycle": (PMultigrid, "apply"),
        "coarse solution": (coarse_problem.Substructures, "solve"),
        "product of the smoother": (TangentOperator, "single_product"),
    }
    for h in sizes:
        spent: dict[str, list[float]] = {name: [] for name in names}
        with ExitStack() as stack:
            for name, (owner, method) in names.items():
                stack.enter_context(patch.object(owner, method, timed(getattr(owner, method), spent[name])))
            result, _ = fractal(MATERIALS["plastic"], h)
        out("| ranks | dofs | part | calls | median ms | shortest twentieth ms |\n|---|---|---|---|---|---|")
        for name, times in spent.items():
            if times:
                median, least = 1e3 * np.quantile(times, (0.5, 0.05))
                row = MPI.COMM_WORLD.size, result.dofs, name, len(times), f"{median:.3f}", f"{least:.3f}"
                out("| " + " | ".join(map(str, row)) + " |")


def timed(work: Callable[..., Any], spent: list[float]) -> Callable[..., Any]:
    """The function, which also appends the seconds of each call."""

    def call(*arguments: Any, **options: Any) -> Any:
        start = perf_counter()
        out = work(*arguments, **options)
        spent.append(perf_counter() - start)
        return out

    return call


def fractal(material: asp.Material, h: float, steps: int = 10, **options: Any) -> tuple[ContactResult, float]:
    """The surface of cases/single.toml to 0.03 L in planned steps, and its CPU seconds."""
    warnings.simplefilter("ignore")
    surface = asp.Surface.from_spec(kind="weierstrass-mandelbrot", L=L, D=2.4, G=1.36e-11)
    start = process_time()
    result = asp.solve_contact(
        surface, material, delta_max=0.03 * L, steps=steps, size=asp.MeshSize(h * L),
        options=asp.SolverOptions(**options),
    )  # fmt: skip
    return result, process_time() - start


def krylov(sizes: tuple[float, ...]) -> None:
    """Iterations against the tolerance of the Krylov solver."""
    print("| dofs | material | Krylov tolerance | Newton | Krylov | CPU s |\n|---|---|---|---|---|---|")
    for h in sizes:
        for name, material in MATERIALS.items():
            for rtol in (1e-3, 1e-2, 3e-2):
                result, seconds = fractal(material, h, krylov_rtol=rtol)
                counts = result.counts
                print(
                    f"| {result.dofs} | {name} | {rtol:g} | {counts.newton} | {counts.krylov} | {seconds:.1f} |",
                    flush=True,
                )


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
    fractal(MATERIALS["elastic"], 0.2)  # imports
    out("| ranks | dofs | coarse problem | Newton | Krylov | CPU s | MiB |\n|---|---|---|---|---|---|---|")
    for h in sizes:
        for name, options in ways.items():
            for option, value in options.items():
                PETSc.Options(coarse_problem.PREFIX)[option] = value
            result, seconds = fractal(MATERIALS["elastic"], h)
            for option in options:
                PETSc.Options(coarse_problem.PREFIX).delValue(option)
            row = MPI.COMM_WORLD.size, result.dofs, name, result.counts.newton, result.counts.krylov
            out("| " + " | ".join(map(str, row)) + f" | {seconds:.1f} | {result.memory / 2**20:.0f} |")


def out(line: str) -> None:
    """Print on rank 0."""
    if MPI.COMM_WORLD.rank == 0:
        print(line, flush=True)


if __name__ == "__main__":
    jobs = {
        "parts": (parts, (0.05,)),
        "krylov": (krylov, (0.05,)),
        "coarse": (coarse, (0.1, 0.05, 0.022)),
    }
    job, sizes = jobs.get("".join(sys.argv[1:2]), (main, SIZES))
    job(tuple(map(float, sys.argv[1 if job is main else 2 :])) or sizes)
