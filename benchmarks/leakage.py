"""Leakage through a pressed rough gap against Reynolds' equation on the gap of boundary elements.

    python3 benchmarks/leakage.py inside [--seed N ...] [--tolerance X ...]
    python3 benchmarks/leakage.py percolation [--seed N ...]
    python3 benchmarks/leakage.py open [--seed N ...]

`inside` presses the patches of area.py and prints, at contact fractions of 0.05, 0.15 and 0.3, the transmissivities,
their bars and the errors. The truth has finite volumes on the cells of boundary elements on the same heights at the
same force, on two grids, whose difference is its uncertainty. `percolation` prints between which contact fractions the
last channel of a patch closes, along x and along y (0.415 of an ensemble: Wang and Mueser, arXiv 2010.13470).
`open` moves a rigid flat into undeformed patches and prints T over the cube of the mean gap h, beside the flow factor
1 - 0.9 exp(-0.56 h/Sq) of Patir and Cheng (J. Lubr. Technol. 100 (1978) 12), by the ratio h/Sq.
"""

from __future__ import annotations

import argparse
import warnings
from dataclasses import replace
from itertools import product

import numpy as np
from area import PRESSURE, patch
from mpi4py import MPI

import asperity as asp
from asperity.adaptive.solve_contact import refine
from asperity.arrays import Floats
from asperity.model.problem import Problem
from asperity.quasistatic.make import make_block, make_contact_solver
from asperity.quasistatic.solve_problem import Callbacks, solve_problem
from asperity.quasistatic.thin_film import ThinFilm
from asperity.reference import RoughHalfSpace
from asperity.reference.halfspace import compliance_of_waves, displacement
from asperity.reference.leakage import transmissivity

CELLS = 144, 288
FRACTIONS = 0.05, 0.15, 0.3


def truth_of(problem: Problem, at: Floats, n: int) -> tuple[Floats, Floats]:
    """P* (k,) and transmissivities along x and y (2, k) at approaches (k,) [L], of boundary elements."""
    surface, nu, sides = problem.surface, problem.material.nu, problem.sides
    layer, summit = RoughHalfSpace(n, problem.height, nu, sides), surface.maximum()[2]
    heights, compliance = layer.heights(surface), compliance_of_waves(n, problem.height, nu, sides)
    force, flow = [], []
    for approach, p in zip(at, layer.pressures(heights, summit, at, 1e-5), strict=True):
        gap = displacement(p, compliance, sides) - (heights - (summit - approach))
        gap = np.where(p > 0.0, 0.0, np.maximum(gap, 0.0))
        force.append(p.mean())
        flow.append([transmissivity(of, sides == "periodic") for of in (gap, gap.T)])
    return np.array(force), np.transpose(flow)


def inside(seeds: list[int], tolerances: list[float]) -> None:
    """Print the table of the bars, at the steps next to some contact fractions."""
    head = "seed, tolerance, contact, direction, T, bar, true T, uncertain by, error over bar, dofs".split(", ")
    print("| " + " | ".join(head) + " |\n|" + " --- |" * len(head))
    for seed in seeds:
        problem = patch(seed)
        path = replace(problem.load_path, force_max=0.5 * PRESSURE, steps=10)
        for tolerance in tolerances:
            run = refine(replace(problem, load_path=path), asp.AccuracyTarget(tolerance), hooks=Callbacks(flow=True))
            curve = run.checked().curve.loading()
            rows = sorted({int(np.abs(curve.area_fraction - a).argmin()) for a in FRACTIONS})
            at = np.unique(np.concatenate([curve.delta_star[rows] * by for by in (0.97, 1.0, 1.03)]))
            coarse, fine = (truth_of(problem, at, n) for n in CELLS)
            for row, axis in product(rows, "xy"):
                value, bar = (getattr(curve, f"{of}transmissivity_{axis}")[row] for of in ("", "error_"))
                less, true = (at_force(found, curve.P_star[row], axis) for found in (coarse, fine))
                cells = (
                    seed, f"{100 * tolerance:g} %", f"{curve.area_fraction[row]:.3f}", axis, f"{value:.2e}",
                    f"{bar:.1e}", f"{true:.2e}", f"{abs(true - less):.1e}", f"{(value - true) / bar:+.2f}",
                    run.levels[-1].dofs,
                )  # fmt: skip
                print("| " + " | ".join(map(str, cells)) + " |", flush=True)


