"""Tamaas: the surface on an elastic half-space, by Fourier transforms; run by a Python that has Tamaas.

    python3 tamaas_model.py MESH.npz OUT.json

Rollers on the sides are mirrors, so the surface is mirrored into a periodic one. The mean displacement, which a
half-space leaves open, is that of the block under the mean pressure. What stays different is physical: the roughness
loads a plane, and the base is infinitely far for what varies along the surface.
"""

import json
import sys
from typing import Any

import numpy as np
import tamaas as tm

LOADS = 12


def interpolate(at: float, x: Any, y: Any) -> float:
    """Value at a point of the cubic through the four nearest ones; x ascends."""
    k = min(max(int(np.searchsorted(x, at)) - 2, 0), len(x) - 4)
    return float(np.polyfit(x[k : k + 4] - at, y[k : k + 4], 3)[-1])


def main(source: str, target: str) -> None:
    """Force at given approaches from solutions at given forces."""
    data = np.load(source)
    heights, E, nu = data["heights"], float(data["E"]), float(data["nu"])
    mirrored = np.block([[heights, heights[:, ::-1]], [heights[::-1], heights[::-1, ::-1]]])
    model = tm.Model(tm.model_type.basic_2d, [2.0, 2.0], list(mirrored.shape))
    model.E, model.nu = E, nu
    solver = tm.PolonskyKeerRey(model, mirrored, 1e-10)
    confined = E * (1 - nu) / ((1 + nu) * (1 - 2 * nu))
    summit = float(data["summit"])
    least, greatest = data["forces"]
    forces = np.geomspace(least, greatest, LOADS)
    approaches = []
    for force in forces:  # the side is 1: force and mean pressure are the same number
        solver.solve(float(force))
        approaches.append(summit - float(np.mean(model.displacement)) + force / confined)
        print(approaches[-1], force, flush=True)
    found = np.array([interpolate(np.log(at), np.log(approaches), np.log(forces)) for at in data["path"]])
    with open(target, "w", encoding="ascii") as out:
        json.dump({"force": np.exp(found).tolist(), "dofs": mirrored.size}, out)


if __name__ == "__main__":
    tm.set_log_level(tm.LogLevel.warning)
    main(*sys.argv[1:])
