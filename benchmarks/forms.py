"""Forms of UFL beside the compiled kernels: CPU seconds of residual, tangent and a load path, and of the compiler.

    ./run python3 benchmarks/forms.py [DOFS ...]

On one process, all points yielding, least of three. The forms are compiled into an empty cache, a laptop's seconds of
the clock. The load path is that of tests/fem/test_forms.py.
"""

from __future__ import annotations

import os
import sys
import tempfile
import warnings
from collections.abc import Callable
from time import perf_counter, process_time

import numpy as np
from mpi4py import MPI

import asperity as asp
from asperity.fem.solid import Solid
from asperity.mesh.block import BlockMesh
from asperity.mesh.distribute import distribute
from asperity.quasistatic.make import make_block, make_contact_solver

SURFACE = asp.Surface.from_spec("weierstrass-mandelbrot", L=1.0, D=2.4, G=1.36e-5, seed=0)
SOLIDS = {kind: asp.Material(1.0, 0.3, 0.005, 0.05, kinematics=kind) for kind in ("small", "finite")}
PATH = (0.004, 0.008, 0.012, 0.011, 0.01)  # approaches [L]
SIZES = {20_000: (0.072, 0.3), 100_000: (0.023, 0.25)}  # about: element sizes for these dofs


def least(work: Callable[[], object]) -> float:
    """Least CPU seconds of three."""
    seconds = []
    for _ in range(3):
        start = process_time()
        work()
        seconds.append(process_time() - start)
    return min(seconds)


def kernels(block: BlockMesh | None, material: asp.Material, forms: bool) -> tuple[float, float, float, int]:
    """Seconds of residual, tangent and compiler, and the dofs."""
    mesh, tags = distribute(MPI.COMM_WORLD, block, 1.0)
    solid = Solid(mesh, tags, material, forms=forms)
    u = solid.points @ np.diag([0.004, 0.002, -0.02]) + 1e-3 * solid.points[:, [1]] * solid.points
    b, values = np.zeros((solid.nodes, 3)), np.zeros(solid.sparsity.size)
    start = perf_counter()
    solid.kernels.add_internal_force(u, b)
    solid.kernels.tangent(u, values)
    first = perf_counter() - start
    force = least(lambda: solid.kernels.add_internal_force(u, b))
    tangent = least(lambda: solid.kernels.tangent(u, values))
    return force, tangent, first, solid.dofs


def load_path(block: BlockMesh | None, material: asp.Material, kind: str) -> float:
    """CPU seconds of a load path."""
    solver = make_contact_solver(
        MPI.COMM_WORLD, SURFACE, block, material, options=asp.SolverOptions(linear="cg", kernels=kind)
    )
    start = process_time()
    for delta in PATH:
        solver.step(delta)
    return process_time() - start


def main(sizes: tuple[int, ...]) -> None:
    """Print the table."""
    os.environ["XDG_CACHE_HOME"] = tempfile.mkdtemp()
    warnings.simplefilter("ignore")
    print("| strain | dofs | residual | ratio | tangent | ratio | load path | ratio | compiler |")
    print("|---|---|---|---|---|---|---|---|---|")
    for size in sizes:
        block = make_block(MPI.COMM_WORLD, SURFACE, 1.0, 0.02, asp.MeshSize(SIZES[size][0], h_max=SIZES[size][1]))
        for kind, material in SOLIDS.items():
            ours, theirs = (kernels(block, material, forms) for forms in (False, True))
            paths = [load_path(block, material, name) for name in ("compiled", "forms")]
            print(
                f"| {kind} | {ours[3]} | {ours[0]:.4f} s | {theirs[0] / ours[0]:.1f} | {ours[1]:.3f} s | "
                f"{theirs[1] / ours[1]:.1f} | {paths[0]:.1f} s | {paths[1] / paths[0]:.1f} | {theirs[2]:.0f} s |",
                flush=True,
            )


if __name__ == "__main__":
    main(tuple(map(int, sys.argv[1:])) or tuple(SIZES))
