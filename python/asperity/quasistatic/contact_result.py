"""Result of a load path, complete or not."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from asperity.curve import Curve
from asperity.errors import CheckError, ConvergenceError
from asperity.mesh.block import BlockMesh
from asperity.quasistatic.balance import Checks
from asperity.quasistatic.contact_solver import ContactSolver, Counts
from asperity.quasistatic.legs import Position
from asperity.quasistatic.measures import Record, Snapshot, mean_stress
from asperity.runtime.display import brief
from asperity.runtime.usage import Phases


@dataclass(frozen=True)
class ContactResult:
    """Result of a load path.

    Attributes:
        curve: accepted steps
        counts: totals of steps, cutbacks, iterations
        dofs, cells: size of the model, all ranks
        phases: seconds per phase, this rank
        memory: greatest resident memory, all ranks [bytes]
        snapshots: states of the top kept, this rank's part
        block: the mesh as built on rank 0, None elsewhere
        solver: with the solid in its last state
        record, position: rows of this rank and place on the load path, for what is left of it
        complete: whether the path was followed to its end
        reason: why it ended
    """

    curve: Curve
    counts: Counts
    dofs: int
    cells: int
    phases: Phases
    memory: int
    snapshots: tuple[Snapshot, ...]
    block: BlockMesh | None
    solver: ContactSolver
    record: Record
    position: Position
    complete: bool
    reason: str

    def __repr__(self) -> str:
        return f"ContactResult({self.curve!r}, dofs={self.dofs}, cells={self.cells}, {brief(self.reason)})"

    @property
    def checks(self) -> Checks:
        """Worst figures of the balances that every step has to keep."""
        return self.solver.checks

    def displacement(self) -> Any:
        """Displacement of the last state, a function of dolfinx, second-order [L]; collective.

        Its mesh is the undeformed block, with coordinates in units of L.

        Examples:
            >>> wave = asp.Surface.from_spec("sinusoid", L=1e-6, amplitude=2e-8)
            >>> size = asp.MeshSize(h_contact=0.3e-6, h_max=0.6e-6)
            >>> result = asp.solve_contact(wave, asp.Material(E=200e9, nu=0.3), delta_max=2e-8, steps=2, size=size)
            >>> import ufl
            >>> from dolfinx import fem
            >>> u = result.displacement()
            >>> pushed_down = fem.assemble_scalar(fem.form(-u[2] * ufl.dx))
            >>> bool(0.0 < pushed_down < 0.02), result.stress().x.array.reshape(-1, 3, 3).shape[0] == result.cells
            (True, True)
        """
        u = self.solver.solid.u.copy()
        u.name = "displacement"
        return u

    def stress(self) -> Any:
        """Mean Cauchy stress of the cells in the last state, a tensor function of dolfinx [E]; collective.

        Its mesh is that of `displacement`.
        """
        from dolfinx import fem

        solid = self.solver.solid
        values, _ = mean_stress(self.solver, solid.u.x.array.reshape(-1, 3))
        V = fem.functionspace(solid.mesh, ("DG", 0, (3, 3)))
        stress = fem.Function(V, name="stress")
        cells = V.dofmap.list[: len(values), 0]
        stress.x.array.reshape(-1, 9)[cells] = values[:, (0, 3, 4, 3, 1, 5, 4, 5, 2)]  # of xx yy zz xy xz yz
        stress.x.scatter_forward()
        return stress


def refuse_wrong(checks: Checks, result: object) -> None:
    """Raise CheckError with a result where a balance is violated."""
    if checks.violated:
        raise CheckError(f"the result is wrong, do not use it: {'; '.join(checks.violated.values())}", result)


class PartialResult(ConvergenceError):
    """The load path ended early; `result`, a `ContactResult`, holds what was reached."""

    result: ContactResult
