# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

"""Checkpoint: the state of a run between two steps, on disk; a run resumes from it on any number of ranks.

The folder holds mesh.npz, written once, snapshot-K.npz for each snapshot, and state.npz, replaced as a whole after
each step: displacements and history in the numbering of the mesh as built, and all numbers as JSON in the array
"meta". Nothing is pickled. The state names the case it belongs to, and holds a digest of itself and of the files it
needs: with these digests, the same format and the same case it is what this program wrote.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

from asperity.errors import CheckpointError
from asperity.mesh.block import BlockMesh
from asperity.quasistatic.checkpoint_files import (
    Headers,
    check_digest,
    damaged,
    digest_of,
    read_arrays,
    read_shares,
    refusing,
    scan,
    write_shares,
)
from asperity.quasistatic.checkpoint_state import Saved, snapshot_fields, solver_fields, solver_numbers
from asperity.quasistatic.contact_solver import ContactSolver
from asperity.quasistatic.stepping import Position, Record
from asperity.runtime.files import UNREADABLE, npz_bytes, remove_asides, replace_file
from asperity.runtime.parallel import on_root_bcast
from asperity.runtime.run_folder import MESH, SNAPSHOT, STATE

if TYPE_CHECKING:
    from mpi4py import MPI

FORMAT = (
    5  # 3: digests; the tolerance of the equations belongs to the case; 4: start of the stiffness columns; 5: names
)


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
        self._mesh = ""  # digest of the mesh written
        self._snapshots: list[str] = []  # digests of those written

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
            files = {STATE: headers}
            blocks.append(_read_block(self.folder / MESH, meta["mesh"]))
            for k, about in enumerate(meta["snapshots"]):
                path = self.folder / SNAPSHOT.format(k)
                content = scan(path)
                check_digest(path, content.digest, about["digest"])
                files[path.name] = content.headers
            return meta, files

        found = on_root_bcast(self._comm, read)
        if found is None:
            return None
        meta, files = found
        state, *snapshots = (read_shares(self._comm, self.folder / name, headers) for name, headers in files.items())
        self._mesh, self._snapshots = meta["mesh"], [about["digest"] for about in meta["snapshots"]]
        return Saved(self.folder, meta, state, tuple(snapshots), blocks[0] if blocks else None)

    def _read_state(self, path: Path) -> tuple[dict[str, Any], Headers]:
        content = scan(path)
        try:
            meta: dict[str, Any] = json.loads(content.meta)
            version = meta["format"]
        except UNREADABLE:
            raise CheckpointError(f"{path} is not a checkpoint of asperity") from None
        if version != FORMAT:
            raise CheckpointError(
                f"{path} was written by asperity {meta.get('version', '?')} in format {version}, this version "
                f"continues format {FORMAT}; use that version, or start again without --resume"
            )
        if content.signed != content.digest:
            raise damaged(path, "its content is not what was written")
        self._refuse(path, meta["identity"], self._identity)
        return meta, content.headers

    def begin(self, block: BlockMesh | None) -> None:
        """Write the mesh, which rank 0 holds.

        Raises:
            OutputError: it cannot be written
        """
        if not self.interval or self._mesh:
            return

        def write() -> str:
            assert block is not None
            self.folder.mkdir(parents=True, exist_ok=True)
            replace_file(self.folder / MESH, npz_bytes(block.arrays()))
            return digest_of(block.arrays())

        self._mesh = on_root_bcast(self._comm, write)

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
            for k, snapshot in enumerate(record.snapshots[len(self._snapshots) :], len(self._snapshots)):
                fields = snapshot_fields(solver, snapshot)
                self._snapshots.append(write_shares(self._comm, self.folder / SNAPSHOT.format(k), fields))
            meta: dict[str, Any] = {
                "format": FORMAT,
                "version": __version__,
                "identity": self._identity,
                "mesh": self._mesh,
                "position": asdict(position),
                "solver": solver_numbers(solver.state()),
                "rows": record.rows,
                "snapshots": [
                    {"step": s.step, "branch": s.branch, "delta": s.delta, "digest": digest}
                    for s, digest in zip(record.snapshots, self._snapshots, strict=True)
                ],
                "seconds": solver.solid.phases.seconds,
                "calls": solver.solid.phases.calls,
            }
            fields = solver_fields(solver)
            write_shares(self._comm, self.folder / STATE, fields, json.dumps(meta, default=float))


def _read_block(path: Path, digest: str) -> BlockMesh:
    arrays = read_arrays(path, digest)
    with refusing(path):
        return BlockMesh.from_arrays(arrays)
