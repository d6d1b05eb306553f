"""The curves of a run with a tolerance, one mesh after the other, within a limit of size."""

from __future__ import annotations

from dataclasses import dataclass, replace
from time import perf_counter
from typing import TYPE_CHECKING

from asperity.adaptive.mesh_plan import GREATEST_STEP, LEAST_STEP, MeshFamily
from asperity.contact.contact_surface import gather_top
from asperity.errors import InputError
from asperity.mesh.block import BlockMesh
from asperity.model.problem import Problem
from asperity.model.settings import AccuracyTarget
from asperity.quasistatic.contact_result import ContactResult, PartialResult
from asperity.quasistatic.solve_problem import Callbacks, solve_problem
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
        block: the last mesh, on rank 0
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
        self.block: BlockMesh | None = None
        self._first: ContactResult | None = None  # the result of the first mesh, until there is another
        self.levels: list[Level] = []
        self.scales: list[float] = []

    def refine(self, finer: float) -> float:
        """Make the next mesh, or the finest that max_dofs allows; greatest size in the contact [length]; collective.

        Raises:
            InputError: not even the first mesh is allowed
            PartialResult: no other is
        """
        family, most = self._family, self._goal.max_dofs

        def make() -> tuple[float, int, float]:
            assert family is not None

            def made(scale: float) -> int:
                self.block = family.block(scale)
                return 3 * len(self.block.points)

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
        hooks, h = self._hooks, self.levels[-1].h if finer is None else self.refine(finer)
        if hooks.checkpoint is not None:  # other limits than those of a run continued may give another size
            name = f"level-{len(self.levels) + 1}-{self.scales[-1]:.6g}-{substeps}"
            hooks = replace(hooks, checkpoint=hooks.checkpoint.part(name))
        parts = {1: "", 2: " with half the load steps"}.get(substeps, f" with 1/{substeps} of the load steps")
        level = f"mesh {len(self.scales)}{parts}"
        hooks = replace(hooks, on_stage=lambda name: self._hooks.stage(f"{level}: {name}"))
        path = replace(problem.load_path, substeps=substeps)
        problem = replace(problem, load_path=path, size=replace(problem.size, h_contact=h))
        result = solve_problem(problem, block=self.block, comm=self._comm, hooks=hooks, checked=False)
        # facets that miss waves have another mean height than the surfaces; that of the summit is exact
        top, exact = result.solver.contact_surface, problem.height + problem.rigid.mean()
        plane = problem.surface.L * top.mean(top.heights) - exact
        result = replace(result, curve=replace(result.curve, mean_gap=result.curve.mean_gap + plane))
        seconds = max(perf_counter() - start, float(result.curve.seconds.sum()))  # of a run continued too
        self.levels.append(Level(h, result.dofs, substeps, seconds))
        self._first = result if len(self.scales) == 1 else None
        return result

    def left_out(self, result: ContactResult) -> Omission:
        """What the top of the mesh of a result leaves out."""
        top = gather_top(result.solver.contact_surface, self.problem.height / self.problem.surface.L)

        def left_out() -> Omission:
            assert self._family is not None and top is not None
            return self._family.guide.left_out(top)

        return on_root_bcast(self._comm, left_out)

    def limit(self, finer: float) -> str:
        """Why no mesh must follow, so much finer or by what max_dofs allows; empty when one may; collective."""
        most = self._goal.max_dofs

        def limit() -> str:
            family, scale, last = self._family, self.scales[-1], self.levels[-1].dofs
            assert family is not None
            if last * GREATEST_STEP**3 <= most:  # no mesh has more
                return ""
            here, least, dofs = (family.dofs(scale / step) for step in (1.0, LEAST_STEP, finer))
            if last * least <= most * here:
                return ""
            return f"the next mesh has about {last * dofs // here} dofs, accuracy.max_dofs = {most} allows no more"

        return on_root_bcast(self._comm, limit)
