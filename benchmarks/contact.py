# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

"""Print what each contact formulation costs and how far off it is, as Markdown tables.

Cases: Hertz and Westergaard against their closed forms, the elastic and the elastic-plastic demo surface against exact
contact on a finer mesh with the same load steps. Further tables on Hertz: "integration" compares quadratures on the
facets, which the edge of contact cuts, with one of 384 points on the same mesh, "area" the area of contact with theory
at many loads, "pressure" local pressures, "refinement" the force when all of the mesh or the contact alone is refined.
Arguments name the tables; without any all are printed (some minutes on one core).
"""

from __future__ import annotations

import sys
import time
import warnings
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.optimize import brentq

from asperity import reference
from asperity.contact import PressureContact
from asperity.contact.contact_surface import FACET_DEGREE, ContactSurface, FacetRule
from asperity.model.material import Material
from asperity.model.settings import Formulation, MeshSize
from asperity.quasistatic import measures
from asperity.quasistatic.contact_solver import ContactSolver
from asperity.quasistatic.make import make_block, make_contact_solver
from asperity.surface import Sinusoid, Sphere, Surface, WeierstrassMandelbrot
from asperity.verification.hertz import CONTACT, RADIUS, SPHERE, layer_force, press_sphere
from asperity.verification.table import solve_on_one_rank as press_alone

NU = 0.3
ELASTIC = Material(1.0, NU)
PLASTIC = Material(1.0, NU, 0.005, 0.05)
FORMULATIONS = {
    "active set": Formulation(),
    "penalty, beta 1": Formulation("penalty", 1.0),
    "penalty, beta 10": Formulation("penalty", 10.0),
    "penalty, beta 100": Formulation("penalty", 100.0),
    "Nitsche 0, gamma 1": Formulation("nitsche", gamma=1.0),
    "Nitsche 0, gamma 10": Formulation("nitsche", gamma=10.0),
    "Nitsche +1, gamma 10": Formulation("nitsche", gamma=10.0, theta=1),
    "Nitsche -1, gamma 10": Formulation("nitsche", gamma=10.0, theta=-1),
}


@dataclass(frozen=True)
class State:
    """What is compared at a step, in units of E = L = 1."""

    force: float
    area: float
    area_error: float
    peak: float


@dataclass(frozen=True)
class Case:
    """A surface pressed in steps, and what is known about the result.

    Attributes:
        theory: force, area, peak pressure at each step in closed form, given the force of a finer mesh at each step;
            None compares with the finer mesh alone
    """

    surface: Surface
    material: Material
    height: float
    steps: tuple[float, ...]
    sizes: tuple[float, ...]
    finer: float
    theory: Callable[[list[State]], list[State]] | None = None


def hertz() -> Case:
    """Contact radius 0.05 L; the walls add to the force, so area and peak are compared at the same force."""
    radius, a = 1.0, 0.05
    law = reference.Hertz(radius, reference.reduced_modulus(1.0, NU))

    def theory(fine: list[State]) -> list[State]:
        depths = [float(law.approach(4.0 * s.force)) for s in fine]
        return [
            State(s.force, 0.25 * np.pi * float(law.radius(d)) ** 2, 0.0, float(law.peak_pressure(d)))
            for s, d in zip(fine, depths, strict=True)
        ]

    cap = Sphere(L=1.0, radius=radius, centre=(0.0, 0.0), shape="paraboloid")
    return Case(cap, ELASTIC, 1.0, (0.5 * a**2, a**2), (a / 3, a / 6), a / 16, theory)


