# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

"""Stiffness columns: what they cost, and what error their loose linear systems leave, docs/stiffness.md.

    python3 benchmarks/stiffness.py cost      share of the columns in the time of a run, and in its iterations
    python3 benchmarks/stiffness.py accuracy  error that their loose linear systems leave
    python3 benchmarks/stiffness.py barber    stiffness against conductance over slope, block, Poisson's ratio, mesh
    python3 benchmarks/stiffness.py matrix    stiffness against six motions of a paraboloid, over that of a bonded disc

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
from asperity.case.schema import WeierstrassMandelbrotSection
from asperity.quasistatic import stiffness
from asperity.quasistatic.contact_solver import ContactSolver
from asperity.quasistatic.hooks import Hooks
from asperity.quasistatic.stiffness_matrix import stiffness_matrix

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


def matrix() -> None:
    """Interface of a paraboloid in the middle of a block against closed forms of discs on a half-space.

    Mindlin (1949); Spence (1968); Borowicka (1943), without friction; Reissner & Sagoci (1944).
    """
    heads("a/L", "dofs", "along x, 8 G a/(2 - nu)", "normal, 4 G a ln(3 - 4 nu)/(1 - 2 nu)",
          "tilt, 8 G a^3/(3 (1 - nu))", "torsion, 16 G a^3/3", "greatest asymmetry")  # fmt: skip
    nu = 0.3
    G = 0.5 / (1.0 + nu)
    paraboloid = asp.Surface.from_spec("sphere", L=1.0, radius=10.0, shape="paraboloid")
    for wanted in (0.02, 0.01):
        size = asp.MeshSize(wanted / 8, growth=0.4, h_max=0.3)
        result = asp.solve_contact(paraboloid, asp.Material(1.0, nu), delta_max=wanted**2 / 10.0, steps=1, size=size)
        a = (7.5 * result.curve.force[-1] * (1.0 - nu**2)) ** (1.0 / 3.0)  # Hertz
        found = stiffness_matrix(result.solver)
        assert found is not None and found.interface is not None
        disc = (8 * G * a / (2 - nu), 4 * G * a * np.log(3 - 4 * nu) / (1 - 2 * nu), 8 * G * a**3 / (3 * (1 - nu)),
                16 * G * a**3 / 3)  # fmt: skip
        cells = (f"{found.interface[k, k] / k_disc:.3f}" for k, k_disc in zip((0, 2, 4, 5), disc, strict=True))
        scale = np.sqrt(found.whole.diagonal())
        skew = np.max(np.abs(found.whole - found.whole.T) / scale / scale[:, None])
        print(f"| {a:.4f} | {result.dofs} | {' | '.join(cells)} | {skew:.0e} |", flush=True)


def barber() -> None:
    """Stiffness of the interface over E' C/2, which is one on a half-space, with one thing changed at a time.

    The surface of the demo, elastic, under the approach of the demo. Heights and approach scaled down together have the
    same contact and a smaller slope.
    """
    heads("slopes times", "height over L", "nu", "element size over L", "sides", "dofs", "area", "k_n_interface",
          "E' C/2", "deviation")  # fmt: skip
    standard: dict[str, Any] = {"scale": 1.0, "height": 1.0, "nu": 0.3, "h": 0.03, "sides": "rollers"}
    changes: list[dict[str, Any]] = [
        {}, {"scale": 0.5}, {"scale": 0.1}, {"scale": 0.01}, {"height": 2.0}, {"nu": 0.0}, {"nu": 0.45}, {"h": 0.06},
        {"h": 0.02}, {"sides": "free"}, {"scale": 0.01, "height": 2.0}, {"scale": 0.01, "nu": 0.0},
        {"scale": 0.01, "nu": 0.45}, {"scale": 0.01, "h": 0.06}, {"scale": 0.01, "sides": "free"},
    ]  # fmt: skip
    demo = Case.load(CASE).surface
    assert isinstance(demo, WeierstrassMandelbrotSection)
    for change in changes:
        of = standard | change
        G = 1.36e-5 * of["scale"] ** (1.0 / (demo.D - 2.0))  # heights go with G^(D - 2)
        surface = asp.Surface.from_spec("weierstrass-mandelbrot", L=1.0, D=demo.D, G=G)
        solid = asp.Material(1.0, of["nu"])
        curve = asp.solve_contact(
            surface, solid, delta_max=0.012 * of["scale"], steps=3, height=of["height"], sides=of["sides"],
            size=asp.MeshSize(of["h"]), stiffness=True, conductance=True,
        )  # fmt: skip
        k, C = curve.curve.k_n_interface[-1], curve.curve.conductance[-1]
        expected = 0.5 * solid.reduced_modulus * C
        print(
            f"| {of['scale']:g} | {of['height']:g} | {of['nu']:g} | {of['h']:g} | {of['sides']} | {curve.dofs} | "
            f"{curve.curve.area_fraction[-1]:.4f} | {k:.4f} | {expected:.4f} | {k / expected - 1.0:+.1%} |",
            flush=True,
        )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("part", choices=("cost", "accuracy", "barber", "matrix"))
    warnings.simplefilter("ignore")
    {"cost": cost, "accuracy": accuracy, "barber": barber, "matrix": matrix}[parser.parse_args().part]()


if __name__ == "__main__":
    main()
