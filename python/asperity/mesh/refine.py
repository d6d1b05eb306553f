"""Refine a distributed mesh uniformly: each rank splits its tetrahedra into eight, so that none holds the whole mesh.

A tetrahedron is split at the middles of its edges into four at its corners and four in the octahedron between them,
about the shortest diagonal of the octahedron, with which further splits do not distort a regular one more than the
first. Neighbours split their common face alike, so only the numbers of the new nodes take communication: they are those
of the second-order displacements on the mesh before.

Elements and nodes get numbers that do not depend on the ranks: the children of element i of the mesh as built are
8 i to 8 i + 7, and nodes follow the order in which the elements name them first.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from asperity.arrays import Floats, Indices
from asperity.mesh.block import NEAR
from asperity.mesh.element import DEGREE, DIAGONALS, EDGES, NODES, PARTS
from asperity.mesh.morph import lift
from asperity.mesh.shared_nodes import Exchange, SharedNodes
from asperity.runtime import compat
from asperity.runtime.distributed_array import places

if TYPE_CHECKING:
    from asperity.surface import Surface

SPLIT_NODES = 4 + len(EDGES)  # corners and middles of the edges
SIDES = 4  # copies of a node on joined sides, at most


def refined(mesh: Any, times: int, surface: Surface, height: float) -> tuple[Any, Indices]:
    """Refine the flat mesh of a block and lift its nodes onto a surface; collective.

    Args:
        mesh: dolfinx mesh of second-order tetrahedra with straight edges, its sides joined or not [length]
        times: number of times each tetrahedron is split into eight

    Returns:
        Mesh of second-order tetrahedra [length], whose nodes have the numbers of the module's text, and the numbers of
        its local cells

    Raises:
        MeshError: see `morph.lift`
    """
    numbers = np.asarray(mesh.topology.original_cell_index)
    corners = mesh.geometry.x[compat.geometry_dofmap(mesh)[:, :4]]
    for _ in range(times):
        mesh, numbers, corners = _split_cells(mesh, numbers, corners)
    return _lifted(mesh, numbers, corners, surface, height), numbers


def split(x: Floats) -> Indices:
    """Nodes that are the corners of the eight parts of each tetrahedron.

    Args:
        x: their corners and the middles of their edges, in the order of gmsh (M, SPLIT_NODES, 3) [length]

    Returns:
        (M, 8, 4)
    """
    lengths = np.stack([((x[:, i] - x[:, j]) ** 2).sum(axis=1) for (i, j), _ in DIAGONALS])
    return np.asarray(PARTS[np.argmax(lengths * (1.0 - 1e-9) <= lengths.min(axis=0), axis=0)])  # whatever the round-off


def _split_cells(mesh: Any, numbers: Indices, corners: Floats) -> tuple[Any, Indices, Floats]:
    """Mesh of linear tetrahedra on the same ranks, with the numbers (8 M,) and corners (8 M, 4, 3) of its cells."""
    import basix.ufl
    import ufl
    from dolfinx import mesh as dmesh

    nodes, index_map = _nodes(mesh, 2, SPLIT_NODES)
    x = _with_middles(corners)
    owned = nodes < index_map.size_local
    points = np.empty((index_map.size_local, 3))
    points[nodes[owned]] = x[owned]
    rows, parts = np.arange(len(x))[:, None, None], split(x)
    cells = index_map.local_to_global(nodes.ravel()).reshape(nodes.shape)[rows, parts].reshape(-1, 4)
    finer = dmesh.create_mesh(
        mesh.comm, cells=cells, x=points, e=ufl.Mesh(basix.ufl.element("Lagrange", "tetrahedron", 1, shape=(3,))),
        partitioner=compat.stay,
    )  # fmt: skip
    first = mesh.comm.exscan(len(cells)) or 0
    order = np.asarray(finer.topology.original_cell_index) - first
    numbers = (8 * numbers[:, None] + np.arange(8)).ravel()
    return finer, numbers[order], x[rows, parts].reshape(-1, 4, 3)[order]


def _lifted(mesh: Any, numbers: Indices, corners: Floats, surface: Surface, height: float) -> Any:
    """Mesh of the same cells with nodes on their edges, lifted onto a surface."""
    import basix.ufl

    nodes, index_map = _nodes(mesh, DEGREE, NODES)
    x = _with_middles(corners)[:, :NODES]
    far = np.abs(x[:, :, :2] - surface.L) < NEAR * surface.L  # joined nodes differ in this
    keys, tets = np.unique(SIDES * nodes.astype(np.int64) + far @ np.array([1, 2]), return_inverse=True)
    tets = tets.reshape(nodes.shape)
    points: Floats = np.empty((len(keys), 3))
    points[tets] = x
    exchange = Exchange(index_map)
    points, _ = lift(points, tets, surface, height, SharedNodes(keys // SIDES, exchange))
    own = np.full((index_map.size_local + index_map.num_ghosts, SIDES), -np.inf)
    np.maximum.at(own.ravel(), keys[tets], -(NODES * numbers[:, None] + np.arange(NODES)).astype(float))
    of_nodes = _ranked(own, index_map.size_local, exchange).ravel()[keys]
    in_order = tets[:, compat.gmsh_to_dolfinx(NODES)].astype(np.int32)
    element = basix.ufl.element("Lagrange", "tetrahedron", DEGREE, shape=(3,))
    return compat.with_geometry(mesh, of_nodes, in_order, points, element)


def _nodes(mesh: Any, degree: int, count: int) -> tuple[Indices, Any]:
    """Numbers of the nodes of a Lagrange element in each cell, in the order of gmsh (M, count), and their index map."""
    from dolfinx import fem

    dofmap = fem.functionspace(mesh, ("Lagrange", degree)).dofmap
    nodes = np.empty_like(dofmap.list)
    nodes[:, compat.gmsh_to_dolfinx(count)] = dofmap.list
    return nodes, dofmap.index_map


def _with_middles(corners: Floats) -> Floats:
    """Corners and middles of the edges of straight tetrahedra in the order of gmsh (M, SPLIT_NODES, 3)."""
    ends = corners[:, EDGES]
    return np.concatenate([corners, 0.5 * (ends[:, :, 0] + ends[:, :, 1])], axis=1)


def _ranked(keys: Floats, owned: int, exchange: Exchange) -> Indices:
    """Places of whole numbers of all ranks in descending order, -1 for -inf, of copies of nodes (nodes, SIDES)."""
    from mpi4py import MPI

    known = np.column_stack([exchange.merge(column, MPI.MAX) for column in keys.T])[:owned]
    there = np.isfinite(known)
    out = np.full(keys.shape, -1.0)
    out[:owned][there], _ = places(exchange.comm, -known[there].astype(np.int64))
    return np.column_stack([exchange.merge(column, MPI.MAX) for column in out.T]).astype(np.int64)
