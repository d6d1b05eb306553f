# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

"""Files of a checkpoint: arrays of all ranks in one .npz file with a digest, written and read by rank 0 in pieces."""

from __future__ import annotations

import hashlib
from collections import deque
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from asperity.arrays import Array
from asperity.errors import CheckpointError
from asperity.runtime.files import Stream, read_npz, stored_arrays, write_npz
from asperity.runtime.shares import DistributedArray, deal, on_root_of, steps, stream

if TYPE_CHECKING:
    from mpi4py import MPI

META, DIGEST = "meta", "digest"  # arrays of letters in a file
Headers = dict[str, tuple[str, tuple[int, ...]]]  # type and shape of arrays by name


@dataclass(frozen=True)
class Content:
    """What a file holds, read once from beginning to end."""

    headers: Headers  # of the arrays
    meta: bytes  # text of its numbers; empty where it has none
    digest: str  # of arrays and text
    signed: str  # digest that it was written with; empty where it has none


def write_shares(comm: MPI.Comm, path: Path, shares: Mapping[str, DistributedArray], meta: str = "") -> str:
    """Replace a file; collective.

    Args:
        meta: text for rank 0 to write with the arrays and their digest

    Returns:
        digest of arrays and text

    Raises:
        OutputError: it cannot be written; the earlier file is untouched
    """
    streams = {name: stream(array) for name, array in sorted(shares.items())}

    def write() -> str:
        content, text = hashlib.sha256(), {META: _letters(meta)} if meta else {}

        def members() -> Iterator[tuple[str, Stream]]:
            for name, array in sorted((streams | text).items()):
                content.update(_header(name, array.dtype, array.shape))
                yield name, replace(array, rows=_hashed(content, array.rows))
            if meta:
                yield DIGEST, _letters(content.hexdigest())

        write_npz(path, members())
        return content.hexdigest()

    return on_root_of(comm, streams.values(), write)


def read_shares(comm: MPI.Comm, path: Path, headers: Headers) -> dict[str, DistributedArray]:
    """Arrays of a file that `scan` has found to be whole; collective."""
    stored = stored_arrays(path) if comm.rank == 0 else iter(())
    out = {}
    for name, (dtype, shape) in sorted(headers.items()):
        array = next((a for a in stored if a.name == name), None)
        out[name] = deal(comm, shape, np.dtype(dtype), None if array is None else array.rows)
    return out


def scan(path: Path) -> Content:
    """Read a file without keeping its arrays.

    Raises:
        CheckpointError: it is missing or damaged
    """
    content, texts, headers = hashlib.sha256(), {META: b"", DIGEST: b""}, {}
    with refusing(path):
        for array in stored_arrays(path):
            rows = (array.rows(end - at) for at, end in steps(0, array.shape[0], array.shape, array.dtype))
            if array.name == DIGEST:
                texts[DIGEST] = b"".join(map(bytes, rows))
                continue
            content.update(_header(array.name, array.dtype, array.shape))
            hashed = _hashed(content, rows)
            if array.name == META:
                texts[META] = b"".join(map(bytes, hashed))
            else:
                deque(hashed, maxlen=0)
                headers[array.name] = array.dtype.str, array.shape
    return Content(headers, texts[META], content.hexdigest(), texts[DIGEST].decode(errors="replace"))


def read_arrays(path: Path, digest: str) -> dict[str, Array]:
    """All arrays of a file that rank 0 alone needs.

    Raises:
        CheckpointError: it is missing, damaged, or another file than that with this digest
    """
    with refusing(path):
        arrays = read_npz(path)
    check_digest(path, digest_of(arrays), digest)
    return arrays


def check_digest(path: Path, found: str, wanted: str) -> None:
    """Refuse another file than that with this digest."""
    if found != wanted:
        raise CheckpointError(f"{path} does not belong to the state in this folder; start the run again with --force")


def digest_of(arrays: Mapping[str, Array]) -> str:
    """SHA-256 of arrays with their names, types and shapes."""
    content = hashlib.sha256()
    for name, array in sorted(arrays.items()):
        content.update(_header(name, array.dtype, array.shape))
        content.update(array.tobytes())
    return content.hexdigest()


@contextmanager
def refusing(path: Path) -> Iterator[None]:
    """Turn errors of reading into those of a checkpoint."""
    try:
        yield
    except FileNotFoundError:
        raise CheckpointError(f"{path} is missing; start the run again with --force") from None
    except OSError as error:
        raise damaged(path, error.strerror or "it cannot be read") from None
    except ValueError as error:
        raise damaged(path, str(error)) from None


def damaged(path: Path, reason: str) -> CheckpointError:
    """Error of a file with this fault."""
    return CheckpointError(f"{path} is damaged: {reason}; start the run again with --force")


def _hashed(content: Any, rows: Iterable[Array]) -> Iterator[Array]:
    for piece in rows:
        content.update(piece.tobytes())
        yield piece


def _header(name: str, dtype: np.dtype[Any], shape: tuple[int, ...]) -> bytes:
    return f"{name} {dtype.str} {shape};".encode()


def _letters(text: str) -> Stream:
    letters = np.frombuffer(text.encode(), dtype=np.uint8)
    return Stream(letters.dtype, letters.shape, iter([letters]))
