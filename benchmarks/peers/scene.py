"""The scene that all programs compute; started, asperity's run of it in a process of its own.

    python3 scene.py MATERIAL size H STEPS OUT.json        the default mesh with elements of size H in the contact
    python3 scene.py MATERIAL tolerance T STEPS OUT.json   driven by a tolerance on the force

The surface of cases/single.toml is on a block of side and height 1 (E = 1 in the unit of stress of each program),
base clamped, sides on rollers, and is pressed by a rigid frictionless flat from first touch to 0.03 L in ten steps, in
small strains.
"""

from __future__ import annotations

import json
import sys
import warnings
from typing import Any

import numpy as np
import numpy.typing as npt

import asperity as asp
from asperity.adaptive.loading import loading_force
from asperity.arrays import Floats
from asperity.surface import Surface

DELTA, STEPS = 0.03, 10
AT = DELTA * np.arange(1, STEPS + 1) / STEPS  # approaches compared [L]
E, NU, YIELD, TANGENT = 1.0, 0.3, 0.005, 0.05  # of cases/single.toml over its E = 200 GPa
MATERIALS = {"elastic": asp.Material(E, NU), "plastic": asp.Material(E, NU, YIELD, TANGENT)}


def surface() -> Surface:
    """The fractal surface with side 1."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return Surface.from_spec(kind="weierstrass-mandelbrot", L=1.0, D=2.4, G=1.36e-5)


def grid(n: int, growth: float = 1.4, largest: float = 0.125) -> Floats:
    """Nodes of a structured mesh of the block as one makes it by hand: n x n columns, layers that grow with the depth.

    They are moved vertically to put the top on the surface, less and less towards the base.

    Args:
        n: elements along a side; the upmost layer is as high as they are wide
        growth: of the height from layer to layer
        largest: height of a layer

    Returns:
        (n + 1, n + 1, layers + 1, 3)
    """
    heights = [1.0 / n]
    while sum(heights) < 1.0:
        heights.append(min(heights[-1] * growth, largest))
    z = np.cumsum([0.0, *heights[::-1]])
    z /= z[-1]
    t = np.linspace(0.0, 1.0, n + 1)
    top = surface()
    x, y = (a[..., None] for a in np.meshgrid(t, t, indexing="ij"))
    return np.stack(np.broadcast_arrays(x, y, z * (1.0 + top.height(x, y) - top.mean())), axis=-1)


def bricks(nodes: Floats) -> npt.NDArray[np.int64]:
    """Numbers of the corners of the elements of a grid: the lower face anticlockwise from above, then the upper one."""
    number = np.arange(nodes.size // 3).reshape(nodes.shape[:3])
    low, high = slice(None, -1), slice(1, None)
    face = ((low, low), (high, low), (high, high), (low, high))
    return np.stack([number[i, j, k].ravel() for k in (low, high) for i, j in face], axis=-1)


def main(material: str, by: str, value: str, steps: str, target: str) -> None:
    """Press the surface; forces, dofs and the greatest error bar, where there is one, in a file."""
    law = MATERIALS[material]
    path: dict[str, Any] = {"delta_max": DELTA, "steps": int(steps)}
    if by == "size":
        result = asp.solve_contact(surface(), law, size=asp.MeshSize(float(value)), **path)
        curve, dofs, bar = result.curve, result.dofs, None
    else:
        goal = asp.AccuracyTarget(float(value), max_dofs=2_000_000)
        found = asp.solve_contact(surface(), law, tolerance=goal, **path)
        curve, dofs, bar = found.curve, found.contact.dofs, found.verdict.force
    force = loading_force(curve, AT) * law.reduced_modulus
    with open(target, "w", encoding="ascii") as out:
        json.dump({"force": force.tolist(), "dofs": dofs, "bar": bar}, out)


if __name__ == "__main__":
    main(*sys.argv[1:])
