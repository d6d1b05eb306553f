"""Order of the displacement nodes in memory.

A product with the tangent reads for each node those that share a cell with it. It is fast where they are in the cache
of the processor because the nodes before have the same neighbours.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from asperity.arrays import Indices, Integers
from asperity.fem.ghosts import Ghosts
from asperity.mesh.element import DEGREE, node_ends
from asperity.runtime import compat


def displacement_space(mesh: Any) -> Any:
    """Space of second-order displacements whose nodes are in the order of `cuthill_mckee`; collective."""
    from dolfinx import fem

    V = fem.functionspace(mesh, ("Lagrange", DEGREE, (3,)))
    index_map = V.dofmap.index_map
    owned, nodes = index_map.size_local, index_map.size_local + index_map.num_ghosts
    order = cuthill_mckee(V.dofmap.list, nodes)
    new = np.arange(nodes)
    new[order[order < owned]] = np.arange(owned)
    numbers = index_map.local_range[0] + new[:owned, None].astype(float)
    ghosts = Ghosts(index_map).scatter_forward(numbers)[owned:, 0].astype(np.int64)
    return compat.renumbered(V, new[V.dofmap.list].astype(np.int32), ghosts)


def cuthill_mckee(cell_nodes: Integers, nodes: int) -> Indices:
    """Order of the nodes of second-order tetrahedra (nodes,): that of the corners, and edges where both ends are known.

    The corners are in the reverse order of Cuthill & McKee (Proc. 24th Nat. Conf. ACM (1969) 157). A node on an edge
    comes just before the later of its ends, so the nodes around a corner lie one after the other.

    Args:
        cell_nodes: nodes of each cell in the order of dolfinx (cells, 10)
    """
    from scipy import sparse
    from scipy.sparse.csgraph import reverse_cuthill_mckee

    if not len(cell_nodes):  # a rank may have none
        return np.arange(nodes)
    corners, at = np.unique(cell_nodes[:, :4], return_inverse=True)
    at, cells = at.reshape(-1, 4), len(cell_nodes)
    entries = np.ones(at.size, dtype=np.int8), at.ravel(), np.arange(0, at.size + 1, 4)
    incidence = sparse.csr_array(entries, shape=(cells, len(corners)))
    graph = sparse.csr_matrix(incidence.T @ incidence)
    place = np.empty(len(corners), dtype=np.int64)
    place[reverse_cuthill_mckee(graph, symmetric_mode=True)] = np.arange(len(corners))
    ends = np.full((nodes, 2), len(corners))  # nodes that no cell holds come last
    for k, of_edge in enumerate(node_ends()):
        ends[cell_nodes[:, k]] = place[at[:, of_edge]]
    return np.lexsort((ends.min(axis=1), ends.max(axis=1)))
