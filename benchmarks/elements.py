# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

"""Which element carries contact: error of the force against dofs and CPU time, tetrahedra and hexahedra.

    ./run python3 benchmarks/elements.py [hertz] [elastic] [plastic]

The program's graded second-order tetrahedra are compared with structured hexahedra (hexahedra.py) on the same surface,
whose lines are as dense, in the plane and in depth, as the size field of the tetrahedra wants them somewhere along each
line. All carry exact contact at the nodes by an active set, take the same load steps (backward Euler) and solve their
systems to the same tolerances, the tetrahedra with the program's linear solver and kernels.

References: the layer theory of `asperity.verification.hertz` for the sphere, the limit of two finer guided tetrahedral
meshes for the demo surface; the limit of each element is printed next to it. Errors are relative root mean squares over
the load steps, seconds are CPU seconds of one process from surface to force, without start-up and compilation of forms.
"""

from __future__ import annotations

import argparse
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from time import process_time
from typing import Any

import numpy as np
from hexahedra import HEXAHEDRA, Hexahedra, lines

import asperity as asp
from asperity.adaptive.extrapolation import loading_force
from asperity.adaptive.mesh_plan import extrapolate
from asperity.arrays import Floats
from asperity.mesh.size_field import FirstContactMap
from asperity.model.load_path import BACKWARD_EULER
from asperity.surface import Surface
from asperity.verification.hertz import CONTACT, RADIUS, SPHERE, layer_force

ELASTIC = asp.Material(1.0, 0.3)
STEEL = asp.Material(1.0, 0.3, 0.005, 0.05)
GROWTH = 0.5  # of the coarsest hexahedra; the finer ones are finer everywhere, which pays with them


@dataclass(frozen=True)
class Scene:
    """What is pressed by steps of equal size, the force that is known, and the element sizes; L = E = 1."""

    surface: Surface
    material: asp.Material
    delta: float
    steps: int
    limit: Callable[[Scene], Floats]
    sizes: dict[str, tuple[float, ...]]

    @property
    def at(self) -> Floats:
        """Approaches of the steps."""
        return self.delta * np.arange(1, self.steps + 1) / self.steps


def tetrahedra(scene: Scene, h: float, reach: FirstContactMap | None = None) -> tuple[Floats, Any]:
    """Force of the program at the load steps, and its whole result."""
    result = asp.solve_contact(
        scene.surface, scene.material, delta_max=scene.delta, steps=scene.steps, height=1.0,
        size=asp.MeshSize(h, reach=reach), integrator=BACKWARD_EULER,
    )  # fmt: skip
    return loading_force(result.curve, scene.at) * ELASTIC.reduced_modulus, result


def measure(name: str, scene: Scene, h: float) -> tuple[Floats, int, float]:
    """Force at the load steps, dofs and CPU seconds of an element at one size."""
    start = process_time()
    if name in HEXAHEDRA:
        corners = lines(scene.surface, scene.delta, h, GROWTH * h / scene.sizes[name][0])
        block = Hexahedra(scene.surface, scene.material, HEXAHEDRA[name], corners)
        force, dofs = block.press(scene.at), block.dofs
    else:
        force, result = tetrahedra(scene, h)
        dofs = result.dofs
    return force, dofs, process_time() - start


def layer_limit(scene: Scene) -> Floats:
    """Force of the layer theory, extrapolated with its second order."""
    force, error = layer_force(scene.at, 1024)
    print(f"layer theory: 512 and 1024 cells a side differ by {100 * error.max():.2g} %")
    return force * ELASTIC.reduced_modulus


def guided_limit(scene: Scene, fine: float) -> Floats:
    """Limit of two fine tetrahedral meshes that are guided by what a coarse one touches."""
    reach = FirstContactMap(*tetrahedra(scene, 0.1)[1].touched_at())
    coarser, finest = (tetrahedra(scene, h, reach)[0] for h in (fine * 2**0.5, fine))
    limit, error = extrapolate(coarser, finest, 2**0.5, 1.8)
    print(f"guided meshes: the limit is {100 * np.max(np.abs(error / limit)):.2g} % from the finer one at most")
    return limit


def scenes() -> dict[str, Scene]:
    """The three scenes."""
    rough = Surface.from_spec(kind="weierstrass-mandelbrot", L=1.0, D=2.4, G=1.36e-5)
    hertz = {
        "P2": (0.04, 0.028, 0.02, 0.014, 0.01), "Q1": (0.03, 0.021, 0.015), "Q1 SRI": (0.03, 0.021, 0.015),
        "Q2": (0.08, 0.056),
    }  # fmt: skip
    demo = {
        "P2": (0.2, 0.14, 0.1, 0.07, 0.05), "Q1": (0.1, 0.07), "Q1 SRI": (0.1, 0.07, 0.05), "Q2": (0.2, 0.14),
    }  # fmt: skip
    plastic = {"P2": (0.14, 0.1, 0.07), "Q1": (0.1,), "Q1 SRI": (0.1, 0.07), "Q2": (0.2,)}
    return {
        "hertz": Scene(SPHERE, ELASTIC, CONTACT**2 / RADIUS, 5, layer_limit, hertz),
        "elastic": Scene(rough, ELASTIC, 0.03, 10, partial(guided_limit, fine=0.025), demo),
        "plastic": Scene(rough, STEEL, 0.03, 10, partial(guided_limit, fine=0.05), plastic),
    }


def compile_forms(scene: Scene) -> None:
    """Compile the forms of all elements, so that the seconds are without."""
    flat = Scene(Surface.from_spec(kind="flat", L=1.0), scene.material, 1e-3, 2, scene.limit, {})
    thirds = np.array([0.0, 1.0 / 3.0, 2.0 / 3.0, 1.0])
    for element in HEXAHEDRA.values():
        Hexahedra(flat.surface, flat.material, element, (thirds, thirds, thirds)).press(flat.at)
    tetrahedra(flat, 0.5)


def table(name: str, scene: Scene) -> list[tuple[str, int, float, float]]:
    """Print the rows of a scene: element, dofs, CPU seconds, rms error in per cent."""
    limit = scene.limit(scene)
    compile_forms(scene)
    print("| scene | element | h_contact/L | dofs | rms error % | last step % | CPU s |\n|" + "---|" * 7)
    out = []
    for element, sizes in scene.sizes.items():
        forces = []
        for h in sizes:
            force, dofs, seconds = measure(element, scene, h)
            forces.append(force)
            error = 100.0 * (force / limit - 1.0)
            out.append((element, dofs, seconds, float(np.sqrt(np.mean(error**2)))))
            print(
                f"| {name} | {element} | {h:g} | {dofs} | {out[-1][3]:.2f} | {error[-1]:+.2f} | {seconds:.1f} |",
                flush=True,
            )
        if len(sizes) < 2:
            continue
        own, _ = extrapolate(forces[-2], forces[-1], sizes[-2] / sizes[-1], 2.0)
        away = 100.0 * np.sqrt(np.mean((own / limit - 1.0) ** 2))
        print(f"limit of {element} (order 2) against the reference: {away:.2f} % rms", flush=True)
    return out


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("names", nargs="*", default=list(scenes()))
    warnings.simplefilter("ignore")
    for name in parser.parse_args().names:
        table(name, scenes()[name])


if __name__ == "__main__":
    main()
