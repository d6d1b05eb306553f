# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

"""Tamaas: an elastic-plastic periodic half-space at given mean pressures; run by a Python that has Tamaas.

    python3 tamaas_plastic.py MAP.npz OUT.npz

MAP has `heights` (n, n) over the side, the number of `layers` and their `depth`, the material `E`, `nu`, `sigma_y` and
`hardening` (of the yield strength with the plastic strain), and the mean `pressures` (k,) in units of E. OUT receives
the contact `pressure` (k, n, n) and the mean `gap` (k,) as far as they were solved.

Contact and plasticity are solved in turn, with Anderson mixing. Of its solvers for the plastic strain the spectral
residual method of SciPy is used: the same method of Tamaas took twice as long.
"""

import sys

import numpy as np
import tamaas as tm
from tamaas.nonlinear_solvers import DFSANESolver, ToleranceManager

# Relative change of the displacements: 1e-6 changed the gap by less than 1e-4 and took twice as long.
FIXED_POINT = 1e-5
# First and last tolerance of the plastic solution, and their ratio from iteration to iteration.
STRAIN = 1e-5, 1e-8, 0.25


def main(source: str, target: str) -> None:
    """Press a rigid flat on the map, mean pressure after mean pressure."""
    data = np.load(source)
    heights, layers = data["heights"], int(data["layers"])
    model = tm.Model(tm.model_type.volume_2d, [float(data["depth"]), 1.0, 1.0], [layers, *heights.shape])
    model.E, model.nu = float(data["E"]), float(data["nu"])
    law = tm.materials.IsotropicHardening(model, float(data["sigma_y"]), float(data["hardening"]))
    plastic = ToleranceManager(*STRAIN)(DFSANESolver)(tm.Residual(model, law))
    contact = tm.PolonskyKeerRey(model, heights, 1e-10)
    solver = tm.AndersonMixing(contact, plastic, FIXED_POINT)
    pressure, gap = [], []
    for mean in data["pressures"]:
        solver.solve(float(mean))
        pressure.append(np.array(model.traction)[..., 2])
        distance = np.array(model.displacement)[0, ..., 2] - heights
        gap.append(float(np.mean(distance - distance.min())))
        np.savez(target, pressure=np.array(pressure), gap=np.array(gap))
        print(mean, gap[-1], flush=True)


if __name__ == "__main__":
    tm.set_log_level(tm.LogLevel.warning)
    main(*sys.argv[1:])
