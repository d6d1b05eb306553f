# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

"""What small strain costs, and how well a coarse mesh shows it.

    python3 benchmarks/small_strain.py mesh      greatest difference of the force by the size of the coarse mesh
    python3 benchmarks/small_strain.py slopes    force, area and exponent over rms slope and yield strain
    python3 benchmarks/small_strain.py cost      force, time and iterations of a step of the demo surface, both ways

Each writes docs/tables/small_strain_NAME.csv and prints it. `slopes` presses a self-affine surface (H = 0.8, shortest
wave 0.1 L) of rising rms slope to a third of the depth of its mean plane, both ways on a mesh of 0.071 L and again on
one of 0.1 L.
"""

from __future__ import annotations

import argparse
import csv
import warnings
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from math import inf, nan
from pathlib import Path
from time import process_time
from typing import Any
from unittest.mock import patch

import numpy as np
from mpi4py import MPI
from tables import versions

import asperity as asp
from asperity.adaptive.mesh_plan import growth
from asperity.adaptive.small_strain import differences
from asperity.curve import Curve
from asperity.fem.compiled_kernels import CompiledKernels
from asperity.quasistatic.make import make_block
from asperity.quasistatic.solve_contact import ContactResult, solve_problem

ROOT = Path(__file__).parent.parent
ELASTIC = asp.Material(1.0, 0.3)
YIELDS = (0.01, 0.003)  # yield strength over E; the tangent modulus is E/20
SLOPES = (0.03, 0.1, 0.3, 0.5, 0.7)
SIZES = (0.1, 0.071, 0.05)
MESHES = (0.1, 0.071)  # of the slopes
STEPS = 5


def plastic(strength: float) -> asp.Material:
    return asp.Material(1.0, 0.3, strength, 0.05)


def both(surface: asp.Surface, material: asp.Material, delta: float, h: float, steps: int) -> tuple[Curve, Curve]:
    """Curves in small and in finite strain on one mesh of size h [L]."""
    problem = asp.Problem.of(surface, material, delta_max=delta, steps=steps)
    block = make_block(MPI.COMM_WORLD, surface, problem.height, delta, asp.MeshSize(h, growth(h)))
    small, finite = (
        solve_problem(replace(problem, material=replace(material, kinematics=kinematics)), block=block).curve
        for kinematics in ("small", "finite")
    )
    return small, finite


def mesh() -> Iterator[Mapping[str, object]]:
    """Greatest difference in per cent on meshes of several sizes."""
    fractal = asp.Surface.from_spec("weierstrass-mandelbrot", L=1.0, D=2.4, G=1.36e-5)
    rough, even = (
        asp.Surface.from_spec("self-affine", L=1.0, H=0.8, rms_slope=slope, lambda_short=0.05, seed=seed)
        for slope, seed in ((0.3, 1), (0.1, 2))
    )
    ball = asp.Surface.from_spec("sphere", L=1.0, radius=0.7)
    scenes = {
        "fractal, 0.03 L": (fractal, plastic(0.005), 0.03),
        "fractal, 0.01 L": (fractal, plastic(0.005), 0.01),
        "fractal, 0.03 L, elastic": (fractal, ELASTIC, 0.03),
        "self-affine, slope 0.3, 0.03 L": (rough, plastic(0.005), 0.03),
        "self-affine, slope 0.1, 0.008 L, elastic": (even, ELASTIC, 0.008),
        "sphere of 0.7 L, 0.01 L": (ball, plastic(0.005), 0.01),
    }
    for name, (surface, material, delta) in scenes.items():
        row: dict[str, object] = {"scene": name, "rms slope": f"{surface.rms_slope():.2f}"}
        for h in SIZES:
            _, _, percent = differences(*both(surface, material, delta, h, 5), 5)
            row[f"{h:g} L"] = f"{np.abs(percent).max():.2f}"
        yield row


def slopes() -> Iterator[Mapping[str, object]]:
    """Differences of force, area and exponent over rms slope and yield strain, and how a coarser mesh changes them."""
    for strength in (None, *YIELDS):
        material = ELASTIC if strength is None else plastic(strength)
        for slope in SLOPES:
            surface = asp.Surface.from_spec("self-affine", L=1.0, H=0.8, rms_slope=slope, lambda_short=0.1, seed=1)
            delta = (surface.maximum()[2] - surface.mean()) / 3.0
            row: dict[str, object] = {
                "yield strain": "elastic" if strength is None else f"{strength:g}",
                "rms slope": f"{slope:g}",
                "delta/L": f"{delta:.4f}",
            }
            coarse, fine = (changes(surface, material, delta, h) for h in MESHES)
            for name, value in fine.items():
                digits = 2 if name.endswith("%") else 3
                row[name] = f"{value:.{digits}f}"
                row[f"{name}, mesh"] = f"{abs(coarse[name] - value):.{digits}f}"
            yield row


