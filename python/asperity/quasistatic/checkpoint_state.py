"""State of a contact solver as plain arrays and numbers: for a checkpoint, and restored from one.

Arrays are in the numbering of the mesh as built, each rank with its share, so the number of ranks may differ between
the two.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from asperity.arrays import Array, Floats, Indices
from asperity.contact.contact_surface import facet_numbers
from asperity.fem.global_numbering import at_built_nodes, cell_numbers, node_numbers, share_cells, share_nodes
from asperity.fem.history import History
from asperity.mesh.block import BlockMesh
from asperity.quasistatic.balance import Checks
from asperity.quasistatic.contact_solver import ContactSolver, Counts, SolverState
from asperity.quasistatic.measures import Snapshot
from asperity.quasistatic.stepping import Position, Record
from asperity.quasistatic.stiffness import Stiffness
from asperity.runtime.shares import DistributedArray, look_up, look_up_some, share_some

OF_CELLS = ("stress", "plastic_strain")  # fields of a snapshot with a row per cell
OF_CONTACT = "contact."  # prefix of the names of the contact's history
HELD = "held"  # what friction keeps of the nodes in contact
STIFFNESS = "stiffness"  # start of the systems of the stiffness columns; in states of runs with these columns only


@dataclass(frozen=True)
class Saved:
    """Content of a checkpoint; this rank's share of the arrays, and the mesh on rank 0 only."""

    meta: Mapping[str, Any]  # position, rows, counts and all other numbers
    arrays: Mapping[str, DistributedArray]  # fields by name
    snapshots: tuple[Mapping[str, DistributedArray], ...]  # fields of each snapshot
    block: BlockMesh | None  # the mesh

    def restore(self, solver: ContactSolver, record: Record) -> Position:
        """Restore the saved state to a solver in its initial state on the same mesh, and to the record; collective.

        Returns the position on the load path.
        """
        solid, arrays = solver.solid, self.arrays
        nodes, cells = node_numbers(solid), cell_numbers(solid)
        owned, top = nodes[: solid.owned], nodes[solver.contact_surface.owned_nodes]

        def some(name: str, numbers: Indices, fill: float = 0.0) -> Array:
            return look_up_some(arrays[f"{name}.at"], arrays[name], numbers, fill)

        def history(numbers: Indices, prefix: str = "") -> History:
            return History(**{name: some(prefix + name, numbers) for name in History.names()})

        displacements = {name: look_up(arrays[f"displacement.{name}"], owned) for name in self._displacements()}
        if solid.material.plastic:
            solid.kernels.restore(history(cells))
        if solver.contact.history() is not None:
            solver.contact.restore(history(facet_numbers(solver.contact_surface), OF_CONTACT))
        if solver.contact.held is not None:
            solver.contact.held = some(HELD, top, np.nan)
        if STIFFNESS in arrays:
            memory = look_up(arrays[STIFFNESS], owned)
            for probe in _with_memory(solver):
                probe.recall(memory)
        solver.restore(_state(self.meta["solver"], displacements))
        record.rows[:] = self.meta["rows"]
        for about, saved in zip(self.meta["snapshots"], self.snapshots, strict=True):
            fields = {name: look_up(values, cells if name in OF_CELLS else nodes) for name, values in saved.items()}
            fields.setdefault("plastic_strain", solid.kernels.history().accumulated.copy())
            record.snapshots.append(Snapshot(about["step"], about["branch"], about["delta"], **fields))
        for kind in ("seconds", "calls"):
            totals = getattr(solid.phases, kind)
            for name, value in self.meta[kind].items():
                totals[name] = totals.get(name, 0) + value
        return Position.from_dict(self.meta["position"])

    def _displacements(self) -> tuple[str, ...]:
        return ("last",) if self.meta["solver"]["before"] is None else ("last", "previous")


def solver_fields(solver: ContactSolver) -> dict[str, DistributedArray]:
    """Fields of a state in the numbering of the mesh as built; collective."""
    solid, comm = solver.solid, solver.solid.comm
    cells = cell_numbers(solid)
    out: dict[str, DistributedArray] = {}

    def keep_some(name: str, numbers: Indices, values: Array) -> None:
        out[f"{name}.at"], out[name] = share_some(comm, numbers, values)

    for name, u in _displacements(solver.state()).items():
        out[f"displacement.{name}"] = share_nodes(solid, solid.scatter_forward(u.ravel()))
    for probe in _with_memory(solver):
        out[STIFFNESS] = share_nodes(solid, solid.ghosts.scatter_forward(probe.memory()))
    if solid.material.plastic:
        history = solid.kernels.history()
        changed = history.changed()
        for name, values in history.arrays().items():
            keep_some(name, cells[changed], values[changed])
    at = solver.contact.held
    if at is not None:
        numbers, held = at_built_nodes(solid, _nodal(solver, at))
        sticking = np.isfinite(held[:, 0])
        keep_some(HELD, numbers[sticking], held[sticking, : at.shape[1]])
    of_contact = solver.contact.history()
    if of_contact is not None:
        facets = facet_numbers(solver.contact_surface)
        for name, values in of_contact.arrays().items():
            keep_some(OF_CONTACT + name, facets, values)
    return out


def _with_memory(solver: ContactSolver) -> list[Stiffness]:
    """Probes that start from what they found at the step before."""
    return [probe for probe in solver.probes if isinstance(probe, Stiffness)]


def _nodal(solver: ContactSolver, values: Floats) -> Floats:
    """Values at all local nodes (nodes, 3), inf but at the owned nodes of the top where they are given; collective."""
    solid = solver.solid
    out = np.full((solid.owned, 3), np.inf)
    out[solver.contact_surface.owned_nodes[: len(values)], : values.shape[1]] = values
    return solid.scatter_forward(out.ravel())


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
    names = ["pressure", "gap", "touched", "displacement", "stress"]
    return [*names, "plastic_strain"] if solver.solid.material.plastic else names


def snapshot_fields(solver: ContactSolver, snapshot: Snapshot) -> dict[str, DistributedArray]:
    """Fields of a snapshot in the numbering of the mesh as built; collective."""
    return {
        name: (share_cells if name in OF_CELLS else share_nodes)(solver.solid, getattr(snapshot, name))
        for name in _snapshot_names(solver)
    }
