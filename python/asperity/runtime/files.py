"""Files that are complete or not there at all: written aside, flushed to the disk, renamed."""

from __future__ import annotations

import io
import os
import re
import shutil
import warnings
import zlib
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from tokenize import TokenError
from typing import Any
from zipfile import BadZipFile

import numpy as np
import numpy.typing as npt

#: What numpy and zipfile raise on files that are damaged or hold something else.
UNREADABLE = (
    OSError, EOFError, LookupError, ValueError, TypeError, AttributeError, ArithmeticError, RuntimeError,
    MemoryError, SyntaxError, BadZipFile, TokenError, zlib.error,
)  # fmt: skip


def _aside_of(path: Path) -> Path:
    """Where this process writes what is to become `path`: beside it, hidden, under a name that nobody else uses."""
    return path.with_name(f".{path.name}.{os.getpid()}.asperity")


def is_aside(name: str) -> bool:
    """Whether a file or folder of that name is what a process was writing aside."""
    return re.fullmatch(r"\..+\.[0-9]+\.asperity", name) is not None


def replace_file(path: Path, data: bytes) -> None:
    """Write a file; whatever happens meanwhile, `path` holds either its old content or the new one.

    Raises:
        OSError: no space, no permission, no such folder; the old content is untouched
    """
    aside = _aside_of(path)
    try:
        with aside.open("wb") as file:
            file.write(data)
            file.flush()
            os.fsync(file.fileno())
        aside.replace(path)
    except OSError as error:
        with suppress(OSError):
            aside.unlink(missing_ok=True)
        raise OSError(error.errno, error.strerror, str(path)) from None


@contextmanager
def files_into(folder: Path) -> Iterator[Path]:
    """A folder to write files in, which are moved to `folder` when all of them are complete."""
    aside = _aside_of(folder)
    aside.mkdir(parents=True)
    try:
        yield aside
        folder.mkdir(exist_ok=True)
        for path in aside.iterdir():
            path.replace(folder / path.name)
    finally:
        shutil.rmtree(aside, ignore_errors=True)


def remove_asides(folder: Path) -> None:
    """Remove what a killed process left half-written in a folder; nobody else may be writing there."""
    for path in folder.glob(".*.asperity"):
        if not is_aside(path.name):
            continue
        if path.is_dir():
            shutil.rmtree(path)
        else:
            path.unlink(missing_ok=True)


def one_line(error: Exception) -> str:
    """Message of an error in printable characters on one line."""
    text = " ".join(str(error).split()) or type(error).__name__
    return "".join(c if c.isprintable() else "?" for c in text)[:200]


def npz_bytes(arrays: Mapping[str, npt.NDArray[Any]], compress: bool = False) -> bytes:
    """Content of a .npz file, a checksum for each array included."""
    buffer, save = io.BytesIO(), np.savez_compressed if compress else np.savez
    save(buffer, **arrays)  # type: ignore[arg-type]
    return buffer.getvalue()


def read_npz(path: str | Path) -> dict[str, npt.NDArray[Any]]:
    """Arrays of a .npz file.

    Raises:
        OSError: the file cannot be read
        ValueError: it is damaged, of another kind, or holds Python objects
    """
    data = io.BytesIO(Path(path).read_bytes())
    try:
        with np.load(data, allow_pickle=False) as file:
            return {name: np.asarray(file[name]) for name in file.files}
    except UNREADABLE:
        raise ValueError("it is not a whole .npz file of numbers") from None


def read_npy(path: str | Path) -> npt.NDArray[Any]:
    """Array of a .npy file; errors as those of `read_npz`."""
    data = io.BytesIO(Path(path).read_bytes())
    try:
        return np.asarray(np.lib.format.read_array(data, allow_pickle=False))
    except UNREADABLE:
        raise ValueError("it is not a whole .npy file of numbers") from None


def read_matrix(path: str | Path, delimiter: str | None, skip: int = 0) -> npt.NDArray[np.float64]:
    """Numbers of a text file (rows, columns).

    Args:
        path: of the file
        delimiter: between numbers; None for white space
        skip: lines before the first row

    Raises:
        OSError: the file cannot be read
        ValueError: it holds something else, or nothing
    """
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of an empty file, which is an error here
        table = np.loadtxt(path, delimiter=delimiter, skiprows=skip, ndmin=2, dtype=float)
    if not table.size:
        raise ValueError("there are no numbers in it")
    return table


def real(values: npt.ArrayLike) -> npt.NDArray[np.float64]:
    """Values as real numbers.

    Raises:
        ValueError: they are complex, or no numbers
    """
    if np.iscomplexobj(values):
        raise ValueError("its numbers are complex")
    return np.array(values, dtype=float)
