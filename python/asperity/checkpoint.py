"""State of a run between two steps, on disk: it goes on from there on any number of ranks.

The folder holds mesh.npz, written once, snapshot-K.npz for each snapshot, and state.npz, replaced as a whole after
each step: displacements and history in the numbering of the mesh as built, and all numbers as JSON in the array
"meta". Nothing is pickled, every array carries a checksum, and the state names the case and the mesh it belongs to.
"""

from __future__ import annotations

import hashlib
import io
import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from .block import BlockMesh
from .case import read_bytes
from .errors import CheckpointError
from .gather import (
    cell_numbers,
    collect,
    collect_some,
    facet_numbers,
    node_numbers,
    spread,
    spread_some,
)
from .loading import Position, Record
from .press import Press, Snapshot
from .schema import show
from .storage import UNREADABLE, npz_bytes, on_root, remove_asides, replace_file

if TYPE_CHECKING:
    from mpi4py import MPI

    from .case import Case

Array = npt.NDArray[Any]

FORMAT = 2  # 2: pieces of the first steps of the midpoint rule
OF_CELLS = ("stress", "plastic_strain")  # fields of a snapshot with a row a cell
MESH, STATE, SNAPSHOT = "mesh.npz", "state.npz", "snapshot-{}.npz"
#: Sections and keys that may differ between a run and its continuation; loading.cycles may also grow.
CHANGEABLE = frozenset({"units", "dynamics", "solver", "output", "accuracy.max_seconds", "accuracy.max_dofs"})
CYCLES = "loading.cycles"
FILES = ("surface.path", "mesh.file")


def identity(case: Case) -> dict[str, Any]:
    """Keys of a case that its checkpoint depends on, with their values; files count by their content."""
    keys: dict[str, Any] = {}
    for section, table in case.to_dict().items():
        if section not in CHANGEABLE:
            keys |= {f"{section}.{key}": value for key, value in table.items()}
    for name in FILES:
        if name in keys:
            keys[name] = hashlib.sha256(read_bytes(Path(keys[name]), name)).hexdigest()
    return {name: value for name, value in keys.items() if name not in CHANGEABLE}


@dataclass(frozen=True)
class Saved:
    """What a checkpoint holds; the arrays and the mesh on rank 0 only.

    Attributes:
        meta: position, rows, counts and all other numbers
        arrays: fields by name
        snapshots: fields of each snapshot
        block: the mesh
    """

    meta: Mapping[str, Any]
    arrays: Mapping[str, Array]
    snapshots: tuple[Mapping[str, Array], ...]
    block: BlockMesh | None

    def restore(self, press: Press, record: Record) -> Position:
        """Put `press`, on the same mesh, and `record` into the saved state; collective."""
        solid, comm = press.solid, press.solid.comm
        nodes, cells = node_numbers(solid), cell_numbers(solid)
        root = comm.rank == 0

        def rows(name: str) -> tuple[Array, Array] | None:
            return (self.arrays[f"{name}.at"], self.arrays[name]) if root else None

        owned = nodes[: solid.owned]
        displacements = {
            name: spread(comm, owned, self.arrays.get(f"displacement.{name}")) for name in self.meta["displacements"]
        }
        touched = spread_some(comm, nodes[press.top.owned_nodes], rows("touched_at"), np.inf)
        if solid.material.plastic:
            solid.bulk.restore(
                spread_some(comm, cells, rows("plastic_strain")),
                spread_some(comm, cells, rows("accumulated")),
            )
        facets = facet_numbers(press.top)
        press.contact.restore_state(
            {name: spread_some(comm, facets, rows(f"contact.{name}")) for name in self.meta["contact"]}
        )
        press.resume(self.meta["press"], displacements, touched)
        record.rows[:] = self.meta["rows"]
        for k, about in enumerate(self.meta["snapshots"]):
            fields = {
                name: spread(comm, cells if name in OF_CELLS else nodes, self._snapshot(k, name))
                for name in about["fields"]
            }
            fields.setdefault("plastic_strain", solid.bulk.history()[1].copy())
            record.snapshots.append(Snapshot(about["step"], about["branch"], about["delta"], **fields))
        for kind in ("seconds", "calls"):
            totals = getattr(solid.phases, kind)
            for name, value in self.meta[kind].items():
                totals[name] = totals.get(name, 0) + value
        return Position.from_dict(self.meta["position"])

    def _snapshot(self, k: int, name: str) -> Array | None:
        return self.snapshots[k][name] if self.snapshots else None


