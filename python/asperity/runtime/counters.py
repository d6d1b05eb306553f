# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

"""Counters that all ranks advance, so that each takes the next piece of work when it has finished one."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from mpi4py import MPI


class Counters:
    """Integers from 0 shared by all ranks of a communicator; making and closing them is collective.

    They are in the memory of rank 0 and are updated by atomic one-sided operations, so that rank 0 can compute at the
    same time.

    Args:
        comm: communicator
        size: number of counters

    Examples:
        >>> from mpi4py import MPI
        >>> counters = Counters(MPI.COMM_SELF, 2)
        >>> counters.advance(0), counters.advance(0), counters.advance(1)
        (0, 1, 0)
        >>> counters.close()
    """

    def __init__(self, comm: MPI.Intracomm, size: int = 1) -> None:
        from mpi4py import MPI

        self._comm, self._add = comm, MPI.SUM
        step = MPI.INT64_T.Get_size()
        self._window = MPI.Win.Allocate(size * step if comm.rank == 0 else 0, step, comm=comm)
        if comm.rank == 0:
            np.frombuffer(self._window.tomemory(), dtype=np.int64)[:] = 0
        comm.Barrier()

    def advance(self, counter: int = 0) -> int:
        """Value of a counter before it is advanced by one; not collective."""
        one, before = np.ones(1, np.int64), np.zeros(1, np.int64)
        self._window.Lock(0)
        self._window.Fetch_and_op(one, before, 0, counter, self._add)
        self._window.Unlock(0)
        return int(before[0])

    def close(self) -> None:
        """Wait for all ranks and free the counters; collective."""
        self._comm.Barrier()
        self._window.Free()
