"""Warnings of a run: each is shown once, on whichever rank it was issued, and recorded for the files of the run."""

from __future__ import annotations

import logging
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

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


def log(text: str) -> None:
    """Write a warning to the log file."""
    logging.getLogger(__name__).info("warning: %s", text)


@contextmanager
def noting(comm: MPI.Comm) -> Iterator[Notices]:
    """Record and log each `AsperityWarning`, regardless of the warning filters of the caller.

    The filters still decide whether a warning is shown, ignored or raised as an error. Rank 0 shows it.
    """
    filters, show = warnings.filters, warnings.showwarning
    display: Callable[..., None] = show if comm.rank == 0 else lambda *_: None
    notices = Notices(comm)

    def note(
        message: Warning | str, category: type[Warning], filename: str, lineno: int, *rest: Any, **named: Any
    ) -> None:
        if not issubclass(category, AsperityWarning):
            show(message, category, filename, lineno, *rest, **named)
            return
        text = str(message)
        if text in notices.texts:
            return
        notices.texts.append(text)
        log(text)
        with warnings.catch_warnings():
            warnings.filters = filters
            warnings.showwarning = display
            warnings.warn_explicit(message, category, filename, lineno)

    with warnings.catch_warnings():
        warnings.simplefilter("always", AsperityWarning)
        warnings.showwarning = note
        yield notices
