"""Signals that end a run: it finishes its step, saves its state, and stops on all ranks together."""

from __future__ import annotations

import os
import signal
import threading
from contextlib import suppress
from types import FrameType
from typing import TYPE_CHECKING, Any

from asperity.runtime.launch import on_terminal

if TYPE_CHECKING:
    from mpi4py import MPI

#: SIGUSR1 is the one that mpirun passes on to its ranks; SIGTERM and SIGINT it answers by killing them.
SIGNALS = (signal.SIGTERM, signal.SIGINT, signal.SIGUSR1)


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
