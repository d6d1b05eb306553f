"""Sum of nodal values over the ranks that hold a node, with the result on all of them."""

from __future__ import annotations

from typing import Any

import numpy as np

from asperity.arrays import Indices, Singles
from asperity.runtime import compat


class SharedNodes:
    """Nodes that several ranks hold, and the exchange that sums their values.

    Every rank that holds a node gets the sum, and the same to the last bit, in one message to each of the other ranks.
    The ghost updates of `Ghosts` take two in succession, to the owner and back.
    """

    def __init__(self, index_map: Any) -> None:
        self._comm = index_map.comm
        self._ranks: list[int] = []
        if self._comm.size == 1:
            return
        nodes, holders = shared_nodes(index_map)
        self._nodes = np.array(nodes, dtype=np.int64)
        self._ranks = sorted({rank for held in holders for rank in held})
        # which of the shared nodes each rank holds, in the same order on both sides
        self._at = [np.array([k for k, held in enumerate(holders) if r in held], dtype=np.int64) for r in self._ranks]
        self._sent = [np.empty((len(at), 4), dtype=np.float32) for at in self._at]
        self._received = [np.empty((len(at), 4), dtype=np.float32) for at in self._at]

    def sum(self, values: Singles) -> Singles:
        """Sum nodal values (nodes, 4) of all ranks, ghosts included, in place; collective."""
        from mpi4py import MPI

        if not self._ranks:
            return values
        # a row as one number of the same 16 bytes: numpy copies these eight times as fast
        rows = values.view(np.complex128)[:, 0]
        comm, own = self._comm, rows[self._nodes].view(np.float32).reshape(-1, 4)
        if len(self._ranks) == 2:  # one call, and no order of the sum: a + b = b + a
            (other,) = [k for k, rank in enumerate(self._ranks) if rank != comm.rank]
            comm.Sendrecv(own, self._ranks[other], recvbuf=self._received[other], source=self._ranks[other])
            own += self._received[other]
            rows[self._nodes] = own.view(np.complex128)[:, 0]
            return values
        others = [k for k, rank in enumerate(self._ranks) if rank != comm.rank]
        requests = [comm.Irecv(self._received[k], self._ranks[k]) for k in others]
        for k in others:
            self._sent[k][:] = own[self._at[k]]
            requests.append(comm.Isend(self._sent[k], self._ranks[k]))
        MPI.Request.Waitall(requests)
        total = np.zeros_like(own)
        for k, rank in enumerate(self._ranks):  # in the order of the ranks, for the same sum on all of them
            total[self._at[k]] += own if rank == comm.rank else self._received[k]
        rows[self._nodes] = total.view(np.complex128)[:, 0]
        return values


def shared_nodes(index_map: Any) -> tuple[Indices, list[list[int]]]:
    """Local numbers of the nodes that several ranks hold, and these ranks, in the order of their global numbers."""
    comm, rank = index_map.comm, index_map.comm.rank
    links = compat.ghost_holders(index_map)
    owned = np.flatnonzero(np.diff(links.offsets[: index_map.size_local + 1])).astype(np.int32)
    numbers = index_map.local_to_global(owned).tolist()
    holders = {n: sorted([rank, *map(int, links.links(k))]) for n, k in zip(numbers, owned, strict=True)}
    # only the owner knows all ranks that hold a node
    messages: list[dict[int, list[int]]] = [{} for _ in range(comm.size)]
    for number, held in holders.items():
        for other in held:
            if other != rank:
                messages[other][number] = held
    for message in comm.alltoall(messages):
        holders |= message
    order = sorted(holders)
    local = index_map.global_to_local(np.array(order, dtype=np.int64))
    return np.asarray(local, dtype=np.int64), [holders[n] for n in order]
