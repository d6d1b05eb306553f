"""Area and mean gap at a force on periodic self-affine patches, and where the nodes place the edge of a contact.

    python3 benchmarks/area.py inside [--seed N ...] [--tolerance X ...]
    python3 benchmarks/area.py edge [--seed N ...]
    python3 benchmarks/area.py ensemble [--seed N ...]

The truth is the boundary-element solution on the same heights at the same force (`RoughHalfSpace`). `inside` prints one
line a run: steps inside the bars of area and gap, median bar over median error, greatest error over its bar, dofs.
`edge` presses single meshes of the scales 3, 1.5, 0.75 of the patches and of classes of `accuracy.py`, and a patch with
the growth 0.7 and no layer below the contact: the area that is missing over that of the facets that the edge crosses,
its mean over all steps but the first. `ensemble` prints the area of the patches, with its bar, at three pressures over
the modulus and the rms slope, and their mean beside that of an ensemble of Green's function molecular dynamics
(Prodanov, Dapp & Mueser, Tribol. Lett. 53 (2014) 433). These patches are twice as long as the roll-off, without a
plateau of the spectrum, as those of the ensemble.
"""

from __future__ import annotations

import argparse
import warnings
from dataclasses import replace
from math import inf

import numpy as np
from accuracy import CLASSES, ELASTIC, FLAT, flattened

import asperity as asp
from asperity.adaptive.guide import guide_of
from asperity.adaptive.meshes import MeshFamily
from asperity.adaptive.solve_contact import refine
from asperity.arrays import Floats
from asperity.curve import Curve
from asperity.model.problem import Problem
from asperity.quasistatic.solve_problem import solve_problem
from asperity.reference import RoughHalfSpace

CELLS, STEPS = 432, 8
SCALES = (3.0, 1.5, 0.75)
PRESSURE = 1.36e-2  # of the patches over E: 0.7 of them in contact
#: Pressure over modulus and rms slope, and part in contact of the ensemble, known to 5 %
ENSEMBLE = ((0.0904, 0.185), (0.235, 0.433), (0.531, 0.772))


def patch(seed: int, lambda_roll: float = 1.0) -> Problem:
    """A periodic patch with waves down to a sixteenth of its side, pressed until 0.7 of it are in contact."""
    surface = asp.Surface.from_spec(
        kind="self-affine", L=1.0, H=0.8, rms_height=2e-3, lambda_roll=lambda_roll, lambda_short=0.0625, plateau=False,
        periodic=True, seed=seed,
    )  # fmt: skip
    solid = asp.Material(1.0, 0.0)
    return asp.Problem.of(surface, solid, height=1.0, sides="periodic", force_max=PRESSURE, steps=STEPS)


def of_class(name: str, seed: int) -> Problem:
    """An elastic surface of accuracy.py."""
    make, depth = CLASSES[name]
    return asp.Problem.of(flattened(make(seed)), ELASTIC, delta_max=FLAT * depth, steps=STEPS)


def truth_at(problem: Problem, curve: Curve) -> tuple[Floats, Floats]:
    """Contact fraction and mean gap of boundary elements at the forces of a curve."""
    surface, solid = problem.surface, problem.material
    layer, summit = RoughHalfSpace(CELLS, problem.height, solid.nu, problem.sides), surface.maximum()[2]
    at = np.unique(np.concatenate([curve.delta_star * by for by in (0.9, 0.97, 1.0, 1.03)]))
    found = layer.curve(layer.heights(surface), summit, at, tolerance=1e-5)
    gap = (
        summit
        - surface.mean()
        - at
        + problem.height * solid.reduced_modulus / solid.block_modulus(problem.sides) * found.P_star
    )
    known = found.P_star > 0.0
    x, here = np.log(found.P_star[known]), np.log(curve.P_star)
    area = np.exp(np.interp(here, x, np.log(np.maximum(found.area_fraction[known], 1e-12))))
    return area, np.interp(here, x, gap[known])


