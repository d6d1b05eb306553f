"""Section of a tetrahedral mesh by a vertical plane."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from asperity.arrays import Array
from asperity.mesh.element import FACES, face_functions


def cut(points: Array, tets: NDArray[np.integer], y: float, parts: int = 3) -> tuple[list[Array], Array]:
    """Cut curved tetrahedra by the plane of constant y.

    Each curved face is divided into parts^2 plane triangles. Their intersections with the plane are collected for each
    cell and sorted around their centre.

    Args:
        points: nodes (N, 3) [length]
        tets: elements in gmsh's node order (M, 10)
        y: position of the plane [length]
        parts: divisions of each edge

    Returns:
        polygons, each (k, 2) in x and z; the size of each element, the edge of a regular tetrahedron of its volume
    """
    # shifted slightly inwards, so that the plane neither touches a side nor contains whole faces
    y += 1e-7 * (points[:, 1].max() + points[:, 1].min() - 2 * y + 0.1 * np.ptp(points[:, 1]))
    height = points[tets, 1]
    crossing = np.flatnonzero((height.min(axis=1) < y) & (height.max(axis=1) > y))
    cells = tets[crossing]
    corners, triangles = _divided(parts)
    faces = np.einsum("pk,cfkd->cfpd", corners, points[cells[:, FACES]])
    pieces = faces[:, :, triangles].reshape(len(cells), -1, 3, 3)
    polygons, kept = [], []
    for index, ends in enumerate(_crossings(pieces, y)):
        if len(ends) >= 3:
            polygons.append(_ordered(ends))
            kept.append(index)
    return polygons, _sizes(points, cells[kept])


def _divided(parts: int) -> tuple[Array, NDArray[np.int64]]:
    """Shape functions of a face at the nodes of a divided triangle, and the small triangles."""
    nodes = [(i, j) for j in range(parts + 1) for i in range(parts + 1 - j)]
    number = {node: n for n, node in enumerate(nodes)}
    u, v = np.array(nodes).T / parts
    triangles = []
    for i, j in nodes:
        if i + j < parts:
            triangles.append([number[i, j], number[i + 1, j], number[i, j + 1]])
        if i + j < parts - 1:
            triangles.append([number[i + 1, j], number[i + 1, j + 1], number[i, j + 1]])
    return face_functions(np.column_stack([1 - u - v, u, v])), np.array(triangles)


def _crossings(pieces: Array, y: float) -> list[Array]:
    """Points (x, z) where edges of the small triangles (c, t, 3, 3) of each cell cross the plane."""
    start, stop = pieces, np.roll(pieces, -1, axis=2)
    a, b = start[..., 1] - y, stop[..., 1] - y
    crossed = (a < 0) != (b < 0)
    share = np.where(crossed, a / np.where(crossed, a - b, 1.0), 0.0)
    ends = (start + share[..., None] * (stop - start))[..., [0, 2]]
    return [ends[cell][crossed[cell]] for cell in range(len(pieces))]


def _ordered(ends: Array) -> Array:
    """Sort points by their angle about the centre."""
    return ends[np.argsort(np.arctan2(*(ends - ends.mean(axis=0)).T))]


def _sizes(points: Array, cells: NDArray[np.integer]) -> Array:
    corner = points[cells[:, :4]]
    volume = np.abs(np.linalg.det(corner[:, 1:] - corner[:, :1])) / 6
    return np.cbrt(6 * np.sqrt(2) * volume)
