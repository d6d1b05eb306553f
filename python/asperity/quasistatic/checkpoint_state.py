# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

"""State of a contact solver as plain arrays and numbers: gathered for a checkpoint, checked and restored from one.

Arrays are on rank 0, in the numbering of the mesh as built, so the number of ranks may differ between the two.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from asperity.arrays import Array, Floats, Indices
from asperity.contact import Stick
from asperity.contact.contact_surface import facet_numbers
from asperity.errors import CheckpointError
from asperity.fem.global_numbering import (
    cell_numbers,
    collect,
    collect_nodes,
    collect_some,
    node_numbers,
    spread,
    spread_some,
)
from asperity.fem.kernels import History
from asperity.mesh.block import BlockMesh
from asperity.quasistatic.balance import Checks
from asperity.quasistatic.contact_solver import ContactSolver, Counts, SolverState
from asperity.quasistatic.measures import FirstContact, Snapshot, snapshot
from asperity.quasistatic.stepping import Position, Record
from asperity.quasistatic.stiffness import Stiffness
from asperity.runtime.parallel import on_root_bcast
from asperity.runtime.run_folder import SNAPSHOT, STATE

OF_CELLS = ("stress", "plastic_strain")  # fields of a snapshot with a row per cell
OF_CONTACT = "contact."  # prefix of the names of the contact's history
HELD = "held"  # tangential displacement of the nodes that stick
STIFFNESS = "stiffness"  # start of the systems of the stiffness columns; in states of runs with these columns only


@dataclass(frozen=True)
class Saved:
    """Content of a checkpoint; the arrays and the mesh on rank 0 only.

    Attributes:
        folder: from which it was read
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
        """Restore the saved state; collective.

        Args:
            solver: on the same mesh, in its initial state
            record: receives rows, snapshots and map of first contact

        Returns:
            position on the load path

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

        def history(numbers: Indices, prefix: str = "") -> History:
            return History(**{name: spread_some(comm, numbers, rows(prefix + name)) for name in History.names()})

        if solid.material.plastic:
            solid.kernels.restore(history(cells))
        if solver.contact.history() is not None:
            solver.contact.restore(history(facet_numbers(solver.contact_surface), OF_CONTACT))
        if isinstance(solver.contact, Stick):
            top = nodes[solver.contact_surface.owned_nodes]
            solver.contact.held = spread_some(comm, top, rows(HELD), np.nan)
        if comm.bcast(STIFFNESS in self.arrays):
            memory = spread(comm, owned, self.arrays.get(STIFFNESS))
            for probe in _with_memory(solver):
                probe.recall(memory)
        solver.restore(_state(self.meta["press"], displacements))
        record.first_contact.delta = touched
        record.rows[:] = self.meta["rows"]
        for k, about in enumerate(self.meta["snapshots"]):
            fields = {
                name: spread(comm, cells if name in OF_CELLS else nodes, self._snapshot(k, name))
                for name in _snapshot_names(solver)
            }
            fields.setdefault("plastic_strain", solid.kernels.history().accumulated.copy())
            record.snapshots.append(Snapshot(about["step"], about["branch"], about["delta"], **fields))
        for kind in ("seconds", "calls"):
            totals = getattr(solid.phases, kind)
            for name, value in self.meta[kind].items():
                totals[name] = totals.get(name, 0) + value
        return Position.from_dict(self.meta["position"])

    def _displacements(self) -> tuple[str, ...]:
        return ("last",) if self.meta["press"]["before"] is None else ("last", "previous")

    def _judge(self, solver: ContactSolver, first_contact: FirstContact) -> None:
        """Refuse arrays of other names, types or shapes than those that `solver` would save; collective."""
        fresh = solver_fields(solver, first_contact)
        fields = snapshot_fields(solver, snapshot(solver, 0, "load")) if self.meta["snapshots"] else {}

        from asperity.quasistatic.checkpoint_schema import wrong_array  # takes time, and only a continued run needs it

        def judge() -> None:
            assert self.block is not None
            counts = self.block.counts()
            like = fresh | {f"displacement.{name}": fresh["displacement.last"] for name in self._displacements()}
            if (STIFFNESS in like) != (STIFFNESS in self.arrays):  # the columns were or are not requested
                like = {name: array for name, array in like.items() if name != STIFFNESS}
            names = [SNAPSHOT.format(k) for k in range(len(self.snapshots))]
            state = {name: array for name, array in self.arrays.items() if name != STIFFNESS or name in like}
            pairs = [(STATE, state, like), *((n, s, fields) for n, s in zip(names, self.snapshots, strict=True))]
            for name, arrays, expected in pairs:
                wrong = wrong_array(arrays, expected, *counts)
                if wrong:
                    raise damaged(self.folder / name, wrong)

        on_root_bcast(solver.solid.comm, judge)

    def _snapshot(self, k: int, name: str) -> Array | None:
        return self.snapshots[k][name] if self.snapshots else None


def solver_fields(solver: ContactSolver, first_contact: FirstContact) -> dict[str, Array]:
    """Fields of a state on rank 0, in the numbering of the mesh as built; empty elsewhere; collective."""
    solid, comm = solver.solid, solver.solid.comm
    cells = cell_numbers(solid)
    out: dict[str, Array] = {}

    def keep_some(name: str, numbers: Array, values: Array) -> None:
        rows = collect_some(comm, numbers, values)
        if rows is not None:
            out[f"{name}.at"], out[name] = rows

    for name, u in _displacements(solver.state()).items():
        values = collect_nodes(solid, solid.scatter_forward(u.ravel()))
        if values is not None:
            out[f"displacement.{name}"] = values
    for probe in _with_memory(solver):
        memory = collect_nodes(solid, solid.ghosts.scatter_forward(probe.memory()))
        if memory is not None:
            out[STIFFNESS] = memory
    touched_at = collect_nodes(solid, _nodal(solver, first_contact.delta))
    if touched_at is not None:
        out["touched_at.at"] = np.flatnonzero(np.isfinite(touched_at))
        out["touched_at"] = touched_at[out["touched_at.at"]]
    if solid.material.plastic:
        history = solid.kernels.history()
        changed = history.changed()
        for name, values in history.arrays().items():
            keep_some(name, cells[changed], values[changed])
    if isinstance(solver.contact, Stick):
        held = solver.contact.held
        sticking = np.flatnonzero(~np.isnan(held[:, 0]))
        keep_some(HELD, node_numbers(solid)[solver.contact_surface.owned_nodes[sticking]], held[sticking])
    of_contact = solver.contact.history()
    if of_contact is not None:
        facets = facet_numbers(solver.contact_surface)
        for name, values in of_contact.arrays().items():
            keep_some(OF_CONTACT + name, facets, values)
    return out


def _with_memory(solver: ContactSolver) -> list[Stiffness]:
    """Probes that start from what they found at the step before."""
    return [probe for probe in solver.probes if isinstance(probe, Stiffness)]


def _nodal(solver: ContactSolver, touched_at: Floats) -> Floats:
    """Approach of first contact at the local nodes, inf for never (nodes,) [L]; collective."""
    solid = solver.solid
    out = np.full((solid.owned, 3), np.inf)
    out[solver.contact_surface.owned_nodes[: len(touched_at)], 0] = touched_at
    return solid.scatter_forward(out.ravel())[:, 0]


def solver_numbers(state: SolverState) -> dict[str, Any]:
    """Numbers of a state as plain values for JSON."""
    numbers = asdict(replace(state, displacement=None, previous=None))  # type: ignore[arg-type]
    return {name: value for name, value in numbers.items() if name not in ("displacement", "previous")}


def _displacements(state: SolverState) -> dict[str, Array]:
    """Displacements of the last step and of the one before, if there is one (owned, 3)."""
    if state.previous is None:
        return {"last": state.displacement}
    return {"last": state.displacement, "previous": state.previous}


def _state(numbers: Mapping[str, Any], displacements: Mapping[str, Array]) -> SolverState:
    """Inverse of `solver_numbers` and `_displacements`."""
    counts, checks = Counts(**numbers["counts"]), Checks.from_dict(numbers["checks"])
    last, previous = displacements["last"], displacements.get("previous")
    return SolverState(**{**numbers, "counts": counts, "checks": checks}, displacement=last, previous=previous)


def _snapshot_names(solver: ContactSolver) -> list[str]:
    names = ["pressure", "gap", "displacement", "stress"]
    return [*names, "plastic_strain"] if solver.solid.material.plastic else names


def snapshot_fields(solver: ContactSolver, snapshot: Snapshot) -> dict[str, Array]:
    """Fields of a snapshot on rank 0; empty elsewhere; collective."""
    solid, out = solver.solid, {}
    for name in _snapshot_names(solver):
        values = getattr(snapshot, name)
        if name in OF_CELLS:
            rows = collect(solid.comm, cell_numbers(solid), values)
        else:
            rows = collect_nodes(solid, values)
        if rows is not None:
            out[name] = rows
    return out


def damaged(path: Path, reason: str) -> CheckpointError:
    return CheckpointError(f"{path} is damaged: {reason}; start the run again with --force")
