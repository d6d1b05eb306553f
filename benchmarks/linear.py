"""Linear solvers on the surface of cases/single.toml: tolerance of the Krylov solver, ways to solve the coarse problem.

    ./run python3 benchmarks/linear.py krylov [H ...]     tolerance of the Krylov solver, elastic and elastic-plastic
    ./run python3 benchmarks/linear.py coarse [H ...]     ways to solve the coarse problem, also under mpirun

Load steps to 0.03 L; H is the element size in the contact in units of L; seconds are CPU seconds of the load path.
"""

from __future__ import annotations

import sys
import warnings
from time import process_time
from typing import Any

from mpi4py import MPI

import asperity as asp
from asperity.linear import coarse as coarse_problem
from asperity.quasistatic.contact_result import ContactResult

L = 1e-6
MATERIALS = {"elastic": asp.Material(200e9, 0.3), "plastic": asp.Material(200e9, 0.3, 1e9, 10e9)}


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
    job, default = {"krylov": (krylov, (0.05,)), "coarse": (coarse, (0.1, 0.05, 0.022))}[sys.argv[1]]
    job(tuple(map(float, sys.argv[2:])) or default)
