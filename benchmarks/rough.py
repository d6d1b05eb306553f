# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

"""Error against error bar of tolerance runs on self-affine surfaces.

    python3 benchmarks/rough.py [elastic] [plastic] [SEED]...

Each run has a tolerance of 5 %; the bars of a run that its greatest number of dofs ends before are judged too. The
reference is extrapolated from two meshes of another grading, with elements of 0.014 L and 0.007 L wherever the surface
is touched; at the first step, whose spots are the smallest, of 0.004 L and 0.0025 L wherever this step touches. Its own
bar, with what the finer mesh leaves out, is in the column `reference`. An error counts as inside the bar if it exceeds
it by no more than that. Prints one Markdown table per material.

The bars of elastic solids were chosen without the seeds 101 to 108, those of solids that yield with them and without
the seeds 201 to 206. The seeds 301 and 302 are steep; nothing was chosen on them, nor on the seeds 401 to 406.
"""

from __future__ import annotations

import sys
import warnings
from time import process_time

import numpy as np
from mpi4py import MPI

import asperity as asp
from asperity.adaptive.mesh_plan import extrapolate_mesh
from asperity.adaptive.roughness import FORCE_BAR, Roughness
from asperity.adaptive.solve_contact import solve_contact
from asperity.arrays import Floats
from asperity.mesh.top import Top
from asperity.model.settings import MeshSize
from asperity.quasistatic.make import make_block
from asperity.surface import SelfAffine

TOLERANCE, STEPS, SIZES = 0.05, 5, (0.014, 0.007)
FIRST_SIZES = 0.004, 0.0025  # of the meshes for the first step alone [L]
MATERIALS = {"elastic": asp.Material(1.0, 0.3), "plastic": asp.Material(1.0, 0.3, 0.01, 0.05)}
MAX_DOFS = {"elastic": 1_000_000, "plastic": 400_000}
#: seed, Hurst exponent, rms slope, roll-off and shortest wavelength [L], greatest approach [L]
SURFACES = (
    (101, 0.8, 0.2, 0.5, 0.02, 0.015),
    (102, 0.5, 0.3, 0.5, 0.02, 0.01),
    (103, 1.0, 0.2, 0.4, 0.012, 0.015),
    (104, 0.8, 0.1, 0.3, 0.03, 0.006),
    (105, 0.5, 0.4, 0.25, 0.01, 0.012),
    (106, 0.8, 0.45, 0.4, 0.01, 0.02),
    (107, 0.5, 0.2, 0.5, 0.05, 0.008),
    (108, 0.5, 0.3, 0.4, 0.04, 0.008),
    (201, 0.8, 0.3, 0.4, 0.02, 0.015),
    (202, 0.6, 0.25, 0.3, 0.03, 0.01),
    (203, 1.0, 0.15, 0.5, 0.015, 0.012),
    (204, 0.7, 0.4, 0.35, 0.012, 0.018),
    (205, 0.5, 0.2, 0.4, 0.04, 0.008),
    (206, 0.9, 0.1, 0.25, 0.02, 0.006),
    (301, 0.8, 1.0, 0.25, 0.03, 0.015),
    (302, 0.8, 1.5, 0.25, 0.03, 0.02),
    (401, 0.7, 0.25, 0.35, 0.025, 0.012),
    (402, 0.9, 0.35, 0.5, 0.015, 0.018),
    (403, 0.6, 0.15, 0.3, 0.02, 0.006),
    (404, 0.8, 0.5, 0.3, 0.02, 0.02),
    (405, 1.0, 0.1, 0.25, 0.03, 0.006),
    (406, 0.5, 0.1, 0.5, 0.06, 0.005),
)

CUTOFF, CUTOFF_DOFS = 500, 300_000


def judge(
    name: str, seed: int, H: float, slope: float, roll: float, short: float, depth: float
) -> tuple[int, float, Floats, Floats, Floats, bool]:
    """Run and reference of one surface: dofs, seconds, and (STEPS,) errors, bars, uncertainties of the reference."""
    surface = SelfAffine(L=1.0, H=H, slope=slope, lambda_roll=roll, lambda_short=short, seed=seed)
    material = MATERIALS[name]
    start = process_time()
    target = asp.AccuracyTarget(TOLERANCE, MAX_DOFS[name])
    found = asp.solve_to_tolerance(surface, material, target, delta_max=depth, steps=STEPS)
    seconds = process_time() - start
    at = depth * np.linspace(1.0 / STEPS, 1.0, STEPS)
    of_all, of_first = reference(surface, material, at, SIZES), reference(surface, material, at[:1], FIRST_SIZES)
    exact, unsure = (np.concatenate([first, rest[1:]]) for first, rest in zip(of_first, of_all, strict=True))
    loading = found.curve.loading()
    P, bar = (np.interp(at, loading.delta_star, column) for column in (loading.P_star, loading.error_P_star))
    return found.contact.dofs, seconds, P / exact - 1.0, bar / exact, unsure, found.met


def reference(
    surface: SelfAffine, material: asp.Material, at: Floats, sizes: tuple[float, float]
) -> tuple[Floats, Floats]:
    """Forces at equally spaced approaches (k,), extrapolated from two meshes, and their relative uncertainty."""
    depth, steps = float(at[-1]), 2 * len(at)
    problem = asp.Problem.of(surface, material, delta_max=depth, steps=steps)
    roughness = Roughness(problem, depth, len(at))
    forces = []
    for h in sizes:
        size = MeshSize(h, growth=0.2, reach=roughness.contact_map(), grading=(1.0, 1.0))
        block = make_block(MPI.COMM_SELF, surface, 1.0, depth, size)
        fine = solve_contact(surface, material, block=block, comm=MPI.COMM_SELF, delta_max=depth, steps=steps)
        forces.append(np.interp(at, fine.curve.loading().delta_star, fine.curve.loading().P_star))
    assert block is not None
    exact, _, spread = extrapolate_mesh(forces[0], forces[1], sizes[0] / sizes[1])
    return exact, np.asarray(spread / exact + FORCE_BAR * np.abs(roughness.left_out(Top.of(block, surface)).at(at)[0]))


def main() -> None:
    """Print the tables."""
    words = sys.argv[1:]
    seeds = {int(word) for word in words if word.isdecimal()}
    surfaces = [surface for surface in SURFACES if not seeds or surface[0] in seeds]
    for name in [word for word in words if word in MATERIALS] or list(MATERIALS):
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
