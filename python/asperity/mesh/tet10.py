"""The second-order tetrahedron: node orders of gmsh and dolfinx, shape functions, quadrature, Jacobians."""

from __future__ import annotations

from typing import Any

import numpy as np

from asperity import _solver
from asperity.arrays import Floats, Indices, Integers

#: Corners at the ends of the edges with the nodes 4 to 9, in the order of gmsh.
EDGES = ((0, 1), (1, 2), (0, 2), (0, 3), (2, 3), (1, 3))
#: Nodes of the faces in the order of gmsh: the corners, then the nodes on the edges 01, 12, 20 of the face.
FACES = ((0, 1, 2, 4, 5, 6), (0, 1, 3, 4, 9, 7), (0, 2, 3, 6, 8, 7), (1, 2, 3, 5, 8, 9))
#: As EDGES, in the order of dolfinx (basix).
BASIX_EDGES = ((2, 3), (1, 3), (1, 2), (0, 3), (0, 2), (0, 1))


def element() -> Any:
    """The basix element of the ten shape functions."""
    import basix

    family, variant = basix.ElementFamily.P, basix.LagrangeVariant.gll_warped
    return basix.create_element(family, basix.CellType.tetrahedron, 2, variant)


def quadrature(degree: int) -> tuple[Floats, Floats]:
    """Gauss rule of a given degree on the reference tetrahedron: points (Q, 3), weights (Q,)."""
    import basix

    points, weights = basix.make_quadrature(basix.CellType.tetrahedron, degree)
    return points, weights


def facet_quadrature(degree: int, splits: int = 0) -> tuple[Floats, Floats]:
    """Gauss rule on each of the 4^splits equal parts of the reference triangle: points (Q, 2), weights (Q,)."""
    import basix

    points, weights = basix.make_quadrature(basix.CellType.triangle, degree)
    n = 2**splits
    parts = []
    for i in range(n):
        for j in range(n - i):
            parts.append((np.array([i, j]) + points) / n)
            if i + j < n - 1:
                parts.append((np.array([i + 1, j + 1]) - points) / n)
    return np.concatenate(parts), np.tile(weights, n * n) / n**2


def shape_functions(points: Floats) -> Floats:
    """The ten shape functions at reference points (Q, 3): (Q, 10)."""
    return np.ascontiguousarray(element().tabulate(0, points)[0, :, :, 0])


def shape_gradients(points: Floats) -> Floats:
    """Gradients of the ten shape functions at reference points (Q, 3): (Q, 10, 3)."""
    return np.ascontiguousarray(np.moveaxis(element().tabulate(1, points)[1:4, :, :, 0], 0, -1))


def at_facet(facet: int, points: Floats) -> Floats:
    """Map points of the reference triangle (Q, 2) to a facet of the reference tetrahedron (Q, 3)."""
    corners = _corners(facet)
    return corners[0] + points @ (corners[1:] - corners[0])


def facet_nodes() -> list[list[int]]:
    """Local nodes of each facet in the order of dolfinx: its corners, then the nodes on the edges opposite to them."""
    import basix

    topology = basix.topology(basix.CellType.tetrahedron)
    return [
        [*corners, *(4 + topology[1].index([v for v in corners if v != opposite]) for opposite in corners)]
        for corners in topology[2]
    ]


def area_vectors() -> Floats:
    """Outward normals of the facets of the reference tetrahedron; their length is twice the area (4, 3)."""
    out = np.empty((4, 3))
    for facet in range(4):
        corners = _corners(facet)
        n = np.cross(corners[1] - corners[0], corners[2] - corners[0])
        inside = np.full(3, 0.25) - corners[0]
        out[facet] = -n * np.sign(n @ inside)
    return out


def _corners(facet: int) -> Floats:
    """Corners of a facet of the reference tetrahedron (3, 3)."""
    import basix

    topology = basix.topology(basix.CellType.tetrahedron)
    return np.asarray(basix.geometry(basix.CellType.tetrahedron)[topology[2][facet]])


def outer_faces(tets: Indices) -> Indices:
    """Nodes (n, 6), ordered as in FACES, of the faces that do not belong to two tetrahedra: the boundary of the mesh.

    Args:
        tets: node numbers (M, 10) in the order of gmsh
    """
    faces = np.concatenate([tets[:, nodes] for nodes in FACES])
    corners = np.sort(faces[:, :3], axis=1)
    order = np.lexsort(corners.T[::-1])
    new = np.any(np.diff(corners[order], axis=0) != 0, axis=1)
    first = np.flatnonzero(np.append(True, new))
    times = np.diff(np.append(first, len(faces)))
    return faces[order[first[times != 2]]]


def least_jacobians(x: Floats, x_nodes: Integers) -> Floats:
    """Smallest Jacobian determinant of each curved cell over a lattice of 35 points (cells,) [length^3].

    Args:
        x: node coordinates (nodes, 3) [length]
        x_nodes: node numbers of the cells in the order of dolfinx (cells, 10)
    """
    import basix

    lattice = basix.create_lattice(basix.CellType.tetrahedron, 4, basix.LatticeType.equispaced, exterior=True)
    cells = _solver.Cells(x, x_nodes, x_nodes, shape_gradients(lattice), np.ones(len(lattice)))
    out = np.empty(len(x_nodes))
    _solver.min_jacobian(cells, out)
    return out
