"""Ghost updates: exchange of nodal values between ranks, by the names of dolfinx, and sums in one exchange."""

from __future__ import annotations

from typing import Any, TypeVar

import numpy as np
import numpy.typing as npt

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
    """

    def __init__(self, index_map: Any, comm: Any) -> None:
        self._comm = comm
        nodes = np.arange(index_map.size_local + index_map.num_ghosts, dtype=np.int32)
        holders = compat.ghost_holders(index_map)
        of_node, rank = np.repeat(nodes, np.diff(holders.offsets)), holders.array
        order = np.lexsort((index_map.local_to_global(nodes)[of_node], rank))
        self._nodes = of_node[order]  # by the other rank, then in an order that both know
        ranks, starts = np.unique(rank[order], return_index=True)
        self._parts = [*zip(ranks.tolist(), map(slice, starts, [*starts[1:], len(order)]), strict=True)]
        self._shared = np.unique(of_node)

    def add(self, values: npt.NDArray[Real]) -> None:
        """Add the parts of the other ranks to nodal values (nodes, k) in place; collective."""
        from mpi4py import MPI

        out, into = values[self._nodes], np.empty((len(self._nodes), values.shape[1]), dtype=values.dtype)
        requests = [self._comm.Irecv(into[part], rank, TAG) for rank, part in self._parts]
        requests += [self._comm.Isend(out[part], rank, TAG) for rank, part in self._parts]
        own, added = values[self._shared], False
        values[self._shared] = 0.0
        MPI.Request.Waitall(requests)
        for rank, part in self._parts:
            if not added and rank > self._comm.rank:
                values[self._shared] += own
                added = True
            values[self._nodes[part]] += into[part]
        if not added:
            values[self._shared] += own
