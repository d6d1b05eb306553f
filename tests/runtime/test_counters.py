# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

"""Counters shared by all ranks: each value is given once, while rank 0 computes too."""

from __future__ import annotations

from itertools import chain
from pathlib import Path

import pytest
from waiting import wait_until

from asperity.runtime.counters import Counters

pytestmark = pytest.mark.mpi


def test_each_value_is_given_to_one_rank() -> None:
    from mpi4py import MPI

    comm = MPI.COMM_WORLD
    counters = Counters(comm, 2)
    mine = [counters.advance(1) for _ in range(50 * (comm.rank + 1))]
    first = counters.advance()
    counters.close()
    assert mine == sorted(mine)
    assert sorted(chain(*comm.allgather(mine))) == list(range(25 * comm.size * (comm.size + 1)))
    assert sorted(comm.allgather(first)) == list(range(comm.size))


def test_the_others_count_while_rank_0_computes(shared_path: Path) -> None:
    """Rank 0 calls nothing of MPI until the others have counted."""
    from mpi4py import MPI

    comm = MPI.COMM_WORLD
    counters = Counters(comm)
    if comm.rank == 0:
        wait_until(lambda: len(list(shared_path.iterdir())) == comm.size - 1)
        before = counters.advance()
    else:
        before = max(counters.advance() for _ in range(5))
        (shared_path / str(comm.rank)).touch()
    counters.close()
    assert comm.bcast(before) == 5 * (comm.size - 1)
