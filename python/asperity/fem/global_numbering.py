"""Fields in a numbering that does not depend on the ranks: that of the mesh as built."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from asperity.arrays import Array, Indices
from asperity.mesh.element import NODES
from asperity.runtime import compat
from asperity.runtime.parallel import gather

if TYPE_CHECKING:
    from asperity.fem.solid import Solid


def node_numbers(solid: Solid) -> Indices:
    """Number in the built mesh of each local displacement node, of one of them where nodes are joined (nodes,)."""
    x_nodes = compat.geometry_dofmap(solid.mesh)
    out = np.full(solid.nodes, -1, dtype=np.int64)
    numbers = solid.mesh.geometry.input_global_indices
    out[solid.V.dofmap.list.ravel()] = np.asarray(numbers)[x_nodes.ravel()]
    return out


def built_nodes(solid: Solid) -> tuple[Indices, Indices]:
    """Numbers in the built mesh of all nodes of this rank's cells, and the displacement node of each (n,)."""
    numbers = np.asarray(solid.mesh.geometry.input_global_indices)
    node = np.empty(len(numbers), dtype=np.int64)
    node[compat.geometry_dofmap(solid.mesh).ravel()] = solid.V.dofmap.list.ravel()
    return numbers, node


def gather_nodes(solid: Solid, values: Array) -> Array | None:
    """Nodal values in the order of the mesh as built, on rank 0; collective; see `built_nodes`."""
    numbers, at = built_nodes(solid)
    found = gather(solid.comm, numbers, values[at])
    return found and found[1]


def gather_cells(solid: Solid, values: Array) -> Array | None:
    """Values of the owned cells (cells, ...) in the order of the mesh as built, on rank 0; collective."""
    found = gather(solid.comm, cell_numbers(solid), values)
    return found and found[1]


def cell_numbers(solid: Solid) -> Indices:
    """Number in the built mesh of each owned cell (cells,)."""
    return np.asarray(solid.mesh.topology.original_cell_index)[: len(solid.cell_nodes)]


def gather_mesh(solid: Solid) -> tuple[Array, Array] | None:
    """Nodes (N, 3) [L] and elements (M, 10), in the order of gmsh, of the mesh as built; on rank 0; collective."""
    numbers = np.asarray(solid.mesh.geometry.input_global_indices)
    x_nodes = compat.geometry_dofmap(solid.mesh)[: len(solid.cell_nodes)]
    points = gather(solid.comm, numbers, solid.mesh.geometry.x)
    tets = np.empty(x_nodes.shape, dtype=np.int64)
    tets[:, compat.gmsh_to_dolfinx(NODES)] = numbers[x_nodes]
    cells = gather_cells(solid, tets)
    return None if points is None or cells is None else (points[1], cells)
