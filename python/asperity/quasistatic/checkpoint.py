"""Checkpoint: the state of a run between two steps, on disk; a run resumes from it on any number of ranks.

The folder holds mesh.npz, written once, snapshot-K.npz for each snapshot, and state.npz, replaced as a whole after
each step: displacements and history in the numbering of the mesh as built, and all numbers as JSON in the array
"meta". Nothing is pickled. Damage shows in the checksum that the zip format has of each array. The array "run" is the
same in all files of a run; the state names the case that it belongs to.
"""

from __future__ import annotations

import json
from collections import deque
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any
from uuid import uuid4

import numpy as np

from asperity.errors import CheckpointError
from asperity.mesh.block import BlockMesh
from asperity.quasistatic.checkpoint_state import Saved, snapshot_fields, solver_fields, solver_numbers
from asperity.quasistatic.contact_solver import ContactSolver
from asperity.quasistatic.stepping import Position, Record
from asperity.runtime.files import (
    UNREADABLE,
    Stream,
    npz_bytes,
    read_npz,
    remove_asides,
    replace_file,
    stored_arrays,
    write_npz,
)
from asperity.runtime.parallel import on_root_bcast
from asperity.runtime.run_folder import MESH, SNAPSHOT, STATE
from asperity.runtime.shares import DistributedArray, deal, on_root_of, steps, stream

if TYPE_CHECKING:
    from mpi4py import MPI

FORMAT = 6  # of the files, which other versions refuse
META, RUN = "meta", "run"  # arrays of letters: the numbers of a state as JSON, and the name of the run
Headers = dict[str, tuple[str, tuple[int, ...]]]  # type and shape of arrays by name


def refuse_unequal(path: Path, saved: Mapping[str, Any], now: Mapping[str, Any]) -> None:
    """Refuse the state of a run with another identity.

    Raises:
        CheckpointError: the identities differ
    """
    if saved != now:
        raise CheckpointError(f"{path} belongs to another run; start again with --force")


class Checkpoint:
    """Folder with the state of one load path; all methods are collective.

    Args:
        folder: for the files; made when needed
        identity: of the run; saved with each state
        comm: ranks of the run
        interval: number of accepted steps between two saves; 0 saves nothing
        refuse: called with the path of a state, its identity and that of the run; raises CheckpointError where the run
            does not continue from it
    """

    def __init__(
        self,
        folder: Path,
        identity: Mapping[str, Any],
        comm: MPI.Comm,
        interval: int = 1,
        refuse: Callable[[Path, Mapping[str, Any], Mapping[str, Any]], None] = refuse_unequal,
    ) -> None:
        self.folder, self.interval = folder, interval
        self._identity, self._comm, self._refuse = dict(identity), comm, refuse
        self._ignored = False  # whether a saved state is left alone
        self._run = ""  # name of the run whose files are in the folder, empty before the mesh is written
        self._snapshots = 0  # written

    def part(self, name: str) -> Checkpoint:
        """Checkpoint of one of several load paths of the same run."""
        part = Checkpoint(self.folder / name, self._identity, self._comm, self.interval, self._refuse)
        part._ignored = self._ignored
        return part

    def ignore(self) -> None:
        """Load no state from now on: the run starts again, and `clear` removes what was saved."""
        self._ignored = True

    def clear(self) -> None:
        """Remove the files of an earlier run, and no others."""

        def remove() -> None:
            for folder in sorted(self.folder.glob("**/"), reverse=True):  # those inside first
                remove_asides(folder)
                for name in (STATE, MESH, SNAPSHOT.format("*")):
                    for path in folder.glob(name):
                        path.unlink(missing_ok=True)
                with suppress(OSError):  # it holds files of others
                    folder.rmdir()

        on_root_bcast(self._comm, remove)

    def found(self) -> bool:
        """Whether there is a state to resume from.

        Raises:
            CheckpointError: there is one, but it is damaged, of another case or of a newer version
        """

        def check() -> bool:
            states = sorted(self.folder.glob(f"**/{STATE}"))
            for path in states:
                self._read_state(path)
            return bool(states)

        return on_root_bcast(self._comm, check)

    def load(self) -> Saved | None:
        """Read the saved state; None when there is none.

        Raises:
            CheckpointError: it is damaged, of another case or of a newer version
        """
        blocks: list[BlockMesh] = []

        def read() -> tuple[dict[str, Any], str, dict[str, Headers]] | None:
            if self._ignored or not (self.folder / STATE).is_file():
                return None
            remove_asides(self.folder)
            meta, run, headers = self._read_state(self.folder / STATE)
            blocks.append(_read_block(self.folder / MESH, run))
            files = {STATE: headers}
            for k in range(len(meta["snapshots"])):
                path = self.folder / SNAPSHOT.format(k)
                texts, files[path.name] = scan(path)
                _check_run(path, texts[RUN], run)
            return meta, run, files

        found = on_root_bcast(self._comm, read)
        if found is None:
            return None
        meta, self._run, files = found
        state, *snapshots = (read_arrays(self._comm, self.folder / name, headers) for name, headers in files.items())
        self._snapshots = len(snapshots)
        return Saved(meta, state, tuple(snapshots), blocks[0] if blocks else None)

    def _read_state(self, path: Path) -> tuple[dict[str, Any], str, Headers]:
        """Numbers, name of the run, and headers of the arrays."""
        texts, headers = scan(path)
        try:
            meta: dict[str, Any] = json.loads(texts[META])
            version = meta["format"]
        except UNREADABLE:
            raise CheckpointError(f"{path} is not a checkpoint of asperity") from None
        if version != FORMAT:
            raise CheckpointError(
                f"{path} was written by asperity {meta.get('version', '?')} in format {version}, this version "
                f"continues format {FORMAT}; use that version, or start again without --resume"
            )
        self._refuse(path, meta["identity"], self._identity)
        return meta, texts[RUN], headers

    def begin(self, block: BlockMesh | None) -> None:
        """Write the mesh, which rank 0 holds.

        Raises:
            OutputError: it cannot be written
        """
        if not self.interval or self._run:
            return

        def write() -> str:
            assert block is not None
            run = uuid4().hex
            self.folder.mkdir(parents=True, exist_ok=True)
            replace_file(self.folder / MESH, npz_bytes({**block.arrays(), RUN: _letters(run)}))
            return run

        self._run = on_root_bcast(self._comm, write)

    def due(self, steps: int) -> bool:
        """Whether to save after that many accepted steps."""
        return self.interval > 0 and steps % self.interval == 0

    def save(self, solver: ContactSolver, record: Record, position: Position) -> None:
        """Replace the saved state.

        Raises:
            OutputError: it cannot be written; the earlier state is untouched
        """
        from asperity import __version__

        if not self.interval:
            return
        with solver.solid.phases.phase("checkpoint"):
            texts = {RUN: self._run}
            for snapshot in record.snapshots[self._snapshots :]:
                path = self.folder / SNAPSHOT.format(self._snapshots)
                write_arrays(self._comm, path, snapshot_fields(solver, snapshot), texts)
                self._snapshots += 1
            meta: dict[str, Any] = {
                "format": FORMAT,
                "version": __version__,
                "identity": self._identity,
                "position": asdict(position),
                "solver": solver_numbers(solver.state()),
                "rows": record.rows,
                "snapshots": [{"step": s.step, "branch": s.branch, "delta": s.delta} for s in record.snapshots],
                "seconds": solver.solid.phases.seconds,
                "calls": solver.solid.phases.calls,
            }
            texts[META] = json.dumps(meta, default=float)
            write_arrays(self._comm, self.folder / STATE, solver_fields(solver), texts)


