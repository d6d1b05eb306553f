# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

"""CalculiX: input deck from a mesh, and the force from its output.

Surface-to-surface penalty contact with a rigid plate, which is one element with all nodes prescribed. Without NLGEOM
CalculiX takes small strains, in plasticity too. Of its options those are taken that were fastest: C3D8 (0.4 of the
time of C3D8I) and conjugate gradients with incomplete Cholesky (0.6 of that of SPOOLES).
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import numpy.typing as npt
import scene

from asperity.arrays import Floats
from asperity.mesh.generate import build_block
from asperity.mesh.size_field import SizeField

Ints = npt.NDArray[np.int64]
Faces = list[tuple[int, ...]]

STRESS = 200e3  # E in the deck [MPa], lengths in units of L
PENALTY = 10.0  # stiffness of the contact, times E over the size of the smallest elements on the top
FINEST = 0.2  # that of asperity's mesh over its size in the contact, around the summit
PLATE = [(-0.1, -0.1), (1.1, -0.1), (1.1, 1.1), (-0.1, 1.1)]
HEX_FACES: Faces = [(0, 1, 2, 3), (4, 7, 6, 5), (0, 4, 5, 1), (1, 5, 6, 2), (2, 6, 7, 3), (3, 7, 4, 0)]
TET_FACES: Faces = [(0, 1, 2), (0, 3, 1), (1, 3, 2), (2, 3, 0)]
GMSH_TO_C3D10 = [0, 1, 2, 3, 4, 5, 6, 7, 9, 8]  # the last two edges change places


def write_grid(path: Path, material: str, n: int, steps: int) -> int:
    """Deck of a structured mesh of n x n columns of bricks; returns its dofs."""
    nodes = scene.grid(n)
    return _write(path, material, nodes.reshape(-1, 3), scene.bricks(nodes), "C3D8", HEX_FACES, 1.0 / n, steps)


def write_own(path: Path, material: str, h: float, steps: int) -> int:
    """Deck of the mesh that asperity makes for elements of size h in the contact; returns its dofs."""
    top = scene.surface()
    block = build_block(top, 1.0, SizeField.of(top, scene.DELTA, h).at)
    return _write(path, material, block.points, block.tets[:, GMSH_TO_C3D10], "C3D10", TET_FACES, FINEST * h, steps)


def _write(
    path: Path, material: str, points: Floats, cells: Ints, element: str, faces: Faces, h: float, steps: int
) -> int:
    top = scene.surface()
    x, y, z = points.T
    on_top = np.abs(z - 1.0 - top.height(x, y) + top.mean()) < 1e-9
    summit = float(z.max())
    plate = np.array([(a, b, summit + c) for c in (0.0, 0.1) for a, b in PLATE])
    first = len(points) + 1
    with path.open("w", encoding="ascii") as deck:
        deck.write("*NODE, NSET=ALL\n" + _rows(np.vstack([points, plate]), "%.12g"))
        deck.write(f"*ELEMENT, TYPE={element}, ELSET=BLOCK\n" + _rows(cells + 1, "%d"))
        deck.write(f"*ELEMENT, TYPE=C3D8, ELSET=PLATE\n{len(cells) + 1}, ")
        deck.write(", ".join(str(first + k) for k in range(8)) + "\n")
        for name, chosen in {
            "BASE": np.abs(z) < 1e-12,
            "XSIDES": np.minimum(np.abs(x), np.abs(x - 1.0)) < 1e-12,
            "YSIDES": np.minimum(np.abs(y), np.abs(y - 1.0)) < 1e-12,
        }.items():
            deck.write(f"*NSET, NSET={name}\n" + "".join(f"{k + 1},\n" for k in np.flatnonzero(chosen)))
        deck.write(f"*NSET, NSET=RIGID, GENERATE\n{first}, {first + 7}\n")
        deck.write("*SURFACE, NAME=ROUGH, TYPE=ELEMENT\n")
        for k, face in enumerate(faces):
            for cell in np.flatnonzero(on_top[cells[:, list(face)]].all(axis=1)):
                deck.write(f"{cell + 1}, S{k + 1}\n")
        deck.write(f"*SURFACE, NAME=FLAT, TYPE=ELEMENT\n{len(cells) + 1}, S1\n")
        deck.write(f"*MATERIAL, NAME=STEEL\n*ELASTIC\n{scene.E * STRESS}, {scene.NU}\n")
        deck.write(f"*MATERIAL, NAME=HARD\n*ELASTIC\n{scene.E * STRESS}, {scene.NU}\n")
        deck.write("*SOLID SECTION, ELSET=PLATE, MATERIAL=HARD\n*SOLID SECTION, ELSET=BLOCK, MATERIAL=STEEL\n")
        stiffness = PENALTY * scene.E * STRESS / h
        deck.write("*SURFACE INTERACTION, NAME=PENALTY\n*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=LINEAR\n")
        deck.write(f"{stiffness:.6g}\n")
        deck.write("*CONTACT PAIR, INTERACTION=PENALTY, TYPE=SURFACE TO SURFACE\nROUGH, FLAT\n")
        deck.write("*BOUNDARY\nBASE, 1, 3\nXSIDES, 1\nYSIDES, 2\nRIGID, 1, 2\n")
        deck.write("*TIME POINTS, NAME=STEPS, GENERATE\n0.1, 1.0, 0.1\n")
        deck.write(f"*STEP, INC=10000\n*STATIC, SOLVER=ITERATIVE CHOLESKY\n{1 / steps}, 1.0, 1e-6, {1 / steps}\n")
        deck.write(f"*BOUNDARY\nRIGID, 3, 3, {-scene.DELTA}\n")
        deck.write("*NODE PRINT, NSET=RIGID, TOTALS=ONLY, TIME POINTS=STEPS\nRF\n*END STEP\n")
    if material == "plastic":
        hard = f"*PLASTIC\n{scene.YIELD * STRESS}, 0.0\n{(scene.YIELD + 10 * scene.HARDENING) * STRESS}, 10.0\n"
        text = path.read_text(encoding="ascii")
        path.write_text(text.replace("*MATERIAL, NAME=HARD", hard + "*MATERIAL, NAME=HARD"), encoding="ascii")
    return 3 * len(points)


def _rows(values: np.ndarray, form: str) -> str:
    """Numbered rows of a table."""
    pattern = ", ".join(["%d"] + [form] * values.shape[1]) + "\n"
    return "".join(pattern % (k, *row) for k, row in enumerate(values.tolist(), 1))


def read(path: Path) -> list[float]:
    """Forces that a .dat file holds, one for each of the steps done [E L^2]."""
    text = path.read_text(encoding="ascii") if path.exists() else ""
    found = re.findall(r"time\s+(\S+)\s+(?:\S+\s+){2}(\S+)", text)
    forces = {round(float(time) * scene.STEPS, 6): -float(force) / STRESS for time, force in found}
    return [forces[k] for k in range(1, scene.STEPS + 1) if k in forces]
