"""Warnings and log of a run: each warning is recorded once, on whichever rank it was issued, and run.log has all."""

from __future__ import annotations

import logging
import warnings
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from logging.handlers import MemoryHandler
from pathlib import Path
from typing import TYPE_CHECKING

from asperity.errors import WARNINGS, warn

if TYPE_CHECKING:
    from mpi4py import MPI


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
