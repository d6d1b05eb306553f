"""Bad surfaces and bad meshes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from asperity.arrays import Floats
from asperity.mesh.element import EDGES, outer_faces

if TYPE_CHECKING:
    from asperity.mesh.block import BlockMesh

Nodes = npt.NDArray[np.int64]
#: Heights in units of L at the nodes of a regular grid, from their coordinates (n, n) in the same units.
Map = Callable[[Floats, Floats], Floats]
SAMPLES = 33
SLIVER = 1e-4  # height of a flattened tetrahedron over its original height


def heights(of: Map, n: int = SAMPLES) -> Floats:
    """A height map in units of L (n, n)."""
    t = np.linspace(0.0, 1.0, n)
    return of(*np.meshgrid(t, t))


def two_peaks(x: Floats, y: Floats) -> Floats:
    """Two equal peaks on a diagonal."""
    one, other = (np.exp(-((x - c) ** 2 + (y - c) ** 2) / 0.02) for c in (0.25, 0.75))
    return 0.05 * (one + other)


def two_peaks_turned(x: Floats, y: Floats) -> Floats:
    """`two_peaks` with the peaks on the other diagonal."""
    return two_peaks(x, 1.0 - y)


def _wave(x: Floats, y: Floats) -> Floats:
    return 0.03 * np.cos(2 * np.pi * (x - 0.4)) * np.cos(2 * np.pi * (y - 0.55))


def noisy(x: Floats, y: Floats) -> Floats:
    """A wave with independent noise at each sample, 1 % of the height of the wave."""
    return _wave(x, y) + 5e-4 * np.random.default_rng(0).standard_normal(x.shape)


def spike(x: Floats, y: Floats) -> Floats:
    """A wave with one sample far above the others."""
    z = _wave(x, y)
    z[20, 9] += 0.1
    return z


def with_nan(x: Floats, y: Floats) -> Floats:
    """A wave with a missing sample."""
    z = _wave(x, y)
    z[3, 5] = np.nan
    return z


def with_slivers(block: BlockMesh, count: int = 4) -> BlockMesh:
    """Flatten `count` tetrahedra inside a mesh to SLIVER times their height; none is turned inside out.

    Raises:
        ValueError: the mesh has too few inner corners away from its top
    """
    points, corners = block.points.copy(), block.tets[:, :4]
    inner, top = _inner_and_top(points, block.tets)
    near = {int(node) for node in top}
    for node in inner:
        around = corners[(corners == node).any(axis=1)]
        if not near.isdisjoint(around.ravel()):
            continue
        for cell in around:
            moved = points.copy()
            a, b, c = points[cell[cell != node]]
            normal = np.cross(b - a, c - a)
            normal /= np.linalg.norm(normal)
            moved[node] -= (1.0 - SLIVER) * np.dot(points[node] - a, normal) * normal
            if np.all(_volumes(moved, around) / _volumes(points, around) > 0.0):
                points, count = moved, count - 1
                near.update(around.ravel().tolist())
                break
        if count == 0:
            return replace(block, points=_straightened(points, block.tets, top))
    raise ValueError(f"the mesh has too few inner corners: {count} slivers are still to be made")


def with_turned_element(block: BlockMesh) -> BlockMesh:
    """Move a corner inside a mesh through the opposite face of a tetrahedron."""
    points, corners = block.points.copy(), block.tets[:, :4]
    inner, top = _inner_and_top(points, block.tets)
    cell = corners[(corners == inner[0]).any(axis=1)][0]
    points[inner[0]] += 1.5 * (points[cell[cell != inner[0]]].mean(axis=0) - points[inner[0]])
    return replace(block, points=_straightened(points, block.tets, top))


def _inner_and_top(points: Floats, tets: Nodes) -> tuple[Nodes, Nodes]:
    """Corners on no outer face, and corners of the top, the only outer face that is not plane."""
    outer = outer_faces(tets)[:, :3]
    plane = np.any(np.ptp(points[outer], axis=1) == 0.0, axis=1)
    return np.setdiff1d(tets[:, :4], outer), np.unique(outer[~plane])


def _straightened(points: Floats, tets: Nodes, top: Nodes) -> Floats:
    """Points of the mesh with midside nodes moved to the middle of their edges, except at the top."""
    points, below = points.copy(), ~np.isin(tets[:, :4], top)
    for k, (i, j) in enumerate(EDGES, 4):
        straight = below[:, i] & below[:, j]
        points[tets[straight, k]] = 0.5 * (points[tets[straight, i]] + points[tets[straight, j]])
    return points


def _volumes(points: Floats, corners: Nodes) -> Floats:
    """Six times the signed volumes of tetrahedra."""
    a, b, c, d = np.moveaxis(points[corners], 1, 0)
    return np.einsum("ij,ij->i", np.cross(b - a, c - a), d - a)
