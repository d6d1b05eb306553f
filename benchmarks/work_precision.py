# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

"""Work against precision: error of the force against CPU time for each choice the program offers.

    ./run python3 benchmarks/work_precision.py [hertz] [elastic] [plastic]

Scenes: a paraboloid against the elastic layer it is on (Hertz with the block's compliance, solved by boundary
elements, `reference.layer_force`), and the demo surface, elastic and elastic-plastic, against the extrapolated limit
of finer guided meshes (and load steps). Prints Markdown tables, which `pictures.py` draws. Errors are root mean
squares over the path, relative to the force at each approach; seconds are CPU seconds of one process, from surface
to curve, without start-up; the limit of the demo scenes is the program's own, so below some 0.1 % it is no judge.
"""

from __future__ import annotations

import argparse
import warnings
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from functools import partial
from time import process_time
from typing import Any

import numpy as np

import asperity as asp
from asperity.adaptive.extrapolation import loading_force
from asperity.adaptive.mesh_plan import extrapolate
from asperity.arrays import Floats
from asperity.mesh.size_field import FirstContactMap
from asperity.surface import Surface
from asperity.verification.hertz import CONTACT, RADIUS, SPHERE, layer_force

ELASTIC = asp.Material(1.0, 0.3)
STEEL = asp.Material(1.0, 0.3, 0.005, 0.05)
ORDER = 1.8  # of the force in the element size, for the limit


@dataclass(frozen=True)
class Scene:
    """What is pressed, how far, and what the force is.

    Attributes:
        surface, material, delta, steps, height: L = E = 1
        at: approaches compared (n,)
        limit: force there, P* (n,)
        sizes: elements in the contact, coarse to fine
    """

    name: str
    surface: Surface
    material: asp.Material
    delta: float
    steps: int
    at: Floats
    limit: Callable[[], Floats]
    sizes: tuple[float, ...]
    height: float = 1.0


@dataclass(frozen=True)
class Choice:
    """A variant: what is changed from the defaults."""

    name: str
    settings: dict[str, Any] = field(default_factory=dict)
    size: Callable[[float], asp.MeshSize] = asp.MeshSize
    guided: bool = False
    plastic_only: bool = False


def uniform(h: float) -> asp.MeshSize:
    """The same size everywhere."""
    return asp.MeshSize(h, growth=1e-6, h_max=h)


CHOICES = (
    Choice("default: active set, graded mesh"),
    Choice("guided mesh", guided=True),
    Choice("uniform mesh", size=uniform),
    Choice("penalty, factor 10", {"formulation": asp.Formulation("penalty", 10.0)}),
    Choice("penalty, factor 100", {"formulation": asp.Formulation("penalty", 100.0)}),
    Choice("Nitsche, theta 0", {"formulation": asp.Formulation("nitsche")}),
    Choice("UFL kernels", {"kernels": "ufl"}),
    Choice("backward Euler", {"integrator": "backward-euler"}, plastic_only=True),
)


def solve(scene: Scene, size: asp.MeshSize, **settings: Any) -> tuple[Floats, Any]:
    """Force at the approaches compared."""
    settings = {"steps": scene.steps} | settings
    result = asp.solve_contact(
        scene.surface, scene.material, delta_max=scene.delta, height=scene.height, size=size, **settings
    )
    return loading_force(result.curve, scene.at), result


def reach_of(scene: Scene) -> FirstContactMap:
    """What a coarse solution touches."""
    return FirstContactMap(*solve(scene, asp.MeshSize(0.1))[1].touched_at())


def guided_limit(scene: Scene, fine: float, steps: int) -> Floats:
    """Richardson's limit of two guided meshes, and of the load steps on the coarser one."""
    reach = reach_of(scene)
    coarser, finest = (solve(scene, asp.MeshSize(h, reach=reach))[0] for h in (fine * 2**0.5, fine))
    limit, _ = extrapolate(coarser, finest, 2**0.5, ORDER)
    if scene.material.plastic:
        coarse = [solve(scene, asp.MeshSize(0.14), steps=n)[0] for n in (scene.steps, steps, 2 * steps)]
        settled, _ = extrapolate(coarse[1], coarse[2], 2.0, 2.0)
        limit *= settled / coarse[0]
    return limit


def layer_limit(at: Floats) -> Floats:
    """Force on an elastic layer by boundary elements."""
    return layer_force(at, 512)[0]


def scenes() -> Iterator[Scene]:
    """The three scenes."""
    depth = CONTACT**2 / RADIUS
    at = np.array([depth * k / 5 for k in range(1, 6)])
    yield Scene("hertz", SPHERE, ELASTIC, depth, 5, at, partial(layer_limit, at), (0.04, 0.028, 0.02, 0.014, 0.01))
    rough = Surface.from_spec(kind="weierstrass-mandelbrot", L=1.0, D=2.4, G=1.36e-5)
    at = np.array([0.003 * k for k in range(1, 11)])
    for name, material, fine, sizes in (
        ("elastic", ELASTIC, 0.018, (0.2, 0.14, 0.1, 0.07, 0.05, 0.035)),
        ("plastic", STEEL, 0.028, (0.2, 0.14, 0.1, 0.07, 0.05)),
    ):
        scene = Scene(name, rough, material, 0.03, 10, at, lambda: at, sizes)
        yield Scene(name, rough, material, 0.03, 10, at, partial(guided_limit, scene, fine, 40), sizes)


def measure(scene: Scene) -> None:
    """Print choice, h, dofs, CPU seconds and rms error in per cent of every run."""
    limit = scene.limit()
    for choice in CHOICES:
        if choice.plastic_only and not scene.material.plastic:
            continue
        for h in scene.sizes:
            if h < 0.19 and choice.name == "uniform mesh":
                continue  # millions of dofs
            start = process_time()
            reach = reach_of(scene) if choice.guided else None
            size = asp.MeshSize(h, reach=reach) if choice.guided else choice.size(h)
            force, result = solve(scene, size, **choice.settings)
            seconds = process_time() - start
            error = 100.0 * float(np.sqrt(np.mean((force / limit - 1.0) ** 2)))
            print(f"| {scene.name} | {choice.name} | {h:g} | {result.dofs} | {seconds:.1f} | {error:.2f} |", flush=True)


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("names", nargs="*", default=["hertz", "elastic", "plastic"])
    arguments = parser.parse_args()
    warnings.simplefilter("ignore")
    chosen = [scene for scene in scenes() if scene.name in arguments.names]
    solve(chosen[0], asp.MeshSize(0.2))  # what is loaded at first use is start-up too
    print("| scene | choice | h | dofs | CPU s | rms error % |\n|---|---|---|---|---|---|")
    for scene in chosen:
        measure(scene)


if __name__ == "__main__":
    main()
