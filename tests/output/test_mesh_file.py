"""The block as a mesh for other programs, read back."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import call
from test_export import calculated, calculix

from asperity.case import Case
from asperity.mesh.element import GMSH_TO_VTK
from asperity.output.mesh_file import ABAQUS_FACES, block_of_case, write_mesh

CASE = {
    "surface": {"kind": "self-affine", "L": 1e-4, "H": 0.8, "rms_height": 1e-6, "lambda_short": 4e-5, "seed": 1},
    "material": {"E": 2e11, "nu": 0.3},
    "loading": {"delta_max": 1e-7},
    "mesh": {"h_contact": 2.5e-5},
}


@pytest.fixture(scope="module")
def made() -> Any:
    return block_of_case(Case.from_dict(CASE))


def volume(points: np.ndarray, tets: np.ndarray) -> float:
    """By the corners, six times a tetrahedron each."""
    a, b, c, d = (points[tets[:, i]] for i in range(4))
    return float(np.einsum("ij,ij->i", np.cross(b - a, c - a), d - a).sum() / 6.0)


def test_a_deck_has_nodes_elements_and_surfaces(tmp_path: Path, made: Any) -> None:
    block, surface = made
    text = write_mesh(block, surface, tmp_path / "a.inp", "a\n*NODE").read_text()
    assert text.startswith("** ") and text.count("\n*NODE, ") == 1  # the name is no keyword
    parts = {}
    for part in re.split(r"^\*(?!\*)", text, flags=re.MULTILINE)[1:]:
        head, *lines = part.strip().splitlines()
        parts[head] = [line.split(", ") for line in lines]
    nodes = np.array(parts["NODE, NSET=ALL"], float)
    np.testing.assert_allclose(nodes[:, 1:], block.points, rtol=1e-11, atol=1e-18)
    tets = np.array(parts["ELEMENT, TYPE=C3D10, ELSET=BLOCK"], int)[:, 1:] - 1
    np.testing.assert_array_equal(tets, block.tets[:, GMSH_TO_VTK])
    ends = block.points[tets[:, [0, 1, 2, 0, 1, 2]]], block.points[tets[:, [1, 2, 0, 3, 3, 3]]]
    straight = np.linalg.norm(0.5 * (ends[0] + ends[1]) - block.points[tets[:, 4:]], axis=2)
    assert np.all(
        straight < 0.1 * np.linalg.norm(ends[1] - ends[0], axis=2)
    )  # middles of the edges that they belong to
    top = np.array([n for line in parts["NSET, NSET=TOP"] for n in line], int) - 1
    np.testing.assert_allclose(block.points[top, 2], block.heights(surface)[top], atol=1e-13)
    covered = []
    for name in ("TOP", "BASE", "SIDES"):
        area = 0.0
        for cell, side in parts[f"SURFACE, NAME={name}, TYPE=ELEMENT"]:
            a, b, c = block.points[tets[int(cell) - 1, ABAQUS_FACES[int(side[1]) - 1]]]
            area += 0.5 * float(np.cross(b - a, c - a)[2])
        covered.append(area / 1e-8)
    assert np.abs(covered) == pytest.approx([1.0, 1.0, 0.0], abs=1e-6)  # in projection


@pytest.mark.skipif(not calculix(), reason="there is no CalculiX: benchmarks/peers/install unpacks ccx")
def test_calculix_finds_the_sets_of_a_deck(tmp_path: Path, made: Any) -> None:
    """A pressure on the surface TOP is held by the node set BASE: pressure times nominal area, between frictionless
    walls."""  # fmt: skip
    write_mesh(made[0], made[1], tmp_path / "block.inp")
    lines = ["*INCLUDE, INPUT=block.inp", "*MATERIAL, NAME=M", "*ELASTIC", "2e11, 0.3"]
    lines += ["*SOLID SECTION, ELSET=BLOCK, MATERIAL=M", "*BOUNDARY", "BASE, 3, 3", "SIDES, 1, 2"]
    lines += ["*STEP", "*STATIC", "*DSLOAD", "TOP, P, 1e8", "*NODE PRINT, NSET=BASE, TOTALS=ONLY", "RF", "*END STEP"]
    *_, force = calculated(tmp_path, "job", lines).split()
    assert float(force) == pytest.approx(1e8 * 1e-8, rel=1e-6)


@pytest.mark.parametrize("suffix", [".msh", ".vtk", ".stl", ".bdf", ".unv"])
def test_gmsh_reads_what_it_wrote(tmp_path: Path, made: Any, suffix: str) -> None:
    import gmsh

    block, surface = made
    path = write_mesh(block, surface, tmp_path / f"a{suffix}")
    gmsh.initialize(readConfigFiles=False, interruptible=False)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        gmsh.open(str(path))
        tags, xyz, _ = gmsh.model.mesh.getNodes()
        points = np.zeros((int(tags.max()) + 1, 3))
        points[tags.astype(int)] = xyz.reshape(-1, 3)
        if suffix == ".stl":
            np.testing.assert_allclose(points[tags.astype(int)].max(axis=0), block.points.max(axis=0), rtol=1e-5)
            return
        _, cells = gmsh.model.mesh.getElementsByType(11)
        tets = cells.astype(int).reshape(-1, 10)
        assert len(tets) == len(block.tets)
        assert volume(points, tets) == pytest.approx(volume(block.points, block.tets), rel=1e-4)
        if suffix == ".msh":
            names = {gmsh.model.getPhysicalName(*group) for group in gmsh.model.getPhysicalGroups()}
            assert names == {"TOP", "BASE", "SIDES", "BLOCK"}
    finally:
        gmsh.finalize()


def test_without_a_solve_and_of_a_run(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    case, out = tmp_path / "case.toml", tmp_path / "out"
    case.write_text(Case.from_dict(CASE).to_toml())
    assert call("export", case, "--to", tmp_path / "a.inp") == 0
    assert "tetrahedra of second order" in capsys.readouterr().out
    assert call("export", case, "--to", tmp_path / "b.inp", "--set", "block.height=2e-4") == 0
    assert (tmp_path / "b.inp").read_text() != (tmp_path / "a.inp").read_text()
    out.mkdir()
    (out / "case.toml").write_text(case.read_text())
    (out / "curve.csv").write_text("delta,force\n1e-8,1\n2e-8,3\n")
    assert call("export", out, "--to", out / "block.inp") == 0
    assert (out / "block.inp").read_text().split("\n", 1)[1] == (tmp_path / "a.inp").read_text().split("\n", 1)[1]
