"""Forms of UFL beside the compiled kernels: CPU seconds of a load path, and seconds of the compiler.

    ./run python3 benchmarks/forms.py      # three minutes

The compiler's are those of the clock for a first step in an empty cache, over a second one.
"""

from __future__ import annotations

import os
import tempfile
import warnings
from time import perf_counter, process_time

import asperity as asp

SURFACE = asp.Surface.from_spec("weierstrass-mandelbrot", L=1.0, D=2.4, G=1.36e-5, seed=0)
SIZE, COARSE = asp.MeshSize(0.072, h_max=0.3), asp.MeshSize(0.3, h_max=0.5)


def press(kind: str, kernels: str, size: asp.MeshSize, steps: int) -> tuple[int, float, float]:
    """Dofs, CPU seconds and seconds of the clock of a load path."""
    law = asp.Material(1.0, 0.3, 0.005, 0.05, kinematics=kind)
    cpu, clock = process_time(), perf_counter()
    result = asp.solve_contact(
        SURFACE, law, delta_max=0.004 * steps, steps=steps, size=size, options=asp.SolverOptions(kernels=kernels)
    )
    return result.dofs, process_time() - cpu, perf_counter() - clock


def main() -> None:
    """Print the table."""
    os.environ["XDG_CACHE_HOME"] = tempfile.mkdtemp()
    warnings.simplefilter("ignore")
    print("| strain, dofs | load path, kernels | forms over kernels | compiler |\n|---|---|---|---|")
    for kind in ("small", "finite"):
        first, second = (press(kind, "forms", COARSE, 1)[2] for _ in range(2))
        dofs, own, _ = press(kind, "compiled", SIZE, 3)
        _, forms, _ = press(kind, "forms", SIZE, 3)
        print(f"| {kind}, {dofs} | {own:.1f} s | {forms / own:.1f} | {first - second:.0f} s |", flush=True)


if __name__ == "__main__":
    main()
