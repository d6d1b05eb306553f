"""State of a run between two steps, on disk: it goes on from there on any number of ranks.

The folder holds mesh.npz, written once, snapshot-K.npz for each snapshot, and state.npz, replaced as a whole after
each step: displacements and history in the numbering of the mesh as built, and all numbers as JSON in the array
"meta". Nothing is pickled. The state names the case it belongs to, and carries a digest of itself and of the files it
needs; what it holds is compared with what a run would save before it is taken up (`state`).
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from asperity.arrays import Array
from asperity.case.case_file import read_bytes
from asperity.case.schema import show
from asperity.contact.contact_surface import facet_numbers
from asperity.errors import CheckpointError
from asperity.fem.global_numbering import (
    cell_numbers,
    collect,
    collect_some,
    node_numbers,
    spread,
    spread_some,
)
from asperity.mesh.block import BlockMesh
from asperity.quasistatic.balance import Checks
from asperity.quasistatic.checkpoint_schema import wrong_array, wrong_number
from asperity.quasistatic.contact_solver import ContactSolver, Counts, SolverState
from asperity.quasistatic.measures import FirstContact, Snapshot, snapshot
from asperity.quasistatic.stepping import Position, Record
from asperity.runtime.files import UNREADABLE, npz_bytes, read_npz, remove_asides, replace_file
from asperity.runtime.parallel import on_root_bcast
from asperity.runtime.run_folder import MESH, SNAPSHOT, STATE

if TYPE_CHECKING:
    from mpi4py import MPI

    from asperity.case import Case


FORMAT = 3  # 3: digests; the tolerance of the equations belongs to the case
OF_CELLS = ("stress", "plastic_strain")  # fields of a snapshot with a row a cell
#: Sections and keys that may differ between a run and its continuation, for the curve stays what it is to the tolerance
#: of the equations; loading.cycles may also grow.
CHANGEABLE = frozenset(
    {"units", "dynamics", "output", "solver.kernels", "solver.linear", "accuracy.max_seconds", "accuracy.max_dofs"}
)
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
        folder: where it was read
        meta: position, rows, counts and all other numbers
        arrays: fields by name
        snapshots: fields of each snapshot
        block: the mesh
    """

    folder: Path
    meta: Mapping[str, Any]
    arrays: Mapping[str, Array]
    snapshots: tuple[Mapping[str, Array], ...]
    block: BlockMesh | None

    def restore(self, solver: ContactSolver, record: Record) -> Position:
        """Put `solver`, on the same mesh and at its initial state, and `record` into the saved state; collective.

        Raises:
            CheckpointError: the arrays are not those of `solver`
        """
        self._judge(solver, record.first_contact)
        solid, comm = solver.solid, solver.solid.comm
        nodes, cells = node_numbers(solid), cell_numbers(solid)
        root = comm.rank == 0

        def rows(name: str) -> tuple[Array, Array] | None:
            return (self.arrays[f"{name}.at"], self.arrays[name]) if root else None

        owned = nodes[: solid.owned]
        displacements = {
            name: spread(comm, owned, self.arrays.get(f"displacement.{name}")) for name in self._displacements()
        }
        touched = spread_some(comm, nodes[solver.contact_surface.owned_nodes], rows("touched_at"), np.inf)
        if solid.material.plastic:
            solid.bulk.restore(
                spread_some(comm, cells, rows("plastic_strain")),
                spread_some(comm, cells, rows("accumulated")),
            )
        facets = facet_numbers(solver.contact_surface)
        solver.contact.restore_state(
            {name: spread_some(comm, facets, rows(f"contact.{name}")) for name in _contact_state(solver)}
        )
        solver.restore(_state(self.meta["press"], displacements))
        record.first_contact.delta = touched
        record.rows[:] = self.meta["rows"]
        for k, about in enumerate(self.meta["snapshots"]):
            fields = {
                name: spread(comm, cells if name in OF_CELLS else nodes, self._snapshot(k, name))
                for name in _snapshot_names(solver)
            }
            fields.setdefault("plastic_strain", solid.bulk.history()[1].copy())
            record.snapshots.append(Snapshot(about["step"], about["branch"], about["delta"], **fields))
        for kind in ("seconds", "calls"):
            totals = getattr(solid.phases, kind)
            for name, value in self.meta[kind].items():
                totals[name] = totals.get(name, 0) + value
        return Position.from_dict(self.meta["position"])

    def _displacements(self) -> tuple[str, ...]:
        return ("last",) if self.meta["press"]["before"] is None else ("last", "previous")

    def _judge(self, solver: ContactSolver, first_contact: FirstContact) -> None:
        """Make sure that the arrays are those that `solver` would save."""
        fresh = _fields(solver, first_contact)
        fields = _snapshot_fields(solver, snapshot(solver, 0, "load")) if self.meta["snapshots"] else {}

        def judge() -> None:
            assert self.block is not None
            like = fresh | {f"displacement.{name}": fresh["displacement.last"] for name in self._displacements()}
            names = [SNAPSHOT.format(k) for k in range(len(self.snapshots))]
            pairs = [(STATE, self.arrays, like), *((n, s, fields) for n, s in zip(names, self.snapshots, strict=True))]
            for name, arrays, expected in pairs:
                wrong = wrong_array(arrays, expected, len(self.block.points), len(self.block.tets))
                if wrong:
                    raise _damaged(self.folder / name, wrong)

        on_root_bcast(solver.solid.comm, judge)

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
        self._mesh = ""  # digest of the mesh written
        self._snapshots: list[str] = []  # digests of those written

    def part(self, name: str) -> Checkpoint:
        """Checkpoint of one of several load paths of the same run."""
        return Checkpoint(self.folder / name, self._identity, self._comm, self.interval)

    def clear(self) -> None:
        """Remove what an earlier run left, and nothing else."""

        def remove() -> None:
            for folder in sorted(self.folder.glob("**/"), reverse=True):  # those inside first
                remove_asides(folder)
                for name in (STATE, MESH, SNAPSHOT.format("*")):
                    for path in folder.glob(name):
                        path.unlink(missing_ok=True)
                with suppress(OSError):  # it holds what is somebody else's
                    folder.rmdir()

        on_root_bcast(self._comm, remove)

    def found(self) -> bool:
        """Whether there is a state to continue from.

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
        found: list[Saved] = []

        def read() -> dict[str, Any] | None:
            if not (self.folder / STATE).is_file():
                return None
            remove_asides(self.folder)
            meta, arrays = self._read_state(self.folder / STATE)
            block = _read_block(self.folder / MESH, meta["mesh"])
            digests = [about["digest"] for about in meta["snapshots"]]
            snapshots = tuple(_read_npz(self.folder / SNAPSHOT.format(k), d) for k, d in enumerate(digests))
            found.append(Saved(self.folder, meta, arrays, snapshots, block))
            return meta

        meta = on_root_bcast(self._comm, read)
        if meta is None:
            return None
        self._mesh, self._snapshots = meta["mesh"], [about["digest"] for about in meta["snapshots"]]
        return found[0] if found else Saved(self.folder, meta, {}, (), None)

    def _read_state(self, path: Path) -> tuple[dict[str, Any], dict[str, Array]]:
        arrays = _read_npz(path)
        try:
            text = arrays["meta"].tobytes()
            meta: dict[str, Any] = json.loads(text)
            version = meta["format"]
        except UNREADABLE:
            raise CheckpointError(f"{path} is not a checkpoint of asperity") from None
        if version != FORMAT:
            raise CheckpointError(
                f"{path} was written by asperity {meta.get('version', '?')} in format {version}, this version "
                f"continues format {FORMAT}; use that version, or start again without --resume"
            )
        digest = arrays.pop("digest", None)
        if digest is None or digest.tobytes() != _digest(arrays).encode():
            raise _damaged(path, "its content is not what was written")
        wrong = wrong_number(text, meta)
        if wrong:
            raise _damaged(path, wrong)
        del arrays["meta"]
        refuse_another(path, meta["identity"], self._identity)
        return meta, arrays

    def begin(self, block: BlockMesh | None) -> None:
        """Write the mesh, held by rank 0.

        Raises:
            OutputError: it cannot be written
        """
        if not self.interval or self._mesh:
            return

        def write() -> str:
            assert block is not None
            self.folder.mkdir(parents=True, exist_ok=True)
            replace_file(self.folder / MESH, npz_bytes(block.arrays()))
            return _digest(block.arrays())

        self._mesh = on_root_bcast(self._comm, write)

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
            arrays = _fields(solver, record.first_contact)
            new = [_snapshot_fields(solver, s) for s in record.snapshots[len(self._snapshots) :]]
            meta: dict[str, Any] = {
                "format": FORMAT,
                "version": _version(),
                "identity": self._identity,
                "mesh": self._mesh,
                "position": asdict(position),
                "press": _numbers(solver.state()),
                "rows": record.rows,
                "seconds": solver.solid.phases.seconds,
                "calls": solver.solid.phases.calls,
            }

            def write() -> list[str]:
                for k, fields in enumerate(new, len(self._snapshots)):
                    replace_file(self.folder / SNAPSHOT.format(k), npz_bytes(fields))
                digests = [*self._snapshots, *map(_digest, new)]
                meta["snapshots"] = [
                    {"step": s.step, "branch": s.branch, "delta": s.delta, "digest": digest}
                    for s, digest in zip(record.snapshots, digests, strict=True)
                ]
                replace_file(self.folder / STATE, npz_bytes(signed(meta, arrays)))
                return digests

            self._snapshots = on_root_bcast(self._comm, write)


def signed(meta: Mapping[str, Any], arrays: Mapping[str, Array]) -> dict[str, Array]:
    """Content of the file of a state."""
    content = {"meta": _letters(json.dumps(meta, default=float)), **arrays}
    return {**content, "digest": _letters(_digest(content))}


def _letters(text: str) -> Array:
    return np.frombuffer(text.encode(), dtype=np.uint8)


def differences(saved: Mapping[str, Any], now: Mapping[str, Any]) -> list[str]:
    """Keys that forbid a continuation, in words."""
    found = []
    for name in sorted({*saved, *now}):
        old, new = saved.get(name), now.get(name)
        if old == new or (name == CYCLES and isinstance(old, int) and isinstance(new, int) and new > old):
            continue
        if name in FILES:
            found.append(f"{name} has another content")
        else:
            words = ["absent" if value is None else show(value) for value in (old, new)]
            found.append(f"{name} = {words[0]} there, {words[1]} here")
    return found


def refuse_another(path: Path, saved: Mapping[str, Any], now: Mapping[str, Any]) -> None:
    """Refuse to continue a run under another case.

    Args:
        path: of the file that tells the case of the run
        saved, now: identities of the case there and of this one, see `identity`

    Raises:
        CheckpointError: they differ in what matters
    """
    different = differences(saved, now)
    if different:
        raise CheckpointError(
            f"{path} belongs to another case: {'; '.join(different[:3])}"
            + (f"; and {len(different) - 3} more keys" if len(different) > 3 else "")
            + "; resume with the case it was made for, or start anew with --force"
        )


def _fields(solver: ContactSolver, first_contact: FirstContact) -> dict[str, Array]:
    """Fields of a state on rank 0, in the numbering of the mesh as built; empty elsewhere; collective."""
    solid, comm = solver.solid, solver.solid.comm
    nodes, cells = node_numbers(solid)[: solid.owned], cell_numbers(solid)
    out: dict[str, Array] = {}

    def keep_some(name: str, numbers: Array, values: Array) -> None:
        rows = collect_some(comm, numbers, values)
        if rows is not None:
            out[f"{name}.at"], out[name] = rows

    for name, u in _displacements(solver.state()).items():
        values = collect(comm, nodes, u)
        if values is not None:
            out[f"displacement.{name}"] = values
    touched_at = first_contact.delta
    touched = np.flatnonzero(np.isfinite(touched_at))
    keep_some("touched_at", nodes[solver.contact_surface.owned_nodes[touched]], touched_at[touched])
    if solid.material.plastic:
        strain, accumulated = solid.bulk.history()
        yielded = np.flatnonzero(accumulated.any(axis=1))
        keep_some("plastic_strain", cells[yielded], strain[yielded])
        keep_some("accumulated", cells[yielded], accumulated[yielded])
    for name, values in _contact_state(solver).items():
        keep_some(f"contact.{name}", facet_numbers(solver.contact_surface), values)
    return out


def _numbers(state: SolverState) -> dict[str, Any]:
    """The numbers of a state, plain values for JSON."""
    numbers = asdict(replace(state, displacement=None, previous=None))  # type: ignore[arg-type]
    return {name: value for name, value in numbers.items() if name not in ("displacement", "previous")}


def _displacements(state: SolverState) -> dict[str, Array]:
    """Displacements of the last step and of the one before, if there is one (owned, 3)."""
    if state.previous is None:
        return {"last": state.displacement}
    return {"last": state.displacement, "previous": state.previous}


def _state(numbers: Mapping[str, Any], displacements: Mapping[str, Array]) -> SolverState:
    """The state of numbers and displacements."""
    counts, checks = Counts(**numbers["counts"]), Checks.from_dict(numbers["checks"])
    last, previous = displacements["last"], displacements.get("previous")
    return SolverState(**{**numbers, "counts": counts, "checks": checks}, displacement=last, previous=previous)


def _contact_state(solver: ContactSolver) -> dict[str, Array]:
    """History of the contact, of the same names on all ranks: one without facets has no rows of it; collective."""
    own = solver.contact.state()
    all_of_them = solver.solid.comm.allgather({name: values.shape[1:] for name, values in own.items()})
    return {name: own.get(name, np.zeros((0, *shape))) for name, shape in max(all_of_them, key=len).items()}


def _snapshot_names(solver: ContactSolver) -> list[str]:
    names = ["pressure", "gap", "displacement", "stress"]
    return [*names, "plastic_strain"] if solver.solid.material.plastic else names


def _snapshot_fields(solver: ContactSolver, snapshot: Snapshot) -> dict[str, Array]:
    """Fields of a snapshot on rank 0; empty elsewhere; collective."""
    solid, out = solver.solid, {}
    for name in _snapshot_names(solver):
        values = getattr(snapshot, name)
        if name in OF_CELLS:
            rows = collect(solid.comm, cell_numbers(solid), values)
        else:
            rows = collect(solid.comm, node_numbers(solid)[: solid.owned], values[: solid.owned])
        if rows is not None:
            out[name] = rows
    return out


def _damaged(path: Path, reason: str) -> CheckpointError:
    return CheckpointError(f"{path} is damaged: {reason}; start the run anew with --force")


def _read_npz(path: Path, digest: str | None = None) -> dict[str, Array]:
    try:
        arrays = read_npz(path)
    except FileNotFoundError:
        raise CheckpointError(f"{path} is missing; start the run anew with --force") from None
    except OSError as error:
        raise _damaged(path, error.strerror or "it cannot be read") from None
    except ValueError as error:
        raise _damaged(path, str(error)) from None
    if digest is not None and digest != _digest(arrays):
        raise CheckpointError(f"{path} does not belong to the state beside it; start the run anew with --force")
    return arrays


def _read_block(path: Path, digest: str) -> BlockMesh:
    try:
        return BlockMesh.from_arrays(_read_npz(path, digest))
    except ValueError as error:
        raise _damaged(path, str(error)) from None


def _digest(arrays: Mapping[str, Array]) -> str:
    """SHA-256 of arrays with their names, types and shapes."""
    content = hashlib.sha256()
    for name, array in sorted(arrays.items()):
        content.update(f"{name} {array.dtype.str} {array.shape};".encode())
        content.update(array.tobytes())
    return content.hexdigest()


def _version() -> str:
    from asperity import __version__

    return __version__
