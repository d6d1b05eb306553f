"""Nodes that have copies, on several ranks or on periodic sides of the block, and values there."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from asperity.arrays import Floats, Indices
from asperity.errors import MeshError
from asperity.mesh.block import NEAR, BlockMesh
from asperity.mesh.element import outer_faces

if TYPE_CHECKING:
    from mpi4py import MPI


class Exchange:
    """Sum or maximum of the values that several ranks have at a node, with the result on all of them."""

    def __init__(self, index_map: Any) -> None:
        from mpi4py import MPI
        from petsc4py import PETSc

        comm = self.comm = index_map.comm
        self._owned, self._sf = index_map.size_local, PETSc.SF().create(comm)
        starts = np.array(comm.allgather(index_map.local_range[0]))
        owners = np.asarray(index_map.owners)
        remote = np.column_stack([owners, np.asarray(index_map.ghosts) - starts[owners]]).astype(PETSc.IntType)
        self._sf.setGraph(self._owned, None, remote.ravel())
        self._unit, self._replace = MPI.DOUBLE, MPI.REPLACE

    def merge(self, values: Floats, op: MPI.Op) -> Floats:
        """Combine the values of all ranks at the local nodes, ghosts included (nodes,); collective."""
        owned, ghosts = values[: self._owned].copy(), values[self._owned :].copy()
        self._sf.reduceBegin(self._unit, ghosts, owned, op)
        self._sf.reduceEnd(self._unit, ghosts, owned, op)
        self._sf.bcastBegin(self._unit, owned, ghosts, self._replace)
        self._sf.bcastEnd(self._unit, owned, ghosts, self._replace)
        return np.concatenate([owned, ghosts])


class SharedNodes:
    """What the copies of a node share. All methods are collective where the nodes belong to several ranks.

    Args:
        same: number that the copies of a node on this rank have in common (n,); None where no node has one
        exchange: between the ranks, at nodes with these numbers; None in a single process
    """

    def __init__(self, same: Indices | None = None, exchange: Exchange | None = None) -> None:
        self._same, self._exchange = same, exchange
        self._count = 0 if same is None else 1 + int(same.max(initial=-1))

    def total(self, values: Floats) -> Floats:
        """Sum over the copies of each node (n,)."""
        if self._same is None:
            return values
        sums: Floats = np.bincount(self._same, values, minlength=self._count).astype(float)
        if self._exchange is not None:
            from mpi4py import MPI

            sums = self._exchange.merge(sums, MPI.SUM)
        return np.asarray(sums[self._same])

    def greatest(self, values: Floats) -> Floats:
        """Maximum over the copies of each node (n,)."""
        if self._same is None:
            return values
        most: Floats = np.full(self._count, -np.inf)
        np.maximum.at(most, self._same, values)
        if self._exchange is not None:
            from mpi4py import MPI

            most = self._exchange.merge(most, MPI.MAX)
        return np.asarray(most[self._same])

    def count(self, here: int) -> int:
        """Sum of a number over the ranks."""
        return here if self._exchange is None else int(self._exchange.comm.allreduce(here))

    def least(self, here: float) -> float:
        """Minimum of a number over the ranks."""
        if self._exchange is None:
            return here
        from mpi4py import MPI

        return float(self._exchange.comm.allreduce(here, MPI.MIN))


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
