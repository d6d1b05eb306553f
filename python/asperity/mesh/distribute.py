"""Distribute the mesh of the block over the ranks, tag its outer facets, and refuse distorted elements."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from asperity.errors import MeshError
from asperity.mesh.block import BlockMesh
from asperity.mesh.element import DEGREE, NODES, least_jacobians
from asperity.runtime import compat

if TYPE_CHECKING:
    from mpi4py import MPI

    from asperity.surface import Surface

BASE, SIDE_X, SIDE_Y, TOP = 1, 2, 3, 4


def distribute(comm: MPI.Comm, block: BlockMesh | None, scale: float) -> tuple[Any, Any]:
    """Partition the mesh of a block over the ranks of `comm`; collective.

    Args:
        comm: communicator
        block: the mesh on rank 0, ignored elsewhere
        scale: factor on the coordinates, 1/L for a block of unit side

    Returns:
        dolfinx mesh and facet tags (BASE, SIDE_X, SIDE_Y, TOP).
    """
    import basix.ufl
    import ufl

    compat.start()

    from dolfinx import mesh as dmesh

    element = basix.ufl.element("Lagrange", "tetrahedron", DEGREE, shape=(3,))
    if comm.rank == 0:
        assert block is not None
        cells = block.tets[:, compat.gmsh_to_dolfinx(NODES)]
        points = block.points * scale
    else:
        cells, points = np.empty((0, NODES), dtype=np.int64), np.empty((0, 3))
    mesh = dmesh.create_mesh(comm, cells=cells, x=points, e=ufl.Mesh(element))  # 0.10 changed their order
    return mesh, _tag_facets(mesh)


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
