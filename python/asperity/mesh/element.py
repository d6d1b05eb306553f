"""The element of all meshes, the second-order tetrahedron: orders of its nodes, shape functions, facets, quadrature.

All that the program knows of it is here and in solver/element.hpp. Another Lagrange element on tetrahedra has other
constants here and other values in the functions of its faces.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from asperity.arrays import Array, Floats, Indices, Integers

DEGREE = 2  # of the shape functions
NODES = 10  # of a cell: the corners, then the middles of the edges
QUADRATURE_DEGREE = 2  # of the cells: four points; degree 4 moved the force by less than 0.1 %

#: Corners at the ends of the edges in the order of gmsh; the middles of the first ON_EDGES are the nodes from 4 on.
EDGES = ((0, 1), (1, 2), (0, 2), (0, 3), (2, 3), (1, 3))
ON_EDGES = NODES - 4
#: Nodes of the faces in the order of gmsh: the corners, then the nodes on the edges 01, 12, 20 of the face.
FACES = ((0, 1, 2, 4, 5, 6), (0, 1, 3, 4, 9, 7), (0, 2, 3, 6, 8, 7), (1, 2, 3, 5, 8, 9))
FACE_TRIANGLES = ((0, 3, 5), (1, 4, 3), (2, 5, 4), (3, 4, 5))  # linear ones through all nodes of a face in that order
#: Points of the nodes of a facet on the reference triangle, in the order of dolfinx: corners, middles opposite to them.
FACET_POINTS = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [0.5, 0.5], [0.0, 0.5], [0.5, 0.0]])
#: Nodes of a facet that carry a uniform pressure, each an equal part of it; the others carry nothing.
BEARING = (3, 4, 5)

VTK_TYPE = 24  # quadratic tetrahedron
GMSH_TO_VTK = (0, 1, 2, 3, 4, 5, 6, 7, 9, 8)  # the last two edges are swapped

# -- shape functions and quadrature ----------------------------------------------------------------------------


def basis() -> Any:
    """The basix element of the shape functions."""
    import basix

    family, variant = basix.ElementFamily.P, basix.LagrangeVariant.gll_warped
    return basix.create_element(family, basix.CellType.tetrahedron, DEGREE, variant)


def quadrature(degree: int) -> tuple[Floats, Floats]:
    """Gauss rule of a given degree on the reference tetrahedron: points (Q, 3), weights (Q,)."""
    import basix

    points, weights = basix.make_quadrature(basix.CellType.tetrahedron, degree)
    return points, weights


def linear_through(points: Floats, at: Floats) -> Floats:
    """Values at reference points `at` (N, 3) of the linear function nearest to those at others (Q, 3): (N, Q)."""
    here, there = (np.column_stack([np.ones(len(p)), p]) for p in (points, at))
    return np.asarray(there @ np.linalg.pinv(here))


def facet_quadrature(degree: int) -> tuple[Floats, Floats]:
    """Gauss rule of a given degree on the reference triangle: points (Q, 2), weights (Q,)."""
    import basix

    points, weights = basix.make_quadrature(basix.CellType.triangle, degree)
    return points, weights


def shape_functions(points: Floats) -> Floats:
    """Shape functions at reference points (Q, 3): (Q, NODES)."""
    return np.ascontiguousarray(basis().tabulate(0, points)[0, :, :, 0])


def shape_gradients(points: Floats) -> Floats:
    """Gradients of the shape functions at reference points (Q, 3): (Q, NODES, 3)."""
    return np.ascontiguousarray(np.moveaxis(basis().tabulate(1, points)[1:4, :, :, 0], 0, -1))


def face_functions(coordinates: Array) -> Array:
    """Shape functions of a face, in the order of FACES, at barycentric coordinates (Q, 3): (Q, nodes of a face)."""
    edges = 4.0 * coordinates * np.roll(coordinates, -1, axis=1)
    return np.column_stack([coordinates * (2.0 * coordinates - 1.0), edges])


def at_inside(coordinates: Array, values: Array) -> Array:
    """Values at barycentric coordinates of faces (Q, 3), from those at their nodes, in the order of FACES (Q, 6)."""
    parts = (face_functions(coordinates) * values).T
    return np.asarray(sum(parts[:3]) + sum(parts[3:]))


def to_face(corners: Array) -> Array:
    """Values at the nodes of faces, in the order of FACES, of the linear functions with these corner values (F, 3)."""
    return np.column_stack([corners, 0.5 * (corners + np.roll(corners, -1, axis=1))])


def corner_derivatives() -> Integers:
    """Derivatives of the shape functions, in the order of gmsh, with respect to the barycentric coordinates.

    Returns:
        at each corner, of each function, with respect to each coordinate (4, NODES, 4)
    """
    out = np.zeros((4, NODES, 4), dtype=np.int32)
    for corner in range(4):
        out[corner, range(4), range(4)] = -1
        out[corner, corner, corner] = 3
        for node, (i, j) in enumerate(EDGES, start=4):
            if corner in (i, j):
                out[corner, node, j if corner == i else i] = 4
    return out


# -- nodes in the order of dolfinx -----------------------------------------------------------------------------


def node_ends() -> Integers:
    """Corners at the ends of the edge of each node, for a corner itself twice (NODES, 2)."""
    import basix

    edges = basix.topology(basix.CellType.tetrahedron)[1][:ON_EDGES]
    return np.array([(corner, corner) for corner in range(4)] + edges, dtype=np.int32)


def facet_nodes() -> list[list[int]]:
    """Local nodes of each facet: its corners, then the nodes on the edges opposite to them."""
    nodes: list[list[int]] = basis().entity_closure_dofs[2]
    return nodes


def at_facet(facet: int, points: Floats) -> Floats:
    """Map points of the reference triangle (Q, 2) to a facet of the reference tetrahedron (Q, 3)."""
    import basix.cell

    cell = basix.CellType.tetrahedron
    first = basix.geometry(cell)[basix.topology(cell)[2][facet][0]]
    return np.asarray(first + points @ basix.cell.facet_jacobians(cell)[facet].T)


def area_vectors() -> Floats:
    """Outward normals of the facets of the reference tetrahedron; their length is twice the area (4, 3)."""
    import basix.cell

    cell = basix.CellType.tetrahedron
    normals = np.cross(*np.moveaxis(basix.cell.facet_jacobians(cell), 2, 0))
    return np.where(np.array(basix.cell.facet_orientations(cell))[:, None], -normals, normals)


def to_corners(values: Floats) -> Floats:
    """Values at the nodes of facets (F, nodes of a facet) tested with the hats of the corners (F, 3).

    The hat of a corner is one there and a half on its two edges.
    """
    corners, edges = values[:, :3], values[:, 3:]
    return corners + 0.5 * (edges.sum(axis=1, keepdims=True) - edges)


def projected_area(points: Floats) -> Floats:
    """Area of facets, projected on the plane z = 0 (F,) [length^2].

    Each edge is an arc of a parabola, which adds two thirds of chord times sagitta to the triangle of the corners.

    Args:
        points: of the nodes of each facet, in the order of FACET_POINTS (F, nodes of a facet, 3) [length]
    """
    corners, middles = points[:, :3, :2], points[:, 3:, :2]
    first, last = np.roll(corners, -1, axis=1), np.roll(corners, -2, axis=1)  # ends of the edges, in order around
    triangle = 0.5 * cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    segments = cross(last - first, middles - 0.5 * (first + last)).sum(axis=1)
    return np.abs(triangle - 2.0 / 3.0 * segments)


def cross(a: Floats, b: Floats) -> Floats:
    """The z component of the product of plane vectors (..., 2): (...,)."""
    out: Floats = a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]
    return out


def shares(p: Floats, a: Floats, b: Floats, c: Floats) -> Floats:
    """Barycentric coordinates of points in triangles a, b, c of the plane, each (..., 2): (..., 3)."""
    twice = cross(b - a, c - a)
    second, third = cross(p - a, c - a) / twice, cross(b - a, p - a) / twice
    return np.stack([1.0 - second - third, second, third], axis=-1)


def triangles_at(x: Floats, y: Floats, points: Floats, triangles: Indices) -> Indices:
    """Number of the triangle of the plane that holds each point of a grid (ny, nx); -1 where none does.

    Args:
        x, y: ascending places of the columns and of the rows (nx,), (ny,)
        points: corners (N, 2)
        triangles: numbers of the corners of each, none over another (F, 3)
    """
    corners = points[triangles]
    lowest, highest = corners[..., 1].min(axis=1), corners[..., 1].max(axis=1)
    of, row = _ranges(np.searchsorted(y, lowest), np.searchsorted(y, highest, "right"))
    cuts = np.full((3, len(of)), np.nan)
    for k, cut in enumerate(cuts):
        start, end = corners[of, k], corners[of, k - 1]
        rise = end[:, 1] - start[:, 1]
        share = np.divide(y[row] - start[:, 1], rise, out=np.full(len(of), -1.0), where=rise != 0.0)
        np.copyto(cut, start[:, 0] + share * (end - start)[:, 0], where=(share >= 0.0) & (share <= 1.0))
    near = 1e-12 * np.ptp(points[:, 0])  # neighbours round a common edge otherwise
    first = np.searchsorted(x, np.fmin.reduce(cuts) - near)
    line, column = _ranges(first, np.searchsorted(x, np.fmax.reduce(cuts) + near, "right"))
    found = np.full((len(y), len(x)), -1)
    found[row[line], column] = of[line]
    return found


def _ranges(first: Indices, end: Indices) -> tuple[Indices, Indices]:
    """All numbers from `first` to below `end`, one range after the other, and the number of the range of each."""
    count = end - first
    of = np.repeat(np.arange(len(count)), count)
    return of, np.arange(len(of)) + (first - np.cumsum(count) + count)[of]


# -- cells of a mesh -------------------------------------------------------------------------------------------


def outer_faces(tets: Indices) -> Indices:
    """Nodes, ordered as in FACES, of the faces that do not belong to two tetrahedra: the boundary of the mesh.

    Args:
        tets: node numbers (M, NODES) in the order of gmsh

    Returns:
        (n, nodes of a face)
    """
    faces = np.concatenate([tets[:, nodes] for nodes in FACES])
    corners = np.sort(faces[:, :3], axis=1)
    order = np.lexsort(corners.T[::-1])
    new = np.any(np.diff(corners[order], axis=0) != 0, axis=1)
    first = np.flatnonzero(np.append(True, new))
    times = np.diff(np.append(first, len(faces)))
    return faces[order[first[times != 2]]]


def volumes(x: Floats, x_nodes: Integers) -> Floats:
    """Volumes of the quadrature points of cells (cells, Q), see `jacobians`."""
    points, weights = quadrature(QUADRATURE_DEGREE)
    return jacobians(x, x_nodes, points) * weights


def jacobians(x: Floats, x_nodes: Integers, points: Floats) -> Floats:
    """Jacobian determinants of cells (cells, Q) [length^3].

    Args:
        x: node coordinates (nodes, 3) [length]
        x_nodes: node numbers of the cells in the order of dolfinx (cells, NODES)
        points: reference points (Q, 3)
    """
    cells, found = x[x_nodes], np.empty((len(x_nodes), len(points)))
    for q, gradients in enumerate(shape_gradients(points)):
        a, b, c = np.einsum("cai,aj->jci", cells, gradients)
        found[:, q] = np.einsum("ci,ci->c", a, np.cross(b, c))
    return found


def least_jacobians(x: Floats, x_nodes: Integers) -> Floats:
    """Smallest Jacobian determinant of each curved cell over a lattice of 35 points (cells,) [length^3].

    Args:
        x: node coordinates (nodes, 3) [length]
        x_nodes: node numbers of the cells in the order of dolfinx (cells, NODES)
    """
    import basix

    lattice = basix.create_lattice(basix.CellType.tetrahedron, 4, basix.LatticeType.equispaced, exterior=True)
    return np.asarray(jacobians(x, x_nodes, lattice).min(axis=1))
