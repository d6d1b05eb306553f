"""Linear solvers on the elastic-plastic demo surface: direct, p-multigrid, algebraic multigrid.

    ./run python3 benchmarks/linear.py [H ...]     element sizes in the contact, in units of L

Three large load steps to 0.03 L on one process. Seconds are CPU seconds of the load path; the part of the linear
systems (elimination, preconditioner, solution) is in seconds of the clock; memory is the peak of all runs so far.
"""

from __future__ import annotations

import resource
import sys
import warnings
from time import process_time

import asperity as asp

L = 1e-6
STEEL = asp.Material(200e9, 0.3, 1e9, 10e9)
SIZES = (0.2, 0.12, 0.08, 0.056, 0.04)
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


if __name__ == "__main__":
    main(tuple(map(float, sys.argv[1:])) or SIZES)
