"""What each contact formulation costs and its errors, as a Markdown table.

    ./run python3 benchmarks/contact.py [SCENE]...      some minutes for all

Hertz and Westergaard against their closed forms, a fractal surface, elastic and elastic-plastic, against exact
contact on a finer mesh with the same load steps. "Refused" are results that a check of the run does not let pass;
Newton iterations are those of a planned step, with its cuts.
"""

from __future__ import annotations

import sys
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from time import process_time

import numpy as np
from mpi4py import MPI
from scipy.optimize import brentq

import asperity as asp
from asperity import reference
from asperity.arrays import Floats
from asperity.errors import CheckError, ConvergenceError
from asperity.mesh.block import BlockMesh
from asperity.quasistatic.contact_result import ContactResult
from asperity.quasistatic.make import make_block

NU = 0.3
ELASTIC = asp.Material(1.0, NU)
PLASTIC = asp.Material(1.0, NU, 0.005, 0.05)
FORMULATIONS = {
    "active set": asp.Formulation(),
    **{f"penalty, beta {beta:g}": asp.Formulation("penalty", beta) for beta in (1.0, 10.0, 100.0)},
    **{f"Nitsche, gamma {gamma:g}": asp.Formulation("nitsche", gamma=gamma) for gamma in (1.0, 10.0)},
}
HEAD = (
    "scene", "h_contact/L", "dofs", "formulation", "force %", "area %", "area bar %", "peak %", "Newton/step",
    "Krylov/Newton", "CPU s",
)  # fmt: skip
CAP, RADIUS = 1.0, 0.05  # radius of the sphere and of its contact [L]
AMPLITUDE, HEIGHT = 0.002, 2.0  # of the wave, half of which is on the block, and of its block [L]


def hertz(curve: asp.Curve) -> Floats:
    """Force, area and peak pressure (steps, 3); the walls add to the force, so the forces are those found."""
    law = reference.Hertz(CAP, reference.reduced_modulus(1.0, NU))
    depths = np.array([float(law.approach(4.0 * force)) for force in curve.force])
    return np.column_stack([curve.force, 0.25 * np.pi * law.radius(depths) ** 2, law.peak_pressure(depths)])


def westergaard(curve: asp.Curve) -> Floats:
    """The same of a wave on a high block."""
    wave = reference.Westergaard(AMPLITUDE, 2.0, reference.reduced_modulus(1.0, NU))
    compliance = HEIGHT / reference.block_modulus(1.0, NU)
    means = [
        brentq(lambda p, d=d: float(wave.approach(p)) + compliance * p - d, 0.0, wave.full_pressure, xtol=1e-18)
        for d in curve.delta
    ]
    return np.array([(p, float(wave.area_fraction(p)), float(wave.pressure(np.zeros(1), p)[0])) for p in means])


def found(curve: asp.Curve) -> Floats:
    """Force, area and peak pressure of a curve (steps, 3)."""
    return np.column_stack([curve.force, curve.area_fraction, curve.max_pressure])


@dataclass(frozen=True)
class Scene:
    """A surface pressed to a depth [L] in steps on meshes of some sizes; what is known follows from a finer one."""

    surface: asp.Surface
    material: asp.Material
    depth: float
    steps: int
    sizes: tuple[float, ...]
    finer: float
    known: Callable[[asp.Curve], Floats] = found
    height: float = 1.0

    def block(self, size: float) -> BlockMesh | None:
        """Mesh of a size."""
        elastic, size_of = asp.Material(1.0, 0.3), asp.MeshSize(size, growth=0.4)
        problem = asp.Problem.of(self.surface, elastic, delta_max=self.depth, height=self.height, size=size_of)
        return make_block(MPI.COMM_SELF, problem, self.depth)

    def planned(self, curve: asp.Curve) -> asp.Curve:
        """The planned steps of a curve, without those that were cut."""
        at = self.depth * np.arange(1, self.steps + 1) / self.steps
        return curve.where(np.any(np.isclose(curve.delta[:, None], at), axis=1))

    def press(self, block: BlockMesh | None, formulation: asp.Formulation) -> ContactResult:
        """Press it on a mesh."""
        return asp.solve_contact(
            self.surface, self.material, delta_max=self.depth, steps=self.steps, height=self.height, block=block,
            formulation=formulation,
        )  # fmt: skip


SPHERE = asp.Surface.from_spec("sphere", L=1.0, radius=CAP, centre=(0.0, 0.0), shape="paraboloid")
WAVE = asp.Surface.from_spec("sinusoid", L=1.0, amplitude=AMPLITUDE, wavelength=2.0, dims=1, centre=(0.0, 0.0))
FRACTAL = asp.Surface.from_spec("weierstrass-mandelbrot", L=1.0, D=2.4, G=1.36e-5)  # of cases/single.toml
SCENES = {
    "Hertz": Scene(SPHERE, ELASTIC, RADIUS**2, 2, (RADIUS / 3, RADIUS / 6), RADIUS / 16, hertz),
    "Westergaard": Scene(WAVE, ELASTIC, 1.5 * AMPLITUDE, 2, (0.12, 0.06), 0.06, westergaard, HEIGHT),
    "fractal, elastic": Scene(FRACTAL, ELASTIC, 0.03, 3, (0.06, 0.04), 0.02),
    "fractal, light": Scene(FRACTAL, ELASTIC, 0.0005, 1, (0.06,), 0.01),  # a few elements carry all
    "fractal, plastic": Scene(FRACTAL, PLASTIC, 0.03, 10, (0.08, 0.05), 0.03),
}


def row(scene: Scene, known: Floats, block: BlockMesh | None, name: str) -> list[str]:
    """Dofs, formulation, errors and costs; the message of one that does not converge."""
    start = process_time()
    try:
        result = scene.press(block, FORMULATIONS[name])
    except CheckError as refused:
        name, result = f"{name}, refused", refused.result
    except ConvergenceError as failure:
        return ["", name, str(failure), *[""] * (len(HEAD) - 5)]
    seconds, counts, curve = process_time() - start, result.counts, scene.planned(result.curve)
    errors = np.column_stack([found(curve) / known - 1.0, curve.error_area_fraction / curve.area_fraction])
    force, area, peak, bar = 100.0 * np.sqrt(np.mean(errors**2, axis=0))
    costs = counts.newton / scene.steps, counts.krylov / counts.newton, seconds
    cells = [f"{force:.2f}", f"{area:.1f}", f"{bar:.1f}", f"{peak:.2f}", *(f"{cost:.1f}" for cost in costs)]
    return [str(result.dofs), name, *cells]


def main(names: list[str]) -> None:
    """Print the table of some scenes."""
    warnings.simplefilter("ignore")
    print("| " + " | ".join(HEAD) + " |\n|" + "---|" * len(HEAD))
    for name in names or SCENES:
        scene = SCENES[name]
        known = scene.known(scene.planned(scene.press(scene.block(scene.finer), asp.Formulation()).curve))
        for size in scene.sizes:
            block = scene.block(size)
            for formulation in FORMULATIONS:
                print(
                    "| " + " | ".join([name, f"{size:.4g}", *row(scene, known, block, formulation)]) + " |", flush=True
                )


if __name__ == "__main__":
    main(sys.argv[1:])
