"""Stiffness columns: what they cost, and the error of their loose linear systems, docs/stiffness.md.

    python3 benchmarks/stiffness.py cost      share of the columns in the time of a run, and in its iterations
    python3 benchmarks/stiffness.py accuracy  error that their loose linear systems leave
    python3 benchmarks/stiffness.py barber    stiffness against conductance over slope, block, Poisson's ratio, mesh
    python3 benchmarks/stiffness.py matrix    stiffness against six motions of a paraboloid, over that of a bonded disc

Each prints a table.
"""

from __future__ import annotations

import argparse
import warnings
from collections.abc import Sequence
from pathlib import Path
from time import process_time
from typing import Any

import numpy as np

import asperity as asp
from asperity.case import Case
from asperity.case.surfaces import WeierstrassMandelbrotSection
from asperity.linear import energy
from asperity.linear.multigrid import PMultigrid
from asperity.quasistatic import stiffness
from asperity.quasistatic.contact_solver import ContactSolver
from asperity.quasistatic.hooks import Hooks
from asperity.quasistatic.stiffness_matrix import stiffness_matrix

CYCLES = [0]  # V-cycles so far, see `count_cycles`
CASE = Path(__file__).parent.parent / "cases" / "single.toml"


def heads(*names: str) -> None:
    """Print the first lines of a table."""
    print("| " + " | ".join(names) + " |\n" + "|---" * len(names) + "|", flush=True)


def single(h: float, *more: str) -> asp.Problem:
    """cases/single.toml with elements of h L, loaded and not unloaded."""
    keys = [f"mesh.h_contact={h}e-6", "loading.unload=false", "material.kinematics=small"]
    return Case.load(CASE, [*keys, *more]).problem()


class Spent:
    """Processor time and V-cycles of the columns, over all their calls."""

    def __init__(self) -> None:
        self.seconds, self.cycles = 0.0, 0
        self._columns: stiffness.Stiffness | None = None

    def __call__(self, solver: ContactSolver) -> dict[str, float]:
        begun, cycles = process_time(), CYCLES[0]
        self._columns = self._columns or stiffness.Stiffness(solver.solid)
        found = self._columns(solver)
        self.seconds += process_time() - begun
        self.cycles += CYCLES[0] - cycles
        return found


def cost() -> None:
    """Processor time of the columns over that of the rest of the load path, and V-cycles of both."""
    heads("material", "dofs", "steps", "V-cycles of the steps", "of the columns", "CPU s of the steps",
          "of the columns", "share")  # fmt: skip
    count_cycles()
    elastic = ("material.yield_strength=", "material.tangent_modulus=")
    finite = ("material.kinematics=finite",)
    for name, more, sizes in (
        ("elastic-plastic", (), (0.04, 0.02)), ("elastic-plastic, finite strain", finite, (0.04,)),
        ("elastic", elastic, (0.04,)),
    ):  # fmt: skip
        for h in sizes:
            spent, before = Spent(), CYCLES[0]
            whole, result = _timed(single(h, *more), spent)
            rest, cycles = whole - spent.seconds, CYCLES[0] - before - spent.cycles
            print(
                f"| {name} | {result.dofs} | {result.counts.steps} | {cycles} | {spent.cycles} | "
                f"{rest:.1f} | {spent.seconds:.2f} | {spent.seconds / rest:.0%} |",
                flush=True,
            )


def count_cycles() -> None:
    """Count the V-cycles of all solvers from now on in CYCLES."""
    apply = PMultigrid.apply

    def counted(self: PMultigrid, pc: Any, r: Any, z: Any) -> None:
        CYCLES[0] += 1
        apply(self, pc, r, z)

    PMultigrid.apply = counted  # type: ignore[method-assign]


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


class Compared:
    """Errors of columns at each step: against systems solved 10000 times tighter.

    Attributes:
        errors: of each step and column
    """

    def __init__(self, names: Sequence[str]) -> None:
        self.errors: list[list[float]] = []
        self._names, self._columns = names, list[stiffness.Stiffness]()

    def __call__(self, solver: ContactSolver) -> dict[str, float]:
        solid, usual = solver.solid, energy.LEFT
        self._columns = self._columns or [stiffness.Stiffness(solid), stiffness.Stiffness(solid)]
        loose = self._columns[0](solver)
        stiffness.LEFT = energy.LEFT = 1e-4 * usual
        tight = self._columns[1](solver)
        stiffness.LEFT = energy.LEFT = usual
        self.errors.append([abs(loose[name] / tight[name] - 1.0) for name in self._names])
        return loose


def accuracy() -> None:
    """Columns against those of systems solved 10000 times as tightly, at each step."""
    heads("material", "dofs", "column", "median error", "greatest error")
    names = ("k_n_elastic", "k_t")
    tall, fine = ("material.nu=0.45",), ("material.kinematics=finite",)
    for name, more, h in (("nu = 0.3", (), 0.04), ("nu = 0.3", (), 0.02), ("nu = 0.45", tall, 0.04),
                          ("nu = 0.3, finite strain", fine, 0.04)):  # fmt: skip
        compare = Compared(names)
        dofs = _timed(single(h, *more), compare)[1].dofs
        for column, errors in zip(names, np.transpose(compare.errors), strict=True):
            print(f"| {name} | {dofs} | {column} | {np.median(errors):.3%} | {np.max(errors):.3%} |", flush=True)


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

    The surface and the approach of cases/single.toml, elastic. Heights and approach scaled down together have the
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
    fractal = Case.load(CASE).surface
    assert isinstance(fractal, WeierstrassMandelbrotSection)
    for change in changes:
        of = standard | change
        G = 1.36e-5 * of["scale"] ** (1.0 / (fractal.D - 2.0))  # heights go with G^(D - 2)
        surface = asp.Surface.from_spec("weierstrass-mandelbrot", L=1.0, D=fractal.D, G=G)
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
