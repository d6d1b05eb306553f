# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

"""Write fields of a run for figures (NumPy files) and for ParaView (VTKHDF with one time step per snapshot)."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from asperity.arrays import Array
from asperity.fem.global_numbering import collect, share_cells, share_nodes
from asperity.mesh.block import BlockMesh
from asperity.mesh.element import FACE_TRIANGLES, GMSH_TO_VTK, NODES, VTK_TYPE, outer_faces, to_face
from asperity.quasistatic.contact_result import ContactResult
from asperity.runtime.display import short_repr
from asperity.runtime.run_folder import BLOCK, TOP

TO_VTK_TENSOR = (0, 1, 2, 3, 5, 4)  # xx yy zz xy yz xz


@dataclass(frozen=True)
class State:
    """A snapshot of the whole mesh, in physical units, rows in the order of `ContactResult.whole_mesh`.

    Attributes:
        step, branch, delta: as in the curve, delta in [length]
        displacement: of the nodes (N, 3) [length]
        pressure: contact pressure at the nodes, on an edge the mean of its corners (N,) [force/length^2]
        gap: distance of the nodes of the top from the flat (N,) [length]
        stress: mean over each cell, xx yy zz xy xz yz (M, 6) [force/length^2]
        plastic_strain: mean accumulated plastic strain of each cell (M,); empty for an elastic material

    Examples:
        >>> scalar, vector, tensor = np.zeros(10), np.zeros((10, 3)), np.zeros((1, 6))
        >>> State(1, "load", 0.01, vector, pressure=scalar, gap=scalar, stress=tensor, plastic_strain=scalar[:1]).step
        1
    """

    step: int
    branch: str
    delta: float
    displacement: Array
    pressure: Array
    gap: Array
    stress: Array
    plastic_strain: Array

    __repr__ = short_repr


def gather_states(result: ContactResult, side: float, E: float) -> list[State]:
    """Gather the snapshots of all ranks on rank 0, an empty list elsewhere; collective.

    Args:
        result: result with snapshots
        side: side L of the patch [length]
        E: elastic modulus, the solver's unit of stress [force/length^2]

    Examples:
        >>> from asperity.surface import Flat
        >>> size = asp.MeshSize(h_contact=1.0, h_max=1.0)

        >>> path, elastic = {"delta_max": 0.01, "steps": 1}, asp.Material(E=1.0, nu=0.3)
        >>> result = asp.solve_contact(Flat(L=1.0), elastic, **path, size=size, snapshots=1)
        >>> (state,) = gather_states(result, side=1.0, E=1.0)
        >>> print(f"{state.stress[:, 2].mean():.6f}")  # a block in uniaxial strain
        -0.013462
    """
    solid = result.solver.solid
    block = result.whole_mesh()
    facets = None if block is None else top_facets(block)
    states = []
    for s in result.snapshots:
        u = collect(share_nodes(solid, s.displacement * side))
        p = collect(share_nodes(solid, s.pressure * E))
        gap = collect(share_nodes(solid, s.gap * side))
        stress = collect(share_cells(solid, s.stress * E))
        alpha = None
        if solid.material.plastic:
            alpha = collect(share_cells(solid, s.plastic_strain.mean(axis=1)))
        if u is not None and p is not None and gap is not None and stress is not None and facets is not None:
            p[facets] = to_face(p[facets[:, :3]])
            mean = np.empty(0) if alpha is None else alpha
            states.append(State(s.step, s.branch, s.delta * side, u, p, gap, stress, mean))
    return states


def top_facets(block: BlockMesh) -> npt.NDArray[np.int64]:
    """Facets of the top: the outer faces on no plane side or base; nodes as in FACES (K, nodes of a face)."""
    outer = outer_faces(block.tets)
    x, L = block.points[outer[:, :3]], block.side
    eps = 1e-9 * L
    on_side = np.zeros(len(outer), dtype=bool)
    for axis, plane in ((0, 0.0), (0, L), (1, 0.0), (1, L), (2, 0.0)):
        on_side |= np.all(np.abs(x[:, :, axis] - plane) < eps, axis=1)
    return outer[~on_side]


def write_figure_data(folder: Path, block: BlockMesh, states: list[State]) -> None:
    """Write mesh.npz and top.npz, the data of the figures; rank 0 only."""
    folder.mkdir(exist_ok=True)
    facets = top_facets(block)
    np.savez_compressed(folder / BLOCK, points=block.points, tets=block.tets, triangles=facets)
    triangles = np.concatenate([facets[:, nodes] for nodes in FACE_TRIANGLES])
    used, number = np.unique(triangles, return_inverse=True)
    np.savez_compressed(
        folder / TOP,
        points=block.points[used, :2],
        triangles=number.reshape(triangles.shape),
        steps=np.array([s.step for s in states]),
        branch=np.array([s.branch for s in states]),
        delta=np.array([s.delta for s in states]),
        pressure=np.array([s.pressure[used] for s in states]),
        gap=np.array([np.maximum(s.gap[used], 0.0) for s in states]),
    )


def von_mises(stress: Array) -> Array:
    """Equivalent stress (...,) of stresses xx yy zz xy xz yz (..., 6), in the same unit."""
    normal, shear = stress[..., :3], stress[..., 3:]
    deviator = normal - normal.mean(axis=-1, keepdims=True)
    return np.asarray(np.sqrt(1.5 * (deviator**2).sum(axis=-1) + 3.0 * (shear**2).sum(axis=-1)))


def write_vtkhdf(path: Path, block: BlockMesh, states: list[State]) -> None:
    """Write the snapshots for ParaView (VTKHDF 2.0 unstructured grid, time = approach); rank 0 only.

    Lengths are in units of L, because viewers have problems with coordinates of 1e-6; stresses are physical.

    Examples:
        >>> from asperity.surface import Flat
        >>> size = asp.MeshSize(h_contact=1.0, h_max=1.0)

        >>> path, elastic = {"delta_max": 0.01, "steps": 1}, asp.Material(E=1.0, nu=0.3)
        >>> result = asp.solve_contact(Flat(L=1.0), elastic, **path, size=size, snapshots=1)
        >>> write_vtkhdf(Path("fields.vtkhdf"), result.block, gather_states(result, side=1.0, E=1.0))
    """
    import h5py

    n, m, steps = len(block.points), len(block.tets), len(states)
    with h5py.File(path, "w") as file:
        root = file.create_group("VTKHDF", track_order=True)
        root.attrs["Version"] = (2, 0)
        root.attrs.create("Type", b"UnstructuredGrid", dtype=h5py.string_dtype("ascii", 16))
        for name, value in (("NumberOfPoints", n), ("NumberOfCells", m), ("NumberOfConnectivityIds", NODES * m)):
            root[name] = np.array([value], dtype=np.int64)
        root["Points"] = block.points / block.side
        root["Connectivity"] = block.tets[:, GMSH_TO_VTK].ravel()
        root["Offsets"] = NODES * np.arange(m + 1, dtype=np.int64)
        root["Types"] = np.full(m, VTK_TYPE, dtype=np.uint8)
        series = root.create_group("Steps")
        series.attrs["NSteps"] = steps
        series["Values"] = np.array([s.delta / block.side for s in states])
        zeros = np.zeros(steps, dtype=np.int64)
        for name in ("PartOffsets", "PointOffsets"):
            series[name] = zeros
        for name in ("CellOffsets", "ConnectivityIdOffsets"):
            series[name] = zeros[:, None]
        series["NumberOfParts"] = np.ones(steps, dtype=np.int64)
        point_data = {
            "displacement": [s.displacement / block.side for s in states],
            "pressure": [s.pressure for s in states],
        }
        cell_data = {
            "stress": [s.stress[:, TO_VTK_TENSOR] for s in states],
            "von Mises stress": [von_mises(s.stress) for s in states],
        }
        if states and states[0].plastic_strain.size:
            cell_data["plastic strain"] = [s.plastic_strain for s in states]
        for kind, fields, rows in (("PointData", point_data, n), ("CellData", cell_data, m)):
            group, offsets = root.create_group(kind), series.create_group(f"{kind}Offsets")
            for name, values in fields.items():
                group[name] = np.concatenate(values) if values else np.empty((0,))
                offsets[name] = rows * np.arange(steps, dtype=np.int64)