class Checkpoint:
    """Folder for the state of one load path; all methods are collective.

    Args:
        folder: receives the files; made when needed
        identity: what the run depends on, see `identity`
        comm: ranks of the run
        interval: accepted steps from one save to the next, 0 to save nothing
    """

    def __init__(self, folder: Path, identity: Mapping[str, Any], comm: MPI.Comm, interval: int = 1) -> None:
        self.folder, self.interval = folder, interval
        self._identity, self._comm = dict(identity), comm
        self._mesh_hash = ""
        self._snapshots = 0  # written so far

    def part(self, name: str) -> Checkpoint:
        """Checkpoint of one of several load paths of the same run."""
        return Checkpoint(self.folder / name, self._identity, self._comm, self.interval)

    def clear(self) -> None:
        """Remove what an earlier run left, and nothing else."""

        def remove() -> None:
            for name in (MESH, STATE, SNAPSHOT.format("*")):
                for path in self.folder.glob(f"**/{name}"):
                    path.unlink(missing_ok=True)

        on_root(self._comm, remove)

    def require(self) -> None:
        """Make sure that there is a state to continue from and that it belongs to this case.

        Raises:
            CheckpointError: there is none, it is damaged, of another case or of a newer version
        """

        def check() -> None:
            states = sorted(self.folder.glob(f"**/{STATE}"))
            if not states:
                raise CheckpointError(
                    f"{self.folder} holds no checkpoint to resume from; start the run anew with --force"
                )
            for path in states:
                self._read_state(path)

        on_root(self._comm, check)

    def load(self) -> Saved | None:
        """Read the saved state; None when there is none.

        Raises:
            CheckpointError: it is damaged, of another case or of a newer version
        """
        found: list[Saved] = []

        def read() -> dict[str, Any] | None:
            if not (self.folder / STATE).is_file():
                return None
            remove_asides(self.folder)
            meta, arrays = self._read_state(self.folder / STATE)
            block = _read_block(self.folder / MESH, meta["mesh"])
            names = [SNAPSHOT.format(k) for k in range(len(meta["snapshots"]))]
            snapshots = tuple(_read_npz(self.folder / name) for name in names)
            found.append(Saved(meta, arrays, snapshots, block))
            return meta

        meta = on_root(self._comm, read)
        if meta is None:
            return None
        self._mesh_hash, self._snapshots = meta["mesh"], len(meta["snapshots"])
        return found[0] if found else Saved(meta, {}, (), None)

    def _read_state(self, path: Path) -> tuple[dict[str, Any], dict[str, Array]]:
        arrays = _read_npz(path)
        try:
            meta = json.loads(arrays.pop("meta").tobytes())
            version, saved = meta["format"], meta["identity"]
        except (KeyError, TypeError, ValueError):
            raise CheckpointError(f"{path} is not a checkpoint of asperity") from None
        if version != FORMAT:
            raise CheckpointError(
                f"{path} was written by asperity {meta.get('version', '?')} in format {version}, this version "
                f"continues format {FORMAT}; use that version, or start again without --resume"
            )
        different = differences(saved, self._identity)
        if different:
            raise CheckpointError(
                f"{path} belongs to another case: {'; '.join(different[:3])}"
                + (f"; and {len(different) - 3} more keys" if len(different) > 3 else "")
                + "; resume with the case it was made for, or start anew with --force"
            )
        return meta, arrays

    def begin(self, block: BlockMesh | None) -> None:
        """Write the mesh, held by rank 0.

        Raises:
            OutputError: it cannot be written
        """
        if not self.interval or self._mesh_hash:
            return

        def write() -> str:
            assert block is not None
            self.folder.mkdir(parents=True, exist_ok=True)
            data = {"points": block.points, "tets": block.tets}
            sizes = {"side": np.array(block.side), "height": np.array(block.height)}
            replace_file(self.folder / MESH, npz_bytes(data | sizes))
            return _hash(block)

        self._mesh_hash = on_root(self._comm, write)

    def due(self, steps: int) -> bool:
        """Whether to save after that many accepted steps."""
        return self.interval > 0 and steps % self.interval == 0

    def save(self, press: Press, record: Record, position: Position) -> None:
        """Replace the saved state.

        Raises:
            OutputError: it cannot be written; the earlier state is untouched
        """
        if not self.interval:
            return
        with press.solid.phases.phase("checkpoint"):
            arrays = _fields(press)
            new = [_snapshot_fields(press, s) for s in record.snapshots[self._snapshots :]]
            about = [
                {"step": s.step, "branch": s.branch, "delta": s.delta, "fields": _snapshot_names(press)}
                for s in record.snapshots
            ]
            meta = {
                "format": FORMAT,
                "version": _version(),
                "identity": self._identity,
                "mesh": self._mesh_hash,
                "position": asdict(position),
                "press": press.numbers(),
                "displacements": list(press.displacements()),
                "contact": list(press.contact.state()),
                "rows": record.rows,
                "snapshots": about,
                "seconds": press.solid.phases.seconds,
                "calls": press.solid.phases.calls,
            }

            def write() -> None:
                for k, fields in enumerate(new, self._snapshots):
                    replace_file(self.folder / SNAPSHOT.format(k), npz_bytes(fields))
                text = json.dumps(meta, default=float).encode()
                state = {"meta": np.frombuffer(text, dtype=np.uint8)} | arrays
                replace_file(self.folder / STATE, npz_bytes(state))

            on_root(self._comm, write)
            self._snapshots = len(record.snapshots)


