"""Write fields of a run for figures (NumPy files) and for ParaView (VTKHDF with one time step per snapshot)."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from asperity.arrays import Array, Floats
from asperity.contact.contact_surface import gather_at_top, gather_top
from asperity.errors import InputError
from asperity.fem.solid import Solid, built_nodes, gather_cells, gather_mesh, gather_nodes
from asperity.mesh.element import FACE_TRIANGLES, GMSH_TO_VTK, NODES, VTK_TYPE
from asperity.quasistatic.contact_result import ContactResult
from asperity.quasistatic.measures import Snapshot
from asperity.runtime.parallel import on_root

TO_VTK_TENSOR = (0, 1, 2, 3, 5, 4)  # xx yy zz xy yz xz


def gather_top_states(result: ContactResult, side: float, E: float) -> dict[str, Any] | None:
    """Arrays of top.npz on rank 0, None elsewhere: K snapshots of the N nodes of the top; collective.

    points (N, 2) [length]; triangles (T, 3), four of each facet; steps, branch, delta (K,); pressure, on an edge the
    mean of its corners (K, N) [force/length^2]; gap, distance from the flat (K, N) [length]; touched, whether the
    thirds of facets at an edge node are in contact (K, N). `side` is the side L of the patch [length], `E` the modulus,
    the solver's unit of stress [force/length^2].
    """
    solid, surface = result.solver.solid, result.solver.contact_surface
    top, found, (_, at) = gather_top(surface, 0.0), result.snapshots, built_nodes(solid)

    def gather(of_snapshot: Callable[[Snapshot], Floats]) -> list[Floats | None]:
        return [gather_at_top(surface, of_snapshot(s)[at]) for s in found]

    pressure, gap = gather(lambda s: surface.linear_on_facets(s.pressure) * E), gather(lambda s: s.gap * side)
    touched = gather(lambda s: s.touched)
    if top is None:
        return None
    return {
        "points": top.points[:, :2] * side,
        "triangles": np.concatenate([top.faces[:, nodes] for nodes in FACE_TRIANGLES]),
        "steps": np.array([s.step for s in found]),
        "branch": np.array([s.branch for s in found]),
        "delta": np.array([s.delta * side for s in found]),
        "pressure": np.array(pressure),
        "gap": np.maximum(np.array(gap), 0.0),
        "touched": np.array(touched, dtype=bool),
    }


def von_mises(stress: Array) -> Array:
    """Equivalent stress (...,) of stresses xx yy zz xy xz yz (..., 6), in the same unit."""
    normal, shear = stress[..., :3], stress[..., 3:]
    deviator = normal - normal.mean(axis=-1, keepdims=True)
    return np.asarray(np.sqrt(1.5 * (deviator**2).sum(axis=-1) + 3.0 * (shear**2).sum(axis=-1)))


def write_vtkhdf(path: Path, result: ContactResult, E: float) -> None:
    """Write the snapshots for ParaView (VTKHDF 2.0 unstructured grid, time = step of the curve); collective.

    Lengths are in units of L, because viewers have problems with coordinates of 1e-6; stresses are physical, by the
    modulus `E`, the solver's unit of stress [force/length^2].

    Raises:
        InputError: the result has no snapshots
        OutputError: it cannot be written
    """
    if not result.snapshots:
        raise InputError("the result has no snapshots: give solve_contact snapshots = 4")
    arrays, times = gather_grid(result, E), [s.step for s in result.snapshots]
    on_root(result.solver.solid.comm, lambda: write_grid(path, arrays, times))


def gather_grid(result: ContactResult, E: float) -> dict[str, Array]:
    """Arrays of `write_vtkhdf` on rank 0, fields of all states one after the other; empty elsewhere; collective."""
    solid, top = result.solver.solid, result.solver.contact_surface

    def states(gather_of: Callable[[Solid, Array], Array | None], values: Callable[[Snapshot], Floats]) -> Any:
        parts = [part for s in result.snapshots if (part := gather_of(solid, values(s))) is not None]
        return np.concatenate(parts) if parts else None

    mesh = gather_mesh(solid)
    fields = {
        "PointData/displacement": states(gather_nodes, lambda s: s.displacement),
        "PointData/pressure": states(gather_nodes, lambda s: top.linear_on_facets(s.pressure) * E),
        "CellData/stress": states(gather_cells, lambda s: s.stress[:, TO_VTK_TENSOR] * E),
        "CellData/von Mises stress": states(gather_cells, lambda s: von_mises(s.stress) * E),
    }
    if solid.material.plastic:
        fields["CellData/plastic strain"] = states(gather_cells, lambda s: s.plastic_strain.mean(axis=1))
    if mesh is None:
        return {}
    points, tets = mesh
    whole = {
        "Points": points, "Connectivity": tets[:, GMSH_TO_VTK].ravel(), "Offsets": NODES * np.arange(len(tets) + 1),
        "Types": np.full(len(tets), VTK_TYPE, dtype=np.uint8),
    }  # fmt: skip
    return whole | fields


def write_grid(path: Path, arrays: dict[str, Array], times: list[int]) -> None:
    """Write the arrays of `gather_grid`, at these times; rank 0 only."""
    import h5py

    counts, count = {"Points": len(arrays["Points"]), "Cells": len(arrays["Types"])}, len(times)
    counts["ConnectivityIds"] = len(arrays["Connectivity"])
    with h5py.File(path, "w") as file:
        root = file.create_group("VTKHDF", track_order=True)
        root.attrs["Version"] = (2, 0)
        root.attrs.create("Type", b"UnstructuredGrid", dtype=h5py.string_dtype("ascii", 16))
        for name, value in counts.items():
            root[f"NumberOf{name}"] = np.array([value], dtype=np.int64)
        series = root.create_group("Steps")
        series.attrs["NSteps"] = count
        series["Values"] = np.array(times, dtype=float)
        zeros = np.zeros(count, dtype=np.int64)
        for name in ("PartOffsets", "PointOffsets"):
            series[name] = zeros
        for name in ("CellOffsets", "ConnectivityIdOffsets"):
            series[name] = zeros[:, None]
        series["NumberOfParts"] = np.ones(count, dtype=np.int64)
        for name, array in arrays.items():
            root[name] = array
            kind, _, field = name.rpartition("/")
            if kind:
                series[f"{kind}Offsets/{field}"] = len(array) // count * np.arange(count, dtype=np.int64)
