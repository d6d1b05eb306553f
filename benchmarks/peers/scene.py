"""The scene all programs compute, and what its force is.

The surface of cases/single.toml is on a block of side and height 1 (E = 1 in the unit of stress of each program),
base clamped, sides on rollers, and is pressed by a rigid frictionless flat from first touch to 0.03 L in ten steps, in
small strains.
"""

from __future__ import annotations

import json
import subprocess
import sys
import warnings
from pathlib import Path

import numpy as np
import numpy.typing as npt

import asperity as asp
from asperity.adaptive.extrapolation import loading_force
from asperity.adaptive.solve_contact import solve_contact
from asperity.arrays import Floats
from asperity.model.settings import AccuracyTarget
from asperity.surface import Surface

DELTA, STEPS = 0.03, 10
AT = DELTA * np.arange(1, STEPS + 1) / STEPS  # approaches compared [L]
E, NU, YIELD, TANGENT = 1.0, 0.3, 0.005, 0.05  # of cases/single.toml over its E = 200 GPa
MATERIALS = {"elastic": asp.Material(E, NU), "plastic": asp.Material(E, NU, YIELD, TANGENT)}
TOLERANCE = {"elastic": 0.002, "plastic": 0.007}  # of the reference: greatest error bar


def surface() -> Surface:
    """The fractal surface with side 1."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return Surface.from_spec(kind="weierstrass-mandelbrot", L=1.0, D=2.4, G=1.36e-5)


def reference(material: str, folder: Path) -> tuple[Floats, float]:
    """Force at the approaches AT [E L^2] and the greatest relative error bar, kept in a file of the folder."""
    file = folder / f"reference-{material}.json"
    if not file.exists():
        # in a process of its own: the memory of a child is measured from that of its parent on
        subprocess.run([sys.executable, __file__, material, str(file)], check=True)
    kept = json.loads(file.read_text(encoding="utf-8"))
    return np.array(kept["force"]), kept["bar"]


def compute_reference(material: str, file: str) -> None:
    """Write the force and its error bar."""
    goal = AccuracyTarget(TOLERANCE[material])
    found = solve_contact(surface(), MATERIALS[material], tolerance=goal, delta_max=DELTA, steps=STEPS)
    modulus = MATERIALS[material].reduced_modulus
    kept = {
        "force": (loading_force(found.curve, AT) * modulus).tolist(),
        "bar": found.worst,
        "dofs": [level.dofs for level in found.levels],
        "substeps": found.levels[-1].substeps,
    }
    Path(file).write_text(json.dumps(kept, indent=1) + "\n", encoding="utf-8")


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


if __name__ == "__main__":
    compute_reference(*sys.argv[1:])
