# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

"""Error of stick in the load steps: a sphere against the closed form, the demo surface against its finest steps.

    ./run python3 benchmarks/stick.py > benchmarks/stick.csv         order of the error
    ./run python3 benchmarks/stick.py bars > benchmarks/stick_bars.csv      whether its error bar holds

`bars` takes three other surfaces, elastic (nu = 0) and plastic (nu = 0.3), and the bars that a run with a tolerance
has: the error of forces in 2 or 4 parts of each step, extrapolated from those in half as many, corrects them; its bar
is the correction and the error by the least order. This is compared with forces in 16 parts.
"""

from __future__ import annotations

import sys
import warnings
from functools import partial

import numpy as np
from mpi4py import MPI

import asperity as asp
from asperity import Formulation, Material, MeshSize, Surface, solve_contact
from asperity.adaptive.load_step_error import step_errors
from asperity.adaptive.mesh_plan import GUIDE, growth, step_rule
from asperity.curve import Curve
from asperity.mesh.block import BlockMesh
from asperity.model.load_path import BACKWARD_EULER, MIDPOINT
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


def bars(steps: int = 6, reference: int = 16) -> None:
    """Errors that corrected forces have, over their bars; the greatest of a path."""
    of = partial(asp.Surface.from_spec, L=1.0)
    surfaces = {
        "self-affine, slope 0.2": (of("self-affine", H=0.7, rms_slope=0.2, lambda_short=0.2, seed=11), 0.01),
        "egg-box": (of("sinusoid", amplitude=0.02, wavelength=0.5, dims=2), 0.02),
        "fractal, D 2.6, seed 7": (of("weierstrass-mandelbrot", D=2.6, G=1e-3, seed=7), 0.01),
    }
    solids = {"elastic nu 0": Material(1.0, 0.0), "plastic nu 0.3": Material(1.0, 0.3, 0.005, 0.05)}
    print("surface,material,parts,order seen,correction %,error left %,bar %,error left over bar")
    for name, (surface, delta) in surfaces.items():
        block = make_block(MPI.COMM_SELF, surface, 1.0, delta, MeshSize(GUIDE, growth(GUIDE)))
        for solid, material in solids.items():
            path = {"delta_max": delta, "steps": steps, "block": block, "comm": MPI.COMM_SELF, "formulation": STICK}
            path["integrator"] = MIDPOINT if material.plastic else BACKWARD_EULER
            rule = step_rule(material.plastic, True, path["integrator"])
            P = {
                n: forces(solve_contact(surface, material, substeps=n, **path).curve, steps)
                for n in (1, 2, 4, reference)
            }
            off = {n: np.sqrt(np.mean((P[n] / P[reference] - 1.0) ** 2)) for n in P}
            for most in (2, 4):
                errors, bars = step_errors({n: P[n] for n in P if n <= most}, rule)
                error, bar = errors[most], bars[most]
                left = P[most] / (1.0 + error) / P[reference] - 1.0
                worst = np.argmax(np.abs(left) / bar)
                print(
                    f'"{name}",{solid},{most},{np.log2(off[most // 2] / off[most]):.1f},'
                    f"{100 * error[worst]:.3f},{100 * left[worst]:.3f},{100 * bar[worst]:.3f},"
                    f"{abs(left[worst]) / bar[worst]:.2f}",
                    flush=True,
                )


if __name__ == "__main__":
    warnings.simplefilter("ignore")
    if sys.argv[1:] == ["bars"]:
        bars()
        raise SystemExit
    print("scene,parts of a step,Newton iterations,rms error %,greatest error %")
    sphere()
    demo("demo elastic nu 0.3", Material(200e9, 0.3))
