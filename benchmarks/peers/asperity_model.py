# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

"""asperity: one run in a process of its own, from the surface to the curve.

python3 asperity_model.py MATERIAL size H STEPS OUT.json        the default mesh with elements of size H in the contact
python3 asperity_model.py MATERIAL tolerance T STEPS OUT.json   driven by a tolerance on the force
"""

import json
import sys

import scene

import asperity as asp
from asperity.adaptive.extrapolation import loading_force
from asperity.adaptive.solve_to_tolerance import solve_to_tolerance
from asperity.model.settings import Goal


def main(material: str, by: str, value: str, steps: str, target: str) -> None:
    """Solve and keep the forces."""
    law = scene.MATERIALS[material]
    if by == "size":
        size = asp.MeshSize(float(value))
        result = asp.solve_contact(scene.surface(), law, delta_max=scene.DELTA, steps=int(steps), size=size)
        curve, dofs = result.curve, result.dofs
    else:
        goal = Goal(float(value))
        found = solve_to_tolerance(scene.surface(), law, goal, delta_max=scene.DELTA, steps=int(steps))
        curve, dofs = found.curve, found.levels[-1].dofs
    force = loading_force(curve, scene.AT) * law.reduced_modulus
    with open(target, "w", encoding="ascii") as out:
        json.dump({"force": force.tolist(), "dofs": dofs}, out)


if __name__ == "__main__":
    main(*sys.argv[1:])
