"""Print what each contact formulation costs and its errors, as a Markdown table.

Cases: Hertz and Westergaard against their closed forms, a fractal surface, elastic and elastic-plastic, against exact
contact on a finer mesh with the same load steps.
Arguments name the scenes, for example "fractal, light"; without any all are printed (some minutes on one core).
"""

from __future__ import annotations

import sys
import time
import warnings
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from mpi4py import MPI
from scipy.optimize import brentq

from asperity import reference
from asperity.arrays import Floats
from asperity.model.material import Material
from asperity.model.settings import Formulation, MeshSize
from asperity.quasistatic import measures
from asperity.quasistatic.contact_solver import ContactSolver
from asperity.quasistatic.make import make_block, make_contact_solver
from asperity.surface import Sinusoid, Sphere, Surface, WeierstrassMandelbrot

NU = 0.3
ELASTIC = Material(1.0, NU)
PLASTIC = Material(1.0, NU, 0.005, 0.05)
FORMULATIONS = {
    "active set": Formulation(),
    **{f"penalty, beta {beta:g}": Formulation("penalty", beta) for beta in (1.0, 10.0, 100.0)},
    **{f"Nitsche, gamma {gamma:g}": Formulation("nitsche", gamma=gamma) for gamma in (1.0, 10.0)},
}
HEAD = (
    "h_contact/L", "dofs", "formulation", "force %", "area %", "area bar %", "peak %", "Newton/step", "Krylov/Newton",
    "CPU s",
)  # fmt: skip


@dataclass(frozen=True)
class Case:
    """A surface pressed in steps, and what is known about the result.

    Attributes:
        theory: force, area, peak pressure at each step (steps, 3) in closed form, of the forces of a finer mesh; None
            compares with the finer mesh alone
    """

    surface: Surface
    material: Material
    height: float
    steps: tuple[float, ...]
    sizes: tuple[float, ...]
    finer: float
    theory: Callable[[Floats], Floats] | None = None


def hertz() -> Case:
    """Contact radius 0.05 L; the walls add to the force, so area and peak are compared at the same force."""
    radius, a = 1.0, 0.05
    law = reference.Hertz(radius, reference.reduced_modulus(1.0, NU))

    def theory(force: Floats) -> Floats:
        depths = np.array([float(law.approach(4.0 * one)) for one in force])
        return np.column_stack([force, 0.25 * np.pi * law.radius(depths) ** 2, law.peak_pressure(depths)])

    cap = Sphere(L=1.0, radius=radius, centre=(0.0, 0.0), shape="paraboloid")
    return Case(cap, ELASTIC, 1.0, (0.5 * a**2, a**2), (a / 3, a / 6), a / 16, theory)


def westergaard() -> Case:
    """Half a wave in a block of twice its width."""
    amplitude, height = 0.002, 2.0
    wave = reference.Westergaard(amplitude, 2.0, reference.reduced_modulus(1.0, NU))
    steps = (0.75 * amplitude, 1.5 * amplitude)
    compliance = height / reference.block_modulus(1.0, NU)

    def theory(_: Floats) -> Floats:
        means = [
            brentq(lambda p, d=d: float(wave.approach(p)) + compliance * p - d, 0.0, wave.full_pressure, xtol=1e-18)
            for d in steps
        ]
        return np.array([(p, float(wave.area_fraction(p)), float(wave.pressure(np.zeros(1), p)[0])) for p in means])

    surface = Sinusoid(L=1.0, amplitude=amplitude, wavelength=2.0, dims=1, centre=(0.0, 0.0))
    return Case(surface, ELASTIC, height, steps, (0.12, 0.06), 0.06, theory)


def fractal(material: Material, steps: int, sizes: tuple[float, ...], finer: float) -> Case:
    """The surface of cases/single.toml, to 0.03 L."""
    surface = WeierstrassMandelbrot(L=1.0, D=2.4, G=1.36e-5, M=10, gamma=1.5, f_max=5, seed=0)
    depths = tuple(float(d) for d in np.linspace(0.0, 0.03, steps + 1)[1:])
    return Case(surface, material, 1.0, depths, sizes, finer)


CASES: dict[str, Callable[[], Case]] = {
    "Hertz": hertz,
    "Westergaard": westergaard,
    "fractal, elastic": lambda: fractal(ELASTIC, 3, (0.06, 0.04), 0.02),
    "fractal, light": lambda: replace(fractal(ELASTIC, 1, (0.06,), 0.01), steps=(0.0005,)),  # a few elements carry all
    "fractal, plastic": lambda: fractal(PLASTIC, 10, (0.08, 0.05), 0.03),
}


def press_along(case: Case, solver: ContactSolver) -> Floats:
    """Force, area, peak pressure and bar of the area at each step (steps, 4), in units of E = L = 1."""
    found = []
    for delta in case.steps:
        if not solver.step(delta).converged:
            raise RuntimeError(f"no convergence at delta = {delta:g}")
        area = solver.contact_surface.area_of(*solver.contact.touched())
        found.append((solver.force, area.value, measures.row(solver)["max_pressure"], area.error))
    return np.array(found)


def rows(case: Case) -> Iterator[tuple[Any, ...]]:
    """Rows of the table of a case."""
    fine, *blocks = (
        make_block(MPI.COMM_SELF, case.surface, case.height, case.steps[-1], MeshSize(size, growth=0.4))
        for size in (case.finer, *case.sizes)
    )

    def solver_of(block: Any, formulation: Formulation) -> ContactSolver:
        return make_contact_solver(MPI.COMM_SELF, case.surface, block, case.material, formulation=formulation)

    known = press_along(case, solver_of(fine, Formulation()))[:, :3]
    if case.theory is not None:
        known = case.theory(known[:, 0])
    for (size, block), (name, formulation) in (
        (mesh, way) for mesh in zip(case.sizes, blocks, strict=True) for way in FORMULATIONS.items()
    ):
        solver, start = solver_of(block, formulation), time.process_time()
        try:
            found = press_along(case, solver)
        except RuntimeError as failure:
            yield f"{size:.4g}", solver.solid.dofs, name, failure, *[""] * (len(HEAD) - 4)
            continue
        seconds, counts = time.process_time() - start, solver.counts
        errors = np.column_stack([found[:, :3] / known - 1.0, found[:, 3] / found[:, 1]])
        force, area, peak, bar = 100.0 * np.sqrt(np.mean(errors**2, axis=0))
        yield (
            f"{size:.4g}", solver.solid.dofs, name, f"{force:.2f}", f"{area:.1f}", f"{bar:.1f}", f"{peak:.2f}",
            f"{counts.newton / counts.steps:.1f}", f"{counts.krylov / counts.newton:.1f}", f"{seconds:.1f}",
        )  # fmt: skip


if __name__ == "__main__":
    warnings.simplefilter("ignore")
    print("| scene | " + " | ".join(HEAD) + " |\n|" + "---|" * (len(HEAD) + 1))
    for name in sys.argv[1:] or CASES:
        for row in rows(CASES[name]()):
            print(f"| {name} | " + " | ".join(map(str, row)) + " |", flush=True)
