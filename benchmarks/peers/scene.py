"""The scene all programs compute, and what its force is.

The surface of cases/demo.toml stands on a block of side and height 1 (E = 1 in the unit of stress of each program),
base clamped, sides on rollers, and is pressed by a rigid frictionless flat from first touch to 0.03 L in ten steps, in
small strains.
"""

from __future__ import annotations

import json
import warnings
from pathlib import Path

import numpy as np
import numpy.typing as npt

import asperity as asp
from asperity.accuracy import Goal, loading_force, solve_to_tolerance
from asperity.surface import Surface

Floats = npt.NDArray[np.float64]

DELTA, STEPS = 0.03, 10
AT = DELTA * np.arange(1, STEPS + 1) / STEPS  # deflections compared [L]
E, NU, YIELD, TANGENT = 1.0, 0.3, 0.005, 0.05  # of cases/demo.toml over its E = 200 GPa
HARDENING = E * TANGENT / (E - TANGENT)  # of the yield strength with the plastic strain
MATERIALS = {"elastic": asp.Material(E, NU), "plastic": asp.Material(E, NU, YIELD, TANGENT)}
TOLERANCE = {"elastic": 0.002, "plastic": 0.004}  # of the reference: greatest error bar


def surface() -> Surface:
    """The fractal surface with side 1."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return Surface.from_spec(kind="weierstrass-mandelbrot", L=1.0, D=2.4, G=1.36e-5)


def reference(material: str, folder: Path) -> tuple[Floats, float]:
    """Force at the deflections AT [E L^2] and the greatest relative error bar, kept in a file of the folder."""
    file = folder / f"reference-{material}.json"
    if not file.exists():
        goal = Goal(TOLERANCE[material])
        found = solve_to_tolerance(surface(), MATERIALS[material], goal, delta_max=DELTA, steps=STEPS)
        modulus = MATERIALS[material].reduced_modulus
        kept = {
            "force": (loading_force(found.curve, AT) * modulus).tolist(),
            "bar": found.worst,
            "dofs": [level.dofs for level in found.levels],
            "steps": found.levels[-1].steps,
        }
        file.write_text(json.dumps(kept, indent=1) + "\n", encoding="utf-8")
    kept = json.loads(file.read_text(encoding="utf-8"))
    return np.array(kept["force"]), kept["bar"]


def grid(n: int, growth: float = 1.4, largest: float = 0.125) -> tuple[Floats, npt.NDArray[np.int64]]:
    """Structured mesh of the block as one makes it by hand: n x n columns, layers that grow with the depth.

    The nodes are moved vertically onto the surface, less and less towards the base.

    Args:
        n: elements along a side; the upmost layer is as high as they are wide
        growth: of the height from layer to layer
        largest: height of a layer

    Returns:
        nodes (N, 3) and hexahedra (M, 8): lower face anticlockwise from above, then the upper one
    """
    heights = [1.0 / n]
    while sum(heights) < 1.0:
        heights.append(min(heights[-1] * growth, largest))
    z = np.cumsum([0.0, *heights[::-1]]) / sum(heights)
    t = np.linspace(0.0, 1.0, n + 1)
    top = surface()
    x, y = np.meshgrid(t, t, indexing="ij")
    f = top.height(x, y) - top.mean()
    points = np.stack(
        [np.broadcast_to(a, (n + 1, n + 1, len(z))) for a in (x[..., None], y[..., None], z * (1.0 + f[..., None]))], -1
    )
    number = np.arange(points.size // 3).reshape(points.shape[:3])
    corners = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)]
    sizes = n, n, len(z) - 1
    cells = np.stack(
        [number[tuple(slice(k, k + s) for k, s in zip(c, sizes, strict=True))].ravel() for c in corners], axis=-1
    )
    return points.reshape(-1, 3), cells