def changes(surface: asp.Surface, material: asp.Material, delta: float, h: float) -> dict[str, float]:
    """What small strain changes at the end of the load path, mesh size h [L]; NaN where a run does not finish."""
    names = ("force %", "area %", "change of n", "greatest strain")
    try:
        small, finite = both(surface, material, delta, h, STEPS)
    except asp.ConvergenceError:
        return dict.fromkeys(names, nan)
    force, area = (
        100.0 * (getattr(small, name)[-1] / getattr(finite, name)[-1] - 1.0) for name in ("force", "area_fraction")
    )
    return dict(zip(names, (force, area, small.fit().n - finite.fit().n, float(finite.max_strain[-1])), strict=True))


@contextmanager
def timed(names: tuple[str, ...]) -> Iterator[dict[str, list[float]]]:
    """Processor seconds of the calls of some methods of the compiled kernels, by name."""
    seconds: dict[str, list[float]] = {name: [] for name in names}
    with ExitStack() as stack:
        for name in names:
            stack.enter_context(
                patch.object(CompiledKernels, name, stopwatch(getattr(CompiledKernels, name), seconds[name]))
            )
        yield seconds


def stopwatch(method: Callable[..., None], seconds: list[float]) -> Callable[..., None]:
    """A method that adds the processor seconds of each call to a list."""

    def call(*arguments: Any) -> None:
        start = process_time()
        method(*arguments)
        seconds.append(process_time() - start)

    return call


def cost(size: float = 0.08, steps: int = 20, repeats: int = 3) -> Iterator[Mapping[str, object]]:
    """Force at 0.03 L, iterations and processor time of a step on the demo surface.

    Both kinematics run in turn; a step has the least time of the repeats, a kernel the median of its calls.
    """
    surface = asp.Surface.from_spec("weierstrass-mandelbrot", L=1.0, D=2.4, G=1.36e-5)
    block = make_block(MPI.COMM_WORLD, surface, 1.0, 0.03, asp.MeshSize(size))
    assert block is not None  # on one rank
    cells = len(block.tets)
    for name, material in {"elastic": ELASTIC, "elastic-plastic": plastic(0.005)}.items():
        results: dict[str, ContactResult] = {}
        seconds = dict.fromkeys(("small", "finite"), inf)
        kernels: dict[str, dict[str, list[float]]] = {}
        for kinematics in repeats * list(seconds):
            problem = asp.Problem.of(surface, replace(material, kinematics=kinematics), delta_max=0.03, steps=steps)
            with timed(("add_internal_force", "tangent")) as kernels[kinematics]:
                start = process_time()
                result = results[kinematics] = solve_problem(problem, block=block)
                seconds[kinematics] = min(seconds[kinematics], (process_time() - start) / result.counts.steps)
        for kinematics, result in results.items():
            counts = result.counts
            force, tangent = (1e6 * np.median(calls) / cells for calls in kernels[kinematics].values())
            yield {
                "material": name,
                "strain": kinematics,
                "dofs": result.dofs,
                "steps": counts.steps,
                "Newton": counts.newton,
                "Krylov": counts.krylov,
                "force us a cell": f"{force:.2f}",
                "tangent us a cell": f"{tangent:.2f}",
                "CPU s a step": f"{seconds[kinematics]:.3f}",
                "times small strain": f"{seconds[kinematics] / seconds['small']:.2f}",
                "force over small strain": f"{result.curve.force[-1] / results['small'].curve.force[-1]:.4f}",
            }


def main() -> None:
    """Write and print the tables that are named."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("tables", nargs="+", choices=("mesh", "slopes", "cost"))
    warnings.simplefilter("ignore")
    makers: dict[str, Callable[[], Iterator[Mapping[str, object]]]] = {"mesh": mesh, "slopes": slopes, "cost": cost}
    for name in parser.parse_args().tables:
        rows: list[Mapping[str, object]] = []
        for row in makers[name]():
            if not rows:
                print(",".join(row), flush=True)
            print(*row.values(), sep=",", flush=True)
            rows.append(row)
        target = ROOT / f"docs/tables/small_strain_{name}.csv"
        target.parent.mkdir(exist_ok=True)
        with target.open("w", encoding="utf-8", newline="") as file:
            file.write(f"# ./run python3 benchmarks/small_strain.py {name}\n# {versions()}\n")
            table = csv.DictWriter(file, rows[0], lineterminator="\n")
            table.writeheader()
            table.writerows(rows)


if __name__ == "__main__":
    main()
