"""CalculiX: input deck from a mesh, and the force from its output.

Surface-to-surface penalty contact with a rigid plate, which is one element with all nodes prescribed. Without NLGEOM
CalculiX takes small strains, in plasticity too. Of its options those are taken that were fastest: C3D8, not C3D8I, and,
in small strain, conjugate gradients with incomplete Cholesky, not SPOOLES.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt
import scene

import asperity as asp
from asperity.arrays import Floats
from asperity.mesh.generate import build_block
from asperity.mesh.size_field import SizeField
from asperity.surface import Surface

Ints = npt.NDArray[np.int64]
Faces = list[tuple[int, ...]]
Mesh = tuple[Floats, Ints, str, Faces]  # points, cells, element and faces of a `Model`

STRESS = 200e3  # E in the deck [MPa], lengths in units of L
PENALTY = 10.0  # stiffness of the contact, times E over the size of the smallest elements on the top
FINEST = 0.2  # that of asperity's mesh over its size in the contact, around the summit
PLATE = [(-0.1, -0.1), (1.1, -0.1), (1.1, 1.1), (-0.1, 1.1)]
HEX_FACES: Faces = [(0, 1, 2, 3), (4, 7, 6, 5), (0, 4, 5, 1), (1, 5, 6, 2), (2, 6, 7, 3), (3, 7, 4, 0)]
TET_FACES: Faces = [(0, 1, 2), (0, 3, 1), (1, 3, 2), (2, 3, 0)]
GMSH_TO_C3D10 = [0, 1, 2, 3, 4, 5, 6, 7, 9, 8]  # the last two edges change places


@dataclass(frozen=True, eq=False)
class Model:
    """A solid with E in units of STRESS, lengths in units of L, pressed by a plate.

    Attributes:
        points: nodes (n, 3)
        cells: numbers of their nodes in the order of CalculiX
        element: its name there
        faces: corners of the faces of a cell, in the order of CalculiX
        on_top: whether a node lies on the surface to be touched (n,)
        held: nodes (n,) and prescribed displacement components, by the name of the set
        material: with E = 1
        depth: of the flat
        steps: greatest and first increment is one part of so many
        outputs: evenly spaced states that are written
        stiffness: of the contact, pressure over penetration
    """

    points: Floats
    cells: Ints
    element: str
    faces: Faces
    on_top: npt.NDArray[np.bool_]
    held: dict[str, tuple[npt.NDArray[np.bool_], str]]
    material: asp.Material
    depth: float
    steps: int
    outputs: int
    stiffness: float


def write_grid(path: Path, material: str, n: int, steps: int) -> int:
    """Deck of the scene with a structured mesh of n x n columns of bricks; returns its dofs."""
    nodes = scene.grid(n)
    mesh = nodes.reshape(-1, 3), scene.bricks(nodes), "C3D8", HEX_FACES
    return _write(path, mesh, scene.surface(), scene.MATERIALS[material], scene.DELTA, steps, 1.0 / n)


def write_own(path: Path, top: Surface, law: asp.Material, depth: float, steps: int, h: float) -> int:
    """Deck of the mesh that asperity makes for elements of size h in the contact; returns its dofs.

    Args:
        path: of the deck
        top: surface with side 1
        law: material with E = 1
        depth, steps: see `Model`
        h: size of the elements
    """
    block = build_block(top, 1.0, SizeField.of(top, depth, h).at)
    mesh = block.points, block.tets[:, GMSH_TO_C3D10], "C3D10", TET_FACES
    return _write(path, mesh, top, law, depth, steps, FINEST * h)


def _write(path: Path, mesh: Mesh, top: Surface, law: asp.Material, depth: float, steps: int, h: float) -> int:
    points, cells, element, faces = mesh
    x, y, z = points.T
    on_top = np.abs(z - 1.0 - top.height(x, y) + top.mean()) < 1e-9
    held, stiffness = rollers(x, y, z), PENALTY / h
    write(path, Model(points, cells, element, faces, on_top, held, law, depth, steps, scene.STEPS, stiffness))
    return 3 * len(points)


def rollers(x: Floats, y: Floats, z: Floats) -> dict[str, tuple[npt.NDArray[np.bool_], str]]:
    """Nodes that are held, see `Model`: a clamped base, sides on rollers."""
    return {
        "BASE": (np.abs(z) < 1e-12, "1, 3"),
        "XSIDES": (np.minimum(np.abs(x), np.abs(x - 1.0)) < 1e-12, "1"),
        "YSIDES": (np.minimum(np.abs(y), np.abs(y - 1.0)) < 1e-12, "2"),
    }


def write(path: Path, model: Model) -> None:
    """Deck of a model: the plate is one element over the summit, and moves down by the depth."""
    first, count = len(model.points) + 1, len(model.cells)
    summit = float(model.points[model.on_top, 2].max())
    plate = np.array([(a, b, summit + c) for c in (0.0, 0.1) for a, b in PLATE])
    with path.open("w", encoding="ascii") as deck:
        deck.write("*NODE, NSET=ALL\n" + rows(np.vstack([model.points, plate]), "%.12g"))
        deck.write(f"*ELEMENT, TYPE={model.element}, ELSET=BLOCK\n" + rows(model.cells + 1, "%d"))
        deck.write(f"*ELEMENT, TYPE=C3D8, ELSET=PLATE\n{count + 1}, ")
        deck.write(", ".join(str(first + k) for k in range(8)) + "\n")
        for name, chosen in {**{name: nodes for name, (nodes, _) in model.held.items()}, "TOP": model.on_top}.items():
            deck.write(f"*NSET, NSET={name}\n" + "".join(f"{k + 1},\n" for k in np.flatnonzero(chosen)))
        deck.write(f"*NSET, NSET=RIGID, GENERATE\n{first}, {first + 7}\n")
        deck.write("*SURFACE, NAME=ROUGH, TYPE=ELEMENT\n")
        for k, face in enumerate(model.faces):
            for cell in np.flatnonzero(model.on_top[model.cells[:, list(face)]].all(axis=1)):
                deck.write(f"{cell + 1}, S{k + 1}\n")
        deck.write(f"*SURFACE, NAME=FLAT, TYPE=ELEMENT\n{count + 1}, S1\n")
        deck.write(f"*MATERIAL, NAME=STEEL\n{law(model.material)}")
        deck.write(f"*MATERIAL, NAME=HARD\n{law(asp.Material(model.material.E, model.material.nu))}")
        deck.write("*SOLID SECTION, ELSET=PLATE, MATERIAL=HARD\n*SOLID SECTION, ELSET=BLOCK, MATERIAL=STEEL\n")
        deck.write(contact(model.stiffness, "ROUGH", "FLAT"))
        deck.write("*BOUNDARY\n" + "".join(f"{name}, {dofs}\n" for name, (_, dofs) in model.held.items()))
        deck.write("RIGID, 1, 2\n")
        deck.write(step(model.steps, model.outputs, f"RIGID, 3, 3, {-model.depth}\n", "RIGID"))


def contact(stiffness: float, first: str, second: str) -> str:
    """A pair of surfaces in contact, with the pressure over their penetration."""
    return (
        "*SURFACE INTERACTION, NAME=PENALTY\n*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=LINEAR\n"
        f"{stiffness * STRESS:.6g}\n"
        f"*CONTACT PAIR, INTERACTION=PENALTY, TYPE=SURFACE TO SURFACE\n{first}, {second}\n"
    )


def step(steps: int, outputs: int, moved: str, pushed: str) -> str:
    """A step whose greatest increment is one part of so many, and which writes the force on a set of nodes."""
    return (
        f"*TIME POINTS, NAME=STEPS, GENERATE\n{1 / outputs}, 1.0, {1 / outputs}\n"
        "*STEP, INC=10000\n*STATIC, SOLVER=ITERATIVE CHOLESKY\n"
        f"{1 / steps}, 1.0, 1e-6, {1 / steps}\n*BOUNDARY\n{moved}"
        f"*NODE PRINT, NSET={pushed}, TOTALS=ONLY, TIME POINTS=STEPS\nRF\n*END STEP\n"
    )


def law(material: asp.Material) -> str:
    """Elasticity, and linear hardening of the yield strength where there is one."""
    elastic = f"*ELASTIC\n{material.E * STRESS}, {material.nu}\n"
    if material.yield_strength is None:
        return elastic
    strength, modulus = material.yield_strength * STRESS, material.plastic_modulus * STRESS
    return f"{elastic}*PLASTIC\n{strength}, 0.0\n{strength + 10 * modulus}, 10.0\n"


def rows(values: np.ndarray, form: str) -> str:
    """Numbered rows of a table."""
    pattern = ", ".join(["%d"] + [form] * values.shape[1]) + "\n"
    return "".join(pattern % (k, *row) for k, row in enumerate(values.tolist(), 1))


def read(path: Path, outputs: int = scene.STEPS) -> list[float]:
    """Forces that a .dat file holds, one for each of the states written [E L^2]."""
    text = path.read_text(encoding="ascii") if path.exists() else ""
    found = re.findall(r"^ total force.*time\s+(\S+)\s+(?:\S+\s+){2}(\S+)", text, re.MULTILINE)
    forces = {round(float(time) * outputs, 6): -float(force) / STRESS for time, force in found}
    return [forces[k] for k in range(1, outputs + 1) if k in forces]
