"""Linear solvers on the surface of cases/single.toml: tolerance of the Krylov solver, ways to solve the coarse problem.

    ./run python3 benchmarks/linear.py krylov [H ...]     tolerance of the Krylov solver, elastic and elastic-plastic
    ./run python3 benchmarks/linear.py coarse [H ...]     ways to solve the coarse problem, also under mpirun
    ./run mpirun --oversubscribe -n N python3 benchmarks/linear.py ranks [H]    counts of N ranks, and what they cost
    ./run mpirun --oversubscribe -n N python3 benchmarks/linear.py memory [H]   memory of N ranks in one step

Load steps to 0.03 L; H is the element size in the contact in units of L; seconds are CPU seconds of the load path.
"""

from __future__ import annotations

import sys
import warnings
from pathlib import Path
from time import process_time
from typing import Any

from dolfinx import fem
from mpi4py import MPI

import asperity as asp
from asperity.linear import coarse as coarse_problem
from asperity.linear.coarse import interface_of
from asperity.mesh.distribute import distribute
from asperity.quasistatic.contact_result import ContactResult
from asperity.quasistatic.make import make_block

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
            for rtol in (1e-3, 1e-2, 4e-2):
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


# Elastic-plastic path of four steps, 221,919 dofs (h_contact 0.0125 L), on 16 cores of a Xeon: seconds of one rank that
# are shared evenly, of the tangent, and of what no rank shares; iterations and factorisations.
EVEN, TANGENT, ALONE, KRYLOV, FACTORS = 88.2, 7.2, 2.9, 857, 141
BUSIEST = {1: 1.0, 2: 1.25, 4: 2.1, 8: 3.1, 16: 3.2}  # cells that flow on the busiest rank over the mean, counted
STREAM, RATE = 3.6e9, 180e9  # bytes and flops a second of a rank, of the dense matrix on 8 ranks
MULTIGRID = 1.26  # CPU seconds of the path with algebraic multigrid over those with substructures, one rank
MEASURED = {1: 98.3, 2: 51.9, 4: 33.2, 8: 27.9}  # seconds of ranks with substructures, there
LATENCY, MESSAGES = 5e-6, {"substructures": 12, "multigrid": 112}  # seconds of one, and how many an iteration takes


def ranks(sizes: tuple[float, ...]) -> None:
    """Counts of a mesh on these ranks, nothing is solved: the interface and its dense matrix.

    Near the end is a model: seconds and efficiency of the path above, exact counts times the costs of that
    machine, beside what was measured there; they hold for H = 0.0125.
    """
    comm = MPI.COMM_WORLD
    names = "ranks | dofs | coarse problem | interface | MB a solution | Gflop a factorisation | model s | efficiency"
    out(f"| {names} | measured s |\n|---|---|---|---|---|---|---|---|---|")
    for h in sizes:
        surface = asp.Surface.from_spec(kind="weierstrass-mandelbrot", L=L, D=2.4, G=1.36e-11)
        block = make_block(comm, surface, L, 0.02 * L, asp.MeshSize(h * L), "rollers")
        mesh = distribute(comm, block, L)[0]
        dofs = 3 * comm.bcast(None if block is None else len(block.points), root=0)
        corners = fem.functionspace(mesh, ("Lagrange", 1, (3,))).dofmap.index_map
        shared, coarse = interface_of(corners, comm).dofs, 3 * corners.size_global
        by_rule = "substructures" if shared**2 <= coarse_problem.DENSE * coarse / comm.size else "multigrid"
        for kind in dict.fromkeys((by_rule, "substructures")):
            dense = kind == "substructures"
            stored, flops = 4.0 * shared**2 * dense, shared**3 / 3.0 * dense
            work = EVEN if dense else EVEN * MULTIGRID
            seconds = ALONE + work / comm.size + TANGENT * BUSIEST.get(comm.size, 3.2) / comm.size
            seconds += KRYLOV * (stored / STREAM + (comm.size > 1) * MESSAGES[kind] * LATENCY) + FACTORS * flops / RATE
            row = comm.size, dofs, kind, shared, f"{stored / 1e6:.1f}", f"{flops / 1e9:.1f}", f"{seconds:.1f}"
            share = (EVEN + TANGENT + ALONE) / seconds / comm.size
            known = MEASURED.get(comm.size, "-") if dense else "-"
            out("| " + " | ".join(map(str, row)) + f" | {share:.2f} | {known} |")


def memory(sizes: tuple[float, ...]) -> None:
    """Sum of the peaks of the ranks, and what they take of the machine at the end, where shared pages count once."""
    out("| ranks | dofs | peaks MiB | of the machine MiB |\n|---|---|---|---|")
    for h in sizes:
        result, _ = fractal(MATERIALS["plastic"], h, steps=1)
        lines = Path("/proc/self/smaps_rollup").read_text().splitlines()
        taken = MPI.COMM_WORLD.allreduce(next(int(line.split()[1]) / 1024 for line in lines if line.startswith("Pss:")))
        out(f"| {MPI.COMM_WORLD.size} | {result.dofs} | {result.memory / 2**20:.0f} | {taken:.0f} |")


def out(line: str) -> None:
    """Print on rank 0."""
    if MPI.COMM_WORLD.rank == 0:
        print(line, flush=True)


if __name__ == "__main__":
    jobs = {"krylov": (krylov, (0.05,)), "coarse": (coarse, (0.1, 0.05, 0.022)), "ranks": (ranks, (0.0125,)),
            "memory": (memory, (0.0125,))}  # fmt: skip
    job, default = jobs[sys.argv[1]]
    job(tuple(map(float, sys.argv[2:])) or default)
