"""What a run tells: its progress on the terminal, its warnings, each once on whichever rank it was, and run.log."""

from __future__ import annotations

import logging
import os
import sys
import time
import warnings
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from logging.handlers import MemoryHandler
from math import inf
from pathlib import Path
from typing import TYPE_CHECKING, Any, TextIO

from asperity.errors import WARNINGS, warn
from asperity.runtime.launch import on_terminal

if TYPE_CHECKING:
    from mpi4py import MPI


class Progress:
    """Silent progress display, a context; base class of the visible one."""

    def __enter__(self) -> Progress:
        return self

    def __exit__(self, *error: object) -> None:
        self.done()

    def stage(self, name: str) -> None:
        """Show the start of a phase, for example "mesh"."""

    def step(self, row: Mapping[str, Any], fraction_done: float) -> None:
        """Show an accepted load step by its row of curve.csv, and the fraction of the load path done, 0 to 1."""

    def done(self) -> None:
        """End the display."""


class ProgressLine(Progress):
    """One live line on a terminal; and a line that stays for each load path, in a file too."""

    def __init__(self) -> None:
        from rich.console import Console
        from rich.progress import Progress as Display
        from rich.progress import SpinnerColumn, TextColumn

        self._display = Display(
            SpinnerColumn("line"), TextColumn("{task.description}", markup=False),
            console=Console(force_terminal=on_terminal(), soft_wrap=True), disable=not on_terminal(), transient=True,
            speed_estimate_period=inf, redirect_stderr=on_terminal("stderr"),
        )  # fmt: skip
        self._task = self._display.add_task("", total=1.0)
        self._start, self._name, self._steps = time.monotonic(), "", 0
        self._display.start()
        self._display.console.show_cursor()  # which a killed process would leave hidden

    def stage(self, name: str) -> None:
        self._close()
        self._name, self._steps = name, 0
        self._display.reset(self._task, completed=0, description=name)

    def step(self, row: Mapping[str, Any], fraction_done: float) -> None:
        self._steps += 1
        self._display.update(self._task, completed=fraction_done)
        left = self._display.tasks[0].time_remaining
        text = f"{self._name.partition(': ')[0]}: step {row['step']} of {round(row['step'] / fraction_done)}"
        text += "" if left is None else f", {duration(left)} left"
        self._display.update(self._task, description=text)

    def done(self) -> None:
        self._close()
        with suppress(OSError):  # the terminal has gone
            if self._display.live.is_started:
                self._display.stop()

    def _close(self) -> None:
        """Print the line that stays."""
        if self._steps:
            steps = f"{self._steps} step{'s' if self._steps > 1 else ''}"
            tell(f"[{time.monotonic() - self._start:6.1f} s] {self._name}: {steps}")
        self._steps = 0


class RunLog(MemoryHandler):
    """Messages of the package during a run; a run that is refused writes none.

    Errors of the file are ignored: where the disk is full, the results raise them.

    Attributes:
        texts: of the warnings, in the order of their first occurrence; after `share` those of all ranks
    """

    def __init__(self, comm: MPI.Comm, path: Path | None) -> None:
        super().__init__(capacity=1)  # as soon as there is a file, a message is passed on at once
        self._comm, self._path = comm, path if comm.rank == 0 else None
        self.texts: list[str] = []

    def filter(self, record: logging.LogRecord) -> bool:
        """Whether a message is new to the log: a warning is so once."""
        if record.name == WARNINGS:
            text = str(record.args[0]) if record.args else ""  # type: ignore[index]
            if text in self.texts:
                return False
            self.texts.append(text)
        return self._path is not None

    def begin(self, append: bool) -> None:
        """Write the messages so far, and from now on, to the file."""
        if self._path is not None:
            with suppress(OSError):
                file = logging.FileHandler(self._path, "a" if append else "w")
                file.setFormatter(logging.Formatter("%(asctime)s %(message)s"))
                file.handleError = lambda record: None  # type: ignore[method-assign]
                self.setTarget(file)
                self.flush()

    def share(self) -> None:
        """Issue the warnings of the other ranks here; collective."""
        everywhere = dict.fromkeys(text for texts in self._comm.allgather(self.texts) for text in texts)
        for text in everywhere:
            if text not in self.texts:
                warn(text)
        self.texts[:] = everywhere

    def close(self) -> None:
        """Close the file."""
        target = self.target
        super().close()
        if target is not None:
            target.close()


@contextmanager
def logged(comm: MPI.Comm, path: Path | None = None) -> Iterator[RunLog]:
    """Record what the package logs in a with-block; rank 0 has a file, if there is a path, and shows warnings."""
    logger, log = logging.getLogger("asperity"), RunLog(comm, path)
    level = logger.level
    logger.setLevel(logging.INFO)
    logger.addHandler(log)
    try:
        with warnings.catch_warnings():
            if comm.rank:
                warnings.showwarning = lambda *_, **__: None
            yield log
    finally:
        logger.removeHandler(log)
        logger.setLevel(level)
        log.close()


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


def world_rank() -> int:
    """Rank of this process under mpirun or srun, 0 without them; read from the environment without starting MPI."""
    names = ("OMPI_COMM_WORLD_RANK", "PMIX_RANK", "PMI_RANK", "MPI_RANKID", "SLURM_PROCID")
    return next((int(os.environ[n]) for n in names if os.environ.get(n, "").isdigit()), 0)


def duration(seconds: float) -> str:
    """Format a time [s] in at most 7 characters: 3.2 s, 19 s, 4 m 05, 2 h 10."""
    if not seconds < 1e8:
        return "?"
    if seconds < 9.95:
        return f"{seconds:.2g} s"
    seconds = round(seconds)
    if seconds < 60:
        return f"{seconds} s"
    if seconds < 3600:
        return f"{seconds // 60} m {seconds % 60:02}"
    return f"{seconds // 3600} h {seconds % 3600 // 60:02}"