def write_arrays(
    comm: MPI.Comm, path: Path, arrays: Mapping[str, DistributedArray], texts: Mapping[str, str] | None = None
) -> None:
    """Replace a .npz file, which rank 0 writes in pieces; collective.

    Args:
        texts: written as arrays of letters

    Raises:
        OutputError: it cannot be written; the earlier file is untouched
    """
    streams = {name: stream(array) for name, array in sorted(arrays.items())}
    letters = {name: _letters(text) for name, text in (texts or {}).items()}
    members = streams | {name: Stream(array.dtype, array.shape, iter([array])) for name, array in letters.items()}
    on_root_of(comm, streams.values(), lambda: write_npz(path, sorted(members.items())))


def read_arrays(comm: MPI.Comm, path: Path, headers: Headers) -> dict[str, DistributedArray]:
    """Arrays of a file that `scan` has found to be whole; collective."""
    stored = stored_arrays(path) if comm.rank == 0 else iter(())
    out = {}
    for name, (dtype, shape) in sorted(headers.items()):
        array = next((a for a in stored if a.name == name), None)
        out[name] = deal(comm, shape, np.dtype(dtype), None if array is None else array.rows)
    return out


def scan(path: Path) -> tuple[dict[str, str], Headers]:
    """Texts of a file, and the headers of its other arrays, which are read for their checksums and not kept.

    Raises:
        CheckpointError: it is missing or damaged
    """
    texts, headers = {META: "", RUN: ""}, {}
    with _refusing(path):
        for array in stored_arrays(path):
            rows = (array.rows(end - at) for at, end in steps(0, array.shape[0], array.shape, array.dtype))
            if array.name in texts:
                texts[array.name] = b"".join(map(bytes, rows)).decode(errors="replace")
            else:
                deque(rows, maxlen=0)
                headers[array.name] = array.dtype.str, array.shape
    return texts, headers


def _read_block(path: Path, run: str) -> BlockMesh:
    """Mesh of a run."""
    with _refusing(path):
        arrays = read_npz(path)
        block = BlockMesh.from_arrays(arrays)
    _check_run(path, arrays.get(RUN, np.empty(0)).tobytes().decode(errors="replace"), run)
    return block


def _check_run(path: Path, found: str, wanted: str) -> None:
    """Refuse a file of another run."""
    if found != wanted:
        raise CheckpointError(f"{path} does not belong to the state in this folder; start the run again with --force")


@contextmanager
def _refusing(path: Path) -> Iterator[None]:
    """Turn errors of reading into those of a checkpoint."""
    try:
        yield
    except FileNotFoundError:
        raise CheckpointError(f"{path} is missing; start the run again with --force") from None
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise CheckpointError(f"{path} is damaged: {reason}; start the run again with --force") from None


def _letters(text: str) -> np.ndarray[Any, np.dtype[np.uint8]]:
    return np.frombuffer(text.encode(), dtype=np.uint8)
