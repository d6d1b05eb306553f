# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

"""Stiffness columns: what they cost, and what error their loose linear systems leave, docs/stiffness.md.

    python3 benchmarks/stiffness.py cost      share of the columns in the time of a run, and in its iterations
    python3 benchmarks/stiffness.py accuracy  error that their loose linear systems leave

Each prints a table.
"""

from __future__ import annotations

import argparse
import warnings
from pathlib import Path
from time import process_time
from typing import Any

import numpy as np

import asperity as asp
from asperity.arrays import Floats
from asperity.case import Case
from asperity.quasistatic import stiffness
from asperity.quasistatic.contact_solver import ContactSolver
from asperity.quasistatic.hooks import Hooks

CASE = Path(__file__).parent.parent / "cases" / "demo.toml"


def heads(*names: str) -> None:
    """Print the first lines of a table."""
    print("| " + " | ".join(names) + " |\n" + "|---" * len(names) + "|", flush=True)


def demo(h: float, *more: str) -> asp.Problem:
    """The demo with elements of h L, loaded and not unloaded."""
    keys = [f"mesh.h_contact={h}e-6", "loading.unload=false", "material.kinematics=small"]
    return Case.load(CASE, [*keys, *more]).problem()


def cost() -> None:
    """Processor time of the probes over the rest of the load path, and CG iterations of both."""
    heads("material", "dofs", "steps", "CG iterations of the steps", "of the columns", "CPU s of the steps",
          "of the columns", "share")  # fmt: skip
    elastic = ("material.yield_strength=", "material.tangent_modulus=")
    finite = ("material.kinematics=finite",)
    for name, more, sizes in (
        ("elastic-plastic", (), (0.04, 0.02)), ("elastic-plastic, finite strain", finite, (0.04,)),
        ("elastic", elastic, (0.04,)),
    ):  # fmt: skip
        for h in sizes:
            problem, spent, count = demo(h, *more), [0.0], [0]

            def probe(solver: ContactSolver, rate: Floats | None, spent: Any = spent, count: Any = count) -> Any:
                linear = solver.newton.linear
                solve = linear.solve

                def counted(*arguments: Any) -> tuple[int, bool]:
                    iterations, solved = solve(*arguments)
                    count[0] += iterations
                    return iterations, solved

                start = process_time()
                linear.solve = counted  # type: ignore[assignment, method-assign]
                found = stiffness.stiffness_of(solver, rate)
                linear.solve = solve  # type: ignore[method-assign]
                spent[0] += process_time() - start
                return found

            whole, result = _timed(problem, probe)
            rest = whole - spent[0]
            print(
                f"| {name} | {result.dofs} | {result.counts.steps} | {result.counts.krylov} | {count[0]} | "
                f"{rest:.1f} | {spent[0]:.2f} | {spent[0] / rest:.0%} |",
                flush=True,
            )


def _timed(problem: asp.Problem, probe: Any) -> tuple[float, Any]:
    """Processor time of a load path with a probe, without mesh and set-up, and its result."""
    begun = [0.0]

    class Probed(Hooks):
        def probes(self, solid: Any) -> tuple[Any, ...]:
            return (probe,)

    def on_ready() -> None:
        begun[0] = process_time()

    result = asp.solve_problem(problem, hooks=Probed(on_ready=on_ready))
    return process_time() - begun[0], result


def accuracy() -> None:
    """Columns against those of systems solved 10000 times as tightly, at each step."""
    heads("column", "median error", "greatest error")
    found: list[list[float]] = []
    names = ("k_n", "k_n_elastic", "k_t")

    def probe(solver: ContactSolver, rate: Floats | None) -> Any:
        usual, loose = stiffness.LEFT, stiffness.stiffness_of(solver, rate)
        stiffness.LEFT = 1e-4 * usual
        tight = stiffness.stiffness_of(solver, rate)
        stiffness.LEFT = usual
        found.append([abs(loose[name] / tight[name] - 1.0) for name in names])
        return loose

    _timed(demo(0.04), probe)
    for name, errors in zip(names, np.transpose(found), strict=True):
        print(f"| {name} | {np.median(errors):.3%} | {np.max(errors):.3%} |", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("part", choices=("cost", "accuracy"))
    warnings.simplefilter("ignore")
    {"cost": cost, "accuracy": accuracy}[parser.parse_args().part]()


if __name__ == "__main__":
    main()
