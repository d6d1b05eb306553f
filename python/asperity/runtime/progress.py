"""Progress display of a run, one line per mesh or nothing; and its log file."""

from __future__ import annotations

import logging
import os
import shutil
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from logging.handlers import MemoryHandler
from pathlib import Path
from typing import Any, TextIO

from asperity.runtime.launch import on_terminal


@contextmanager
def log_file(path: Path | None, append: bool = False) -> Iterator[Callable[[], None]]:
    """Write the log messages of the package to a file, one line each with its time; None writes nothing.

    The messages are kept in memory until the function that is yielded is called, which opens the file: a run that is
    refused writes nothing. Errors of the log are ignored: where the disk is full, the results raise them.
    """
    if path is None:
        yield lambda: None
        return
    logger = logging.getLogger("asperity")
    handler = MemoryHandler(capacity=1)  # passes on each message at once, as soon as it has a target
    level = logger.level
    logger.setLevel(logging.INFO)
    logger.addHandler(handler)

    def begin() -> None:
        with suppress(OSError):
            file = logging.FileHandler(path, "a" if append else "w")
            file.setFormatter(logging.Formatter("%(asctime)s %(message)s"))
            file.handleError = lambda record: None  # type: ignore[method-assign]
            handler.setTarget(file)
            handler.flush()

    try:
        yield begin
    finally:
        logger.removeHandler(handler)
        logger.setLevel(level)
        target = handler.target
        handler.close()
        if target is not None:
            target.close()


class Progress:
    """Silent progress display; base class of the visible one."""

    def stage(self, name: str) -> None:
        """Show the start of a phase, for example "mesh"."""

    def step(self, row: Mapping[str, Any], fraction_done: float) -> None:
        """Show an accepted load step by its row of curve.csv, and the fraction of the load path done, 0 to 1."""

    def done(self) -> None:
        """End the display."""


SILENCE = 10.0  # time between two lines about the same phase [s]
_CELLS = {  # column of curve.csv: format of its values
    "step": "{}", "branch": "{}", "delta_star": "{:.4e}", "P_star": "{:.4e}", "area_fraction": "{:.4f}",
    "newton": "{}", "krylov": "{}", "seconds": "{:.1f} s",
}  # fmt: skip


class LevelLines(Progress):
    """One line per phase, and so per mesh: on a terminal a live one, elsewhere when it ends and every ten seconds.

    Args:
        live: whether the line is written again and again; default on a terminal
    """

    def __init__(self, live: bool | None = None) -> None:
        self._live = on_terminal() if live is None else live
        self._start = self._last = time.monotonic()
        self._name = self._state = ""
        self._first: float | None = None
        self._steps = 0

    def stage(self, name: str) -> None:
        self._close()
        self._name, self._state, self._first, self._steps = name, "", None, 0
        self._last = time.monotonic()
        self._show()

    def step(self, row: Mapping[str, Any], fraction_done: float) -> None:
        now = time.monotonic()
        self._steps += 1
        if self._first is None:
            self._first = now - float(row["seconds"])
        left = (now - self._first) * (1 / fraction_done - 1) if fraction_done > 0 else float("nan")
        self._state = f"{duration(left)} left, step {row['step']}, {row['branch']}"  # a narrow screen cuts the end
        self._show()

    def done(self) -> None:
        self._close()
        if self._name:  # the case was not refused
            tell(f"{self._time()} end")

    def _time(self) -> str:
        return f"[{time.monotonic() - self._start:6.1f} s]"

    def _line(self) -> str:
        return f"{self._time()} {self._name}{': ' if self._state else ''}{self._state}"

    def _show(self) -> None:
        now = time.monotonic()
        if self._live:
            width = shutil.get_terminal_size().columns - 1
            tell(f"\r{self._line()[:width]}\x1b[K", end="")
        elif self._state and now - self._last >= SILENCE:
            tell(self._line())
            self._last = now

    def _close(self) -> None:
        """End the line of a phase; on a terminal a short phase without steps is written over."""
        if self._steps:
            self._state = f"{self._steps} step{'s' if self._steps > 1 else ''}"
        elif self._live:
            return
        if self._name:
            tell(f"\r{self._line()}\x1b[K" if self._live else self._line())


def tell(text: str, stream: TextIO | None = None, end: str = "\n") -> None:
    """Print to the standard output or another stream, of which a run does not depend, see `silence`."""
    stream = sys.stdout if stream is None else stream
    try:
        print(text, file=stream, end=end, flush=True)
    except OSError:
        silence(stream)


def silence(stream: TextIO) -> None:
    """Let what is printed go nowhere from now on: the reader has gone, or the disk is full, and the run goes on."""
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, stream.fileno())
    os.close(nowhere)


def row_line(row: Mapping[str, Any]) -> str:
    """A load step in a line, with its names, for the log."""
    return ", ".join(f"{name} {form.format(row[name])}" for name, form in _CELLS.items())


def world_rank() -> int:
    """Rank of this process under mpirun or srun, 0 without them; read from the environment without starting MPI."""
    names = ("OMPI_COMM_WORLD_RANK", "PMIX_RANK", "PMI_RANK", "MPI_RANKID", "SLURM_PROCID")
    return next((int(os.environ[n]) for n in names if os.environ.get(n, "").isdigit()), 0)


def duration(seconds: float) -> str:
    """Format a time [s] in at most 7 characters: 3.2 s, 4 m 05, 2 h 10."""
    if not seconds < 1e8:
        return "?"
    if seconds < 59.95:
        return f"{seconds:.1f} s"
    seconds = round(seconds)
    if seconds < 3600:
        return f"{seconds // 60} m {seconds % 60:02}"
    return f"{seconds // 3600} h {seconds % 3600 // 60:02}"
