"""Locks in the folder of a study, against other jobs; the system releases them when a process ends."""

from __future__ import annotations

import fcntl
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from asperity.errors import InputError

FOLDER, CASES = ".lock", ".lock-cases"
LOCK_FILES = (FOLDER, CASES)


class FolderLock:
    """Lock of the folder of a study: a whole study alone, or any number of parts (`shared`) side by side."""

    def __init__(self, folder: Path, shared: bool) -> None:
        self.shared = shared
        self._path, self._file = folder / FOLDER, -1

    def take(self) -> None:
        """Lock the folder.

        Raises:
            InputError: another job has locked it
        """
        self._file = os.open(self._path, os.O_CREAT | os.O_RDWR, 0o644)  # NFS reads for a shared lock
        try:
            fcntl.flock(self._file, (fcntl.LOCK_SH if self.shared else fcntl.LOCK_EX) | fcntl.LOCK_NB)
        except BlockingIOError:
            self.release()
            folder = self._path.parent
            raise InputError(f"a study is running in {folder}; wait for it, or choose another folder") from None
        except OSError:
            return  # a file system without locks

    def release(self) -> None:
        """Unlock the folder if it is locked by this process."""
        if self._file >= 0:
            os.close(self._file)
            self._file = -1


@contextmanager
def claimed(folder: Path, key: str) -> Iterator[bool]:
    """Claim a case for this process while it is computed; yields False where another process has it.

    One byte of a file is locked for each case, at the place that its key names, so that no files are left over and jobs
    on several machines see each other wherever the file system has POSIX locks.
    """
    with (folder / CASES).open("ab") as file:
        try:
            fcntl.lockf(file, fcntl.LOCK_EX | fcntl.LOCK_NB, 1, int(key[1:], 16))
        except (BlockingIOError, PermissionError):
            yield False
            return
        except OSError:
            pass  # a file system without locks
        yield True
