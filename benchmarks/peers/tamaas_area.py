# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

"""Tamaas: contact pressures of a periodic elastic half-space at given mean pressures; run by a Python that has Tamaas.

    python3 tamaas_area.py MAP.npz OUT.npz

MAP has `heights` (n, n) over the side, and the mean pressures `P_star` (k,) over E'. OUT receives `pressures` (k, n, n)
over E'.
"""

import sys

import numpy as np
import tamaas as tm


def main(source: str, target: str) -> None:
    """Press a rigid flat on the map."""
    data = np.load(source)
    heights = data["heights"]
    model = tm.Model(tm.model_type.basic_2d, [1.0, 1.0], list(heights.shape))
    model.E, model.nu = 1.0, 0.0
    solver = tm.PolonskyKeerRey(model, heights, 1e-8)
    pressures = []
    for P in data["P_star"]:
        solver.solve(float(P))
        pressures.append(np.array(model.traction).reshape(heights.shape))
    np.savez(target, pressures=np.array(pressures))


if __name__ == "__main__":
    tm.set_log_level(tm.LogLevel.warning)
    main(*sys.argv[1:])
