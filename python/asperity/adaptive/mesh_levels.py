"""The curves of a run with a tolerance, one mesh after the other, within limits of size and time."""

from __future__ import annotations

from dataclasses import dataclass, replace
from time import perf_counter
from typing import TYPE_CHECKING

from asperity.adaptive.mesh_plan import DOFS_ORDER, LEAST_STEP, RATIO, MeshFamily
from asperity.contact.contact_surface import gather_top
from asperity.errors import InputError
from asperity.mesh.block import BlockMesh
from asperity.model.problem import Problem
from asperity.model.settings import AccuracyTarget
from asperity.quasistatic.callbacks import Callbacks
from asperity.quasistatic.contact_result import ContactResult, PartialResult
from asperity.quasistatic.solve_problem import solve_problem
from asperity.runtime.parallel import on_root_bcast

if TYPE_CHECKING:
    from mpi4py import MPI

    from asperity.adaptive.guide import Guide, Omission


@dataclass(frozen=True)
class Level:
    """One computed curve: greatest element size in the contact [length], dofs, parts of each load step, seconds."""

    h: float
    dofs: int
    substeps: int
    seconds: float


class LevelSolver:
    """Solves one level after the other and keeps the account; collective.

    Args:
        problem: what to solve; its load path has the planned steps, its element sizes are not used
        guide: half-space with all waves, on rank 0, which makes the meshes
        goal: limits
        comm: communicator
        hooks: see `Callbacks`; each level has a checkpoint of its own

    Attributes:
        problem: see above
        compliance: of the block under a uniform pressure, compression over P* [length]
        levels: what was computed, in order
        scales: of the meshes
    """

    def __init__(
        self, problem: Problem, guide: Guide | None, goal: AccuracyTarget, comm: MPI.Comm,
        hooks: Callbacks,
    ) -> None:  # fmt: skip
        material = problem.material
        self.problem, self._goal, self._comm, self._hooks = problem, goal, comm, hooks
        self.compliance = problem.height * material.reduced_modulus / material.block_modulus(problem.sides)
        self._family = None if guide is None else MeshFamily(problem, guide)
        self._start = perf_counter()
        self._block: BlockMesh | None = None  # the last mesh, on rank 0
        self._first: ContactResult | None = None  # the result of the first mesh, until there is another
        self.levels: list[Level] = []
        self.scales: list[float] = []

    def _refine(self, finer: float) -> float:
        """The next mesh, or the finest that max_dofs allows; its greatest size in the contact [length]; collective.

        Raises:
            InputError: not even the first mesh is allowed
            PartialResult: no other is
        """
        family, most = self._family, self._goal.max_dofs

        def make() -> tuple[float, int, float]:
            assert family is not None

            def made(scale: float) -> int:
                self._block = family.block(scale)
                return 3 * len(self._block.points)

            if self.scales:
                scale, dofs = family.finest(self.scales[-1] / finer, self.scales[-1], most, made)
            else:
                scale, dofs = family.first(most, made)
            return scale, dofs, family.h(scale)

        scale, dofs, h = on_root_bcast(self._comm, make)
        small = (
            f"accuracy.max_dofs = {most} is too small, a coarse mesh of this block has {dofs} dofs: "
            "raise it, or choose the mesh by mesh.h_contact"
        )
        if self._first is not None and min(self.scales[0] / scale, dofs / self._first.dofs) < LEAST_STEP:
            raise PartialResult(f"the force has no error bar: {small}", self._first)
        if dofs > most:
            raise InputError(small)
        self.scales.append(scale)
        return h

    def __call__(self, finer: float | None = None, substeps: int = 1) -> ContactResult:
        """Curve on the next mesh.

        Args:
            finer: than the last one; None takes the last one again
            substeps: parts of each load step
        """
        start, problem = perf_counter(), self.problem
        hooks, h = self._hooks, self.levels[-1].h if finer is None else self._refine(finer)
        if hooks.checkpoint is not None:  # other limits than those of a run continued may give another size
            name = f"level-{len(self.levels) + 1}-{self.scales[-1]:.6g}-{substeps}"
            hooks = replace(hooks, checkpoint=hooks.checkpoint.part(name))
        level = f"h = {h / problem.surface.L:.3g} L" + (f", {substeps} substeps" if substeps > 1 else "")
        whole, on_step = 1.0 + self._later(substeps), hooks.on_step
        if on_step is not None:  # what is shown as left is that of all meshes that are planned
            hooks = replace(hooks, on_step=lambda rows, done: on_step(rows, done / whole))
        hooks = replace(hooks, on_stage=lambda name: self._hooks.stage(f"{level}: {name}"))
        path = replace(problem.load_path, substeps=substeps)
        problem = replace(problem, load_path=path, size=replace(problem.size, h_contact=h))
        result = solve_problem(problem, block=self._block, comm=self._comm, hooks=hooks, checked=False)
        # facets that miss waves have another mean height than the surface; that of the summit is exact
        top, of_solid = result.solver.contact_surface, result.solver.solid.points
        plane = problem.surface.L * top.mean(of_solid[:, 2]) - problem.height
        result = replace(result, curve=replace(result.curve, mean_gap=result.curve.mean_gap + plane))
        seconds = max(perf_counter() - start, float(result.curve.seconds.sum()))  # of a run continued too
        self.levels.append(Level(h, result.dofs, substeps, seconds))
        self._first = result if len(self.scales) == 1 else None
        return result

    def _later(self, substeps: int) -> float:
        """Work of the meshes that follow the current one at least, over its own."""
        if len(self.scales) > 1:
            return 0.0
        twice = 2.0 if self.problem.path_dependent and substeps == 1 else 0.0  # the same mesh with half the steps
        return twice + self.scales[0] ** DOFS_ORDER / substeps

    def left_out(self, result: ContactResult) -> Omission:
        """What the top of the mesh of a result leaves out."""
        top = gather_top(result.solver.contact_surface, self.problem.height / self.problem.surface.L)

        def left_out() -> Omission:
            assert self._family is not None and top is not None
            return self._family.guide.left_out(top)

        return on_root_bcast(self._comm, left_out)

    def limit(self, finer: float = 1.0, substeps: int = 1) -> str:
        """Why the next level must not be computed; empty when it may; collective, by the clock of rank 0.

        Args:
            finer: than the last mesh, see `__call__`; max_dofs may make it less
            substeps: of the next level
        """
        goal = self._goal

        def limit() -> str:
            family, scale, last = self._family, self.scales[-1], self.levels[-1]
            assert family is not None
            if goal.max_seconds is None and last.dofs * RATIO**3 <= goal.max_dofs:  # no mesh has more
                return ""
            counted = [family.dofs(scale / min(finer, step)) for step in (1.0, LEAST_STEP, RATIO)]
            least, dofs = (int(last.dofs * count / counted[0]) for count in counted[1:])
            if least > goal.max_dofs:
                return f"the next mesh has about {dofs} dofs, accuracy.max_dofs = {goal.max_dofs} allows no more"
            elapsed = max(perf_counter() - self._start, sum(level.seconds for level in self.levels))
            needed = last.seconds * substeps / last.substeps * min(dofs, goal.max_dofs) / last.dofs
            if goal.max_seconds is None or elapsed + needed <= goal.max_seconds:
                return ""
            return (
                f"the next mesh takes about {needed:.0f} s after the {elapsed:.0f} s so far, accuracy.max_seconds = "
                f"{goal.max_seconds:g} allows no more"
            )

        return on_root_bcast(self._comm, limit)
