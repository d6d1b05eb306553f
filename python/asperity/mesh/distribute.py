"""Distribute the mesh of the block over the ranks, tag its outer facets, and refuse distorted elements."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from asperity.arrays import Floats, Indices
from asperity.errors import MeshError
from asperity.mesh.block import BlockMesh
from asperity.mesh.element import DEGREE, NODES, least_jacobians
from asperity.mesh.shared_nodes import joined
from asperity.runtime import compat
from asperity.runtime.parallel import on_root

if TYPE_CHECKING:
    from mpi4py import MPI

    from asperity.surface import Surface

BASE, SIDE_X, SIDE_Y, TOP = 1, 2, 3, 4  # tags of the facets


def distribute(comm: MPI.Comm, block: BlockMesh | None, scale: float, periodic: bool = False) -> tuple[Any, Any]:
    """Partition the mesh of a block over the ranks of `comm`; collective.

    Args:
        block: the mesh on rank 0, ignored elsewhere
        scale: factor on the coordinates, 1/L for a block of unit side
        periodic: whether to join opposite sides: their nodes are the same in the topology of the mesh, and so have the
            same dofs, but not in its geometry, where each cell keeps its own coordinates

    Returns:
        dolfinx mesh and facet tags (BASE, SIDE_X, SIDE_Y, TOP); joined sides have no facets. Numbers that
        do not depend on the ranks are `topology.original_cell_index` of the cells, `geometry.input_global_indices` of
        the nodes.

    Raises:
        MeshError: opposite sides do not fit, see `shared_nodes.joined`
    """
    import basix.ufl
    import ufl

    compat.start()

    from dolfinx import mesh as dmesh

    element = basix.ufl.element("Lagrange", "tetrahedron", DEGREE, shape=(3,))
    cells: Indices = np.empty((0, NODES), dtype=np.int64)
    points: Floats = np.empty((0, 3))
    if comm.rank == 0:
        assert block is not None
        cells, points = block.tets[:, compat.gmsh_to_dolfinx(NODES)], block.points
    joined_cells = cells
    if periodic and (same := on_root(comm, lambda: joined(block))) is not None:
        joined_cells = same[cells]
    mesh = dmesh.create_mesh(comm, cells=joined_cells, x=points, e=ufl.Mesh(element))  # 0.10 changed their order
    if periodic:
        mesh = _with_geometry(mesh, cells, points)
    mesh.geometry.x[:] *= scale
    return mesh, _tag_facets(mesh)


def _with_geometry(mesh: Any, cells: Indices, points: Floats) -> Any:
    """Give the cells of a mesh the coordinates of their own nodes, all of which are on rank 0; collective."""
    wanted, parts = mesh.comm.gather(np.asarray(mesh.topology.original_cell_index), root=0), None
    if wanted is not None:
        parts = []
        for numbers in wanted:
            nodes, x_nodes = np.unique(cells[numbers], return_inverse=True)
            parts.append((nodes, x_nodes.reshape(-1, NODES).astype(np.int32), points[nodes]))
    return compat.with_geometry(mesh, *mesh.comm.scatter(parts, root=0))


def _tag_facets(mesh: Any) -> Any:
    """Tag the outer facets by the position of their midpoints; the side of the block is 1."""
    from dolfinx import mesh as dmesh

    tdim = mesh.topology.dim
    mesh.topology.create_connectivity(tdim - 1, tdim)
    facets = dmesh.exterior_facet_indices(mesh.topology)
    mid = dmesh.compute_midpoints(mesh, tdim - 1, facets)
    values = np.full(len(facets), TOP, dtype=np.int32)
    for axis, tag in ((0, SIDE_X), (1, SIDE_Y)):
        values[(np.abs(mid[:, axis]) < 1e-9) | (np.abs(mid[:, axis] - 1.0) < 1e-9)] = tag
    values[np.abs(mid[:, 2]) < 1e-9] = BASE
    return dmesh.meshtags(mesh, tdim - 1, facets, values)


def check_distortion(mesh: Any, surface: Surface) -> None:
    """Refuse a dolfinx mesh with an element that is turned inside out; collective.

    Raises:
        MeshError: gives the position, the slope of the surface there and the size of the element
    """
    x, cells = mesh.geometry.x, compat.geometry_dofmap(mesh)
    worst: tuple[float, Any] = (np.inf, None)
    if len(cells):
        jacobians = least_jacobians(x, cells)
        c = int(np.argmin(jacobians))
        corners = x[cells[c, :4]]
        worst = (float(jacobians[c]), corners)
    jacobian, corners = min(mesh.comm.allgather(worst), key=lambda w: w[0])
    if jacobian > 0.0:
        return
    L = surface.L
    cx, cy, cz = corners.mean(axis=0) * L
    size = float(np.max(np.linalg.norm(corners - np.roll(corners, 1, axis=0), axis=1))) * L
    slope = float(np.hypot(*surface.gradient(np.array(cx), np.array(cy))))
    raise MeshError(
        f"mesh.file: at x = {cx:.4g}, y = {cy:.4g}, z = {cz:.4g} an element of size {size:.3g} is turned inside out "
        f"(slope of the surface {slope:.3g}): correct it, or leave mesh.file out"
    )
