"""The rough block of the demo as asperity exports it, read back by gmsh and pressed by CalculiX, as a Markdown table.

    benchmarks/peers/install                      # once
    ./run python3 benchmarks/peers/block.py [SIZE]

The case is in units of the side and of MPa, in small strain, pressed to the approach of the demo in five steps. Both
programs have the same nodes and second-order tetrahedra: `asperity export CASE --to block.inp` writes them. CalculiX
has penalty contact with a rigid plate of one element; its C3D10 lock where the solid flows, asperity's do not.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

import calculix
import gmsh
import numpy as np
from programs import timed
from unpacked import inside

import asperity as asp
from asperity.mesh.block import BlockMesh
from asperity.output.mesh_file import block_of_case, write_mesh

DEMO = Path(__file__).parents[2] / "cases/demo.toml"
STEPS, STIFFNESS = 5, 3000.0  # stiffness of the contact over E/L


def demo() -> asp.Case:
    """The case of the demo with lengths in units of its side and stresses in MPa, on one mesh."""
    data = asp.Case.load(DEMO).to_dict()
    side = data["surface"]["L"]
    surface = data["surface"] | {"L": 1.0, "G": data["surface"]["G"] / side}
    solid = {name: data["material"][name] * 1e-6 for name in ("E", "yield_strength", "tangent_modulus")}
    return asp.Case.from_dict({
        "units": "other", "surface": surface, "material": solid | {"nu": data["material"]["nu"]},
        "loading": {"delta_max": data["loading"]["delta_max"] / side, "steps": STEPS},
    })  # fmt: skip


def deck(block: BlockMesh, law: asp.Material, depth: float) -> str:
    """What CalculiX needs besides block.inp: plate, supports, contact, steps."""
    x, y, z = block.points.T
    first, cell, law = len(x) + 1, len(block.tets) + 1, law.scaled(calculix.STRESS)
    text = ["*INCLUDE, INPUT=block.inp", "*NODE"]
    for number, (a, b, c) in enumerate(((a, b, c) for c in (0.0, 0.1) for a, b in calculix.PLATE), first):
        text.append(f"{number}, {a:.12g}, {b:.12g}, {float(z.max()) + c:.12g}")
    text += ["*ELEMENT, TYPE=C3D8, ELSET=PLATE", f"{cell}, {', '.join(str(first + k) for k in range(8))}"]
    for name, along in (("X", x), ("Y", y)):
        side = np.flatnonzero(np.minimum(np.abs(along), np.abs(along - 1.0)) < 1e-9) + 1
        text += [f"*NSET, NSET={name}SIDES", *(f"{node}," for node in side)]
    text += [f"*NSET, NSET=RIGID, GENERATE\n{first}, {first + 7}", f"*SURFACE, NAME=FLAT, TYPE=ELEMENT\n{cell}, S1"]
    hard = calculix.law(asp.Material(law.E, law.nu))
    text += [f"*MATERIAL, NAME=STEEL\n{calculix.law(law)}*MATERIAL, NAME=HARD\n{hard}"
             "*SOLID SECTION, ELSET=PLATE, MATERIAL=HARD\n*SOLID SECTION, ELSET=BLOCK, MATERIAL=STEEL\n"
             + calculix.contact(STIFFNESS * law.E, "TOP", "FLAT")
             + "*BOUNDARY\nBASE, 1, 3\nXSIDES, 1\nYSIDES, 2\nRIGID, 1, 2\n"
             + calculix.step(STEPS, STEPS, f"RIGID, 3, 3, {-depth}\n", "RIGID")]  # fmt: skip
    return "\n".join(text)


def read_back(path: Path) -> str:
    """What gmsh finds in a mesh: nodes, elements, groups, volume, worst Jacobian."""
    gmsh.initialize(interruptible=False)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        gmsh.open(str(path))
        tets, _ = gmsh.model.mesh.getElementsByType(11)
        groups = [gmsh.model.getPhysicalName(*group) for group in gmsh.model.getPhysicalGroups()]
        weights = gmsh.model.mesh.getIntegrationPoints(11, "Gauss4")[1]
        jacobians = gmsh.model.mesh.getJacobians(11, gmsh.model.mesh.getIntegrationPoints(11, "Gauss4")[0])[1]
        volume = float((np.reshape(jacobians, (-1, len(weights))) @ weights).sum())
        nodes = len(gmsh.model.mesh.getNodes()[0])
        worst = min(jacobians) / np.mean(jacobians)
        return (
            f"gmsh: {nodes} nodes, {len(tets)} tetrahedra, groups {', '.join(groups)}, volume {volume:.6f} L^3, "
            f"least Jacobian over the mean {worst:.2g}"
        )
    finally:
        gmsh.finalize()


def main(size: float) -> None:
    """Print the table."""
    case = demo()
    block, surface = block_of_case(case, size)
    problem = case.problem()
    print(f"{len(block.points)} nodes, {len(block.tets)} tetrahedra\n")
    print("| solid | approach/L | force, asperity | CalculiX | difference % |\n|---|---|---|---|---|")
    command, environment = inside("bookworm", "usr/bin/ccx")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for label, law in (("elastic", asp.Material(E=problem.material.E, nu=problem.material.nu)),
                           ("elastic-plastic", problem.material)):  # fmt: skip
            ours = asp.solve_contact(surface, law, delta_max=case.loading.delta_max, steps=STEPS, block=block).curve
            write_mesh(block, surface, folder / "block.inp", "block of the demo")
            (folder / "model.inp").write_text(deck(block, law, float(ours.delta[-1])), encoding="ascii")
            timed([*command, "model"], environment, folder, limit=3600.0)
            theirs = [force * calculix.STRESS for force in calculix.read(folder / "model.dat", STEPS)]
            forces = dict(zip(np.linspace(0.0, ours.delta[-1], STEPS + 1)[1:].round(12), theirs, strict=False))
            for delta, force in zip(ours.delta, ours.force, strict=True):
                other = forces.get(round(float(delta), 12))
                if other is not None:
                    print(f"| {label} | {delta:.5f} | {force:.4g} | {other:.4g} | {100 * (other / force - 1):+.2f} |")
        print("\n" + read_back(write_mesh(block, surface, folder / "block.msh")))


if __name__ == "__main__":
    main(float(sys.argv[1]) if sys.argv[1:] else 0.045)