def westergaard() -> Case:
    """Half a wave in a block of twice its width."""
    amplitude, height = 0.002, 2.0
    wave = reference.Westergaard(amplitude, 2.0, reference.reduced_modulus(1.0, NU))
    steps = (0.75 * amplitude, 1.5 * amplitude)
    compliance = height / reference.block_modulus(1.0, NU)

    def theory(_: list[State]) -> list[State]:
        means = [
            brentq(lambda p, d=d: float(wave.approach(p)) + compliance * p - d, 0.0, wave.full_pressure, xtol=1e-18)
            for d in steps
        ]
        return [State(p, float(wave.area_fraction(p)), 0.0, float(wave.pressure(np.zeros(1), p)[0])) for p in means]

    surface = Sinusoid(L=1.0, amplitude=amplitude, wavelength=2.0, dims=1, centre=(0.0, 0.0))
    return Case(surface, ELASTIC, height, steps, (0.12, 0.06), 0.06, theory)


def demo(material: Material, steps: int, sizes: tuple[float, ...], finer: float) -> Case:
    """The fractal surface of the demo, to 0.03 L."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        surface = WeierstrassMandelbrot(L=1.0, D=2.4, G=1.36e-5, M=10, gamma=1.5, f_max=5, seed=0)
    depths = tuple(float(d) for d in np.linspace(0.0, 0.03, steps + 1)[1:])
    return Case(surface, material, 1.0, depths, sizes, finer)


CASES: dict[str, Callable[[], Case]] = {
    "hertz": hertz,
    "westergaard": westergaard,
    "elastic": lambda: demo(ELASTIC, 3, (0.06, 0.04), 0.02),
    "plastic": lambda: demo(PLASTIC, 10, (0.08, 0.05), 0.03),
}


def press_along(case: Case, solver: ContactSolver) -> list[State]:
    """Follow the steps of a case; fails when one does not converge."""
    states = []
    for delta in case.steps:
        if not solver.step(delta).converged:
            raise RuntimeError(f"no convergence at delta = {delta:g}")
        area = solver.contact_surface.area_of(*solver.contact.touched())
        states.append(State(solver.force, area.value, area.error, measures.row(solver)["max_pressure"]))
    return states


def make(case: Case, size: float) -> Callable[[Formulation], ContactSolver]:
    """A maker of presses on one mesh."""
    from mpi4py import MPI

    comm = MPI.COMM_SELF
    block = make_block(comm, case.surface, case.height, case.steps[-1], MeshSize(size, growth=0.4))
    return lambda formulation: make_contact_solver(comm, case.surface, block, case.material, formulation=formulation)


def rms(values: Any) -> float:
    """Root of the mean square, in per cent."""
    return 100.0 * float(np.sqrt(np.mean(np.square(values))))


def rows(case: Case) -> Iterator[tuple[str, ...]]:
    """Rows of the table of a case."""
    fine = press_along(case, make(case, case.finer)(Formulation()))
    known = fine if case.theory is None else case.theory(fine)
    for size in case.sizes:
        press_of = make(case, size)
        for name, formulation in FORMULATIONS.items():
            if case.material.plastic and formulation.theta != 0:
                continue
            solver = press_of(formulation)
            start = time.process_time()
            try:
                states = press_along(case, solver)
            except RuntimeError as failure:
                yield f"{size:.4g}", f"{solver.solid.dofs}", name, str(failure), *[""] * (len(HEAD) - 4)
                continue
            seconds = time.process_time() - start
            counts = solver.counts

            def error(key: str, states: list[State] = states) -> list[float]:
                pairs = zip(states, known, strict=True)
                return [getattr(s, key) / getattr(k, key) - 1.0 for s, k in pairs]

            bar = rms([s.area_error / s.area for s in states])
            yield (
                f"{size:.4g}",
                f"{solver.solid.dofs}",
                name,
                f"{rms(error('force')):.2f}",
                f"{rms(error('area')):.1f}",
                f"{bar:.1f}",
                f"{rms(error('peak')):.2f}",
                f"{counts.newton / counts.steps:.1f}",
                f"{counts.krylov / counts.newton:.1f}",
                f"{seconds:.1f}",
            )


HEAD = (
    "h_contact/L", "dofs", "formulation", "force %", "area %", "area bar %", "peak %", "Newton/step", "Krylov/Newton",
    "CPU s",
)  # fmt: skip


RULES = {  # degree and splits of the rule, and whether heights at its points are exact or interpolated
    "3 points": (2, 0, False),
    "6 points": (4, 0, False),
    "16 points": (8, 0, False),
    "16 points, exact heights": (8, 0, True),
    "4 x 6 points": (4, 1, False),
    "16 x 6 points": (4, 2, False),
}


def points_of(top: ContactSurface, degree: int) -> tuple[Any, Any]:
    """x and y of the points of a rule (facets, points); second-order facets are straight seen from above."""
    import basix

    points, _ = basix.make_quadrature(basix.CellType.triangle, degree)
    first, second, third = np.moveaxis(top.solid.points[top.nodes[:, :3], :2], 1, 0)[:, :, None]
    x, y = np.moveaxis(first + points[:, :1] * (second - first) + points[:, 1:] * (third - first), -1, 0)
    return x, y


def integration() -> Iterator[tuple[str, ...]]:
    """Rows of the table of quadratures: what they change on a mesh, against the finest."""
    for scene, case, size in (("hertz", hertz(), 0.05 / 6), ("demo", demo(ELASTIC, 3, (), 0.0), 0.06)):
        press_of = make(case, size)
        for law, factor in (("penalty", 10.0), ("nitsche", 1.0)):
            plain = press_of(Formulation(law, factor, factor))

            def press_with(degree: int, splits: int, exact: bool) -> tuple[list[State], ContactSolver, float]:
                solver = press_of(Formulation(law, factor, factor))  # noqa: B023
                rule = FacetRule(solver.contact_surface, degree, splits)
                if exact:
                    x, y = points_of(solver.contact_surface, degree)
                    rule.height = 1.0 + case.surface.height(x, y) - case.surface.mean()  # noqa: B023
                parts = solver.solid, solver.contact_surface
                contact = PressureContact(*parts, factor, traction=law == "nitsche", rule=rule)  # noqa: B023
                solver = ContactSolver(*parts, contact, solver.summit, solver.newton.options)
                start = time.process_time()
                return press_along(case, solver), solver, time.process_time() - start  # noqa: B023

            finest, _, _ = press_with(4, 3, False)
            for name, choice in RULES.items():
                states, solver, seconds = press_with(*choice)

                def change(key: str, states: list[State] = states, finest: list[State] = finest) -> float:
                    return rms([getattr(a, key) / getattr(b, key) - 1.0 for a, b in zip(states, finest, strict=True)])

                yield (
                    scene, f"{plain.solid.dofs}", law, name, f"{change('force'):.3f}", f"{change('area'):.2f}",
                    f"{change('peak'):.2f}", f"{solver.counts.newton / solver.counts.steps:.1f}", f"{seconds:.1f}",
                )  # fmt: skip


def areas() -> Iterator[tuple[str, ...]]:
    """Rows of the table of areas: their error against Hertz under the same force, over many loads."""
    radius, a = 1.0, 0.05
    law = reference.Hertz(radius, reference.reduced_modulus(1.0, NU))
    loads = tuple(float(d) for d in np.linspace(0.25, 1.0, 24) * a**2)
    case = Case(Sphere(L=1.0, radius=radius, centre=(0.0, 0.0), shape="paraboloid"), ELASTIC, 1.0, loads, (), 0.0)
    for size in (a / 3, a / 6):
        press_of = make(case, size)
        for name in ("active set", "penalty, beta 10", "Nitsche 0, gamma 1"):
            solver = press_of(FORMULATIONS[name])
            states = press_along(case, solver)
            exact = [0.25 * np.pi * float(law.radius(law.approach(4.0 * s.force))) ** 2 for s in states]
            error = np.array([s.area / e - 1.0 for s, e in zip(states, exact, strict=True)])
            bar = np.array([s.area_error / s.area for s in states])
            yield (
                f"{size:.4g}", f"{solver.solid.dofs}", name, f"{100 * error.mean():+.1f}", f"{rms(error):.1f}",
                f"{rms(bar):.1f}", f"{100 * np.mean(np.abs(error) <= bar):.0f}",
            )  # fmt: skip


def pressures() -> Iterator[tuple[str, ...]]:
    """Rows of the table of local pressures within 0.8 of the radius of Hertz, as they come and as reported."""
    case = hertz()
    law = reference.Hertz(1.0, reference.reduced_modulus(1.0, NU))
    for size in (0.05 / 3, 0.05 / 6):
        press_of = make(case, size)
        for name, formulation in FORMULATIONS.items():
            solver = press_of(formulation)
            press_along(case, solver)
            top, contact = solver.contact_surface, solver.contact
            depth = float(law.approach(4.0 * solver.force))
            p0, radius = float(law.peak_pressure(depth)), float(law.radius(depth))

            def errors(xy: Any, found: Any, p0: float = p0, radius: float = radius, depth: float = depth) -> Any:
                r = np.hypot(xy[0], xy[1])
                return (found - law.pressure(r, depth))[r < 0.8 * radius] / p0

            corners = np.unique(top.nodes[:, :3])
            reported = errors(solver.solid.points[corners].T, solver.pressure[corners])
            if isinstance(contact, PressureContact):
                raw = errors(points_of(top, FACET_DEGREE), contact.points)
            else:
                nodes = np.unique(top.nodes[:, 3:])
                area = top.assemble(top.nodes[:, 3:], np.repeat(top.area[:, None] / 3.0, 3, axis=1))
                raw = errors(solver.solid.points[nodes].T, solver.nodal_force[nodes] / area[nodes])
            yield (
                f"{size:.4g}", name, f"{rms(raw):.1f}", f"{100 * np.abs(raw).max():.0f}", f"{rms(reported):.1f}",
                f"{100 * np.abs(reported).max():.0f}",
            )  # fmt: skip


def refinement() -> Iterator[tuple[str, ...]]:
    """Rows of the table of the force of Hertz when all of the mesh is refined, and when the contact is alone."""
    depth = CONTACT**2 / RADIUS
    theory = layer_force([0.5 * depth, depth], 1024)[0][-1]
    for k in 0.5 * 2.0 ** (0.5 * np.arange(6)):
        size = 0.25 * CONTACT / k
        alone = press_alone(SPHERE, ELASTIC, delta_max=depth, steps=2, size=MeshSize(size))
        cells = [
            f"{value}"
            for result in (press_sphere(k), alone)
            for value in (result.dofs, f"{100 * (result.curve.P_star[-1] / theory - 1.0):.3f}")
        ]
        yield f"{size:.4g}", *cells


REFINEMENT_HEAD = ("h_contact/L", "dofs, all refined", "force %", "dofs, contact alone", "force %")
PRESSURE_HEAD = ("h_contact/L", "formulation", "raw rms %", "raw greatest %", "reported rms %", "reported greatest %")
INTEGRATION_HEAD = (
    "scene", "dofs", "formulation", "rule", "force %", "area %", "peak %", "Newton/step", "CPU s",
)  # fmt: skip
AREA_HEAD = ("h_contact/L", "dofs", "formulation", "mean error %", "rms error %", "rms bar %", "inside %")
TABLES: dict[str, tuple[tuple[str, ...], Callable[[], Iterator[tuple[str, ...]]]]] = {
    **{name: (HEAD, lambda case=case: rows(case())) for name, case in CASES.items()},  # type: ignore[misc]
    "integration": (INTEGRATION_HEAD, integration),
    "area": (AREA_HEAD, areas),
    "pressure": (PRESSURE_HEAD, pressures),
    "refinement": (REFINEMENT_HEAD, refinement),
}


def main(names: list[str]) -> None:
    """Print the tables named."""
    for name in names or list(TABLES):
        head, table = TABLES[name]
        print(f"\n{name}\n\n| " + " | ".join(head) + " |\n|" + "---|" * len(head))
        for row in table():
            print("| " + " | ".join(row) + " |", flush=True)


if __name__ == "__main__":
    main(sys.argv[1:])
