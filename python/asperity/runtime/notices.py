"""Warnings of a run: shown as they come, kept for its files, each once, whichever rank gave it."""

from __future__ import annotations

import logging
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any, TextIO

from asperity.errors import AsperityWarning

if TYPE_CHECKING:
    from mpi4py import MPI


class Notices:
    """Sentences of the warnings given so far.

    Attributes:
        texts: in the order they came in; after `share` those of all ranks
    """

    def __init__(self, comm: MPI.Comm) -> None:
        self._comm = comm
        self.texts: list[str] = []

    def share(self) -> None:
        """Take up the warnings that other ranks have given; collective."""
        everywhere = dict.fromkeys(text for texts in self._comm.allgather(self.texts) for text in texts)
        for text in everywhere:
            warnings.warn(text, AsperityWarning, stacklevel=2)  # those of this rank are known already
        self.texts[:] = everywhere

    def log(self) -> None:
        """Write those so far into a log that has just been opened."""
        for text in self.texts:
            _log(text)


def _log(text: str) -> None:
    logging.getLogger(__name__).info("warning: %s", text)


@contextmanager
def noting(comm: MPI.Comm) -> Iterator[Notices]:
    """Note and log each `AsperityWarning`, whatever the filters of the caller are.

    These decide, as ever, whether it is shown, left out or raised; what is shown, the first rank shows.

    Args:
        comm: ranks of the run
    """
    filters, show = warnings.filters, warnings.showwarning
    display: Callable[..., None] = show if comm.rank == 0 else _silent
    notices = Notices(comm)

    def note(
        message: Warning | str,
        category: type[Warning],
        filename: str,
        lineno: int,
        file: TextIO | None = None,
        line: str | None = None,
    ) -> None:
        if not issubclass(category, AsperityWarning):
            show(message, category, filename, lineno, file, line)
            return
        text = str(message)
        if text in notices.texts:
            return
        notices.texts.append(text)
        _log(text)
        with warnings.catch_warnings():
            warnings.filters = filters
            warnings.showwarning = display
            warnings.warn_explicit(message, category, filename, lineno)

    with warnings.catch_warnings():
        warnings.simplefilter("always", AsperityWarning)
        warnings.showwarning = note
        yield notices


def _silent(*_: Any) -> None:
    """Show nothing."""
