"""The rough block as a mesh for other finite element programs: second-order tetrahedra, with sets of its faces."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from io import BytesIO
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from asperity.arrays import Array, Indices
from asperity.case import Case
from asperity.errors import InputError, MeshError
from asperity.mesh.block import NEAR, BlockMesh
from asperity.mesh.element import FACE_TRIANGLES, GMSH_TO_VTK, outer_faces
from asperity.output.results import Results
from asperity.runtime import compat
from asperity.runtime.display import comment
from asperity.runtime.files import replace_file
from asperity.surface import Surface
from asperity.version import __version__

SUFFIXES = (".inp", ".msh", ".vtk", ".stl", ".bdf", ".unv")  # of the deck, and of what gmsh writes
#: Corners of the faces of an element in CalculiX and Abaqus, S1 to S4, counted from 0.
ABAQUS_FACES = ((0, 1, 2), (0, 3, 1), (1, 3, 2), (2, 3, 0))


def export_mesh(source: str | Path, path: str | Path, overrides: Iterable[str] = ()) -> tuple[Path, BlockMesh]:
    """Write the mesh of a run, or that of a case without a solve; return the file and the mesh.

    Args:
        source: folder of a run, whose finest mesh is taken, or a case file
        path: see `write_mesh`
        overrides: strings "section.key=value" that replace keys of the case file

    Raises:
        InputError: the folder holds no run, the case cannot be meshed, or as for `write_mesh`
    """
    source, h = Path(source), None
    if source.is_dir():
        results = Results.read(source)
        if not results.case:
            raise InputError(f"{source} holds no case.toml, which describes the block; give the folder of a run")
        levels = (results.summary.get("accuracy") or {}).get("levels") or [{}]  # the last has the finest mesh
        case, h = Case.from_dict(results.case, folder=source), levels[-1].get("h")
    else:
        case = Case.load(source, overrides)
    block, surface = block_of_case(case, h)
    return write_mesh(block, surface, path, f"block of {source.resolve().name} by asperity {__version__}"), block


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

    surface = case.surface
    if case.mesh.file is not None:
        block: BlockMesh | None = BlockMesh.read(case.mesh.file)
    else:
        problem = case.problem()
        delta = case.loading.delta_max or (surface.light_approach() if surface.rough else 1e-3 * surface.L)
        size = replace(case.mesh.size, h_contact=case.mesh.size.h_contact if h is None else h)
        block = make_block(MPI.COMM_SELF, replace(problem, size=size), delta)
    assert block is not None
    return block, surface


def write_mesh(block: BlockMesh, surface: Surface, path: str | Path, about: str = "") -> Path:
    """Write a mesh in the format of a suffix; return the path.

    Args:
        block: in the unit of length of its case, the base at z = 0
        surface: the top it was built for
        path: .inp (CalculiX, Abaqus), .msh (gmsh 4.1), .vtk, .stl (the boundary, of flat triangles), .bdf, .unv
        about: first line of a deck

    Raises:
        InputError: another suffix
        OutputError: it cannot be written
    """
    path = Path(path)
    kind = path.suffix.lower()
    if kind not in SUFFIXES:
        raise InputError(f"{path}: meshes are written as {', '.join(SUFFIXES)}")
    outer, z, near = outer_faces(block.tets), block.points[:, 2], NEAR * block.side
    on_top = (np.abs(block.heights(surface) - z) < near)[outer].all(axis=1)
    on_base = (np.abs(z) < near)[outer].all(axis=1) & ~on_top
    faces = {"TOP": outer[on_top], "BASE": outer[on_base], "SIDES": outer[~on_top & ~on_base]}
    path.parent.mkdir(parents=True, exist_ok=True)
    replace_file(path, _inp(block, faces, about) if kind == ".inp" else _by_gmsh(block, faces, kind))
    return path


def _inp(block: BlockMesh, faces: dict[str, Indices], about: str) -> bytes:
    """Deck with nodes, elements, and a node set and an element surface of the name of each face."""
    out = BytesIO()

    def write(head: str, rows: Array, form: str) -> None:
        out.write(f"*{head}\n".encode())
        np.savetxt(out, rows, fmt=form, delimiter=", ")

    def numbered(rows: Array) -> Array:
        return np.column_stack([np.arange(1, len(rows) + 1), rows])

    out.write(f"** {comment(about)}\n".encode())
    write("NODE, NSET=ALL", numbered(block.points), "%d, %.12g, %.12g, %.12g")
    write("ELEMENT, TYPE=C3D10, ELSET=BLOCK", numbered(block.tets[:, GMSH_TO_VTK] + 1), "%d")
    for name, of_set in faces.items():
        write(f"NSET, NSET={name}", np.unique(of_set) + 1, "%d")
        write(f"SURFACE, NAME={name}, TYPE=ELEMENT", _element_faces(block.tets, of_set) + 1, "%d, S%d")
    return out.getvalue()


def _element_faces(tets: Indices, faces: Indices) -> Array:
    """Element and number of its face, as of ABAQUS_FACES, of faces by their corners, (n, 2)."""
    count = int(tets.max()) + 1

    def numbers(corners: Indices) -> Indices:
        """One number for the three corners of each face, in any order."""
        return np.asarray(np.sort(corners, axis=1) @ np.array([count**2, count, 1], dtype=np.int64))

    wanted = numbers(faces[:, :3])
    sides = [np.isin(numbers(tets[:, corners]), wanted) for corners in ABAQUS_FACES]
    return np.argwhere(np.transpose(sides))


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
