"""Warnings of a run: each is shown once, on whichever rank it was issued, and recorded for the files of the run."""

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
    """Texts of the warnings issued so far.

    Attributes:
        texts: in the order of their first occurrence; after `share` those of all ranks
    """

    def __init__(self, comm: MPI.Comm) -> None:
        self._comm = comm
        self.texts: list[str] = []

    def share(self) -> None:
        """Add the warnings of the other ranks; collective."""
        everywhere = dict.fromkeys(text for texts in self._comm.allgather(self.texts) for text in texts)
        for text in everywhere:
            warnings.warn(text, AsperityWarning, stacklevel=2)  # has no effect for the warnings this rank already has
        self.texts[:] = everywhere

    def log(self) -> None:
        """Write the warnings so far to a log file that has just been opened."""
        for text in self.texts:
            _log(text)


def _log(text: str) -> None:
    logging.getLogger(__name__).info("warning: %s", text)


@contextmanager
def noting(comm: MPI.Comm) -> Iterator[Notices]:
    """Record and log each `AsperityWarning`, regardless of the warning filters of the caller.

    The filters still decide whether a warning is shown, ignored or raised as an error. Rank 0 shows it.
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
    """Discard a warning."""
