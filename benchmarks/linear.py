# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

"""Linear solvers on the elastic-plastic demo surface: direct, p-multigrid, algebraic multigrid.

    ./run python3 benchmarks/linear.py [H ...]            element sizes in the contact, in units of L
    ./run python3 benchmarks/linear.py pieces [H ...]     parts of the p-multigrid in two ways, PETSc's or other orders
    ./run python3 benchmarks/linear.py parts [H ...]      time of each part of a load path, also under mpirun -n 2
    ./run python3 benchmarks/linear.py krylov [H ...]     tolerance of the Krylov solver, elastic and elastic-plastic
    ./run python3 benchmarks/linear.py norms [H ...]      energy norm of the residual by V-cycle and by prediction
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
from asperity import _solver
from asperity.arrays import Integers, Singles
from asperity.fem.solid import Solid
from asperity.fem.sparsity import SparsityPattern
from asperity.linear import coarse as coarse_problem
from asperity.linear.matrix_free import TangentOperator
from asperity.linear.multigrid import PMultigrid
from asperity.linear.petsc_matrix import assembled, local_matrix
from asperity.linear.solver import Krylov
from asperity.quasistatic.contact_result import ContactResult

L = 1e-6
STEEL = asp.Material(200e9, 0.3, 1e9, 10e9)
MATERIALS = {"elastic": asp.Material(200e9, 0.3), "plastic": STEEL}
SIZES = (0.2, 0.12, 0.08, 0.056, 0.04)
REPEATS = 15
KINDS = ("cg", "lu", "gamg")  # the first one always runs and gives the size
LARGEST = {"lu": 40_000, "gamg": 60_000}  # dofs beyond which there is nothing left to compare


def main(sizes: tuple[float, ...]) -> None:
    """Print the table."""
    warnings.simplefilter("ignore")
    surface = asp.Surface.from_spec(kind="weierstrass-mandelbrot", L=L, D=2.4, G=1.36e-11)
    print("| dofs | solver | Newton | Krylov | CPU s | linear s | memory MiB |")
    print("|---|---|---|---|---|---|---|")
    for h in sizes:
        dofs = 0
        for kind in KINDS:
            if dofs > LARGEST.get(kind, dofs):
                continue
            start = process_time()
            result = asp.solve_contact(
                surface,
                STEEL,
                delta_max=0.03 * L,
                steps=3,
                size=asp.MeshSize(h * L),
                options=asp.SolverOptions(linear=kind),
            )
            seconds = process_time() - start
            dofs, counts, spent = result.dofs, result.counts, result.phases.seconds
            linear = sum(spent.get(name, 0.0) for name in ("preconditioner", "linear solve"))
            memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
            row = dofs, kind, counts.newton, counts.krylov, f"{seconds:.1f}", f"{linear:.1f}", f"{memory:.0f}"
            print("| " + " | ".join(map(str, row)) + " |", flush=True)


def pieces(sizes: tuple[float, ...]) -> None:
    """Milliseconds of parts of a V-cycle and its set-up in two ways, elastic stiffness; medians of REPEATS calls."""
    from dolfinx import fem

    warnings.simplefilter("ignore")
    surface = asp.Surface.from_spec(kind="weierstrass-mandelbrot", L=L, D=2.4, G=1.36e-11)
    print("| dofs | part | first ms | second ms | ratio |\n|---|---|---|---|---|")
    for h in sizes:
        result = asp.solve_contact(surface, MATERIALS["elastic"], delta_max=0.03 * L, steps=1, size=asp.MeshSize(h * L))
        solid = result.solver.solid
        tangent = TangentOperator(solid, symmetric=True, single=True)
        tangent.hold(solid.fixed)
        tangent.update()
        cycle = PMultigrid(tangent)
        cycle.update()
        A = assembled(solid)
        A.zeroRowsColumns(solid.fixed, diag=1.0)
        x, y = solid.vector(), solid.vector()
        x.array = np.random.default_rng(0).normal(size=solid.dofs)
        single = tangent.padded(x.array_r)
        product = median(A.mult, x, y), median(tangent.single_product, single)
        P = interpolation(cycle)
        galerkin = median(A.ptap, P, A.ptap(P)), median(cycle._galerkin)
        factors, solution = coarse_factors(cycle)
        in_other_order = half_product(fem.functionspace(solid.mesh, ("Lagrange", 2)).dofmap.list, single)
        for name, (theirs, ours) in {
            "product, half (nodes in the order of dolfinx; here: Cuthill & McKee)": (in_other_order, product[1]),
            "product (PETSc: double, all; here: single, half)": product,
            "Galerkin's matrix (PETSc: PtAP; here: kernel)": galerkin,
            "coarse factors (PETSc: CHOLMOD, double; here: single)": factors,
            "coarse solution (PETSc: CHOLMOD, double; here: single)": solution,
        }.items():
            print(f"| {solid.dofs} | {name} | {theirs:.2f} | {ours:.2f} | {theirs / ours:.1f} |", flush=True)


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
            result, _ = demo(MATERIALS["plastic"], h)
        comm = result.solver.solid.comm
        if comm.rank == 0:
            print("| ranks | dofs | part | calls | median ms | shortest twentieth ms |\n|---|---|---|---|---|---|")
        for name, times in spent.items():
            if comm.rank == 0 and times:
                median, least = 1e3 * np.quantile(times, (0.5, 0.05))
                row = comm.size, result.dofs, name, len(times), f"{median:.3f}", f"{least:.3f}"
                print("| " + " | ".join(map(str, row)) + " |", flush=True)


def timed(work: Callable[..., Any], spent: list[float]) -> Callable[..., Any]:
    """The function, which also appends the seconds of each call."""

    def call(*arguments: Any, **options: Any) -> Any:
        start = perf_counter()
        out = work(*arguments, **options)
        spent.append(perf_counter() - start)
        return out

    return call


def demo(material: asp.Material, h: float, **options: float) -> tuple[ContactResult, float]:
    """The demo surface to 0.03 L in ten planned steps, and its CPU seconds."""
    warnings.simplefilter("ignore")
    surface = asp.Surface.from_spec(kind="weierstrass-mandelbrot", L=L, D=2.4, G=1.36e-11)
    start = process_time()
    result = asp.solve_contact(
        surface, material, delta_max=0.03 * L, steps=10, size=asp.MeshSize(h * L), options=asp.SolverOptions(**options)
    )
    return result, process_time() - start


def krylov(sizes: tuple[float, ...]) -> None:
    """Iterations against the tolerance of the Krylov solver."""
    print("| dofs | material | Krylov tolerance | Newton | Krylov | CPU s |\n|---|---|---|---|---|---|")
    for h in sizes:
        for name, material in MATERIALS.items():
            for rtol in (1e-3, 1e-2, 3e-2):
                result, seconds = demo(material, h, krylov_rtol=rtol)
                counts = result.counts
                print(
                    f"| {result.dofs} | {name} | {rtol:g} | {counts.newton} | {counts.krylov} | {seconds:.1f} |",
                    flush=True,
                )


def norms(sizes: tuple[float, ...]) -> None:
    """Square of the energy norm of the residual by a V-cycle over the prediction of `Krylov`: quantiles."""
    print("| dofs | material | iteration | residuals | 1 % | 50 % | 99 % |\n|---|---|---|---|---|---|---|")
    for h in sizes:
        for name, material in MATERIALS.items():
            solves: list[list[tuple[float, float]]] = []
            with ExitStack() as stack:
                stack.enter_context(patch.object(PMultigrid, "apply", recorded(PMultigrid.apply, solves)))
                stack.enter_context(patch.object(Krylov, "solve", counted(Krylov.solve, solves)))
                dofs = demo(material, h)[0].dofs
            found: dict[str, list[float]] = {"first": [], "later": []}
            for energies, squares in (np.array(rows).T for rows in solves if len(rows) > 1):
                ratios = (energies[1:] / energies[:-1]) / (squares[1:] / squares[:-1])
                found["first"].append(ratios[0])
                found["later"].extend(ratios[1:])
            for which, values in found.items():
                low, middle, high = np.quantile(values, (0.01, 0.5, 0.99))
                print(
                    f"| {dofs} | {name} | {which} | {len(values)} | {low:.2f} | {middle:.2f} | {high:.2f} |", flush=True
                )


def recorded(cycle: Callable[..., None], solves: list[list[tuple[float, float]]]) -> Callable[..., None]:
    """The V-cycle, which also notes r.z and r.r of the last solution; one process."""

    def call(multigrid: PMultigrid, pc: Any, r: Any, z: Any) -> None:
        cycle(multigrid, pc, r, z)
        solves[-1].append((multigrid.energy, float(r.array_r @ r.array_r)))

    return call


def counted(solve: Callable[..., Any], solves: list[list[tuple[float, float]]]) -> Callable[..., Any]:
    """The solution of a system, which also starts a list."""

    def call(*arguments: Any) -> Any:
        solves.append([])
        return solve(*arguments)

    return call


def coarse(sizes: tuple[float, ...]) -> None:
    """Iterations and time with the ways to solve the coarse problem, elastic; also under mpirun."""
    limits: dict[str, dict[str, Any]] = {
        "factorised": {"DIRECT_LIMIT": coarse_problem.DIRECT_LIMIT},
        "whole on each rank": {"INTERFACE_LIMIT": -1, "REPLICATED_LIMIT": coarse_problem.DIRECT_LIMIT},
        "algebraic multigrid": {"DIRECT_LIMIT": 0},
    }
    if MPI.COMM_WORLD.size == 1:
        del limits["whole on each rank"]
    demo(MATERIALS["elastic"], 0.2)  # imports
    out("| ranks | dofs | coarse problem | Newton | Krylov | CPU s | MiB |\n|---|---|---|---|---|---|---|")
    for h in sizes:
        for name, limit in limits.items():
            with patch.multiple(coarse_problem, **limit):
                result, seconds = demo(MATERIALS["elastic"], h)
            row = MPI.COMM_WORLD.size, result.dofs, name, result.counts.newton, result.counts.krylov
            out("| " + " | ".join(map(str, row)) + f" | {seconds:.1f} | {result.memory / 2**20:.0f} |")


def out(line: str) -> None:
    """Print on rank 0."""
    if MPI.COMM_WORLD.rank == 0:
        print(line, flush=True)


def median(work: Callable[..., object], *arguments: object) -> float:
    """Milliseconds of CPU time of a call, the median of REPEATS."""
    spent = []
    for _ in range(REPEATS):
        start = process_time()
        work(*arguments)
        spent.append(1e3 * (process_time() - start))
    return float(np.median(spent))


def half_product(cell_nodes: Integers, x: Singles) -> float:
    """Milliseconds of a product with the upper half of a matrix whose nodes have these numbers; one process."""
    values = x.reshape(-1, 4)
    starts, columns = SparsityPattern(cell_nodes, len(values)).upper
    blocks = np.ones(9 * len(columns) + 1, dtype=np.float32)
    return median(_solver.symmetric_product, starts, columns, blocks, values, np.empty_like(values))


def interpolation(cycle: PMultigrid) -> Any:
    """Interpolation from the coarse to the fine level as a matrix of PETSc; one process."""
    from petsc4py import PETSc

    P = cycle._prolongation
    P = P[np.arange(P.shape[0]) % 4 < 3]  # without the padding
    csr = P.indptr.astype(PETSc.IntType), P.indices.astype(PETSc.IntType), P.data.astype(float)
    return PETSc.Mat().createAIJ(P.shape, csr=csr, comm=PETSc.COMM_SELF)


def coarse_factors(cycle: PMultigrid) -> tuple[tuple[float, float], tuple[float, float]]:
    """Milliseconds of coarse factors of known structure and of a coarse solution, by PETSc and here."""
    from petsc4py import PETSc

    coarse, ksp = cycle._coarse, PETSc.KSP().create(PETSc.COMM_SELF)
    A = local_matrix(coarse.sparsity, coarse.values, PETSc.COMM_SELF)
    A.setOption(PETSc.Mat.Option.SPD, True)
    ksp.setType("preonly")
    ksp.getPC().setType("cholesky")
    ksp.getPC().setFactorSolverType("cholmod")
    ksp.setOperators(A)

    def update() -> None:
        A.assemble()
        ksp.setOperators(A)
        ksp.setUp()

    x, b = A.createVecs()
    b.array = np.random.default_rng(0).normal(size=A.size[0])
    right = b.array_r.astype(np.float32)
    return (median(update), median(coarse.update)), (median(ksp.solve, b, x), median(coarse.solve, right))


if __name__ == "__main__":
    jobs = {
        "pieces": (pieces, (0.08, 0.04)),
        "parts": (parts, (0.05,)),
        "krylov": (krylov, (0.05,)),
        "norms": (norms, (0.1, 0.05)),
        "coarse": (coarse, (0.1, 0.05, 0.022)),
    }
    job, sizes = jobs.get("".join(sys.argv[1:2]), (main, SIZES))
    job(tuple(map(float, sys.argv[1 if job is main else 2 :])) or sizes)
