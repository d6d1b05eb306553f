"""Nodes that have copies on periodic sides of the block, and values there."""

from __future__ import annotations

import numpy as np

from asperity.arrays import Floats, Indices
from asperity.errors import MeshError
from asperity.mesh.block import NEAR, BlockMesh
from asperity.mesh.element import outer_faces


def total(values: Floats, same: Indices | None) -> Floats:
    """Sum of values (n,) over the copies of each node, which have a number in common, `same`; None: no node has one."""
    return values if same is None else np.bincount(same, values)[same].astype(float)


def greatest(values: Floats, same: Indices | None) -> Floats:
    """Maximum over the copies of each node, see `total`."""
    if same is None:
        return values
    most: Floats = np.full(1 + int(same.max()), -np.inf)
    np.maximum.at(most, same, values)
    return np.asarray(most[same])


def same_nodes(points: Floats, side: float) -> Indices:
    """Number of the node at x < L and y < L that each node is the same as, often itself (N,).

    Raises:
        MeshError: a node at x = L or y = L has no partner on the opposite side
    """
    from scipy.spatial import cKDTree

    near = NEAR * side
    moved = points.copy()
    moved[:, :2][np.abs(points[:, :2] - side) < near] = 0.0
    beyond = (moved != points).any(axis=1)
    on_low = np.flatnonzero((np.abs(points[:, :2]) < near).any(axis=1) & ~beyond)
    distance, at = cKDTree(points[on_low]).query(moved[beyond], distance_upper_bound=near)
    if not np.isfinite(distance).all():
        _refuse(int(np.sum(~np.isfinite(distance))))
    same = np.arange(len(points))
    same[beyond] = on_low[at]
    return same


def joined(block: BlockMesh | None) -> Indices:
    """As `same_nodes`, for the nodes of a mesh whose opposite sides fit face to face (N,).

    Raises:
        MeshError: they do not, or an element is too wide
    """
    assert block is not None
    widest = float(np.ptp(block.points[block.tets[:, :4], :2], axis=1).max())
    if widest >= 0.5 * block.side:  # in wider ones, two edges could have the same ends
        raise MeshError(
            f'block.sides = "periodic": an element is {widest:.3g} wide, and must be narrower than half the side '
            f"{block.side:.3g}: reduce mesh.h_max"
        )
    same = same_nodes(block.points, block.side)
    faces = outer_faces(same[block.tets])[:, :3]
    x, y, _ = np.abs(np.moveaxis(block.points[faces], 2, 0)) < NEAR * block.side
    left = np.flatnonzero(x.all(axis=1) | y.all(axis=1))
    if len(left):
        _refuse(len(left))
    return same


def _refuse(count: int) -> None:
    raise MeshError(
        f'block.sides = "periodic": {count} nodes or faces on the sides of the mesh have no partner on the opposite '
        "side: leave mesh.file out, or mesh the case again"
    )