def inside(seeds: list[int], tolerances: list[float]) -> None:
    """Print the table of the bars."""
    print("| seed | tolerance | area inside | gap inside | bar/error | greatest error/bar | dofs |\n|" + 7 * " --- |")
    for seed in seeds:
        for tolerance in tolerances:
            problem = patch(seed)
            run = refine(problem, asp.AccuracyTarget(tolerance)).checked()
            curve = run.curve.loading()
            truth = truth_at(problem, curve)
            bars = (curve.error_area_fraction, curve.error_mean_gap)
            off = [np.abs(v - t) for v, t in zip((curve.area_fraction, curve.mean_gap), truth, strict=True)]
            cells = [f"{np.sum(e <= bar)}/{len(e)}" for e, bar in zip(off, bars, strict=True)]
            ratio = np.median(bars[0]) / np.median(off[0])
            print(f"| {seed} | {100 * tolerance:g} % | {' | '.join(cells)} | {ratio:.1f} | "
                  f"{np.max(off[0] / bars[0]):.2f} | {run.levels[-1].dofs} |", flush=True)  # fmt: skip


def part_of_edge(problem: Problem, size: asp.MeshSize) -> tuple[float, int]:
    """Area that is missing over that of the facets that the edge crosses, mean over the steps, and dofs."""
    result = solve_problem(replace(problem, size=size), checked=False)
    curve = result.curve.loading()
    missing = (truth_at(problem, curve)[0] - curve.area_fraction) / curve.edge_fraction
    return float(np.mean(missing[1:])), result.dofs


def edge(seeds: list[int]) -> None:
    """Print the table of the place of the edge."""
    print("| surface | mesh | dofs | missing area over the facets that the edge crosses |\n|" + 4 * " --- |")
    problems = {f"patch {seed}": patch(seed) for seed in seeds}
    names = ("spot", "cone", "ring", "angled", "honed", "inclusions")
    problems |= {f"{name} {seed}": of_class(name, seed) for name in names for seed in seeds[:1]}
    for name, problem in problems.items():
        family = MeshFamily(problem, guide_of(problem), inf)
        for scale in SCALES:
            part, dofs = part_of_edge(problem, family.size(scale))
            print(f"| {name} | scale {scale:g} | {dofs} | {part:+.3f} |", flush=True)
    for h in (0.06, 0.03):
        for growth in (0.7, 0.2):
            part, dofs = part_of_edge(patch(seeds[0]), asp.MeshSize(h, growth=growth))
            print(f"| patch {seeds[0]} | h = {h:g} L, growth {growth:g}, no layer | {dofs} | {part:+.3f} |", flush=True)


def ensemble(seeds: list[int], tolerance: float) -> None:
    """Print the area of patches and of the ensemble."""
    print("| seed |" + "".join(f" area at {p:g} | bar |" for p, _ in ENSEMBLE) + "\n|" + 7 * " --- |")
    found = []
    for seed in seeds:
        problem = patch(seed, lambda_roll=0.5)
        unit = problem.material.reduced_modulus * problem.surface.rms_slope()
        pressures = unit * np.array([p for p, _ in ENSEMBLE])
        path = replace(problem.load_path, force_max=1.001 * pressures[-1], steps=2 * STEPS)
        run = refine(replace(problem, load_path=path), asp.AccuracyTarget(tolerance)).checked()
        curve = run.curve.loading()
        area, bar = (np.interp(pressures, curve.force, v) for v in (curve.area_fraction, curve.error_area_fraction))
        found.append(area)
        print(
            f"| {seed} | " + " | ".join(f"{a:.3f} | {b:.3f}" for a, b in zip(area, bar, strict=True)) + " |", flush=True
        )
    for name, values in (("mean", np.mean(found, axis=0)), ("ensemble", [a for _, a in ENSEMBLE])):
        print(f"| {name} | " + " | ".join(f"{a:.3f} | -" for a in values) + " |")


if __name__ == "__main__":
    warnings.simplefilter("ignore")
    parser = argparse.ArgumentParser()
    parser.add_argument("what", choices=["inside", "edge", "ensemble"])
    parser.add_argument("--seed", type=int, nargs="*", default=[1, 3, 5])
    parser.add_argument("--tolerance", type=float, nargs="*", default=[0.05, 0.02])
    options = parser.parse_args()
    if options.what == "edge":
        edge(options.seed)
    elif options.what == "ensemble":
        ensemble(options.seed, options.tolerance[0])
    else:
        inside(options.seed, options.tolerance)
