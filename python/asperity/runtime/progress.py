"""Progress display of a run: nothing, one line per step, or a live bar.

The solver calls `stage` at the start of a phase, `step` after each accepted load step and `done` at
the end; only rank 0 shows anything.
"""

from __future__ import annotations

import logging
import os
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from logging.handlers import MemoryHandler
from pathlib import Path
from typing import Any, TextIO

from asperity.runtime.launch import TERMINAL, started_ranks


@contextmanager
def log_file(path: Path | None, append: bool = False) -> Iterator[Callable[[], None]]:
    """Write the log messages of the package to a file, one line each with its time; None writes nothing.

    The messages are kept in memory until the function that is yielded is called, which opens the file: a run that is
    refused writes nothing. Errors while writing the log are ignored: if the disk is full, writing the results raises
    the error.
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
    """Silent progress display; base class of the visible ones."""

    def stage(self, name: str) -> None:
        """Show the start of a phase, for example "mesh"."""

    def part(self, fraction_done: float) -> None:
        """Show how much of a phase without load steps is done, 0 to 1."""

    def step(self, row: Mapping[str, Any], fraction_done: float) -> None:
        """Show an accepted load step by its row of curve.csv, and the fraction of the load path done, 0 to 1."""

    def done(self) -> None:
        """End the display."""


SILENCE = 10.0  # time between two lines about the same phase [s]
COLUMNS = ("step", "branch", "delta/L", "P*", "area", "Newton", "Krylov", "time", "left")
_WIDTHS = (5, 7, 11, 11, 7, 6, 6, 8, 8)  # of the columns [characters]


class StepLines(Progress):
    """One plain line per step, with the remaining time; for log files and batch jobs."""

    def __init__(self, stream: TextIO | None = None):
        self._stream = stream
        self._start = time.monotonic()
        self._first: float | None = None
        self._headed = self._begun = False
        self._last = self._start  # time of the last line about a phase

    def _write(self, line: str) -> None:
        print(line, file=self._stream or sys.stdout, flush=True)

    def stage(self, name: str) -> None:
        self._write(f"[{time.monotonic() - self._start:6.1f} s] {name}")
        self._headed, self._begun, self._last, self._first = False, True, time.monotonic(), None

    def part(self, fraction_done: float) -> None:
        now = time.monotonic()
        if now - self._last >= SILENCE:
            self._write(f"[{now - self._start:6.1f} s]   {fraction_done:.0%}")
            self._last = now

    def step(self, row: Mapping[str, Any], fraction_done: float) -> None:
        if not self._headed:
            self._write(_line(COLUMNS))
            self._headed = True
        self._write(_line(self._cells(row, fraction_done)))

    def _cells(self, row: Mapping[str, Any], fraction_done: float) -> tuple[str, ...]:
        now = time.monotonic()
        if self._first is None:
            self._first = now - float(row["seconds"])
        elapsed = now - self._first
        left = elapsed * (1 / fraction_done - 1) if fraction_done > 0 else float("nan")
        return (
            f"{row['step']}",
            f"{row['branch']}",
            f"{row['delta_star']:.4e}",
            f"{row['P_star']:.4e}",
            f"{row['area_fraction']:.4f}",
            f"{row['newton']}",
            f"{row['krylov']}",
            f"{row['seconds']:.1f} s",
            duration(left),
        )

    def done(self) -> None:
        if self._begun:  # the case was not refused
            self._write(f"[{time.monotonic() - self._start:6.1f} s] end")


class StepTable(StepLines):
    """The same lines on a terminal, above a live bar with phase, completed fraction and remaining time."""

    def __init__(self) -> None:
        from rich.console import Console
        from rich.progress import BarColumn, Progress, SpinnerColumn, TextColumn

        super().__init__()
        self._console = Console(highlight=False)
        columns = (
            SpinnerColumn(),
            TextColumn("{task.description}"),
            BarColumn(),
            TextColumn("{task.percentage:.0f} % {task.fields[left]}"),
        )
        self._bar = Progress(*columns, console=self._console, transient=True)
        self._task = self._bar.add_task("start", total=1.0, left="")

    def _write(self, line: str) -> None:
        self._console.print(line, markup=False, soft_wrap=True)

    def stage(self, name: str) -> None:
        if not self._begun:
            self._bar.start()  # not earlier: messages about the case come first
        super().stage(name)
        self._bar.update(self._task, description=name, completed=0.0, left="")

    def part(self, fraction_done: float) -> None:
        self._bar.update(self._task, completed=fraction_done, left="")

    def step(self, row: Mapping[str, Any], fraction_done: float) -> None:
        super().step(row, fraction_done)
        left = self._cells(row, fraction_done)[-1]
        self._bar.update(self._task, completed=fraction_done, left=f"{left} left")

    def done(self) -> None:
        self._bar.stop()
        super().done()


def make_progress(quiet: bool = False) -> Progress:
    """Display for this process: silent on ranks above 0, a live bar on a terminal, else lines."""
    if quiet or world_rank() > 0:
        return Progress()
    return StepTable() if is_terminal() else StepLines()


def is_terminal() -> bool:
    """Whether the output of this process is shown on a terminal that a cursor can move on.

    Open MPI gives its ranks a terminal even where mpirun writes to a file, so a rank counts as one only if `launch`
    started it on a terminal.
    """
    through_mpirun = started_ranks() is not None and TERMINAL not in os.environ
    return sys.stdout.isatty() and os.environ.get("TERM") != "dumb" and not through_mpirun


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


def _line(cells: tuple[str, ...]) -> str:
    return " ".join(cell.rjust(width) for cell, width in zip(cells, _WIDTHS, strict=True))
