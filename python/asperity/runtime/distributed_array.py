"""Arrays whose rows are spread over the ranks in equal blocks: filled from any ranks, looked up, passed to rank 0.

No rank holds more than two blocks and the rows that it gives or wants, except rank 0, which holds a whole array that it
reads from a file or collects. Rows travel as they are in memory, without pickling.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from itertools import chain
from math import prod
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from asperity.arrays import Array, Indices
from asperity.runtime.files import Stream
from asperity.runtime.parallel import on_root_bcast

if TYPE_CHECKING:
    from mpi4py import MPI

T = TypeVar("T")


@dataclass(frozen=True, eq=False)
class DistributedArray:
    """Block of the rows of an array that this rank holds.

    Attributes:
        comm: the ranks, which hold blocks of equal size in their order; the last ones may be shorter or empty
        values: rows of this rank (n, ...)
        total: number of rows on all ranks

    Examples:
        >>> from mpi4py import MPI
        >>> array = share(MPI.COMM_SELF, np.array([2, 0, 1]), np.array([0.2, 0.0, 0.1]), total=3)
        >>> array.shape, array.values, look_up(array, np.array([1, 1]))
        ((3,), array([0. , 0.1, 0.2]), array([0.1, 0.1]))
    """

    comm: MPI.Comm
    values: Array
    total: int

    @property
    def shape(self) -> tuple[int, ...]:
        """Shape of the whole array."""
        return (self.total, *self.values.shape[1:])

    @property
    def numbers(self) -> Indices:
        """Numbers of the rows of this rank (n,)."""
        return np.arange(*bounds(self.comm, self.total)[self.comm.rank])


def share(comm: MPI.Comm, numbers: Indices, values: Array, total: int, fill: Any = 0) -> DistributedArray:
    """Array with the given rows; collective.

    Args:
        numbers: of rows of the array (n,); a row may have several givers
        values: of these rows (n, ...), the same from all givers
        total: number of rows of the array
        fill: value of rows that nobody gives
    """
    start, stop = bounds(comm, total)[comm.rank]
    out = np.full((stop - start, *values.shape[1:]), fill, dtype=values.dtype)
    order, counts = _by_holder(comm, numbers, total)
    given, _ = exchange(comm, numbers[order], counts)
    out[given - start], _ = exchange(comm, values[order], counts)
    return DistributedArray(comm, out, total)


def look_up(array: DistributedArray, wanted: Indices) -> Array:
    """Rows `wanted` (n,) of an array, each rank its own ones (n, ...); collective."""
    start, _ = bounds(array.comm, array.total)[array.comm.rank]
    return _ask(array.comm, wanted, array.total, lambda asked: array.values[asked - start])


def share_some(comm: MPI.Comm, numbers: Indices, values: Array) -> tuple[DistributedArray, DistributedArray]:
    """Numbers (n,) of some rows in ascending order, each once, and the rows (n, ...); collective."""
    at, total = places(comm, numbers)
    return share(comm, at, numbers, total), share(comm, at, values, total)


def look_up_some(numbers: DistributedArray, rows: DistributedArray, wanted: Indices, fill: float = 0.0) -> Array:
    """Rows `wanted` of the result of `share_some`, `fill` where there is none; collective."""
    total = count(numbers.comm, numbers.values, wanted)
    place = share(numbers.comm, numbers.values, numbers.numbers, total, fill=-1)
    at = look_up(place, wanted)
    out = np.full((len(wanted), *rows.values.shape[1:]), fill)
    out[at >= 0] = look_up(rows, at[at >= 0])
    return out


def places(comm: MPI.Comm, numbers: Indices) -> tuple[Indices, int]:
    """Place of each number (n,) among the distinct ones of all ranks, ascending, and their count; collective."""
    total = 0

    def place(asked: Indices) -> Indices:
        nonlocal total
        distinct, at = np.unique(asked, return_inverse=True)
        of_ranks = comm.allgather(len(distinct))
        total = sum(of_ranks)
        return np.asarray(sum(of_ranks[: comm.rank]) + at.ravel(), dtype=np.int64)

    found = _ask(comm, numbers, count(comm, numbers), place)
    return found, total


def pieces(array: DistributedArray) -> Iterator[Array]:
    """Block after block on rank 0; the others send theirs. Collective: all ranks must exhaust it."""
    comm, block = array.comm, array.values
    for rank, (start, stop) in enumerate(bounds(comm, array.total)):
        if rank and comm.rank == rank:
            comm.Send(_bytes(block), 0)
        elif rank and comm.rank == 0:
            block = np.empty((stop - start, *block.shape[1:]), dtype=block.dtype)
            comm.Recv(_bytes(block), rank)
        if comm.rank == 0 and stop > start:
            yield block


def collect(array: DistributedArray) -> Array | None:
    """All rows on rank 0, None elsewhere; collective."""
    rows = list(pieces(array))
    return np.concatenate([array.values[:0], *rows]) if array.comm.rank == 0 else None


def stream(array: DistributedArray) -> Stream:
    """The rows on their way to rank 0; see `pieces`."""
    return Stream(array.values.dtype, array.shape, pieces(array))


def on_root_of(comm: MPI.Comm, streams: Iterable[Stream], work: Callable[[], T]) -> T:
    """Do work on rank 0 that takes streams in their order, and broadcast its result, see `on_root_bcast`; collective.

    Where the work fails, the other ranks send all the same.
    """
    rows = [stream.rows for stream in streams]

    def exhaust() -> None:
        deque(chain.from_iterable(rows), maxlen=0)

    def drained() -> T:
        try:
            return work()
        finally:
            exhaust()

    if comm.rank:
        exhaust()
    return on_root_bcast(comm, drained)


def deal(comm: MPI.Comm, array: Array | None) -> DistributedArray:
    """Blocks of an array of rank 0, None elsewhere; collective."""
    shape, dtype = comm.bcast(None if array is None else (array.shape, array.dtype), root=0)
    values: Array = np.empty(0)
    for rank, (start, stop) in enumerate(bounds(comm, shape[0])):
        if array is not None and rank:
            comm.Send(_bytes(array[start:stop]), rank)
        elif array is not None:
            values = array[start:stop].copy()
        elif comm.rank == rank:
            values = np.empty((stop - start, *shape[1:]), dtype=dtype)
            comm.Recv(_bytes(values), 0)
    return DistributedArray(comm, values, shape[0])


def exchange(comm: MPI.Comm, values: Array, counts: Indices) -> tuple[Array, Indices]:
    """Send rows (n, ...), ordered by the ranks that get so many each; rows received and their number; collective."""
    from mpi4py import MPI

    received = np.empty_like(counts)
    comm.Alltoall(counts, received)
    out = np.empty((received.sum(), *values.shape[1:]), dtype=values.dtype)
    row = MPI.BYTE.Create_contiguous(values.dtype.itemsize * prod(values.shape[1:])).Commit()
    comm.Alltoallv([np.ascontiguousarray(values), counts, row], [out, received, row])
    row.Free()
    return out, received


def count(comm: MPI.Comm, *numbers: Indices) -> int:
    """One more than the greatest number of all ranks."""
    from mpi4py import MPI

    return 1 + int(comm.allreduce(max(int(n.max(initial=-1)) for n in numbers), MPI.MAX))


def _ask(comm: MPI.Comm, numbers: Indices, total: int, answer: Callable[[Indices], Array]) -> Array:
    """Answers of the ranks that hold the rows of these numbers, a row for each of the numbers; collective."""
    order, counts = _by_holder(comm, numbers, total)
    asked, back = exchange(comm, numbers[order], counts)
    answers, _ = exchange(comm, answer(asked), back)
    out = np.empty_like(answers)
    out[order] = answers
    return out


def _by_holder(comm: MPI.Comm, numbers: Indices, total: int) -> tuple[Indices, Indices]:
    """Order of rows by the rank that holds them (n,), and their count for each rank."""
    holder = numbers // max(1, -(-total // comm.size))
    return np.argsort(holder.astype(np.uint16), kind="stable"), np.bincount(holder, minlength=comm.size)


def bounds(comm: MPI.Comm, total: int) -> list[tuple[int, int]]:
    """First row of each rank and that after its last."""
    block = max(1, -(-total // comm.size))
    return [(min(total, rank * block), min(total, (rank + 1) * block)) for rank in range(comm.size)]


def _bytes(values: Array) -> Any:
    from mpi4py import MPI

    return [values, MPI.BYTE]