def differences(saved: Mapping[str, Any], now: Mapping[str, Any]) -> list[str]:
    """Keys that forbid a continuation, in words."""
    found = []
    for name in sorted({*saved, *now}):
        old, new = saved.get(name), now.get(name)
        if old == new or (name == CYCLES and old is not None and new is not None and new > old):
            continue
        if name in FILES:
            found.append(f"{name} has another content")
        else:
            words = ["absent" if value is None else show(value) for value in (old, new)]
            found.append(f"{name} = {words[0]} there, {words[1]} here")
    return found


def _fields(press: Press) -> dict[str, Array]:
    """Fields of a state on rank 0, in the numbering of the mesh as built; empty elsewhere; collective."""
    solid, comm = press.solid, press.solid.comm
    nodes, cells = node_numbers(solid)[: solid.owned], cell_numbers(solid)
    out: dict[str, Array] = {}

    def keep_some(name: str, numbers: Array, values: Array) -> None:
        rows = collect_some(comm, numbers, values)
        if rows is not None:
            out[f"{name}.at"], out[name] = rows

    for name, u in press.displacements().items():
        values = collect(comm, nodes, u)
        if values is not None:
            out[f"displacement.{name}"] = values
    touched_at = press.touched_at()
    touched = np.flatnonzero(np.isfinite(touched_at))
    keep_some("touched_at", nodes[press.top.owned_nodes[touched]], touched_at[touched])
    if solid.material.plastic:
        strain, accumulated = solid.bulk.history()
        yielded = np.flatnonzero(accumulated.any(axis=1))
        keep_some("plastic_strain", cells[yielded], strain[yielded])
        keep_some("accumulated", cells[yielded], accumulated[yielded])
    for name, values in press.contact.state().items():
        keep_some(f"contact.{name}", facet_numbers(press.top), values)
    return out


def _snapshot_names(press: Press) -> list[str]:
    names = ["pressure", "gap", "displacement", "stress"]
    return [*names, "plastic_strain"] if press.solid.material.plastic else names


def _snapshot_fields(press: Press, snapshot: Snapshot) -> dict[str, Array]:
    """Fields of a snapshot on rank 0; empty elsewhere; collective."""
    solid, out = press.solid, {}
    for name in _snapshot_names(press):
        values = getattr(snapshot, name)
        if name in OF_CELLS:
            rows = collect(solid.comm, cell_numbers(solid), values)
        else:
            rows = collect(solid.comm, node_numbers(solid)[: solid.owned], values[: solid.owned])
        if rows is not None:
            out[name] = rows
    return out


def _read_npz(path: Path) -> dict[str, Array]:
    try:
        with np.load(io.BytesIO(path.read_bytes()), allow_pickle=False) as file:
            return {name: file[name] for name in file.files}
    except FileNotFoundError:
        raise CheckpointError(f"{path} is missing; start the run anew with --force") from None
    except UNREADABLE as error:
        raise CheckpointError(f"{path} is damaged ({error}); start the run anew with --force") from None


def _read_block(path: Path, expected: str) -> BlockMesh:
    arrays = _read_npz(path)
    try:
        block = BlockMesh(arrays["points"], arrays["tets"], float(arrays["side"]), float(arrays["height"]))
    except (KeyError, TypeError):
        raise CheckpointError(f"{path} is not a mesh of asperity") from None
    if _hash(block) != expected:
        raise CheckpointError(f"{path} is not the mesh the state beside it was computed on")
    return block


def _hash(block: BlockMesh) -> str:
    content = [np.ascontiguousarray(a).tobytes() for a in (block.points, block.tets)]
    return hashlib.sha256(b"".join(content)).hexdigest()


def _version() -> str:
    from . import __version__

    return __version__
