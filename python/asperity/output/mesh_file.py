"""The rough block as a mesh for other finite element programs: second-order tetrahedra, with sets of its faces."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from io import StringIO
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from asperity.arrays import Array, Indices
from asperity.case import Case
from asperity.errors import InputError, MeshError
from asperity.mesh.block import NEAR, BlockMesh
from asperity.mesh.element import FACE_TRIANGLES, GMSH_TO_VTK, VTK_TYPE, outer_faces
from asperity.output.results import Results
from asperity.runtime import compat
from asperity.runtime.display import comment
from asperity.runtime.files import replace_file
from asperity.surface import Surface
from asperity.surface.cutoff import approach_of_share
from asperity.version import __version__

SETS = ("TOP", "BASE", "SIDES")
BY_GMSH = (".msh", ".stl", ".bdf", ".unv")
SUFFIXES = (".inp", ".vtu", *BY_GMSH)
#: Corners of the faces of an element in CalculiX and Abaqus, S1 to S4, counted from 0.
ABAQUS_FACES = ((0, 1, 2), (0, 3, 1), (1, 3, 2), (2, 3, 0))
_LINE = 8  # numbers of a set in a line


def block_of_case(case: Case, h: float | None = None) -> tuple[BlockMesh, Surface]:
    """Mesh of the block of a case, in one process, and its surface.

    Args:
        case: with the element size of one mesh
        h: element size at the contact instead [length]

    Raises:
        InputError: the case cannot be meshed
    """
    from mpi4py import MPI

    from asperity.quasistatic.make import make_block

    surface = case.build_surface()
    if case.mesh.file is not None:
        block: BlockMesh | None = BlockMesh.read(case.mesh.file)
    else:
        delta = case.loading.delta_max or (approach_of_share(surface) if surface.rough else 1e-3 * surface.L)
        size = replace(case.mesh.size, refinements=0, h_contact=case.mesh.size.h_contact if h is None else h)
        block = make_block(MPI.COMM_SELF, surface, case.problem().height, delta, size, case.block.sides)
    assert block is not None
    if block.refinements:
        raise InputError("the mesh of mesh.file is refined by a run: leave mesh.file out")
    return block, surface


def export_mesh(folder: str | Path, path: str | Path) -> Path:
    """Write the block of a run, with elements of the size of its finest mesh; arguments and errors as of `write_mesh`.

    Args:
        folder: of the run
    """
    results = Results.read(folder)
    if not results.case:
        raise InputError(f"{folder} holds no case.toml, which describes the block; give the folder of a run")
    case = Case.from_dict(results.case, folder=folder)
    levels = (results.summary.get("accuracy") or {}).get("levels") or [{}]
    block, surface = block_of_case(case, levels[-1].get("h"))
    return write_mesh(block, surface, path, f"block of {Path(folder).resolve().name} by asperity {__version__}")


def write_mesh(block: BlockMesh, surface: Surface, path: str | Path, about: str = "") -> Path:
    """Write a mesh in the format of a suffix; return the path.

    Args:
        block: in the unit of length of its case, the base at z = 0
        surface: the top it was built for
        path: .inp (CalculiX, Abaqus), .msh (gmsh 4.1), .vtu, .stl (the boundary, of flat triangles), .bdf, .unv
        about: first line of a deck

    Raises:
        InputError: another suffix
        OutputError: it cannot be written
    """
    path = Path(path)
    kind = path.suffix.lower()
    if kind not in SUFFIXES:
        raise InputError(f"{path}: meshes are written as {', '.join(SUFFIXES)}")
    faces = _faces(block, surface)
    writers: dict[str, Callable[[], bytes]] = {
        ".inp": lambda: _inp(block, faces, about).encode(),
        ".vtu": lambda: _vtu(block, faces).encode(),
    }
    path.parent.mkdir(parents=True, exist_ok=True)
    replace_file(path, writers.get(kind, lambda: _by_gmsh(block, faces, kind))())
    return path


def _faces(block: BlockMesh, surface: Surface) -> dict[str, Indices]:
    """Outer faces of the sets, their nodes in the order of gmsh (F, 6)."""
    faces = outer_faces(block.tets)
    z = block.points[:, 2]
    near = NEAR * block.side
    on_top = (np.abs(block.heights(surface) - z) < near)[faces].all(axis=1)
    on_base = (np.abs(z) < near)[faces].all(axis=1)
    return {"TOP": faces[on_top], "BASE": faces[on_base & ~on_top], "SIDES": faces[~on_top & ~on_base]}


def _inp(block: BlockMesh, faces: dict[str, Indices], about: str) -> str:
    """Deck with nodes, elements, and node sets and element surfaces of the faces."""
    out = StringIO()
    out.write(f"** {comment(about)}\n*NODE, NSET=ALL\n")
    points: Any = block.points.tolist()
    for i, (x, y, z) in enumerate(points, 1):
        out.write(f"{i}, {x:.12g}, {y:.12g}, {z:.12g}\n")
    out.write("*ELEMENT, TYPE=C3D10, ELSET=BLOCK\n")
    tets: Any = (block.tets[:, GMSH_TO_VTK] + 1).tolist()
    for i, nodes in enumerate(tets, 1):
        out.write(f"{i}, {', '.join(map(str, nodes))}\n")
    for name, of_set in faces.items():
        out.write(f"*NSET, NSET=N{name}\n")
        out.writelines(_lines(np.unique(of_set) + 1))
        out.write(f"*SURFACE, NAME=S{name}, TYPE=ELEMENT\n")
        out.writelines(f"{cell + 1}, S{side + 1}\n" for cell, side in _element_faces(block.tets, of_set))
    return out.getvalue()


def _lines(numbers: Array) -> Iterator[str]:
    for i in range(0, len(numbers), _LINE):
        yield ", ".join(f"{n}" for n in numbers[i : i + _LINE]) + "\n"


def _element_faces(tets: Indices, faces: Indices) -> Iterator[tuple[int, int]]:
    """Element and number of its face, as of ABAQUS_FACES, of faces by their corners."""
    count = int(tets.max()) + 1

    def numbers(corners: Indices) -> Indices:
        """One number for the three corners of each face, in any order."""
        return np.asarray(np.sort(corners, axis=1) @ np.array([count**2, count, 1], dtype=np.int64))

    wanted = numbers(faces[:, :3])
    for side, corners in enumerate(ABAQUS_FACES):
        for cell in np.flatnonzero(np.isin(numbers(tets[:, corners]), wanted)):
            yield int(cell), side


def _vtu(block: BlockMesh, faces: dict[str, Indices]) -> str:
    """XML of an unstructured grid, with a mark of each set at its nodes."""
    n, m = len(block.points), len(block.tets)

    def array(name: str, values: Array, kind: str, parts: int = 1) -> str:
        text = " ".join(f"{v:.12g}" for v in values.ravel())
        return f'<DataArray type="{kind}" Name="{name}" NumberOfComponents="{parts}" format="ascii">{text}</DataArray>'

    marks = [array(name, np.isin(np.arange(n), of_set).astype(int), "UInt8") for name, of_set in faces.items()]
    return "\n".join([
        '<?xml version="1.0"?>',
        '<VTKFile type="UnstructuredGrid" version="0.1" byte_order="LittleEndian"><UnstructuredGrid>',
        f'<Piece NumberOfPoints="{n}" NumberOfCells="{m}"><Points>',
        array("Points", block.points, "Float64", 3), "</Points><Cells>",
        array("connectivity", block.tets[:, GMSH_TO_VTK], "Int64"),
        array("offsets", np.arange(1, m + 1) * block.tets.shape[1], "Int64"),
        array("types", np.full(m, VTK_TYPE), "UInt8"), "</Cells><PointData>", *marks, "</PointData></Piece>",
        "</UnstructuredGrid></VTKFile>", "",
    ])  # fmt: skip


def _by_gmsh(block: BlockMesh, faces: dict[str, Indices], kind: str) -> bytes:
    """File by gmsh: the block and its faces as physical groups, the boundary alone in .stl."""
    compat.require("gmsh", "python3-gmsh")
    import gmsh

    from asperity.mesh.generate import OPTIONS, separate_model

    try:
        with TemporaryDirectory() as folder, separate_model(OPTIONS):
            model, points = gmsh.model, block.points.ravel()
            for tag, (name, of_set) in enumerate(faces.items(), 1):
                model.addDiscreteEntity(2, tag)
                if tag == 1:
                    model.mesh.addNodes(2, 1, np.arange(1, len(block.points) + 1), points)
                if kind == ".stl":  # of flat triangles: four to a face show its curvature
                    flat = np.concatenate([of_set[:, corners] for corners in FACE_TRIANGLES])
                    model.mesh.addElementsByType(tag, 2, [], (flat + 1).ravel())
                else:
                    model.mesh.addElementsByType(tag, 9, [], (of_set + 1).ravel())
                model.addPhysicalGroup(2, [tag], tag, name)
            if kind != ".stl":
                model.addDiscreteEntity(3, 1, list(range(1, len(faces) + 1)))
                model.mesh.addElementsByType(1, 11, [], (block.tets + 1).ravel())
                model.addPhysicalGroup(3, [1], 1, "BLOCK")
            target = Path(folder) / f"block{kind}"
            gmsh.write(str(target))
            return target.read_bytes()
    except Exception as e:
        raise MeshError(f"gmsh could not write the mesh: {e}") from e
