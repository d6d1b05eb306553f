"""Checkpoint: the state of a run between two steps, on disk; a run resumes from it on any number of ranks.

The folder holds mesh.npz, written once, snapshot-K.npz for each snapshot, and state.npz, replaced as a whole after
each step: displacements and history in the numbering of the mesh as built, gathered by rank 0, and all numbers as JSON
in the array "meta". Where not all rows are there, the array "NAME.at" has their numbers. Nothing is pickled. Damage
shows in the checksum that the zip format has of each array. The state names the case that it belongs to.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from asperity.arrays import Array, Indices
from asperity.case.case_file import refuse_another
from asperity.errors import CheckpointError
from asperity.fem.history import History
from asperity.fem.solid import built_nodes, cell_numbers, node_numbers
from asperity.mesh.block import BlockMesh
from asperity.quasistatic.balance import Checks
from asperity.quasistatic.contact_solver import ContactSolver, Counts, SolverState
from asperity.quasistatic.legs import Position
from asperity.quasistatic.measures import Record, Snapshot
from asperity.runtime.files import UNREADABLE, read_npz, remove_asides, write_npz
from asperity.runtime.parallel import gather, hand_out, on_root, on_root_bcast, on_root_of
from asperity.runtime.run_folder import MESH, SNAPSHOT, STATE
from asperity.version import __version__

if TYPE_CHECKING:
    from mpi4py import MPI

FORMAT = 13  # of the files, which other versions refuse
META = "meta"  # array of letters: the numbers of a state as JSON
Arrays = Mapping[str, Array]  # by name, on rank 0
Field = tuple[str, Indices, Array]  # name, numbers of rows, and the rows of this rank
DISPLACEMENTS = ("displacement", "previous")  # of a state
OF_CELLS = ("stress", "plastic_strain")  # fields of a snapshot with a row per cell
HELD = "held"  # what friction keeps of the nodes in contact


class Checkpoint:
    """Folder with the state of one load path; all methods are collective.

    Args:
        folder: for the files; made when needed
        identity: of the run, saved with each state; another one is refused
        comm: ranks of the run
        interval: number of accepted steps between two saves; 0 saves nothing
    """

    def __init__(self, folder: Path, identity: Mapping[str, Any], comm: MPI.Comm, interval: int = 1) -> None:
        self.folder, self.interval = folder, interval
        self._identity, self._comm = dict(identity), comm
        self._ignored = self._begun = False  # whether a saved state is left alone, and whether the mesh is written
        self._snapshots = 0  # written

    def part(self, name: str) -> Checkpoint:
        """Checkpoint of one of several load paths of the same run."""
        part = Checkpoint(self.folder / name, self._identity, self._comm, self.interval)
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
        """Whether there is a state to resume from; CheckpointError as for `load`."""

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
        saved = on_root(self._comm, self._read)
        meta = self._comm.bcast(saved and saved.meta)
        if meta is None:
            return None
        self._begun, self._snapshots = True, len(meta["snapshots"])
        return saved or Saved(meta)

    def _read(self) -> Saved | None:
        """The saved state in one process."""
        if self._ignored or not (self.folder / STATE).is_file():
            return None
        remove_asides(self.folder)
        meta, arrays = self._read_state(self.folder / STATE)
        path = self.folder / MESH
        with _refusing(path):
            block = BlockMesh.from_arrays(read_npz(path))
        if any(len(arrays.get(name, ())) != len(block.points) for name in DISPLACEMENTS):
            raise CheckpointError(f"{path} does not belong to the state; start the run again with --force")
        snapshots = tuple(_read(self.folder / SNAPSHOT.format(k)) for k in range(len(meta["snapshots"])))
        return Saved(meta, arrays, snapshots, block)

    def _read_state(self, path: Path) -> tuple[dict[str, Any], Arrays]:
        """Numbers and arrays."""
        arrays = _read(path)
        try:
            meta: dict[str, Any] = json.loads(arrays.pop(META).tobytes())
            version = meta["format"]
        except UNREADABLE:
            raise CheckpointError(f"{path} is not a checkpoint of asperity") from None
        if version != FORMAT:
            raise CheckpointError(
                f"{path} was written by asperity {meta.get('version', '?')} in format {version}, this version "
                f"continues format {FORMAT}; use that version, or start again without --resume"
            )
        refuse_another(path, meta["identity"], self._identity)
        return meta, arrays

    def begin(self, block: BlockMesh | None) -> None:
        """Write the mesh, which rank 0 holds; OutputError where it cannot be written."""

        def write() -> None:
            assert block is not None
            self.folder.mkdir(parents=True, exist_ok=True)
            write_npz(self.folder / MESH, block.arrays().items())

        if self.interval and not self._begun:
            on_root_bcast(self._comm, write)
            self._begun = True

    def due(self, steps: int) -> bool:
        """Whether to save after that many accepted steps."""
        return self.interval > 0 and steps % self.interval == 0

    def save(self, solver: ContactSolver, record: Record, position: Position) -> None:
        """Replace the saved state; OutputError where it cannot be written, and the earlier one is untouched."""
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
                "solver": {k: v for k, v in asdict(solver.state()).items() if k not in DISPLACEMENTS},
                "columns": sorted(solver.columns),
                "rows": record.rows,
                "snapshots": [{"step": s.step, "branch": s.branch, "delta": s.delta} for s in record.snapshots],
                "seconds": solver.solid.phases.seconds,
                "calls": solver.solid.phases.calls,
            }
            write_arrays(self._comm, self.folder / STATE, solver_fields(solver), json.dumps(meta, default=float))


def write_arrays(comm: MPI.Comm, path: Path, fields: Iterator[Field], text: str = "") -> None:
    """Replace a .npz file, for which rank 0 gathers field after field, with a text as the array "meta"; collective.

    Where it cannot be written (OutputError) the earlier file is untouched.
    """

    def arrays() -> Iterator[tuple[str, Array]]:
        for name, numbers, rows in fields:
            if (found := gather(comm, numbers, rows)) is not None:
                if not np.array_equal(found[0], np.arange(len(found[0]))):
                    yield f"{name}.at", found[0]
                yield name, found[1]
        yield META, np.frombuffer(text.encode(), dtype=np.uint8)

    members = arrays()
    on_root_of(comm, members, lambda: write_npz(path, members))


def read_rows(comm: MPI.Comm, arrays: Arrays, name: str, wanted: Indices, fill: float = 0.0) -> Array:
    """Rows of a field of a file that rank 0 has read, `fill` where there is none; collective."""
    found = None
    if comm.rank == 0:
        found = arrays.get(f"{name}.at", np.arange(len(arrays[name]))), arrays[name]
    return hand_out(comm, found, wanted, fill)


def _read(path: Path) -> dict[str, Array]:
    with _refusing(path):
        return read_npz(path)


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


@dataclass(frozen=True)
class Saved:
    """Content of a checkpoint; all but the numbers on rank 0 only."""

    meta: Mapping[str, Any]  # position, rows, counts and all other numbers
    arrays: Arrays = field(default_factory=dict)
    snapshots: tuple[Arrays, ...] = ()  # those of each
    block: BlockMesh | None = None  # the mesh

    def refuse_other_columns(self, solver: ContactSolver, legs: int) -> None:
        """Refuse a solver that measures what the rows so far lack, or not what the rest of `legs` would lack."""
        now, before, rows = solver.columns, set(self.meta["columns"]), len(self.meta["rows"])
        partly = now - before if self.meta["position"]["leg"] == legs else now ^ before
        if rows and partly:
            raise CheckpointError(
                f"output.stiffness or [slip] is not that of the {rows} steps saved: a part of the columns "
                f"{', '.join(sorted(partly))} would be empty; resume as it was, or start again with --force"
            )

    def restore(self, solver: ContactSolver, record: Record) -> Position:
        """Restore the saved state to a solver in its initial state on the same mesh, and to the record; collective.

        Returns the position on the load path.
        """
        solid, comm = solver.solid, solver.solid.comm
        nodes, cells = node_numbers(solid), cell_numbers(solid)
        owned, top = nodes[: solid.owned], nodes[solver.contact_surface.owned_nodes]

        if solid.material.plastic:
            names = solid.kernels.history().arrays()
            solid.kernels.restore(History(**{name: read_rows(comm, self.arrays, name, cells) for name in names}))
        if solver.contact.held is not None:
            solver.contact.held = read_rows(comm, self.arrays, HELD, top, np.nan)
        numbers = dict(self.meta["solver"])
        numbers |= {"counts": Counts(**numbers["counts"]), "checks": Checks(**numbers["checks"])}
        numbers |= {name: read_rows(comm, self.arrays, name, owned) for name in DISPLACEMENTS}
        solver.restore(SolverState(**numbers))
        record.rows[:] = self.meta["rows"]
        for k, about in enumerate(self.meta["snapshots"]):
            saved = self.snapshots[k] if self.snapshots else {}
            fields = {
                name: read_rows(comm, saved, name, cells if name in OF_CELLS else nodes)
                for name in snapshot_names(solver)
            }
            fields.setdefault("plastic_strain", solid.kernels.history().accumulated.copy())
            record.snapshots.append(Snapshot(about["step"], about["branch"], about["delta"], **fields))
        for kind in ("seconds", "calls"):
            totals = getattr(solid.phases, kind)
            for name, value in self.meta[kind].items():
                totals[name] = totals.get(name, 0) + value
        return Position(**self.meta["position"])


def solver_fields(solver: ContactSolver) -> Iterator[Field]:
    """Fields of a state in the numbering of the mesh as built; the steps are collective."""
    solid, state = solver.solid, solver.state()
    numbers, at = built_nodes(solid)
    for name in DISPLACEMENTS:
        yield name, numbers, solid.scatter_forward(getattr(state, name).ravel())[at]
    if solid.material.plastic:
        history, cells = solid.kernels.history(), cell_numbers(solid)
        changed = history.changed()
        for name, values in history.arrays().items():
            yield name, cells[changed], values[changed]
    of_top = solver.contact.held
    if of_top is not None:
        held = np.full((solid.owned, 3), np.inf)  # but at the owned nodes of the top
        held[solver.contact_surface.owned_nodes[: len(of_top)], : of_top.shape[1]] = of_top
        held = solid.scatter_forward(held.ravel())[at]
        sticking = np.isfinite(held[:, 0])
        yield HELD, numbers[sticking], held[sticking, : of_top.shape[1]]


def snapshot_names(solver: ContactSolver) -> list[str]:
    """Names of the fields of a snapshot that are saved."""
    names = ["pressure", "gap", "touched", "displacement", *OF_CELLS]
    return names if solver.solid.material.plastic else names[:-1]


def snapshot_fields(solver: ContactSolver, snapshot: Snapshot) -> Iterator[Field]:
    """Fields of a snapshot in the numbering of the mesh as built."""
    numbers, at = built_nodes(solver.solid)
    for name in snapshot_names(solver):
        values = getattr(snapshot, name)
        if name in OF_CELLS:
            yield name, cell_numbers(solver.solid), values
        else:
            yield name, numbers, values[at]
