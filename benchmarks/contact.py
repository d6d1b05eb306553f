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
from scipy.optimize import brentq

from asperity import reference
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
    "penalty, beta 1": Formulation("penalty", 1.0),
    "penalty, beta 10": Formulation("penalty", 10.0),
    "penalty, beta 100": Formulation("penalty", 100.0),
    "Nitsche, gamma 1": Formulation("nitsche", gamma=1.0),
    "Nitsche, gamma 10": Formulation("nitsche", gamma=10.0),
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


def fractal(material: Material, steps: int, sizes: tuple[float, ...], finer: float) -> Case:
    """The surface of cases/single.toml, to 0.03 L."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
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


def main(names: list[str]) -> None:
    """Print the rows of the scenes named, of all without names."""
    print("| scene | " + " | ".join(HEAD) + " |\n|" + "---|" * (len(HEAD) + 1))
    for name in names or CASES:
        for row in rows(CASES[name]()):
            print(f"| {name} | " + " | ".join(row) + " |", flush=True)


if __name__ == "__main__":
    main(sys.argv[1:])
