# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

"""Which cases of a study a job and its groups of ranks take: parts, portions with one mesh, and their queue."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

import numpy as np

from asperity.errors import InputError
from asperity.study.definition import Entry
from asperity.study.shared_mesh import mesh_key

if TYPE_CHECKING:
    from mpi4py import MPI

PORTIONS = 4  # portions per group, approximately: with fewer, groups become idle; with more, meshes are built twice


def part(entries: Sequence[Entry], number: int, parts: int) -> list[int]:
    """Return the case numbers of a part of a study; all parts together are the study.

    Cases with the same mesh are next to each other, so that few parts build the same mesh. The parts differ by one case
    at most, and depend on the study only, not on what is finished.

    Args:
        entries: of the study.
        number: of the part, from 1.
        parts: number of all parts; those beyond the number of cases are empty.

    Raises:
        InputError: there is no part of that number.

    Examples:
        >>> from asperity.study.portions import part
        >>> part([], 1, 2)
        []
    """
    if not 1 <= number <= parts:
        raise InputError(
            f"--only {number}/{parts} is no part: the first is 1/{max(parts, 1)}, the last {parts}/{parts}"
        )
    ordered = [i for batch in _by_mesh(entries, range(len(entries))) for i in batch]
    first, last = ((n * len(ordered)) // parts for n in (number - 1, number))
    return ordered[first:last]


def portions(entries: Sequence[Entry], todo: Sequence[int], groups: int) -> list[list[int]]:
    """Divide case numbers into portions with one mesh each, small enough to keep all groups busy to the end."""
    size = max(1, -(-len(todo) // (PORTIONS * groups))) if groups > 1 else len(todo)
    return [batch[i : i + size] for batch in _by_mesh(entries, todo) for i in range(0, len(batch), size)]


def _by_mesh(entries: Sequence[Entry], numbers: Iterable[int]) -> list[list[int]]:
    """Case numbers in groups with the same mesh."""
    batches: dict[str, list[int]] = {}
    for i in numbers:
        batches.setdefault(mesh_key(entries[i].case), []).append(i)
    return list(batches.values())


class Queue:
    """Two counters shared by all ranks of a communicator: portions taken and cases finished.

    They are in the memory of rank 0 and are updated by atomic one-sided operations, so that rank 0 can compute at the
    same time.
    """

    def __init__(self, comm: MPI.Intracomm) -> None:
        from mpi4py import MPI

        self._comm, self._add = comm, MPI.SUM
        size = MPI.INT64_T.Get_size()
        self._window = MPI.Win.Allocate(2 * size if comm.rank == 0 else 0, size, comm=comm)
        if comm.rank == 0:
            np.frombuffer(self._window.tomemory(), dtype=np.int64)[:] = 0
        comm.Barrier()

    def take(self) -> int:
        """Return the number of the next portion and advance the counter."""
        return self._next(0)

    def count(self) -> int:
        """Count a finished case; return the number of finished cases."""
        return self._next(1) + 1

    def _next(self, place: int) -> int:
        one, before = np.ones(1, np.int64), np.zeros(1, np.int64)
        self._window.Lock(0)
        self._window.Fetch_and_op(one, before, 0, place, self._add)
        self._window.Unlock(0)
        return int(before[0])

    def close(self) -> None:
        """Wait for all ranks and free the counters; collective."""
        self._comm.Barrier()
        self._window.Free()
