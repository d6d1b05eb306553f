# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

"""A hemisphere flattened deeply in finite strain: asperity and CalculiX with NLGEOM on the same mesh.

    benchmarks/peers/install                             once: fetches CalculiX
    ./run python3 benchmarks/peers/deep_sphere.py        [--size 0.06] [--steps 40]

An eighth of a sphere between planes of symmetry is pressed by a rigid frictionless flat to 100 times the approach at
the onset of yield (Jackson & Green). The yield strength is E/100, so that the radius of contact exceeds 0.3 R. Both
programs have the same second-order tetrahedra with four integration points, backward Euler in the same equal steps, and
J2 plasticity with linear hardening, but different finite strain: logarithmic strain space here, a multiplicative split
of the deformation gradient there; exact contact at the nodes here, a penalty at the integration points of the faces
there. Small strain in both is the control. Prints the force of the whole sphere over that at the onset of yield at
tenths of the approach, and the rms difference of the displacements of the nodes of the sphere at the end over their
rms value.
"""

from __future__ import annotations

import argparse
import subprocess
from dataclasses import replace
from math import hypot
from os import environ
from pathlib import Path

import calculix
import numpy as np
import programs

import asperity as asp
from asperity import reference
from asperity.arrays import Floats
from asperity.mesh.block import BlockMesh
from asperity.model.load_path import BACKWARD_EULER, MIDPOINT, Schedule
from asperity.verification.flattening import flatten
from asperity.verification.solids import eighth_sphere

STRENGTH, NU = 0.01, 0.3
STEEL = asp.Material(1.0, NU, STRENGTH, 0.02)
MODULUS = reference.reduced_modulus(1.0, NU)
ONSET = float((0.5 * np.pi * 1.295 * np.exp(0.736 * NU) * STRENGTH / MODULUS) ** 2)
DEPTH = 100.0 * ONSET
ONSET_FORCE = float(reference.Hertz(1.0, MODULUS).force(ONSET))
OUTPUTS = 10
PENALTY = 2000.0  # stiffness of the contact of CalculiX [E/R]: a pressure of 0.03 E penetrates by 0.03 % of the way
FINE = 0.42  # distance from the pole within which elements have the given size
AT = DEPTH * np.arange(1, OUTPUTS + 1) / OUTPUTS


def sphere(h: float) -> BlockMesh:
    """Mesh with elements of size h around the contact."""
    return eighth_sphere(1.0, 0.0, lambda x, y, z: min(h + 0.4 * max(hypot(x, y, z - 1.0) - FINE, 0.0), 0.3))


def own(block: BlockMesh, kinematics: str, steps: int, integrator: str) -> tuple[Floats, Floats, float]:
    """Forces at AT, displacements of the nodes of the mesh (n, 3) and radius of contact in the end."""
    path = Schedule(delta_max=DEPTH, steps=steps, integrator=integrator)
    solver, curve = flatten(block, replace(STEEL, kinematics=kinematics), path)
    solid = solver.solid
    order = np.lexsort(np.round(solid.points, 9).T), np.lexsort(np.round(block.points, 9).T)
    u = np.empty_like(block.points)
    u[order[1]] = solid.u.x.array.reshape(-1, 3)[order[0]]
    assert np.abs(solid.points[order[0]] - block.points[order[1]]).max() < 1e-8
    radius = float(np.sqrt(4.0 * curve.area_fraction[-1] / np.pi))
    return np.interp(AT, curve.delta, curve.force), u, radius


def theirs(block: BlockMesh, kinematics: str, steps: int, folder: Path) -> tuple[Floats, Floats]:
    """Forces of CalculiX at AT, and rows of node number from 1 and displacement of the nodes of the sphere (m, 4)."""
    x, y, z = block.points.T
    held = {name: (np.abs(a) < 1e-12, dof) for name, a, dof in (("XSIDE", x, "1"), ("YSIDE", y, "2"), ("BASE", z, "3"))}
    model = calculix.Model(
        block.points, block.tets[:, calculix.GMSH_TO_C3D10], "C3D10", calculix.TET_FACES,
        np.abs(np.linalg.norm(block.points, axis=1) - 1.0) < 1e-9, held, STEEL, DEPTH, steps, OUTPUTS,
        PENALTY, kinematics == "finite", True,
    )  # fmt: skip
    place = folder / f"{kinematics}-{len(block.points)}-{steps}"
    data = place / "model.dat"
    if len(calculix.read(data, OUTPUTS)) < OUTPUTS:
        place.mkdir(parents=True, exist_ok=True)
        calculix.write(place / "model.inp", model)
        command, added = programs.inside("bookworm", "usr/bin/ccx")
        with (place / "log").open("w", encoding="utf-8") as log:
            subprocess.run(
                [*command, "model"], cwd=place, env=environ | {"OMP_NUM_THREADS": "1"} | added, stdout=log, stderr=log
            )
    forces = calculix.read(data, OUTPUTS)
    if len(forces) < OUTPUTS:
        raise SystemExit(f"CalculiX ended after {len(forces)} of {OUTPUTS} states: {place / 'log'}")
    return np.array(forces), calculix.read_displacements(data)


def row(name: str, forces: Floats) -> None:
    """Print forces of the eighth over that of the whole sphere at the onset of yield."""
    print(f"| {name} | " + " | ".join(f"{4.0 * f / ONSET_FORCE:.2f}" for f in forces) + " |", flush=True)


def compare(block: BlockMesh, kinematics: str, steps: int, folder: Path) -> None:
    """Print the rows of both programs, their difference in per cent, and that of the displacements."""
    force, u, radius = own(block, kinematics, steps, BACKWARD_EULER)
    row(f"asperity, {kinematics} strain", force)
    row(f"asperity, {kinematics} strain, midpoint rule", own(block, kinematics, steps, MIDPOINT)[0])
    other, rows = theirs(block, kinematics, steps, folder)
    row(f"CalculiX, {'NLGEOM' if kinematics == 'finite' else 'small strain'}", other)
    print("| difference, % | " + " | ".join(f"{100 * d:+.2f}" for d in force / other - 1.0) + " |", flush=True)
    nodes = rows[:, 0].astype(int) - 1
    off = np.sqrt(np.mean((u[nodes] - rows[:, 1:]) ** 2) / np.mean(rows[:, 1:] ** 2))
    print(
        f"| radius of contact {radius:.3f} R, displacements of the sphere differ by {100 * off:.2f} % rms |", flush=True
    )


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("-o", "--output", type=Path, default=Path("out/deep_sphere"))
    parser.add_argument("--size", type=float, default=0.06, help="of the elements around the contact [R]")
    parser.add_argument("--steps", type=int, default=40, help="equal steps, a multiple of ten")
    parser.add_argument("kinematics", nargs="*", default=["finite", "small"])
    arguments = parser.parse_args()
    block = sphere(arguments.size)
    print(f"{3 * len(block.points)} dofs, {arguments.steps} steps, w = 100 is an approach of {DEPTH:.4f} R")
    print("| w | " + " | ".join(f"{d / ONSET:.0f}" for d in AT) + " |\n|" + "---|" * (1 + OUTPUTS))
    for kinematics in arguments.kinematics:
        compare(block, kinematics, arguments.steps, arguments.output.absolute())


if __name__ == "__main__":
    main()
