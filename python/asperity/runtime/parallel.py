"""All ranks of a parallel job end together, with one message and one exit code."""

from __future__ import annotations

import os
import sys
import time
import traceback
from collections.abc import Callable
from typing import Any

from asperity.errors import AsperityError

PATIENCE = 30.0  # seconds a failed rank waits for the others before it ends the job


class Ranks:
    """The processes of this job; start it before any work, on every rank.

    A communicator of its own keeps its messages apart from those of an interrupted computation.
    """

    def __init__(self) -> None:
        self._comm: Any = None
        if _launched_in_parallel():
            from mpi4py import MPI

            self._comm = MPI.COMM_WORLD.Dup() if MPI.COMM_WORLD.size > 1 else None
        if self._comm is not None:
            sys.excepthook = self._crash

    def leave(self, code: int, message: str = "") -> int:
        """Wait for all ranks and agree on the exit code, the greatest of all.

        The first failed rank prints its message. When the others do not come, because they wait for
        this rank inside the solver, the job is aborted with the code.
        """
        if self._comm is None:
            _complain(message)
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
                _complain(f"{message} (rank {self._comm.rank}; the other ranks were stopped)")
                self._comm.Abort(code)
        if code and size - worst[1] == self._comm.rank:
            _complain(message)
        return int(worst[0])

    def _crash(self, kind: Any, error: Any, trace: Any) -> None:
        """Show an internal error and end every rank, which could wait for this one forever."""
        traceback.print_exception(kind, error, trace)
        sys.stderr.flush()
        self._comm.Abort(1)


def on_first_rank(function: Callable[[], Any]) -> Any:
    """Call a function on the first rank; every rank gets its result, or its error."""
    if not _launched_in_parallel():
        return function()
    from mpi4py import MPI

    result: tuple[Any, Exception | None] = None, None
    if MPI.COMM_WORLD.rank == 0:
        try:
            result = function(), None
        except (AsperityError, OSError) as error:
            result = None, error
    value, failure = MPI.COMM_WORLD.bcast(result)
    if failure is not None:
        raise failure
    return value


def _complain(message: str) -> None:
    if message:
        print(f"error: {message}", file=sys.stderr, flush=True)


def _launched_in_parallel() -> bool:
    names = ("OMPI_COMM_WORLD_SIZE", "PMIX_RANK", "PMI_SIZE", "PMI_RANK", "SLURM_NTASKS")
    return any(name in os.environ for name in names)