def at_force(found: tuple[Floats, Floats], P_star: float, axis: str) -> float:
    """Transmissivity at a force, between those of boundary elements in logarithms; 0 where they are closed."""
    force, flow = found
    log_flow = np.log(np.maximum(flow["xy".index(axis)], 1e-40))
    value = float(np.exp(np.interp(np.log(P_star), np.log(force), log_flow)))
    return value if value > 1e-30 else 0.0


def percolation(seeds: list[int]) -> None:
    """Print between which contact fractions the last channel closes."""
    print("| seed | open along x up to | closed from | open along y up to | closed from |\n|" + 5 * " --- |")
    found = []
    for seed in seeds:
        problem = patch(seed)
        path = replace(problem.load_path, steps=24)
        problem = replace(problem, load_path=path, size=asp.MeshSize(0.03))
        curve = solve_problem(problem, hooks=Callbacks(flow=True), checked=False).curve.loading()
        ends = []
        for name in ("transmissivity_x", "transmissivity_y"):
            last = np.flatnonzero(getattr(curve, name) > 0.0)[-1]
            ends += [float(a) for a in curve.area_fraction[last : last + 2]]
        found.append(ends)
        print(f"| {seed} | " + " | ".join(f"{a:.3f}" for a in ends) + " |", flush=True)
    print("| mean | " + " | ".join(f"{a:.3f}" for a in np.mean(found, axis=0)) + " |")


def open_gaps(seeds: list[int]) -> None:
    """Print the flow factors."""
    ratios = np.array([1.0, 1.5, 2.0, 2.5, 3.0])
    print("| seed |" + "".join(f" {ratio:g} |" for ratio in ratios) + "\n|" + 6 * " --- |")
    found = []
    for seed in seeds:
        problem = patch(seed)
        surface, Sq = problem.surface, problem.surface.statistics().Sq
        depth = surface.maximum()[2] - surface.mean()
        problem = replace(problem, size=asp.MeshSize(0.02, h_max=0.02))
        solver = make_contact_solver(MPI.COMM_SELF, problem, make_block(MPI.COMM_SELF, problem, 10.0 * depth))
        top, factors = solver.contact_surface, []
        film = ThinFilm(top, surface, solver.summit)
        for ratio in ratios:
            solver.delta = depth - ratio * Sq
            gap = solver.gap()
            flows = film.through(gap, gap <= 0.0)
            factors.append(0.5 * (flows["transmissivity_x"] + flows["transmissivity_y"]) / (ratio * Sq) ** 3)
        found.append(factors)
        print(f"| {seed} | " + " | ".join(f"{factor:.3f}" for factor in factors) + " |", flush=True)
    known = 1.0 - 0.9 * np.exp(-0.56 * ratios)
    for name, values in (("mean", np.mean(found, axis=0)), ("Patir and Cheng", known)):
        print(f"| {name} | " + " | ".join(f"{factor:.3f}" for factor in values) + " |")


if __name__ == "__main__":
    warnings.simplefilter("ignore")
    parser = argparse.ArgumentParser()
    parser.add_argument("what", choices=["inside", "percolation", "open"])
    parser.add_argument("--seed", type=int, nargs="*", default=[1, 2, 3, 4, 5])
    parser.add_argument("--tolerance", type=float, nargs="*", default=[0.05, 0.02])
    options = parser.parse_args()
    if options.what == "inside":
        inside(options.seed, options.tolerance)
    elif options.what == "percolation":
        percolation(options.seed)
    else:
        open_gaps(options.seed)
