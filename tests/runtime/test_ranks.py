"""Work on rank 0: where its result is, and that its errors reach every rank."""

from __future__ import annotations

import atexit
import sys
from collections.abc import Callable
from functools import partial
from typing import Any

import pytest
from conftest import world

from asperity.errors import InputError, OutputError
from asperity.runtime import compat
from asperity.runtime.parallel import agree, on_root, on_root_bcast, spread

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


def test_libraries_that_start_twice_end_once() -> None:
    """PETSc's end is collective: a rank that has started it more often than the others would wait for them for ever."""
    compat.start()
    before = atexit._ncallbacks()
    if world().rank == 0:
        compat.start()
    assert atexit._ncallbacks() == before


def test_tasks_are_spread_and_their_errors_reach_every_rank(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each is done once, in equal parts."""
    from mpi4py import MPI

    comm, done = world(), []

    def task(number: int) -> None:
        done.append(number)

    spread(comm, [partial(task, number) for number in range(5)], near=True)
    assert sorted(number for numbers in comm.allgather(done) for number in numbers) == [0, 1, 2, 3, 4]
    if comm.size > 1:
        assert len(done) in (5 // comm.size, 5 // comm.size + 1)
    orders: list[list[Callable[[], object]]] = [[partial(task, 0), refuse], [refuse, partial(task, 0)]]
    for tasks in orders:
        with pytest.raises(InputError, match="no"):
            spread(comm, tasks)
    monkeypatch.setattr(MPI, "Get_processor_name", lambda: f"node {comm.rank}")
    done.clear()
    spread(comm, [partial(task, number) for number in range(5)], near=True)
    assert done == ([] if comm.rank else [0, 1, 2, 3, 4])


def test_a_process_alone_does_not_start_mpi(monkeypatch: pytest.MonkeyPatch) -> None:
    if world().size > 1:
        pytest.skip("for one process")
    monkeypatch.setitem(sys.modules, "mpi4py", None)  # importing it is an error
    assert on_root_bcast(None, lambda: 7) == 7
    with pytest.raises(InputError):
        on_root_bcast(None, refuse)
