# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

"""What the accuracy of the force costs on the demo surface: element size, load steps, tolerance.

    python3 benchmarks/accuracy.py orders        order and bars of the family of meshes, on surfaces of many kinds
    python3 benchmarks/accuracy.py tolerance     bars and errors of runs driven by a tolerance, on the same surfaces
    python3 benchmarks/accuracy.py plastic       the same for elastic-plastic material
    python3 benchmarks/accuracy.py few           the same in fewer planned steps

Prints Markdown tables. CPU seconds are those of rank 0, others of the clock. The limits that errors are judged by are
those of meshes of another grading than the runs have. Forces are kept in out/accuracy, so that the next job need not
compute them again.
"""

from __future__ import annotations

import sys
import warnings
from collections.abc import Sequence
from pathlib import Path
from time import process_time
from typing import ClassVar

import numpy as np
from mpi4py import MPI

import asperity as asp
from asperity.adaptive.extrapolation import loading_force, steady
from asperity.adaptive.mesh_levels import Level, LevelSolver
from asperity.adaptive.mesh_plan import (
    GUIDE,
    LARGEST_RATIO,
    MESH_ORDER,
    SMALLEST_RATIO,
    error_of,
    extrapolate,
    extrapolate_mesh,
    growth,
)
from asperity.adaptive.solve_to_tolerance import solve_to_tolerance
from asperity.arrays import Floats
from asperity.mesh.block import BlockMesh
from asperity.mesh.size_field import GRADING, GUIDED, FirstContactMap
from asperity.model.settings import AccuracyTarget
from asperity.quasistatic.contact_result import ContactResult
from asperity.quasistatic.make import make_block

Judged = tuple[Floats, Floats]  # relative error and bar at some approaches

L, DELTA, STEPS = 1e-6, 0.03e-6, 10
UNIT = asp.Material(1.0, 0.3)
KEPT = Path("out/accuracy")
FAMILY = (0.1, 0.0707, 0.05, 0.0354, 0.025, 0.0177)  # element sizes in the contact
FINEST = 0.0125  # of elastic-plastic material, whose force converges later


