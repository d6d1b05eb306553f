"""Work on rank 0: where its result is, and that its errors reach every rank."""

from __future__ import annotations

import sys
from collections.abc import Callable
from typing import Any

import pytest
from conftest import world

from asperity.errors import InputError, OutputError
from asperity.runtime.parallel import agree, on_root, on_root_bcast

pytestmark = pytest.mark.mpi


def refuse() -> int:
    raise InputError("no")


def lose_the_disk() -> int:
    raise OSError(28, "No space left on device", "curve.csv")


def test_the_result_stays_on_rank_0_or_is_broadcast() -> None:
    comm = world()
    ranks = []

    def work() -> int:
        ranks.append(comm.rank)
        return 7

    assert on_root(comm, work) == (7 if comm.rank == 0 else None)
    assert on_root_bcast(comm, work) == 7
    assert comm.allreduce(len(ranks)) == 2 and set(ranks) <= {0}
    assert agree(comm, lambda: comm.rank) == comm.rank


@pytest.mark.parametrize("call", [on_root, on_root_bcast])
def test_errors_of_rank_0_reach_every_rank(call: Callable[[Any, Callable[[], int]], Any]) -> None:
    with pytest.raises(InputError, match="no"):
        call(world(), refuse)
    with pytest.raises(OutputError, match=r"cannot write curve\.csv: No space left on device"):
        call(world(), lose_the_disk)
    with pytest.raises(InputError, match="no"):
        agree(world(), refuse if world().rank == world().size - 1 else lambda: 1)


def test_a_process_alone_does_not_start_mpi(monkeypatch: pytest.MonkeyPatch) -> None:
    if world().size > 1:
        pytest.skip("for one process")
    monkeypatch.setitem(sys.modules, "mpi4py", None)  # importing it is an error
    assert on_root_bcast(None, lambda: 7) == 7
    with pytest.raises(InputError):
        on_root_bcast(None, refuse)
