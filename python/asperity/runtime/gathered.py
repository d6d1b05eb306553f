"""Rows of all ranks gathered on rank 0 by their numbers, and handed out again to any ranks.

Only rank 0 holds arrays of the whole mesh: the mesh that it has made, and the arrays that it writes.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from asperity.arrays import Array, Indices
from asperity.runtime.parallel import on_root_bcast

if TYPE_CHECKING:
    from mpi4py import MPI

T = TypeVar("T")


def gather(comm: MPI.Comm, numbers: Indices, rows: Array) -> tuple[Indices, Array] | None:
    """Numbers of the rows of all ranks, ascending, each once, and the rows; on rank 0, None elsewhere; collective.

    Args:
        numbers: of the rows of this rank (n,); several ranks may have the same
        rows: those of this rank (n, ...), the same of all ranks that have them

    Examples:
        >>> from mpi4py import MPI
        >>> numbers, rows = gather(MPI.COMM_SELF, np.array([4, 0, 4]), np.array([0.4, 0.0, 0.4]))
        >>> numbers, rows, hand_out(MPI.COMM_SELF, (numbers, rows), np.array([4, 5]), fill=-1.0)
        (array([0, 4]), array([0. , 0.4]), array([ 0.4, -1. ]))
    """
    if comm.rank:
        comm.send((numbers, rows), 0)
        return None
    parts = [(numbers, rows), *(comm.recv(source=rank) for rank in range(1, comm.size))]
    numbers, rows = (np.concatenate(of_ranks) for of_ranks in zip(*parts, strict=True))
    distinct, first = np.unique(numbers, return_index=True)
    return distinct, rows[first]


def hand_out(comm: MPI.Comm, found: tuple[Indices, Array] | None, wanted: Indices, fill: float = 0.0) -> Array:
    """Rows of `wanted` numbers (n,) of this rank, from what rank 0 has, see `gather`; collective.

    Args:
        found: numbers in ascending order and rows on rank 0, None elsewhere
        fill: in rows that are not there
    """
    if found is None:
        comm.send(wanted, 0)
        return np.asarray(comm.recv(source=0))
    numbers, rows = found

    def of(wanted: Indices) -> Array:
        out = np.full((len(wanted), *rows.shape[1:]), fill)
        place = np.searchsorted(numbers, wanted)
        there = np.append(numbers, -1)[place] == wanted
        out[there] = rows[place[there]]
        return out

    for rank in range(1, comm.size):
        comm.send(of(comm.recv(source=rank)), rank)
    return of(wanted)


def on_root_of(comm: MPI.Comm, rows: Iterator[Any], work: Callable[[], T]) -> T:
    """Do work on rank 0 that takes an iterator, and broadcast its result, see `on_root_bcast`; collective.

    The steps of the iterator are collective: they are taken on the other ranks too, also where the work fails.
    """

    def drained() -> T:
        try:
            return work()
        finally:
            deque(rows, maxlen=0)

    if comm.rank:
        deque(rows, maxlen=0)
    return on_root_bcast(comm, drained)
