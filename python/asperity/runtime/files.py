"""Read files, and write them completely or not at all: to a temporary file, flushed to the disk, renamed, flushed."""

from __future__ import annotations

import csv
import errno
import io
import os
import re
import secrets
import shutil
import stat
import tomllib
import zlib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from tokenize import TokenError
from typing import IO, Any
from zipfile import ZIP_DEFLATED, ZIP_STORED, BadZipFile, ZipFile

import numpy as np
import numpy.typing as npt

#: Errors that numpy and zipfile raise on files that are damaged or of another kind.
UNREADABLE = (
    OSError, EOFError, LookupError, ValueError, TypeError, AttributeError, ArithmeticError, RuntimeError,
    MemoryError, SyntaxError, BadZipFile, TokenError, zlib.error, csv.Error,
)  # fmt: skip
NPZ = ".npz"
MOST_TEXT = 2**26  # size of a text that is read, and of anything from a device or pipe [bytes]
MOST_DATA = 2**32  # size of a file of arrays, and of its arrays unpacked [bytes]
MOST_PARTS = 100  # of a key in TOML
PACKED = 200  # ratio to which heights and fields are never packed; files of a megabyte are let through


def _temporary_for(path: Path) -> Path:
    """Hidden file or folder for the new content of `path`, of a name that no process has: in sandboxes, pids repeat."""
    return path.with_name(f".{path.name}.{secrets.randbits(64)}.asperity")


def is_aside(name: str) -> bool:
    """Whether a file or folder of that name is a temporary one of `replace_file` or `files_into`."""
    return re.fullmatch(r"\..+\.[0-9]+\.asperity", name) is not None


def _sync(path: Path) -> None:
    """Wait until a file, or the names in a folder, are on the disk."""
    file = os.open(path, os.O_RDONLY)
    try:
        os.fsync(file)
    finally:
        os.close(file)


@contextmanager
def replacing(path: Path) -> Iterator[IO[bytes]]:
    """File for the new content of `path`, which always has its old content or all of the new one, on the disk too.

    Raises:
        OSError: no space, no permission, no such folder; the old content is unchanged
    """
    aside = _temporary_for(path)
    try:
        with aside.open("wb") as file:
            yield file
            file.flush()
            os.fsync(file.fileno())
        aside.replace(path)
        with suppress(OSError):  # a file system that keeps names in another way
            _sync(path.parent)
    except OSError as error:
        with suppress(OSError):
            aside.unlink(missing_ok=True)
        raise OSError(error.errno, error.strerror, str(path)) from None


def replace_file(path: Path, data: bytes) -> None:
    """Write a file so that `path` always has either its old content or the new one, see `replacing`."""
    with replacing(path) as file:
        file.write(data)


@contextmanager
def files_into(folder: Path) -> Iterator[Path]:
    """Temporary folder; its files are moved to `folder` when all of them are complete."""
    aside = _temporary_for(folder)
    aside.mkdir(parents=True)
    try:
        yield aside
        folder.mkdir(exist_ok=True)
        for path in aside.iterdir():
            _sync(path)
        for path in list(aside.iterdir()):
            path.replace(folder / path.name)
        with suppress(OSError):
            _sync(folder)
    finally:
        shutil.rmtree(aside, ignore_errors=True)


def read_whole(path: str | Path, most: int = MOST_DATA) -> bytes:
    """Content of a file, of a device or pipe too; OSError where it cannot be read, or is larger than `most`."""
    with open(path, "rb") as file:
        status = os.fstat(file.fileno())
        regular = stat.S_ISREG(status.st_mode)
        limit = most if regular else min(most, MOST_TEXT)
        data = b"" if regular and status.st_size > limit else file.read(limit + 1)
        if not (status.st_size <= limit and len(data) <= limit):
            raise OSError(errno.EFBIG, os.strerror(errno.EFBIG), str(path))
    return data


def read_text(path: str | Path) -> str:
    """Text of a file in UTF-8, errors as for `read_whole`; a ValueError where it is in another encoding."""
    return read_whole(path, MOST_TEXT).decode("utf-8-sig")


def parse_toml(text: str) -> dict[str, Any]:
    """Tables of a text in TOML; ValueError where it is none, RecursionError where it is nested too deeply."""
    # the parser takes a time of the square of the parts of a key
    if any(piece.count(".") > MOST_PARTS for piece in re.split(r"[,=\[\]{}\n]", text)):
        raise ValueError(f"a key has more than {MOST_PARTS} parts")
    return tomllib.loads(text)


def remove_asides(folder: Path) -> None:
    """Remove the temporary files of killed processes from a folder; no other process may be writing there."""
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


@contextmanager
def _readable(kind: str) -> Iterator[None]:
    """Raise ValueError for all errors of a damaged file, or of one of another kind."""
    try:
        yield
    except UNREADABLE:
        raise ValueError(f"it is not a whole {kind} file of numbers") from None


def write_csv(
    path: Path, names: Sequence[str], rows: Iterable[Mapping[str, Any]], comment: str = "", digits: int = 17
) -> None:
    """Write a table: a comment if there is one, the names, a line per row of numbers with so many digits at most.

    Absent values, None and NaN are empty cells.
    """

    def cell(value: Any) -> str:
        if value is None or value != value:
            return ""
        if isinstance(value, bool):
            return str(value).lower()
        return str(float(f"{value:.{digits}g}") if isinstance(value, float) else value)

    text = io.StringIO(newline="")
    text.write(f"# {comment}\n" if comment else "")
    table = csv.writer(text, lineterminator="\n")
    table.writerow(names)
    table.writerows([cell(row.get(name)) for name in names] for row in rows)
    replace_file(path, text.getvalue().encode())


def write_npz(path: Path, arrays: Iterable[tuple[str, npt.NDArray[Any]]], compress: bool = False) -> None:
    """Write a .npz file, array after array with its checksum, complete or not at all; see `replacing`."""
    with replacing(path) as file, ZipFile(file, "w", ZIP_DEFLATED if compress else ZIP_STORED) as archive:
        for name, array in arrays:
            with archive.open(f"{name}.npy", "w", force_zip64=True) as member:
                np.lib.format.write_array(member, array, allow_pickle=False)


def read_npz(path: str | Path) -> dict[str, npt.NDArray[Any]]:
    """Arrays of a .npz file.

    Raises:
        OSError: the file cannot be read
        ValueError: it is damaged, of another kind, contains Python objects, or would unpack to far more than it is
    """
    data = io.BytesIO(read_whole(path))
    with _readable(NPZ), ZipFile(data) as archive:
        unpacked = sum(info.file_size for info in archive.infolist())
    packed = data.seek(0, io.SEEK_END)
    if unpacked > min(MOST_DATA, PACKED * max(packed, 2**20)):
        raise ValueError(f"its {packed / 1e6:.3g} MB would unpack to {unpacked / 1e9:.3g} GB")
    data.seek(0)
    with _readable(NPZ), np.load(data, allow_pickle=False) as file:
        return {name: np.asarray(file[name]) for name in file.files}


def read_npy(path: str | Path) -> npt.NDArray[Any]:
    """Array of a .npy file; errors as for `read_npz`."""
    data = io.BytesIO(read_whole(path))
    with _readable(".npy"):
        return np.asarray(np.lib.format.read_array(data, allow_pickle=False))


def real(values: npt.ArrayLike) -> npt.NDArray[np.float64]:
    """Values as real numbers; ValueError if they are complex or not numbers."""
    if np.iscomplexobj(values):
        raise ValueError("its numbers are complex")
    return np.array(values, dtype=float)
