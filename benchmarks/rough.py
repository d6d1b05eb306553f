# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

"""Error against error bar of tolerance runs on self-affine surfaces.

    python3 benchmarks/rough.py [elastic] [plastic] [SEED]...
    python3 benchmarks/rough.py orders
    python3 benchmarks/rough.py cutoff

Each run has a tolerance of 5 %; the bars of a run that its greatest number of dofs ends before are judged too. The
reference is extrapolated from two meshes of another grading, with elements of 0.014 L and 0.007 L wherever the surface
is touched; at the first step, whose spots are the smallest, of 0.004 L and 0.0025 L wherever this step touches. Its own
bar, with what the finer mesh leaves out, is in the column `reference`. An error counts as inside the bar if it exceeds
it by no more than that. Prints one Markdown table per material.

The bars of elastic solids were chosen without the seeds 101 to 108, those of solids that yield with them and without
the seeds 201 to 206. The seeds 301 and 302 are steep; nothing was chosen on them, nor on the seeds 401 to 406.

`orders`: the order of the force observed from three meshes of the family, step by step, and the bars that it gives
beside those of the range of orders of two meshes, against half-spaces; elastic, slopes of 0.05. `cutoff`: waves down
to 1/500 of the side, periodic and elastic, with few dofs, against a half-space of four cells per shortest wave.
"""

from __future__ import annotations

import sys
import warnings
from time import process_time

import numpy as np
from mpi4py import MPI

import asperity as asp
from asperity.adaptive.extrapolation import steady
from asperity.adaptive.mesh_plan import extrapolate_mesh, growth
from asperity.adaptive.roughness import FORCE_BAR, Roughness
from asperity.arrays import Floats
from asperity.mesh.top import Top
from asperity.model.settings import MeshSize
from asperity.quasistatic.make import make_block
from asperity.quasistatic.solve_contact import solve_contact, solve_problem
from asperity.reference import RoughHalfSpace
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

FAMILY = (0.0707, 0.0354, 0.0177)  # element sizes of the meshes of `orders` [L]
#: of `orders`: seed, Hurst exponent, shortest wavelength [L]
GENTLE = ((1, 0.8, 0.1), (2, 0.8, 0.05), (3, 0.5, 0.1), (4, 0.5, 0.05), (5, 1.0, 0.1), (6, 1.0, 0.05))
CUTOFF, CUTOFF_DOFS = 500, 300_000
CLIP = 0.5, 4.0  # of an observed order


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


def observed(P: Floats) -> tuple[Floats, Floats]:
    """Limit and half of its distance from the last force, by the order observed at each step from three meshes.

    Args:
        P: forces on meshes finer from one to the next by the factor 2 (3, steps)
    """
    first, second = P[0] - P[1], P[1] - P[2]
    ratio = np.divide(first, second, out=np.ones_like(first), where=first * second > 0.0)
    order = np.clip(np.log2(np.maximum(ratio, 1e-9)), *CLIP)
    error = second / (2.0**order - 1.0)
    return P[2] - error, np.abs(error)


def orders() -> None:
    """Print how often each bar holds the error, and how wide it is."""
    columns = "seed", "H", "shortest/L", "orders observed", "inside, observed", "bar over error", "inside, range"
    print(f"| {' | '.join(columns)} | bar over error |\n" + "| --- " * 8 + "|")
    everything: list[tuple[Floats, ...]] = []
    for seed, H, short in GENTLE:
        surface = SelfAffine(L=1.0, H=H, slope=0.05, lambda_roll=0.4, lambda_short=short, seed=seed)
        depth = 1.2 * surface.exact_rms()[0]
        at = depth * np.linspace(0.2, 1.0, STEPS)
        problem = asp.Problem.of(surface, asp.Material(1.0, 0.3), delta_max=depth, steps=STEPS)
        spots = Roughness(problem, depth, STEPS).contact_map()
        layer = RoughHalfSpace(512, 1.0, 0.3)
        exact = layer.curve(layer.heights(surface), surface.maximum()[2], at, tolerance=1e-4).P_star
        forces = []
        for h in FAMILY:
            block = make_block(MPI.COMM_SELF, surface, 1.0, depth, MeshSize(h, growth(h), reach=spots))
            curve = solve_problem(problem, block=block, comm=MPI.COMM_SELF).curve
            forces.append(np.interp(at, curve.delta_star, curve.P_star))
        P = np.array(forces)
        limit, bar = observed(P)
        value, _, width = extrapolate_mesh(P[1], P[2], FAMILY[1] / FAMILY[2])
        order = np.log2(np.maximum((P[0] - P[1]) / (P[1] - P[2]), 1e-9))
        found = (limit / exact - 1.0, steady(bar / exact), value / exact - 1.0, steady(width / exact), order)
        show(f"{seed} | {H} | {short}", [found])
        everything.append(found)
    show("all | any | any", everything)


def show(about: str, found: list[tuple[Floats, ...]]) -> None:
    """Print a row of the table of `orders`; an error of 0.3 % is that of the half-space."""
    error, bar, error_of_range, range_bar, order = (np.concatenate(column) for column in zip(*found, strict=True))
    spread = " ".join(f"{value:.1f}" for value in np.quantile(order, (0.1, 0.5, 0.9)))
    cells = [spread]
    for e, b in ((error, bar), (error_of_range, range_bar)):
        inside = np.count_nonzero(np.abs(e) <= b + 3e-3)
        cells += [f"{inside}/{len(e)}", f"{np.median(b / np.maximum(np.abs(e), 1e-4)):.1f}"]
    print(f"| {about} | {' | '.join(cells)} |", flush=True)


def cutoff() -> None:
    """Print errors and bars of force and area of a run that the dofs end, at the approaches of the half-space."""
    surface = SelfAffine(L=1.0, H=0.8, slope=0.2, lambda_roll=0.25, lambda_short=1.0 / CUTOFF, seed=11)
    depth, layer = surface.exact_rms()[0], RoughHalfSpace(2048, 1.0, 0.0, "periodic")
    target = asp.AccuracyTarget(TOLERANCE, CUTOFF_DOFS)
    found = asp.solve_to_tolerance(
        surface, asp.Material(1.0, 0.0), target, delta_max=depth, steps=STEPS, sides="periodic"
    )
    curve = found.curve.loading()
    exact = layer.curve(layer.heights(surface), surface.maximum()[2], curve.delta_star)
    print(f"{found.contact.dofs} dofs; {found.reason}\n")
    print("| delta/L | error of P* % | bar % | A/A0 | error of A % | bar % |\n" + "| --- " * 6 + "|")
    of_force = curve.P_star / exact.P_star - 1.0, curve.error_P_star / curve.P_star
    of_area = curve.area_fraction / exact.area_fraction - 1.0, curve.error_area_fraction / curve.area_fraction
    for delta, e, b, area, f, c in zip(curve.delta_star, *of_force, exact.area_fraction, *of_area, strict=True):
        print(f"| {delta:.5f} | {100 * e:.1f} | {100 * b:.1f} | {area:.6f} | {100 * f:.0f} | {100 * c:.0f} |")


def main() -> None:
    """Print the tables."""
    if sys.argv[1:] in (["orders"], ["cutoff"]):
        {"orders": orders, "cutoff": cutoff}[sys.argv[1]]()
        return
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
