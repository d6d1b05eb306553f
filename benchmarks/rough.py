# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

"""Error against error bar of tolerance runs on self-affine surfaces.

    python3 benchmarks/rough.py [elastic] [plastic] [SEED]...

Each run has a tolerance of 5 %; the bars of a run that its greatest number of dofs ends before are judged too. The
reference is extrapolated from two meshes of another grading, with elements of 0.014 L and 0.007 L wherever the surface
is touched; its own bar, with what the finer mesh leaves out, is in the column `reference`. An error counts as inside
the bar if it exceeds it by no more than that. Prints one Markdown table per material.
"""

from __future__ import annotations

import sys
import warnings
from time import process_time

import numpy as np

import asperity as asp
from asperity.adaptive.mesh_plan import extrapolate_mesh
from asperity.adaptive.roughness import FORCE_BAR, Roughness
from asperity.arrays import Floats
from asperity.model.settings import MeshSize
from asperity.quasistatic.make import make_block
from asperity.quasistatic.solve_contact import solve_contact
from asperity.surface import SelfAffine

TOLERANCE, STEPS, SIZES = 0.05, 5, (0.014, 0.007)
MATERIALS = {"elastic": asp.Material(1.0, 0.3), "plastic": asp.Material(1.0, 0.3, 0.01, 0.05)}
MAX_DOFS = {"elastic": 1_000_000, "plastic": 250_000}
#: seed, Hurst exponent, rms slope, roll-off and shortest wavelength [L], greatest approach [L]
SURFACES = (
    (101, 0.8, 0.2, 0.5, 0.02, 0.015),
    (102, 0.5, 0.3, 0.5, 0.02, 0.01),
    (103, 1.0, 0.2, 0.4, 0.012, 0.015),
    (104, 0.8, 0.1, 0.3, 0.03, 0.006),
    (105, 0.5, 0.4, 0.25, 0.01, 0.012),
    (106, 0.8, 0.45, 0.4, 0.01, 0.02),
)


def judge(
    name: str, seed: int, H: float, slope: float, roll: float, short: float, depth: float
) -> tuple[int, float, Floats, Floats, Floats, bool]:
    """Run and reference of one surface: dofs, seconds, and (STEPS,) errors, bars, uncertainties of the reference."""
    from mpi4py import MPI

    surface = SelfAffine(L=1.0, H=H, slope=slope, lambda_roll=roll, lambda_short=short, seed=seed)
    material = MATERIALS[name]
    start = process_time()
    target = asp.AccuracyTarget(TOLERANCE, MAX_DOFS[name])
    found = asp.solve_to_tolerance(surface, material, target, delta_max=depth, steps=STEPS)
    seconds = process_time() - start
    at = depth * np.linspace(1.0 / STEPS, 1.0, STEPS)
    problem = asp.Problem.of(surface, material, delta_max=depth, steps=2 * STEPS)
    roughness = Roughness(problem, depth, STEPS)
    forces = []
    for h in SIZES:
        size = MeshSize(h, growth=0.2, reach=roughness.contact_map(), grading=(1.0, 1.0))
        block = make_block(MPI.COMM_SELF, surface, 1.0, depth, size)
        fine = solve_contact(surface, material, block=block, comm=MPI.COMM_SELF, delta_max=depth, steps=2 * STEPS)
        forces.append(np.interp(at, fine.curve.loading().delta_star, fine.curve.loading().P_star))
    assert block is not None
    exact, _, spread = extrapolate_mesh(forces[0], forces[1], SIZES[0] / SIZES[1])
    unsure = np.asarray(spread / exact + FORCE_BAR * np.abs(roughness.left_out(block).at(at)[0]))
    loading = found.curve.loading()
    P, bar = (np.interp(at, loading.delta_star, column) for column in (loading.P_star, loading.error_P_star))
    return found.contact.dofs, seconds, P / exact - 1.0, bar / exact, unsure, found.met


def main() -> None:
    """Print the tables."""
    seeds = {int(word) for word in sys.argv[1:] if word.isdecimal()}
    surfaces = [surface for surface in SURFACES if not seeds or surface[0] in seeds]
    for name in [word for word in sys.argv[1:] if not word.isdecimal()] or list(MATERIALS):
        print(
            f"\n{name}\n\n| seed | H | slope | shortest/L | dofs | CPU s | met | errors % | bars % | reference % |\n"
            + "| --- " * 10
            + "|"
        )
        inside, ratios = [], []
        for seed, H, slope, roll, short, depth in surfaces:
            dofs, seconds, error, bar, unsure, met = judge(name, seed, H, slope, roll, short, depth)
            inside += list(np.abs(error) <= bar + unsure)
            ratios += list(bar / np.maximum(np.abs(error), 1e-4))
            columns = (" ".join(f"{100 * v:.1f}" for v in values) for values in (error, bar, unsure))
            print(
                f"| {seed} | {H} | {slope} | {short} | {dofs} | {seconds:.0f} | {met} | " + " | ".join(columns) + " |",
                flush=True,
            )
        print(
            f"\n{np.mean(inside):.0%} of {len(inside)} steps inside, median of bar over error {np.median(ratios):.1f}"
        )


if __name__ == "__main__":
    warnings.simplefilter("ignore")
    main()
