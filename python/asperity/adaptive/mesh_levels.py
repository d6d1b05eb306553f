"""The curves of a run with a tolerance, one mesh after the other, within limits of size and time."""

from __future__ import annotations

from dataclasses import dataclass, replace
from time import perf_counter
from typing import TYPE_CHECKING

from asperity.adaptive.family import MeshFamily
from asperity.adaptive.mesh_plan import GREATEST_STEP, LEAST_STEP, RATIO
from asperity.contact.contact_surface import gather_top
from asperity.errors import InputError
from asperity.mesh.block import BlockMesh
from asperity.mesh.resolution import SHARE, unresolved_height
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
        depth: greatest approach, which the meshes are made for [length]
        guide: half-space with all waves, on rank 0, which makes the meshes
        scale: of the first mesh
        max_dofs: size no mesh may exceed
        comm: communicator
        hooks: see `solve_contact.Callbacks`; each level has a checkpoint of its own

    Attributes:
        comm: communicator
        side, height: of the block [length]
        compliance: of the block under a uniform pressure, compression over P* [length]
        delta_star, singular, flowing: approaches of the guide and what it says of them (k,), see `Guide`
        force_max: greatest force of a load path that gives it [force]
        levels: what was computed, in order
        scales: of the meshes
    """

    def __init__(
        self, problem: Problem, depth: float, guide: Guide | None, scale: float, max_dofs: int, comm: MPI.Comm,
        hooks: Callbacks,
    ) -> None:  # fmt: skip
        material = problem.material
        self._problem, self._depth, self._max_dofs, self._hooks = problem, depth, max_dofs, hooks
        self.comm, self.side, self.height = comm, problem.surface.L, problem.height
        self.compliance = problem.height * material.reduced_modulus / material.block_modulus(problem.sides)
        self.force_max = problem.load_path.force_max
        self._family = None if guide is None else MeshFamily(problem, depth, guide)
        self._first_scale = scale
        self._start = perf_counter()
        seen = None if guide is None else (guide.delta_star, guide.singular, guide.flowing)
        self.delta_star, self.singular, self.flowing = comm.bcast(seen, root=0)
        self._block: BlockMesh | None = None  # the last mesh, on rank 0
        self._first: ContactResult | None = None  # the result of the first mesh, until there is another
        self.levels: list[Level] = []
        self.scales: list[float] = []

    def _make(self, finer: float) -> tuple[float, int, float]:
        """Make a mesh finer than the last one, or the finest that the greatest number of dofs allows; on rank 0.

        Returns:
            greatest size in the contact [length], dofs and scale
        """
        family = self._family
        assert family is not None

        def made(scale: float) -> int:
            self._block = family.block(scale)
            return 3 * self._block.counts()[0]

        if self.scales:
            last = self.scales[-1]
            scale, dofs = family.within(last / finer, last, self._max_dofs, made)
        else:
            scale, dofs = family.first(self._first_scale, self._max_dofs, made)
        return family.h(scale), dofs, scale

    def _refine(self, finer: float) -> float:
        """The next mesh; its greatest size in the contact [length]; collective.

        Raises:
            InputError: not even the first mesh is allowed
            PartialResult: no other is
        """
        h, dofs, scale = on_root_bcast(self.comm, lambda: self._make(finer))
        small = (
            f"accuracy.max_dofs = {self._max_dofs} is too small, a coarse mesh of this block has {dofs} dofs: "
            "raise it, or choose the mesh by mesh.h_contact"
        )
        if self._first is not None and self.scales[0] < LEAST_STEP * scale:
            raise PartialResult(f"the force has no error bar: {small}", self._first)
        if dofs > self._max_dofs:
            raise InputError(small)
        self.scales.append(scale)
        return h

    def __call__(self, finer: float | None = None, substeps: int = 1) -> ContactResult:
        """Curve on the next mesh.

        Args:
            finer: than the last one; None takes the last one again
            substeps: parts of each load step
        """
        start = perf_counter()
        hooks, h = self._hooks, self.levels[-1].h if finer is None else self._refine(finer)
        if hooks.checkpoint is not None:  # other limits than those of a run continued may give another size
            name = f"level-{len(self.levels) + 1}-{self.scales[-1]:.6g}-{substeps}"
            hooks = replace(hooks, checkpoint=hooks.checkpoint.part(name))
        level = f"h = {h / self.side:.3g} L" + (f", {substeps} substeps" if substeps > 1 else "")
        whole, on_step = 1.0 + self._later(substeps), hooks.on_step
        if on_step is not None:  # what is shown as left is that of all meshes that are planned
            hooks = replace(hooks, on_step=lambda rows, done: on_step(rows, done / whole))
        hooks = replace(hooks, on_stage=lambda name: self._hooks.stage(f"{level}: {name}"))
        path = replace(self._problem.load_path, substeps=substeps)
        problem = replace(self._problem, load_path=path, size=replace(self._problem.size, h_contact=h))
        result = solve_problem(problem, block=self._block, comm=self.comm, hooks=hooks, checked=False)
        # facets that miss waves have another mean height than the surface; that of the summit is exact
        top, of_solid = result.solver.contact_surface, result.solver.solid.points
        plane = self.side * top.mean(of_solid[:, 2]) - self.height
        result = replace(result, curve=replace(result.curve, mean_gap=result.curve.mean_gap + plane))
        seconds = max(perf_counter() - start, float(result.curve.seconds.sum()))  # of a run continued too
        self.levels.append(Level(h, result.dofs, substeps, seconds))
        self._first = result if len(self.scales) == 1 else None
        return result

    def _later(self, substeps: int) -> float:
        """Work of the meshes that follow the current one at least, over its own; on rank 0."""
        if self._family is None or len(self.scales) > 1:
            return 0.0
        first = self.scales[0]
        finer = self._family.dofs(min(first, self._first_scale) / RATIO) / self._family.dofs(first)
        twice = 2.0 if self._problem.path_dependent and substeps == 1 else 0.0  # the same mesh with half the steps
        return twice + finer / substeps

    def left_out(self, result: ContactResult) -> Omission:
        """What the top of the mesh of a result leaves out."""
        top = gather_top(result.solver.contact_surface, self.height / self.side)

        def left_out() -> Omission:
            assert self._family is not None and top is not None
            return self._family.guide.left_out(top)

        return on_root_bcast(self.comm, left_out)

    def misses_waves(self, tolerance: float) -> bool:
        """Whether the elements of the last mesh are longer than waves that matter to a tolerance of the force."""
        return unresolved_height(self._problem.surface, self.levels[-1].h, self._depth) > SHARE * tolerance

    def limit(self, goal: AccuracyTarget, finer: float = 1.0, substeps: int = 1) -> str:
        """Why the next level must not be computed; empty when it may; collective, by the clock of rank 0.

        Args:
            goal: with the limits
            finer: than the last mesh, see `__call__`; max_dofs may make it less
            substeps: of the next level
        """
        return on_root_bcast(self.comm, lambda: self._limit(goal, finer, substeps))

    def _limit(self, goal: AccuracyTarget, finer: float, substeps: int) -> str:
        family, scale, last = self._family, self.scales[-1], self.levels[-1]
        assert family is not None
        counted = [family.dofs(scale / min(finer, step)) for step in (1.0, LEAST_STEP, GREATEST_STEP)]
        least, dofs = (int(last.dofs * count / counted[0]) for count in counted[1:])
        if least > goal.max_dofs:
            return f"the next mesh has about {dofs} dofs, accuracy.max_dofs = {goal.max_dofs} allows no more"
        elapsed = max(perf_counter() - self._start, sum(level.seconds for level in self.levels))
        needed = last.seconds * substeps / last.substeps * min(dofs, goal.max_dofs) / last.dofs
        if goal.max_seconds is not None and elapsed + needed > goal.max_seconds:
            return (
                f"the next mesh takes about {needed:.0f} s after the {elapsed:.0f} s so far, accuracy.max_seconds = "
                f"{goal.max_seconds:g} allows no more"
            )
        return ""
