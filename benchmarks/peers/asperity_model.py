"""asperity: one run in a process of its own, from the surface to the curve.

python3 asperity_model.py MATERIAL size H STEPS OUT.json        the default mesh with elements of size H in the contact
python3 asperity_model.py MATERIAL tolerance T STEPS OUT.json   driven by a tolerance on the force
"""

import json
import sys
from pathlib import Path

import scene
from mpi4py import MPI

import asperity as asp
from asperity.adaptive.extrapolation import loading_force
from asperity.arrays import Floats
from asperity.surface import Surface


def solve(
    top: Surface, law: asp.Material, depth: float, at: Floats, by: str, value: float, steps: int, target: Path
) -> None:
    """Press a surface, and keep forces and dofs in a file; collective.

    Args:
        top: surface with side 1
        law: material with E = 1
        depth: of the flat [L]
        at: approaches of the forces [L]
        by: "size" or "tolerance"
        value: of it
        steps: planned ones
        target: the file
    """
    if by == "size":
        size = asp.MeshSize(value)
        result = asp.solve_contact(top, law, delta_max=depth, steps=steps, size=size)
        curve, dofs = result.curve, result.dofs
    else:
        goal = asp.AccuracyTarget(value, max_dofs=2_000_000)
        found = asp.solve_contact(top, law, tolerance=goal, delta_max=depth, steps=steps)
        curve, dofs = found.curve, found.contact.dofs
    force = loading_force(curve, at) * law.reduced_modulus
    if MPI.COMM_WORLD.rank == 0:
        target.write_text(json.dumps({"force": force.tolist(), "dofs": dofs}), encoding="ascii")


if __name__ == "__main__":
    material, by, value, steps, target = sys.argv[1:]
    law = scene.MATERIALS[material]
    solve(scene.surface(), law, scene.DELTA, scene.AT, by, float(value), int(steps), Path(target))
