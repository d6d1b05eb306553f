"""Forms of UFL beside the compiled kernels: CPU seconds of a load path, and seconds of the compiler.

    ./run python3 benchmarks/forms.py      # three minutes

The compiler's are CPU seconds of a first step in an empty cache over those of a second one, each in a process of its
own: within one, some expressions are compiled again.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import warnings
from resource import RUSAGE_CHILDREN, getrusage
from time import process_time

import asperity as asp

SURFACE = asp.Surface.from_spec("weierstrass-mandelbrot", L=1.0, D=2.4, G=1.36e-5, seed=0)
SIZE, COARSE = asp.MeshSize(0.072, h_max=0.3), asp.MeshSize(0.3, h_max=0.5)


def press(kind: str, kernels: str, size: asp.MeshSize, steps: int) -> tuple[int, float]:
    """Dofs and CPU seconds of a load path."""
    law = asp.Material(1.0, 0.3, 0.005, 0.05, kinematics=kind)
    since = process_time()
    result = asp.solve_contact(
        SURFACE, law, delta_max=0.004 * steps, steps=steps, size=size, options=asp.SolverOptions(kernels=kernels)
    )
    return result.dofs, process_time() - since


def one_step(kind: str) -> float:
    """CPU seconds of a process that makes one step, with its compilers."""
    before = getrusage(RUSAGE_CHILDREN)
    subprocess.run([sys.executable, __file__, kind], check=True)
    after = getrusage(RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def main() -> None:
    """Print the table."""
    os.environ["XDG_CACHE_HOME"] = tempfile.mkdtemp()
    print("| strain, dofs | load path, kernels | forms over kernels | compiler |\n|---|---|---|---|")
    for kind in ("small", "finite"):
        first, second = one_step(kind), one_step(kind)
        dofs, own = press(kind, "compiled", SIZE, 3)
        _, forms = press(kind, "forms", SIZE, 3)
        print(f"| {kind}, {dofs} | {own:.1f} s | {forms / own:.1f} | {first - second:.0f} s |", flush=True)


if __name__ == "__main__":
    warnings.simplefilter("ignore")
    if len(sys.argv) > 1:
        press(sys.argv[1], "forms", COARSE, 1)
    else:
        main()
