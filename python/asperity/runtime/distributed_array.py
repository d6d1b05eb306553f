"""Arrays whose rows are spread over the ranks in equal blocks: filled from any ranks, looked up, passed to rank 0.

No rank holds more than its block, the rows that it gives or wants, and a buffer. Rows travel as they are in memory,
without pickling.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from itertools import chain, repeat
from math import prod
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from asperity.arrays import Array, Indices
from asperity.runtime.files import Stream
from asperity.runtime.parallel import on_root_bcast

if TYPE_CHECKING:
    from mpi4py import MPI

T = TypeVar("T")

PIECE = 2**22  # size of a buffer [bytes]


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
        return np.arange(*_bounds(self.comm, self.total, self.comm.rank))


def share(comm: MPI.Comm, numbers: Indices, values: Array, total: int, fill: Any = 0) -> DistributedArray:
    """Array with the given rows; collective.

    Args:
        numbers: of rows of the array (n,); a row may have several givers
        values: of these rows (n, ...), the same from all givers
        total: number of rows of the array
        fill: value of rows that nobody gives
    """
    start, stop = _bounds(comm, total, comm.rank)
    out = np.full((stop - start, *values.shape[1:]), fill, dtype=values.dtype)
    for part in _rounds(comm, values):
        order, counts = _by_holder(comm, numbers[part], total)
        given, _ = exchange(comm, numbers[part][order], counts)
        out[given - start], _ = exchange(comm, values[part][order], counts)
    return DistributedArray(comm, out, total)


def look_up(array: DistributedArray, wanted: Indices) -> Array:
    """Rows `wanted` (n,) of an array, each rank its own ones (n, ...); collective."""
    start, _ = _bounds(array.comm, array.total, array.comm.rank)
    out = np.empty((len(wanted), *array.values.shape[1:]), dtype=array.values.dtype)
    for part in _rounds(array.comm, out):
        out[part] = _ask(array.comm, wanted[part], array.total, lambda asked: array.values[asked - start])
    return out


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
    """Rows in pieces of at most PIECE bytes on rank 0, and send them there elsewhere.

    Collective: all ranks must exhaust it.
    """
    comm, size = array.comm, array.comm.size
    for rank in range(size):
        start, stop = _bounds(comm, array.total, rank)
        for at, end in steps(start, stop, array.shape, array.values.dtype):
            if comm.rank == rank:
                piece = array.values[at - start : end - start]
                if rank == 0:
                    yield piece
                else:
                    comm.Send(_bytes(piece), 0)
            elif comm.rank == 0:
                piece = np.empty((end - at, *array.values.shape[1:]), dtype=array.values.dtype)
                comm.Recv(_bytes(piece), rank)
                yield piece


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


def deal(
    comm: MPI.Comm, shape: tuple[int, ...], dtype: np.dtype[Any], read: Callable[[int], Array] | None
) -> DistributedArray:
    """Array of a shape that rank 0 reads in pieces of at most PIECE bytes; collective.

    On rank 0 `read` returns the next rows, called with their number.
    """
    start, stop = _bounds(comm, shape[0], comm.rank)
    values = np.empty((stop - start, *shape[1:]), dtype=dtype)
    for rank in range(comm.size):
        start, stop = _bounds(comm, shape[0], rank)
        for at, end in steps(start, stop, shape, values.dtype):
            mine = values[at - start : end - start]
            if read is not None:
                piece = read(end - at)
                if rank:
                    comm.Send(_bytes(piece), rank)
                else:
                    mine[:] = piece
            elif comm.rank == rank:
                comm.Recv(_bytes(mine), 0)
    return DistributedArray(comm, values, shape[0])


def exchange(comm: MPI.Comm, values: Array, counts: Indices) -> tuple[Array, Indices]:
    """Send rows (n, ...), in the order of the ranks that receive so many each; collective.

    Returns:
        rows in the order of the ranks that sent them, and their number from each rank
    """
    from mpi4py import MPI

    received = np.empty_like(counts)
    comm.Alltoall(counts, received)
    out = np.empty((received.sum(), *values.shape[1:]), dtype=values.dtype)
    row = MPI.BYTE.Create_contiguous(values.dtype.itemsize * prod(values.shape[1:])).Commit()
    comm.Alltoallv([np.ascontiguousarray(values), counts, row], [out, received, row])
    row.Free()
    return out, received


def _rounds(comm: MPI.Comm, values: Array) -> Iterator[slice]:
    """Parts of the rows of this rank, of at most PIECE bytes and as many on all ranks; collective."""
    from mpi4py import MPI

    parts = [slice(*bounds) for bounds in steps(0, len(values), values.shape, values.dtype)]
    return chain(parts, repeat(slice(0, 0), comm.allreduce(len(parts), MPI.MAX) - len(parts)))


def steps(start: int, stop: int, shape: tuple[int, ...], dtype: np.dtype[Any]) -> Iterator[tuple[int, int]]:
    """Bounds of pieces of at most PIECE bytes between two rows of an array of this shape and type."""
    step = max(1, PIECE // max(1, dtype.itemsize * prod(shape[1:])))
    return ((at, min(stop, at + step)) for at in range(start, stop, step))


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
    holder = numbers // _block(comm, total)
    return np.argsort(holder.astype(np.uint16), kind="stable"), np.bincount(holder, minlength=comm.size)


def _block(comm: MPI.Comm, total: int) -> int:
    return max(1, -(-total // comm.size))


def _bounds(comm: MPI.Comm, total: int, rank: int) -> tuple[int, int]:
    """First row of a rank and that after its last."""
    block = _block(comm, total)
    return min(total, rank * block), min(total, (rank + 1) * block)


def _bytes(values: Array) -> Any:
    from mpi4py import MPI

    return [values, MPI.BYTE]