def surface(seed: int = 0) -> asp.Surface:
    """The surface of cases/demo.toml, or another seed of it."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return asp.Surface.from_spec(kind="weierstrass-mandelbrot", L=L, D=2.4, G=1.36e-11, seed=seed)


def row(*cells: object) -> None:
    """Print a row of a table, on rank 0."""
    if MPI.COMM_WORLD.rank == 0:
        print("| " + " | ".join(f"{c:.2f}" if isinstance(c, float) else str(c) for c in cells) + " |", flush=True)


def per_cent(value: np.ndarray, reference: np.ndarray) -> tuple[float, float]:
    """Root mean square and greatest relative difference over the path, in per cent."""
    e = 100.0 * (value / reference - 1.0)
    return float(np.sqrt(np.mean(e**2))), float(np.max(np.abs(e)))


def scenes() -> dict[str, tuple[asp.Surface, float]]:
    """Surfaces, and how deep they are pressed; L = 1. The constants of the bars were chosen without the last four."""

    def rough(seed: int, D: float, G: float) -> asp.Surface:
        return asp.Surface.from_spec(kind="weierstrass-mandelbrot", L=1.0, D=D, G=G, seed=seed)

    def of(kind: str, **shape: object) -> asp.Surface:
        return asp.Surface.from_spec(kind=kind, L=1.0, **shape)

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return {
            "rough, seed 12": (rough(12, 2.4, 1.36e-5), 0.03),
            "rough, seed 14": (rough(14, 2.4, 1.36e-5), 0.05),
            "rough, D 2.2": (rough(1, 2.2, 1e-10), 0.02),
            "rough, D 2.6": (rough(2, 2.6, 1e-3), 0.03),
            "sphere in the middle": (of("sphere", radius=1.5, centre=(0.5, 0.5)), 0.02),
            "sphere off the middle": (of("sphere", radius=3.0, centre=(0.3, 0.4)), 0.01),
            "four summits": (of("sinusoid", amplitude=0.01, wavelength=0.5, dims=2), 0.015),
            "rough, seed 21": (rough(21, 2.4, 1.36e-5), 0.02),
            "rough, D 2.5": (rough(22, 2.5, 1e-4), 0.025),
            "small sphere": (of("sphere", radius=0.6, centre=(0.6, 0.45)), 0.01),
            "two bumps": (of("sinusoid", amplitude=0.02, wavelength=0.8, dims=2), 0.01),
        }


def forces(
    name: str,
    surface: asp.Surface,
    delta: float,
    sizes: Sequence[float],
    material: asp.Material = UNIT,
    substeps: int = 1,
    grading: tuple[float, float] = GRADING,
) -> dict[float, Floats]:
    """Force at ten approaches on a family of meshes, kept in a file of KEPT; that of the tolerance runs is GUIDED."""
    path = KEPT / f"{name.replace(' ', '-').replace(',', '')}.npz"
    kept = dict(np.load(path)) if path.is_file() else {}
    at, reach, out = delta * np.arange(1, 11) / 10, None, {}
    for h in sizes:
        key = f"{h:.4f}" if grading == GRADING else f"{grading[0]:g} {grading[1]:g} {h:.4f}"
        if material.plastic:
            key += f" {material.yield_strength:g} {material.tangent_modulus:g} {substeps}"
        if key not in kept:
            if reach is None and h < GUIDE:
                guide = asp.solve_contact(surface, material, delta_max=delta, size=asp.MeshSize(GUIDE, growth(GUIDE)))
                reach = FirstContactMap(*guide.first_contact.gather(guide.solver))
            block = mesh_of(surface, delta, h, reach, grading if reach else GRADING)
            result = asp.solve_contact(surface, material, delta_max=delta, substeps=substeps, block=block)
            kept[key] = loading_force(result.curve, at)
            KEPT.mkdir(parents=True, exist_ok=True)
            np.savez(path, **kept)
        out[h] = kept[key]
    return out


def mesh_of(
    surface: asp.Surface, delta: float, h: float, reach: FirstContactMap | None, grading: tuple[float, float]
) -> BlockMesh | None:
    """A mesh as a run with a tolerance makes it, with a given grading."""
    size = asp.MeshSize(h, growth(h), reach=reach, grading=grading)
    return make_block(MPI.COMM_WORLD, surface, surface.L, delta, size)


def orders() -> None:
    """Order of the force along the family of meshes, and how often the bar of two of them holds the error."""
    judged = []
    row("surface", *(f"h = {h:.3g} L" for h in FAMILY[:-1]), "order", "excess of the guide")
    row(*["---"] * (len(FAMILY) + 2))
    guide, second, _, fourth = FAMILY[:4]
    for name, (surface, delta) in scenes().items():
        found = forces(name, surface, delta, FAMILY[:-1], grading=GUIDED)
        limit = _limit(forces(name, surface, delta, FAMILY[3:]))
        errors = [per_cent(P, limit)[0] for P in found.values()]
        order = float(np.polyfit(np.log(FAMILY[1:-1]), np.log(errors[1:]), 1)[0])
        excess = seen(found, guide, second, second) / seen(found, second, fourth, second)
        row(name, *errors, order, excess)
        for k, coarse in enumerate(FAMILY[1:-1], start=1):
            for fine in FAMILY[k + 1 : -1]:
                if SMALLEST_RATIO <= coarse / fine <= LARGEST_RATIO:
                    value, _, bar = extrapolate_mesh(found[coarse], found[fine], coarse / fine)
                    judged.append((np.abs(value / limit - 1.0), steady(bar / limit)))
    summary(judged)


def seen(found: dict[float, Floats], coarse: float, fine: float, h: float) -> float:
    """Greatest error of the mesh h, as a run sees it from the bar of two meshes as if both were of the family."""
    _, _, bar = extrapolate_mesh(found[coarse], found[fine], coarse / fine)
    error = error_of(float(np.max(steady(bar / found[fine]))), coarse / fine, guide=False)
    return error * (h / fine) ** MESH_ORDER


def _limit(found: dict[float, Floats]) -> Floats:
    """Limit of the finest three meshes with the one order that fits them best at all approaches."""
    sizes = sorted(found)[:3]
    P = np.array([found[h] for h in sizes])
    best, limit = np.inf, P[0]
    for order in np.linspace(1.0, 4.0, 61):
        basis = np.stack([np.ones(3), np.array(sizes) ** order], axis=1)
        fit = np.linalg.lstsq(basis, P, rcond=None)[0]
        left = float(np.sum(((basis @ fit - P) / fit[0]) ** 2))
        if left < best:
            best, limit = left, fit[0]
    return limit


def tolerance() -> None:
    """Bars of tolerance-driven runs against the errors they estimate, on all surfaces."""
    judged = []
    header("surface")
    for name, (surface, delta) in scenes().items():
        limit = _limit(forces(name, surface, delta, FAMILY[3:]))
        for goal in (0.05, 0.02, 0.01):
            judged.append(driven(name, surface, UNIT, goal, delta * np.arange(1, 11) / 10, limit))
    summary(judged)


def plastic_scenes() -> dict[str, tuple[asp.Surface, float, asp.Material]]:
    """Surfaces, how deep they are pressed, and materials that yield early or late and harden much or not at all."""
    chosen = {
        "rough, seed 12": (0.005, 0.05),
        "rough, seed 14": (0.002, 0.01),
        "rough, D 2.2": (0.005, 0.05),
        "rough, D 2.6": (0.01, 0.2),
        "rough, seed 21": (0.005, 0.0),
        "sphere off the middle": (0.003, 0.02),
        "two bumps": (0.01, 0.1),
    }
    return {name: (*scenes()[name], asp.Material(1.0, 0.3, *yields)) for name, yields in chosen.items()}


def plastic_limit(name: str, surface: asp.Surface, delta: float, material: asp.Material) -> Floats:
    """Limit of three finer meshes than those of elastic material, and of the load steps on a coarser one."""
    meshes = forces(name, surface, delta, (*FAMILY[4:], FINEST), material)
    whole, half, quarter = (forces(name, surface, delta, FAMILY[2:3], material, n)[FAMILY[2]] for n in (1, 2, 4))
    settled, _ = extrapolate(half, quarter, 2.0, 2.0)
    return _limit(meshes) * settled / whole


def plastic() -> None:
    """Bars of elastic-plastic runs against the limit of finer meshes and load steps."""
    judged = []
    header("surface, sigma_y/E, E_t/E")
    for name, (surface, delta, material) in plastic_scenes().items():
        limit = plastic_limit(name, surface, delta, material)
        for goal in (0.05, 0.02):
            label = f"{name}, {material.yield_strength:g}, {material.tangent_modulus:g}"
            judged.append(driven(label, surface, material, goal, delta * np.arange(1, 11) / 10, limit))
    summary(judged)


def few() -> None:
    """Bars of runs in fewer planned steps, also by the rule of first order."""
    header("surface, steps")
    judged = []
    for name in ("rough, seed 12", "rough, seed 14", "rough, seed 21", "sphere off the middle"):
        surface, delta = scenes()[name]
        limit = _limit(forces(name, surface, delta, FAMILY[3:]))
        for steps in (1, 2, 5):
            rows = np.arange(1, steps + 1) * 10 // steps - 1
            at = delta * (rows + 1) / 10
            judged.append(driven(f"{name}, {steps}", surface, UNIT, 0.01, at, limit[rows]))
            if name in ("rough, seed 12", "sphere off the middle"):
                _, _, material = plastic_scenes()[name]
                yielding = plastic_limit(name, surface, delta, material)[rows]
                for rule in ("midpoint", "backward-euler"):
                    label = f"{name}, {steps}, elastic-plastic, {rule}"
                    judged.append(driven(label, surface, material, 0.03, at, yielding, integrator=rule))
    summary(judged)


LIGHT_SLOPE, FLATTER = 0.05, 0.2  # heights and approach are scaled by the latter: boundary elements know no slopes


class Remembering(LevelSolver):
    """A runner that does not solve a level twice, for runs on one surface that share meshes.

    Attributes:
        kept: result and CPU seconds by element size, of all runs
        seconds: of this run as if it had solved all of its levels
    """

    kept: ClassVar[dict[float, tuple[ContactResult, Level, float]]] = {}
    seconds: ClassVar[float] = 0.0

    def __call__(self, h: float, substeps: int = 1) -> ContactResult:
        """See LevelSolver; elastic material only."""
        if h not in self.kept:
            start = process_time()
            result = super().__call__(h, substeps)
            self.kept[h] = result, self.levels.pop(), process_time() - start
        result, level, seconds = self.kept[h]
        self.levels.append(level)
        Remembering.seconds += seconds
        return result


def header(first: str) -> None:
    """Head of the tables of `driven`."""
    row(first, "tolerance %", "met", "bar %", "true error %", "steps inside", "finest dofs", "CPU s")
    row(*["---"] * 8)


def driven(
    name: object,
    top: asp.Surface,
    material: asp.Material,
    goal: float,
    at: Floats,
    limit: Floats,
    integrator: str = "midpoint",
) -> Judged:
    """Run to a tolerance; error and bar at the approaches `at` [length], relative, and a row of the table."""
    start = process_time()
    result = solve_to_tolerance(
        top, material, AccuracyTarget(goal), delta_max=float(at[-1]), steps=len(at), integrator=integrator
    )
    seconds = process_time() - start
    branch = result.curve.loading()
    rows = [int(np.argmin(np.abs(branch.delta_star - d))) for d in at / top.L]
    error = np.abs(branch.P_star[rows] / limit - 1.0)
    bar = (branch.error_P_star / branch.P_star)[rows]
    row(
        name, f"{100 * goal:g}", result.met, 100 * float(np.median(bar)), 100 * float(np.median(error)),
        f"{int(np.sum(error <= bar))}/{len(bar)}", result.levels[-1].dofs, seconds,
    )  # fmt: skip
    return error, bar


def summary(judged: Sequence[Judged]) -> None:
    """Print how often errors are inside their bars, and how much larger these are."""
    inside = np.concatenate([error <= bar for error, bar in judged])
    ratio = np.median([np.median(bar) / np.median(error) for error, bar in judged])
    print(f"\nerror inside the bar: {100 * np.mean(inside):.0f} % of {len(inside)} steps; ", end="")
    print(f"bar over error, medians: {ratio:.1f}")


if __name__ == "__main__":
    jobs = {"orders": orders, "tolerance": tolerance, "plastic": plastic, "few": few}
    for job in sys.argv[1:] or jobs:
        if MPI.COMM_WORLD.rank == 0:
            print(f"\n## {job}\n")
        jobs[job]()
