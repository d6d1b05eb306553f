"""Two rough blocks of one metal in CalculiX, against the one block of `asp.equivalent_block` there.

Both are meshed alike, so what differs is the model: half the modulus under the sum of the heights.

    python benchmarks/peers/two_bodies.py      # a quarter of an hour; needs benchmarks/peers/install
"""

from __future__ import annotations

import sys
import tempfile
from dataclasses import replace
from pathlib import Path

import calculix
import numpy as np
import scene
from programs import timed
from unpacked import inside

import asperity as asp
from asperity.arrays import Floats
from asperity.model.joint import equivalent_block
from asperity.surface import Surface

N, DEPTH, STEPS = 16, 0.02, 5  # elements along a side, approach of the bodies [L], states that are compared
LIMIT = 3600.0  # CPU seconds of a run
METAL = scene.MATERIALS["plastic"]
HARDER = replace(METAL, yield_strength=2.0 * scene.YIELD)
PAIRS = {
    "elastic": (scene.MATERIALS["elastic"], scene.MATERIALS["elastic"]),
    "yielding": (METAL, METAL),
    "without hardening": 2 * (replace(METAL, tangent_modulus=0.0),),
    "unlike": (METAL, HARDER),
}


def rough(seed: int) -> Surface:
    """One of the two surfaces: eight elements to the shortest wave."""
    return Surface.from_spec("self-affine", L=1.0, H=0.8, rms_slope=0.05, lambda_short=0.5, seed=seed)


def flat_grid(n: int) -> Floats:
    """Nodes of `scene.grid` before they are moved onto a surface."""
    nodes = scene.grid(n)
    nodes[..., 2] *= 1.0 / nodes[:, :, -1:, 2]
    return nodes


def lifted(nodes: Floats, heights: Floats) -> Floats:
    """The same with heights on the top, less and less towards the base."""
    out = nodes.copy()
    out[..., 2] *= 1.0 + heights[..., None]
    return out


def one_block(path: Path, nodes: Floats, heights: Floats, material: asp.Material, stiffness: float) -> None:
    """Deck of a block under a rigid flat."""
    points = lifted(nodes, heights).reshape(-1, 3)
    x, y, z = nodes.reshape(-1, 3).T
    model = calculix.Model(
        points, scene.bricks(nodes), "C3D8", calculix.HEX_FACES, z > 1.0 - 1e-9, calculix.rollers(x, y, z), material,
        DEPTH, 4 * STEPS, STEPS, stiffness,
    )  # fmt: skip
    calculix.write(path, model)


def two_blocks(
    path: Path, nodes: Floats, heights: tuple[Floats, Floats], materials: tuple[asp.Material, ...], stiffness: float
) -> None:
    """Deck of the two blocks; the second stands on its head and its base moves down."""
    below, above = (lifted(nodes, h).reshape(-1, 3) for h in heights)
    above[:, 0] = 1.0 - above[:, 0]  # turned over, as it lies on the first
    above[:, 2] = 2.0 + float(np.max(heights[0] + heights[1][::-1])) - above[:, 2]
    cells, n = scene.bricks(nodes), len(below)
    x, y, z = nodes.reshape(-1, 3).T
    top = z > 1.0 - 1e-9
    faces = np.flatnonzero(top[cells].sum(axis=1) == 4) + 1
    with path.open("w", encoding="ascii") as deck:
        deck.write("*NODE, NSET=ALL\n" + calculix.rows(np.vstack([below, above]), "%.12g"))
        for k, (name, material) in enumerate(zip(("LOW", "HIGH"), materials, strict=True)):
            numbers = cells + 1 + k * n
            table = calculix.rows(numbers, "%d").splitlines()
            deck.write(f"*ELEMENT, TYPE=C3D8, ELSET={name}\n")
            deck.writelines(f"{i + 1 + k * len(cells)},{row.partition(',')[2]}\n" for i, row in enumerate(table))
            for held, (chosen, _) in calculix.rollers(x, y, z).items():
                deck.write(f"*NSET, NSET={name}{held}\n")
                deck.writelines(f"{i + 1 + k * n},\n" for i in np.flatnonzero(chosen))
            deck.write(f"*SURFACE, NAME={name}FACE, TYPE=ELEMENT\n")
            deck.writelines(f"{i + k * len(cells)}, S2\n" for i in faces)
            deck.write(f"*MATERIAL, NAME={name}\n{calculix.law(material)}")
            deck.write(f"*SOLID SECTION, ELSET={name}, MATERIAL={name}\n")
        deck.write(calculix.contact(stiffness, "LOWFACE", "HIGHFACE") + "*BOUNDARY\n")
        deck.write("LOWBASE, 1, 3\nHIGHBASE, 1, 2\n")
        deck.writelines(f"{name}{side}SIDES, {i}\n" for name in ("LOW", "HIGH") for i, side in ((1, "X"), (2, "Y")))
        deck.write(calculix.step(4 * STEPS, STEPS, f"HIGHBASE, 3, 3, {-DEPTH}\n", "HIGHBASE"))


def forces(path: Path) -> Floats:
    """Run a deck; the force at each state [E L^2]."""
    command, environment = inside("bookworm", "usr/bin/ccx")
    used = timed([*command, path.stem], environment, path.parent, LIMIT)
    found = np.array(calculix.read(path.with_suffix(".dat"), STEPS))
    print(f"# {path.stem}: {used.ended}, {used.cpu:.0f} CPU s", file=sys.stderr, flush=True)
    return np.pad(found, (0, STEPS - len(found)), constant_values=np.nan)


def main() -> None:
    nodes = flat_grid(N)
    x, y = nodes[:, :, -1, 0], nodes[:, :, -1, 1]
    first, second = rough(1), rough(2)
    z = first.height(x, y) - first.mean(), second.height(x, y) - second.mean()
    sums = z[0] + (second.height(1.0 - x, y) - second.mean())
    stiffness = calculix.PENALTY * N
    print("pair,force over E L^2,one block less two %")
    with tempfile.TemporaryDirectory(prefix="asperity-") as folder:
        for name, pair in PAIRS.items():
            material, _ = equivalent_block(pair[0], pair[0], (1.0, 1.0), nu=scene.NU)
            one, two = (Path(folder) / f"{name.replace(' ', '-')}-{k}.inp" for k in (1, 2))
            one_block(one, nodes, sums, material, stiffness)
            two_blocks(two, nodes, z, pair, stiffness)
            a, b = forces(one), forces(two)
            for force, change in zip(b, 100.0 * (a / b - 1.0), strict=True):
                print(f"{name},{force:.5g},{change:+.2f}", flush=True)


if __name__ == "__main__":
    main()
