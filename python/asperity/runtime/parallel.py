"""Work on rank 0, agreement between ranks, rows of all ranks, and a common end: by a signal, or with one message.

Only rank 0 holds arrays of the whole mesh: the mesh that it has made, and the arrays that it writes.
"""

from __future__ import annotations

import os
import signal
import sys
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from types import FrameType
from typing import TYPE_CHECKING, Any, TypeVar, cast

from asperity.errors import AsperityError, OutputError
from asperity.runtime.launch import on_terminal, started_ranks
from asperity.runtime.progress import tell

if TYPE_CHECKING:
    from mpi4py import MPI

    from asperity.arrays import Array, Floats, Indices

T = TypeVar("T")

INTERNAL = 70  # exit code of an error that nobody has foreseen, EX_SOFTWARE of sysexits.h
PATIENCE = 30.0  # time a failed rank waits for the others before it aborts the job [s]
#: SIGUSR1 is the one that mpirun passes on to its ranks; SIGTERM and SIGINT it answers by killing them.
SIGNALS = (signal.SIGTERM, signal.SIGINT, signal.SIGUSR1)


class Ranks:
    """The ranks of this job; create it on every rank before any work.

    It has its own communicator, so that its messages do not mix with those of an interrupted computation.
    """

    def __init__(self) -> None:
        self._comm: Any = None
        if started_ranks() is not None:
            from mpi4py import MPI

            self._comm = MPI.COMM_WORLD.Dup() if MPI.COMM_WORLD.size > 1 else None

    def leave(self, code: int, message: str) -> int:
        """Wait for all ranks and return the exit code of the job, the greatest of all ranks; collective.

        The lowest failed rank prints its message. Where the others do not arrive, it aborts the job with its code.
        """
        if self._comm is None:
            _print_error(message)
            return code
        import numpy as np
        from mpi4py import MPI

        size = self._comm.size
        mine = np.array([code, size - self._comm.rank if code else 0])
        worst = np.empty_like(mine)
        request = self._comm.Iallreduce(mine, worst, MPI.MAX)
        since = time.monotonic()
        while not request.Test():
            time.sleep(0.02)
            if code and time.monotonic() - since > PATIENCE:
                _print_error(f"{message} (rank {self._comm.rank}; the other ranks were stopped)")
                self._comm.Abort(code)
        if code and size - worst[1] == self._comm.rank:
            _print_error(message)
        return int(worst[0])


class StopRequest:
    """Context in which the first SIGTERM, SIGINT or SIGUSR1 is only recorded; the next one ends the process at once.

    It has no effect outside the main thread, where Python cannot handle signals.
    """

    def __init__(self, comm: MPI.Comm) -> None:
        self._comm = comm
        self._noted = 0
        self._before: dict[int, Any] = {}

    def __enter__(self) -> StopRequest:
        if threading.current_thread() is threading.main_thread():
            self._before = {s: signal.signal(s, self._note) for s in SIGNALS}
        return self

    def __exit__(self, *error: object) -> None:
        for s, handler in self._before.items():
            signal.signal(s, signal.SIG_DFL if handler is None else handler)

    def _note(self, number: int, frame: FrameType | None) -> None:
        self._noted = number
        for s in SIGNALS:
            signal.signal(s, signal.SIG_DFL)
        name = signal.Signals(number).name
        if self._comm.rank == 0:  # the signal may have interrupted print(), which is not re-entrant
            with suppress(OSError):  # the terminal may have gone
                line = "\n" if on_terminal("stderr") else ""  # the live one
                os.write(2, f"{line}{name}: the run ends after this step; a second signal ends it at once\n".encode())

    def agreed(self) -> str:
        """Name of the signal that some rank has received, empty if none; collective."""
        from mpi4py import MPI

        number = self._comm.allreduce(self._noted, op=MPI.MAX)
        return signal.Signals(number).name if number else ""


def on_root(comm: MPI.Comm, work: Callable[[], T]) -> T | None:
    """Do work on rank 0 and keep its result there, None elsewhere; collective.

    Every rank raises the AsperityError of `work`, for an OSError an OutputError.
    """
    result, error = _attempt(work) if comm.rank == 0 else (None, None)
    if failure := comm.bcast(error, root=0):
        raise failure
    return result


def on_root_bcast(comm: MPI.Comm | None, work: Callable[[], T]) -> T:
    """Do work on rank 0 and broadcast its result, which is pickled; collective, errors as for `on_root`.

    Without a communicator all ranks of the job take part, and MPI is not started in a process that runs alone.
    """
    if comm is None and started_ranks() is not None:
        from mpi4py import MPI

        comm = MPI.COMM_WORLD
    outcome = _attempt(work) if comm is None or comm.rank == 0 else (None, None)
    result, failure = outcome if comm is None else comm.bcast(outcome, root=0)
    if failure is not None:
        raise failure
    return cast(T, result)


def spread(comm: MPI.Comm, tasks: Sequence[Callable[[], object]], near: bool = False) -> None:
    """Do tasks that do not need each other, each on one rank, `near` on the machine of rank 0, whose files it sees.

    Collective, errors as for `on_root`.
    """
    from mpi4py import MPI

    places = comm.allgather(MPI.Get_processor_name())
    busy = [rank for rank, place in enumerate(places) if not near or place == places[0]]
    failure = None
    if comm.rank in busy:
        for task in tasks[busy.index(comm.rank) :: len(busy)]:
            failure = failure or _attempt(task)[1]
    _raise_first(comm, failure)


def agree(comm: MPI.Comm, work: Callable[[], T]) -> T:
    """Do the same work on every rank; the error of the lowest rank where it fails is raised on all, as by `on_root`."""
    result, failure = _attempt(work)
    _raise_first(comm, failure)
    return cast(T, result)


def summed(comm: MPI.Comm, *values: float) -> Floats:
    """Sums of numbers over the ranks, in one message without pickling; collective."""
    import numpy as np
    from mpi4py import MPI

    found = np.array(values, dtype=float)
    if comm.size > 1:
        comm.Allreduce(MPI.IN_PLACE, found)
    return found


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
    import numpy as np

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
    import numpy as np

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


def _raise_first(comm: MPI.Comm, failure: AsperityError | None) -> None:
    """Raise the error of the lowest rank that has one on all ranks; collective."""
    for error in comm.allgather(failure):
        if error is not None:
            raise error


def _attempt(work: Callable[[], T]) -> tuple[T | None, AsperityError | None]:
    """Result of `work` and None, or None and its error."""
    try:
        return work(), None
    except AsperityError as error:
        return None, error
    except OSError as error:
        return None, OutputError(f"cannot write {error.filename or 'the results'}: {error.strerror or error}")


def _print_error(message: str) -> None:
    if message:
        line = "".join(c if c.isprintable() else "?" for c in " ".join(message.split()))
        tell(f"error: {line}", sys.stderr)
