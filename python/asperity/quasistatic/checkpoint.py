"""Checkpoint: the state of a run between two steps, on disk; a run resumes from it on any number of ranks.

The folder holds mesh.npz, written once, snapshot-K.npz for each snapshot, and state.npz, replaced as a whole after
each step: displacements and history in the numbering of the mesh as built, and all numbers as JSON in the array
"meta". Nothing is pickled. Damage shows in the checksum that the zip format has of each array. The state names the case
that it belongs to.
"""

from __future__ import annotations

import json
from collections import deque
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from asperity.errors import CheckpointError
from asperity.mesh.block import BlockMesh
from asperity.quasistatic.checkpoint_state import (
    DISPLACEMENTS,
    Saved,
    probe_names,
    snapshot_fields,
    solver_fields,
    solver_numbers,
)
from asperity.quasistatic.contact_solver import ContactSolver
from asperity.quasistatic.stepping import Position, Record
from asperity.runtime.distributed_array import DistributedArray, deal, on_root_of, steps, stream
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
from asperity.version import __version__

if TYPE_CHECKING:
    from mpi4py import MPI

FORMAT = 8  # of the files, which other versions refuse
META = "meta"  # array of letters: the numbers of a state as JSON
Headers = dict[str, tuple[str, tuple[int, ...]]]  # type and shape of arrays by name


def refuse_another_run(path: Path, saved: Mapping[str, Any], now: Mapping[str, Any]) -> None:
    """Refuse to continue from the state in a file under another identity than that saved there (CheckpointError)."""
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
        refuse: Callable[[Path, Mapping[str, Any], Mapping[str, Any]], None] = refuse_another_run,
    ) -> None:
        self.folder, self.interval = folder, interval
        self._identity, self._comm, self._refuse = dict(identity), comm, refuse
        self._ignored = self._begun = False  # whether a saved state is left alone, and whether the mesh is written
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

        def read() -> tuple[dict[str, Any], dict[str, Headers]] | None:
            if self._ignored or not (self.folder / STATE).is_file():
                return None
            remove_asides(self.folder)
            meta, headers = self._read_state(self.folder / STATE)
            path = self.folder / MESH
            with _refusing(path):
                blocks.append(block := BlockMesh.from_arrays(read_npz(path)))
                nodes = headers[DISPLACEMENTS[0]][1][0]
            if not block.refinements and nodes != len(block.points):
                raise CheckpointError(f"{path} does not belong to the state; start the run again with --force")
            names = [SNAPSHOT.format(k) for k in range(len(meta["snapshots"]))]
            return meta, {STATE: headers} | {name: scan(self.folder / name)[1] for name in names}

        found = on_root_bcast(self._comm, read)
        if found is None:
            return None
        meta, files = found
        self._begun = True
        state, *snapshots = (read_arrays(self._comm, self.folder / name, headers) for name, headers in files.items())
        self._snapshots = len(snapshots)
        return Saved(meta, state, tuple(snapshots), blocks[0] if blocks else None)

    def _read_state(self, path: Path) -> tuple[dict[str, Any], Headers]:
        """Numbers, and headers of the arrays."""
        text, headers = scan(path)
        try:
            meta: dict[str, Any] = json.loads(text)
            version = meta["format"]
        except UNREADABLE:
            raise CheckpointError(f"{path} is not a checkpoint of asperity") from None
        if version != FORMAT:
            raise CheckpointError(
                f"{path} was written by asperity {meta.get('version', '?')} in format {version}, this version "
                f"continues format {FORMAT}; use that version, or start again without --resume"
            )
        self._refuse(path, meta["identity"], self._identity)
        return meta, headers

    def begin(self, block: BlockMesh | None) -> None:
        """Write the mesh, which rank 0 holds.

        Raises:
            OutputError: it cannot be written
        """

        def write() -> None:
            assert block is not None
            self.folder.mkdir(parents=True, exist_ok=True)
            replace_file(self.folder / MESH, npz_bytes(block.arrays()))

        if self.interval and not self._begun:
            on_root_bcast(self._comm, write)
            self._begun = True

    def due(self, steps: int) -> bool:
        """Whether to save after that many accepted steps."""
        return self.interval > 0 and steps % self.interval == 0

    def save(self, solver: ContactSolver, record: Record, position: Position) -> None:
        """Replace the saved state.

        Raises:
            OutputError: it cannot be written; the earlier state is untouched
        """
        if not self.interval:
            return
        with solver.solid.phases.phase("checkpoint"):
            for snapshot in record.snapshots[self._snapshots :]:
                path = self.folder / SNAPSHOT.format(self._snapshots)
                write_arrays(self._comm, path, snapshot_fields(solver, snapshot))
                self._snapshots += 1
            meta: dict[str, Any] = {
                "format": FORMAT,
                "version": __version__,
                "identity": self._identity,
                "position": asdict(position),
                "solver": solver_numbers(solver.state()),
                "probes": probe_names(solver),
                "rows": record.rows,
                "snapshots": [{"step": s.step, "branch": s.branch, "delta": s.delta} for s in record.snapshots],
                "seconds": solver.solid.phases.seconds,
                "calls": solver.solid.phases.calls,
            }
            write_arrays(self._comm, self.folder / STATE, solver_fields(solver), json.dumps(meta, default=float))


def write_arrays(comm: MPI.Comm, path: Path, arrays: Mapping[str, DistributedArray], text: str = "") -> None:
    """Replace a .npz file, which rank 0 writes in pieces, with a text as the array "meta"; collective.

    Raises:
        OutputError: it cannot be written; the earlier file is untouched
    """
    streams = {name: stream(array) for name, array in sorted(arrays.items())}
    letters = np.frombuffer(text.encode(), dtype=np.uint8)
    members = streams | {META: Stream(letters.dtype, letters.shape, iter([letters]))}
    on_root_of(comm, streams.values(), lambda: write_npz(path, sorted(members.items())))


def read_arrays(comm: MPI.Comm, path: Path, headers: Headers) -> dict[str, DistributedArray]:
    """Arrays of a file that `scan` has found to be whole; collective."""
    stored = stored_arrays(path) if comm.rank == 0 else iter(())
    out = {}
    for name, (dtype, shape) in sorted(headers.items()):
        array = next((a for a in stored if a.name == name), None)
        out[name] = deal(comm, shape, np.dtype(dtype), None if array is None else array.rows)
    return out


def scan(path: Path) -> tuple[str, Headers]:
    """Text of a file, and the headers of its other arrays, which are read for their checksums and not kept.

    Raises:
        CheckpointError: it is missing or damaged
    """
    text, headers = "", {}
    with _refusing(path):
        for array in stored_arrays(path):
            rows = (array.rows(end - at) for at, end in steps(0, array.shape[0], array.shape, array.dtype))
            if array.name == META:
                text = b"".join(map(bytes, rows)).decode(errors="replace")
            else:
                deque(rows, maxlen=0)
                headers[array.name] = array.dtype.str, array.shape
    return text, headers


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
