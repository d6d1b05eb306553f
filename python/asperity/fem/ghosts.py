"""Ghost updates: exchange of nodal values between ranks, by the names of dolfinx, and sums in one exchange."""

from __future__ import annotations

from functools import partial
from typing import Any, TypeVar

import numpy as np
import numpy.typing as npt

from asperity.arrays import Singles
from asperity.runtime import compat

TAG = 52  # of the messages of a sum
Real = TypeVar("Real", np.float32, np.float64)


class Ghosts:
    """Ghost update of nodal values. A node of several ranks is owned by one of them and a ghost on the others.

    Results are views of buffers, which the next exchange of the same width and precision overwrites. On a single rank
    the result is the argument.
    """

    def __init__(self, index_map: Any) -> None:
        self._map, self._alone = index_map, index_map.comm.size == 1
        self._buffers: dict[Any, Any] = {}  # setting up an exchange is collective and slower than an exchange

    def scatter_forward(self, owned: npt.NDArray[Real]) -> npt.NDArray[Real]:
        """Append the values of the ghosts to those of the owned nodes (owned, k): (nodes, k); collective."""
        if self._alone:
            return owned
        vector, values = self._buffer(owned)
        values[: len(owned)] = owned
        vector.scatter_forward()
        return values

    def scatter_reverse(self, values: npt.NDArray[Real]) -> npt.NDArray[Real]:
        """Sum nodal values (nodes, k) over the ranks that hold a node; at the owned nodes (owned, k); collective."""
        if self._alone:
            return values
        from dolfinx import la

        vector, sums = self._buffer(values)
        sums[:] = values
        vector.scatter_reverse(la.InsertMode.add)
        return sums[: self._map.size_local]

    def _buffer(self, like: npt.NDArray[Real]) -> tuple[Any, npt.NDArray[Real]]:
        from dolfinx import la

        width = like.shape[1]
        key = width, like.dtype
        if key not in self._buffers:
            self._buffers[key] = la.vector(self._map, width, like.dtype)
        vector = self._buffers[key]
        return vector, vector.array.reshape(-1, width)


class SharedSums:
    """Sums of nodal values over the ranks that hold a node, on each of them: one exchange between neighbours.

    All add the parts of a node in the order of the ranks, so they have the same sum to the last bit.

    Args:
        width: values of a node, in single precision
    """

    def __init__(self, index_map: Any, comm: Any, width: int) -> None:
        from scipy import sparse

        nodes = np.arange(index_map.size_local + index_map.num_ghosts, dtype=np.int32)
        holders = compat.ghost_holders(index_map)
        of_node, rank = np.repeat(nodes, np.diff(holders.offsets)), holders.array
        order = np.lexsort((index_map.local_to_global(nodes)[of_node], rank))
        self._sent = of_node[order]  # by the other rank, then in an order that both know
        self._shared, row = np.unique(self._sent, return_inverse=True)
        own = len(self._shared)
        self._out = np.empty((len(self._sent), width), dtype=np.float32)
        self._parts = np.empty((own + len(self._sent), width), dtype=np.float32)  # those of this rank first
        ranks, starts, counts = np.unique(rank[order], return_index=True, return_counts=True)
        self._messages = [
            (partial(comm.Irecv, self._parts[own + start : own + start + count], other, TAG),
             partial(comm.Isend, self._out[start : start + count], other, TAG))
            for other, start, count in zip(ranks.tolist(), starts, counts, strict=True)
        ]  # fmt: skip
        row = np.concatenate([np.arange(own), row])
        by_rank = np.lexsort((np.concatenate([np.full(own, comm.rank), rank[order]]), row))
        pointers = np.searchsorted(row[by_rank], np.arange(own + 1))
        ones = np.ones(len(row), dtype=np.float32)
        self._sum = sparse.csr_array((ones, by_rank, pointers), (own, len(row)))

    def add(self, values: Singles) -> None:
        """Add the parts of the other ranks to nodal values (nodes, width) in place; collective."""
        from mpi4py import MPI

        np.take(values, self._sent, axis=0, out=self._out, mode="clip")
        requests = [start() for message in self._messages for start in message]
        own = self._parts[: len(self._shared)]
        np.take(values, self._shared, axis=0, out=own, mode="clip")
        MPI.Request.Waitall(requests)
        values[self._shared] = self._sum @ self._parts
