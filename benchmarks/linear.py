"""Linear solvers on the elastic-plastic demo surface: direct, p-multigrid, algebraic multigrid.

    ./run python3 benchmarks/linear.py [H ...]            element sizes in the contact, in units of L
    ./run python3 benchmarks/linear.py pieces [H ...]     parts of the p-multigrid against what PETSc has for them

Three large load steps to 0.03 L on one process. Seconds are CPU seconds of the load path; the part of the linear
systems (elimination, preconditioner, solution) is in seconds of the clock; memory is the peak of all runs so far.
"""

from __future__ import annotations

import resource
import sys
import warnings
from collections.abc import Callable
from time import process_time

import numpy as np

import asperity as asp
from asperity.multigrid import PMultigrid

L = 1e-6
STEEL = asp.Material(200e9, 0.3, 1e9, 10e9)
SIZES = (0.2, 0.12, 0.08, 0.056, 0.04)
REPEATS = 15
KINDS = ("cg", "lu", "gamg")  # the first one always runs and tells the size
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
            linear = sum(spent.get(name, 0.0) for name in ("elimination", "preconditioner", "linear solve"))
            memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
            row = dofs, kind, counts.newton, counts.krylov, f"{seconds:.1f}", f"{linear:.1f}", f"{memory:.0f}"
            print("| " + " | ".join(map(str, row)) + " |", flush=True)


def pieces(sizes: tuple[float, ...]) -> None:
    """Milliseconds of the parts of a V-cycle and its set-up on the elastic stiffness, medians of REPEATS calls."""
    warnings.simplefilter("ignore")
    surface = asp.Surface.from_spec(kind="weierstrass-mandelbrot", L=L, D=2.4, G=1.36e-11)
    print("| dofs | part | PETSc ms | here ms | ratio |\n|---|---|---|---|---|")
    for h in sizes:
        result = asp.solve_contact(
            surface, asp.Material(200e9, 0.3), delta_max=0.03 * L, steps=1, size=asp.MeshSize(h * L)
        )
        solid = result.press.solid
        A = solid.assemble_tangent()
        A.zeroRowsColumns(solid.fixed, diag=1.0)
        cycle = PMultigrid(solid)
        cycle.update(A, solid.fixed)
        x, y = A.createVecRight(), A.createVecRight()
        x.array = np.random.default_rng(0).normal(size=solid.dofs)
        single = x.array_r.astype(np.float32)
        product = median(A.mult, x, y), median(cycle._product, single)
        coarse = A.ptap(cycle._P)
        galerkin = median(A.ptap, cycle._P, coarse), median(cycle._galerkin)
        factor = median(factorise, cycle, "mumps"), median(factorise, cycle, "cholmod")
        for name, (theirs, ours) in {
            "product (double, all; single, half)": product,
            "Galerkin's matrix (PtAP; kernel)": galerkin,
            "coarse factors (MUMPS; CHOLMOD)": factor,
        }.items():
            print(f"| {solid.dofs} | {name} | {theirs:.2f} | {ours:.2f} | {theirs / ours:.1f} |", flush=True)


def median(work: Callable[..., object], *arguments: object) -> float:
    """Milliseconds of CPU time of a call, the median of REPEATS."""
    spent = []
    for _ in range(REPEATS):
        start = process_time()
        work(*arguments)
        spent.append(1e3 * (process_time() - start))
    return float(np.median(spent))


def factorise(cycle: PMultigrid, package: str) -> None:
    """Symbolic and numeric factorisation of the coarse matrix."""
    from petsc4py import PETSc

    pc = PETSc.PC().create(PETSc.COMM_SELF)
    pc.setType("cholesky")
    pc.setFactorSolverType(package)
    pc.setOperators(cycle._coarse.A)
    pc.setUp()


if __name__ == "__main__":
    job, numbers = (pieces, sys.argv[2:]) if sys.argv[1:2] == ["pieces"] else (main, sys.argv[1:])
    job(tuple(map(float, numbers)) or (SIZES if job is main else (0.08, 0.04)))
