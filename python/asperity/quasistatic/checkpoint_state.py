"""State of a contact solver as plain arrays and numbers: for a checkpoint, and restored from one.

Arrays are in the numbering of the mesh as built, each rank with its share, so the number of ranks may differ between
the two.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from asperity.arrays import Array, Floats, Indices
from asperity.contact.contact_surface import facet_numbers
from asperity.errors import CheckpointError
from asperity.fem.global_numbering import at_built_nodes, cell_numbers, node_numbers, share_cells, share_nodes
from asperity.fem.history import History
from asperity.mesh.block import BlockMesh
from asperity.quasistatic.balance import Checks
from asperity.quasistatic.contact_solver import ContactSolver, Counts, SolverState
from asperity.quasistatic.measures import Snapshot
from asperity.quasistatic.stepping import Position, Record
from asperity.quasistatic.stiffness import Stiffness
from asperity.runtime.distributed_array import DistributedArray, look_up, look_up_some, share_some

DISPLACEMENTS = ("displacement", "previous")  # of a state
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

    def refuse_other_columns(self, solver: ContactSolver, legs: int) -> None:
        """Refuse a solver that measures what the rows so far lack, or not what the rest of them would lack.

        Args:
            legs: of the load path

        Raises:
            CheckpointError: the curve would have empty cells
        """
        before, now = self.meta.get("probes"), probe_names(solver)
        if before is None or not self.meta["rows"]:  # of an earlier version
            return
        begun = [f"output.{name} = true here, but not" for name in now if name not in before]
        ended = [f"output.{name} = false here, but not" for name in before if name not in now]
        for text in begun or (ended if self.meta["position"]["leg"] < legs else []):
            raise CheckpointError(
                f"{text} for the {len(self.meta['rows'])} steps saved: a part of its columns would be empty; resume "
                "as it was, or start again with --force"
            )

    def restore(self, solver: ContactSolver, record: Record) -> Position:
        """Restore the saved state to a solver in its initial state on the same mesh, and to the record; collective.

        Returns the position on the load path.
        """
        solid, arrays = solver.solid, self.arrays
        nodes, cells = node_numbers(solid), cell_numbers(solid)
        owned, top = nodes[: solid.owned], nodes[solver.contact_surface.owned_nodes]

        def some(name: str, numbers: Indices, fill: float = 0.0) -> Array:
            return look_up_some(arrays[f"{name}.at"], arrays[name], numbers, fill)

        def history(like: History, numbers: Indices, prefix: str = "") -> History:
            return History(**{name: some(prefix + name, numbers) for name in like.arrays()})

        if solid.material.plastic:
            solid.kernels.restore(history(solid.kernels.history(), cells))
        of_contact = solver.contact.history()
        if of_contact is not None:
            solver.contact.restore(history(of_contact, facet_numbers(solver.contact_surface), OF_CONTACT))
        if solver.contact.held is not None:
            solver.contact.held = some(HELD, top, np.nan)
        if STIFFNESS in arrays:
            memory = look_up(arrays[STIFFNESS], owned)
            for probe in _with_memory(solver):
                probe.recall(memory)
        numbers = dict(self.meta["solver"])
        numbers |= {"counts": Counts(**numbers["counts"]), "checks": Checks.from_dict(numbers["checks"])}
        numbers |= {name: look_up(arrays[name], owned) for name in DISPLACEMENTS}
        solver.restore(SolverState(**numbers))
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


def probe_names(solver: ContactSolver) -> list[str]:
    """Names of what measures each step, those of keys of the section output."""
    return sorted(type(probe).__name__.lower() for probe in solver.probes)


def solver_fields(solver: ContactSolver) -> dict[str, DistributedArray]:
    """Fields of a state in the numbering of the mesh as built; collective."""
    solid, comm = solver.solid, solver.solid.comm
    cells = cell_numbers(solid)
    out: dict[str, DistributedArray] = {}

    def keep_some(name: str, numbers: Indices, values: Array) -> None:
        out[f"{name}.at"], out[name] = share_some(comm, numbers, values)

    for name in DISPLACEMENTS:
        out[name] = share_nodes(solid, solid.scatter_forward(getattr(solver.state(), name).ravel()))
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
    return {name: value for name, value in asdict(state).items() if name not in DISPLACEMENTS}


def snapshot_fields(solver: ContactSolver, snapshot: Snapshot) -> dict[str, DistributedArray]:
    """Fields of a snapshot in the numbering of the mesh as built; collective."""
    names = ["pressure", "gap", "touched", "displacement", *OF_CELLS]
    return {
        name: (share_cells if name in OF_CELLS else share_nodes)(solver.solid, getattr(snapshot, name))
        for name in (names if solver.solid.material.plastic else names[:-1])
    }
