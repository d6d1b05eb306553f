# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

"""Error of stick in the load steps: a sphere against the closed form, the demo surface against its finest steps.

./run python3 benchmarks/stick.py > benchmarks/stick.csv
"""

from __future__ import annotations

import warnings

import numpy as np
from mpi4py import MPI

from asperity import Formulation, Material, MeshSize, Surface, solve_contact
from asperity.curve import Curve
from asperity.mesh.block import BlockMesh
from asperity.quasistatic.make import make_block
from asperity.surface import Sphere

STICK = Formulation(friction="stick")
SPHERE_RATIO = 1.05289  # force with stick over that without at the same approach, nu = 0 (tests/contact/test_stick.py)


def forces(curve: Curve, steps: int) -> np.ndarray:
    """Forces at the ends of the planned steps of a loading."""
    load = curve.loading()
    return np.interp(load.delta_star[-1] * np.arange(1, steps + 1) / steps, load.delta_star, load.force)


def report(scene: str, parts: int, newton: int, errors: np.ndarray) -> None:
    """A row of the table: errors in per cent."""
    print(
        f"{scene},{parts},{newton},{100 * np.sqrt(np.mean(errors**2)):.2f},{100 * np.abs(errors).max():.2f}", flush=True
    )


def sphere(steps: int = 6) -> None:
    """A quarter of a sphere at the corner of a large block."""
    surface, a = Sphere(L=1.0, radius=10.0, centre=(0.0, 0.0), shape="paraboloid"), 0.02
    delta, solid = a * a / 10.0, Material(1.0, 0.0)
    block = make_block(MPI.COMM_SELF, surface, 1.0, delta, MeshSize(a / 8, growth=0.4, h_max=0.3))
    path = {"delta_max": delta, "steps": steps, "block": block, "comm": MPI.COMM_SELF}
    free = forces(solve_contact(surface, solid, **path).curve, steps)
    for parts in (1, 2, 4):
        curve = solve_contact(surface, solid, substeps=parts, formulation=STICK, **path).curve
        report("sphere", parts, int(curve.newton.sum()), forces(curve, steps) / free / SPHERE_RATIO - 1.0)


def demo(name: str, solid: Material, steps: int = 6, most: int = 16) -> None:
    """The demo surface on the stored mesh of the tests."""
    surface = Surface.from_spec(kind="weierstrass-mandelbrot", L=1e-6, D=2.4, G=1.36e-11)
    path = {"delta_max": 0.03e-6, "steps": steps, "block": BlockMesh.read("meshes/fractal.npz"), "formulation": STICK}
    found = {}
    for parts in [2**k for k in range(int(np.log2(most)) + 1)]:
        curve = solve_contact(surface, solid, substeps=parts, **path).curve
        found[parts] = forces(curve, steps), int(curve.newton.sum())
    for parts in list(found)[:-1]:
        report(name, parts, found[parts][1], found[parts][0] / found[most][0] - 1.0)


if __name__ == "__main__":
    warnings.simplefilter("ignore")
    print("scene,parts of a step,Newton iterations,rms error %,greatest error %")
    sphere()
    demo("demo elastic nu 0.3", Material(200e9, 0.3))
