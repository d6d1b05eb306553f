# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

"""Locking of second-order tetrahedra in plastic flow: force by the size of the elements, with either dilatation.

    ./run python3 benchmarks/locking.py

Two scenes: a sphere pressed in until it flows without hardening, and the surface of the 256 x 256 map of scan.py at its
last step, on the meshes of a run with a tolerance. The volumetric strain is that of each point, or the mean of each
cell that has flowed. Deviations are from the mean of the limits of both, extrapolated with order 2 from their two
finest meshes, and half the difference of these limits is printed as its uncertainty.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from mpi4py import MPI
from scan import MATERIALS, L, approach, rough

import asperity as asp
from asperity.adaptive.mesh_plan import extrapolate, growth
from asperity.adaptive.roughness import Roughness
from asperity.model.settings import MEAN, POINT
from asperity.quasistatic.make import make_block
from asperity.quasistatic.solve_contact import solve_problem
from asperity.surface import Surface

SPHERE_SIZES = (0.08, 0.06, 0.04, 0.028, 0.02, 0.014)  # of the elements in the contact [L]
MAP_SIZES = (0.0283, 0.02, 0.0141, 0.01)  # the same for the map [L]
STEPS = 10  # of the map

Force = Callable[[float, str], tuple[float, int, int]]


def sphere(h: float, dilatation: str) -> tuple[float, int, int]:
    """Force, dofs and Newton iterations on the sphere; the size grows by less around finer contacts."""
    surface, solid = Surface.from_spec("sphere", L=1.0, radius=1.0), asp.Material(1.0, 0.3, 0.002)
    size = asp.MeshSize(h, growth(h), grading=(1.0, 1.0))
    result = asp.solve_contact(surface, solid, delta_max=0.003, steps=3, size=size, dilatation=dilatation)
    return float(result.curve.P_star[-1]), result.dofs, int(result.curve.newton.sum())


def of_map() -> Force:
    """The same of the map, whose half-space says where the elements are small."""
    surface, material = rough(256), MATERIALS["plastic"]
    depth = approach(surface, material)
    whole = asp.Problem.of(surface, material, delta_max=depth, steps=STEPS)
    spots = Roughness(whole, depth, STEPS).contact_map()

    def force(h: float, dilatation: str) -> tuple[float, int, int]:
        size = asp.MeshSize(h * L, growth(h, flowing=True), reach=spots)
        block = make_block(MPI.COMM_SELF, surface, L, depth, size)
        result = solve_problem(replace(whole, dilatation=dilatation), block=block, comm=MPI.COMM_SELF)
        return float(result.curve.P_star[-1]), result.dofs, int(result.curve.newton.sum())

    return force


def table(name: str, sizes: Sequence[float], force: Force) -> None:
    """Print the rows of a scene."""
    rows = [[force(h, dilatation) for dilatation in (POINT, MEAN)] for h in sizes]
    P = np.array([[found[0] for found in row] for row in rows])
    limits, _ = extrapolate(P[-2], P[-1], sizes[-2] / sizes[-1], 2.0)
    limit, unsure = limits.mean(), 50.0 * abs(float(np.diff(limits)[0])) / limits.mean()
    for h, row, value in zip(sizes, rows, P, strict=True):
        off = " | ".join(f"{100 * (p / limit - 1):+.1f} | {found[2]}" for p, found in zip(value, row, strict=True))
        print(f"| {name} | {h} | {row[0][1]} | {off} | {unsure:.1f} |", flush=True)


def main() -> None:
    """Print the table."""
    warnings.simplefilter("ignore")
    columns = "scene", "h/L", "dofs", "point: force %", "Newton", "mean: force %", "Newton", "limit known to %"
    print(f"| {' | '.join(columns)} |\n" + "| --- " * len(columns) + "|")
    table("sphere", SPHERE_SIZES, sphere)
    table("256 x 256 map", MAP_SIZES, of_map())


if __name__ == "__main__":
    main()
