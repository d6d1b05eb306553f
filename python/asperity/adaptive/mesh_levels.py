"""The curves of a run with a tolerance, one mesh after the other, within limits of size and time."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import log
from time import perf_counter
from typing import TYPE_CHECKING

import numpy as np

from asperity.adaptive.dof_count import dofs_of, finest_within
from asperity.adaptive.mesh_plan import DOFS_ORDER, LEAST_RATIO, LEAST_STEP, MOST_SCALE, growth, widest
from asperity.arrays import Floats
from asperity.errors import InputError
from asperity.mesh.block import BlockMesh
from asperity.mesh.resolution import SHARE, unresolved_height
from asperity.model.problem import Problem
from asperity.model.settings import MEAN, POINT, AccuracyTarget, MeshSize, wrong_dilatation
from asperity.quasistatic.contact_result import ContactResult, PartialResult
from asperity.quasistatic.hooks import Hooks
from asperity.quasistatic.make import make_block, size_field
from asperity.quasistatic.solve_problem import solve_problem
from asperity.runtime.parallel import on_root_bcast

if TYPE_CHECKING:
    from mpi4py import MPI


@dataclass(frozen=True)
class Level:
    """One computed curve: greatest element size in the contact [length], dofs, parts of each load step, seconds, and
    `Problem.dilatation`.
    """

    h: float
    dofs: int
    substeps: int
    seconds: float
    dilatation: str


class LevelSolver:
    """Solves one level after the other and keeps the account; collective.

    Args:
        problem: what to solve; its load path has the planned steps, its element sizes are not used
        depth: greatest approach, which the meshes are made for [length]
        sizes: see `guide.Guide`, on rank 0, which makes the meshes
        max_dofs: size no mesh may exceed
        comm: communicator
        hooks: see `solve_contact.Hooks`; each level has a checkpoint of its own

    Attributes:
        comm: communicator
        side, height: of the block [length]
        compliance: of the block under a uniform pressure, compression over P* [length]
        plastic: whether the solid yields
        levels: what was computed, in order
        scales: of their meshes, the element sizes over `sizes`
    """

    def __init__(
        self, problem: Problem, depth: float, sizes: Floats | None, max_dofs: int, comm: MPI.Comm, hooks: Hooks
    ) -> None:
        if problem.material.plastic and problem.dilatation is None:  # elements as large as a spot that flows would lock
            possible = not wrong_dilatation(MEAN, problem.formulation.method)
            problem = replace(problem, dilatation=MEAN if possible else POINT)
        self._problem, self._depth, self._max_dofs, self._hooks = problem, depth, max_dofs, hooks
        self.comm, self.side, self.height = comm, problem.surface.L, problem.height
        material = problem.material
        self.plastic = material.plastic
        self.compliance = problem.height * material.reduced_modulus / material.block_modulus(problem.sides)
        self._start = perf_counter()
        self._sizes = None if sizes is None else np.asarray(sizes * self.side)
        unit = None if self._sizes is None else float(self._sizes[np.isfinite(self._sizes)].max())
        self._unit: float = comm.bcast(unit, root=0)
        self._made: tuple[float, BlockMesh | None] | None = None  # the last mesh and its scale
        self._last: ContactResult | None = None  # of the first mesh, until there is another
        self.levels: list[Level] = []
        self.scales: list[float] = []

    def _mesh(self, scale: float) -> tuple[BlockMesh | None, float]:
        """Mesh of a scale, or the finest that the greatest number of dofs allows, and its scale; collective.

        Raises:
            InputError: not even the first mesh is allowed
            PartialResult: no other is
        """
        if self._made is not None and self._made[0] == scale:  # once more, in other steps
            return self._made[1], scale
        comm, problem, most = self.comm, self._problem, float(self._max_dofs)
        coarsest = self.scales[0] if self.scales else MOST_SCALE
        if not self.levels and scale < MOST_SCALE:  # leave room for the second mesh
            most /= LEAST_RATIO**DOFS_ORDER

        def made(scale: float) -> int:
            block = make_block(comm, problem.surface, problem.height, self._depth, self._size(scale), problem.sides)
            self._made = scale, block
            return int(comm.bcast(None if block is None else 3 * block.counts()[0], root=0))

        # no mesh is made that is much too large
        scale, _ = finest_within(scale, 1.5 * most, coarsest, lambda scale: self._expected_dofs(scale, 3.0 * most))
        scale, dofs = finest_within(scale, most, coarsest, made)
        small = (
            f"accuracy.max_dofs = {self._max_dofs} is too small, a coarse mesh of this block has {dofs} dofs: "
            "raise it, or choose the mesh by mesh.h_contact"
        )
        if self._last is not None and scale > self.scales[0] / LEAST_STEP:
            raise PartialResult(f"the force has no error bar: {small}", self._last)
        if dofs > self._max_dofs:
            raise InputError(small)
        assert self._made is not None
        return self._made[1], scale

    def _expected_dofs(self, scale: float, most: float) -> int:
        problem = self._problem

        def count() -> int:
            field = size_field(problem.surface, self._depth, self._size(scale), problem.sides)
            return dofs_of(field, problem.size.refinements, self.height / self.side, most)

        return on_root_bcast(self.comm, count)

    def _size(self, scale: float) -> MeshSize:
        cells = None if self._sizes is None else scale * self._sizes
        most = widest(scale) * self.side
        h = min(scale * self._unit, most)
        return MeshSize(h, growth(scale), most, cells=cells, refinements=self._problem.size.refinements)

    def __call__(self, scale: float, substeps: int = 1) -> ContactResult:
        """Curve on a mesh of this scale, or of the smallest allowed, and load steps in so many parts."""
        start = perf_counter()
        L, hooks = self.side, self._hooks
        block, scale = self._mesh(scale)
        size = self._size(scale)
        assert size.h_contact is not None
        if hooks.checkpoint is not None:  # other limits than those of a run continued may give another size
            hooks = replace(
                hooks, checkpoint=hooks.checkpoint.part(f"level-{len(self.levels) + 1}-{scale:.6g}-{substeps}")
            )
        level = f"h = {size.h_contact / L:.3g} L" + (f", {substeps} substeps" if substeps > 1 else "")
        hooks = replace(hooks, on_stage=lambda name: self._hooks.stage(f"{level}: {name}"))
        path = replace(self._problem.load_path, substeps=substeps)
        problem = replace(self._problem, load_path=path, size=size)
        result = solve_problem(problem, block=block, comm=self.comm, hooks=hooks)
        # facets that miss waves have another mean height than the surface; that of the summit is exact
        top, of_solid = result.solver.contact_surface, result.solver.solid.points
        plane = L * top.mean(of_solid[:, 2]) - self.height
        result = replace(result, curve=replace(result.curve, mean_gap=result.curve.mean_gap + plane))
        seconds = max(perf_counter() - start, float(result.curve.seconds.sum()))  # of a run continued too
        self.levels.append(Level(size.h_contact, result.dofs, substeps, seconds, self._problem.dilatation or POINT))
        self.scales.append(scale)
        self._last = result if scale == self.scales[0] else None
        return result

    def misses_waves(self, tolerance: float) -> bool:
        """Whether the elements of the last mesh are longer than waves that matter to a tolerance of the force."""
        return unresolved_height(self._problem.surface, self.levels[-1].h, self._depth) > SHARE * tolerance

    def growth_of_dofs(self) -> float:
        """Order of the dofs in 1/scale, from the last two meshes; no less than the usual one."""
        last = self.scales[-1]
        before = [(s, level.dofs) for s, level in zip(self.scales, self.levels, strict=True) if s > last]
        if not before:
            return DOFS_ORDER
        scale, dofs = before[-1]
        return max(DOFS_ORDER, log(self.levels[-1].dofs / dofs) / log(scale / last))

    def limit(self, goal: AccuracyTarget, finer: float, substeps: int) -> str:
        """Why the next level must not be computed; empty when it may; collective, by the clock of rank 0.

        Args:
            goal: with the limits
            finer: scale of the next level
            substeps: of the next level
        """
        reason = self._limit(goal, self.scales[-1] / finer, substeps)
        return str(self.comm.bcast(reason, root=0))

    def _limit(self, goal: AccuracyTarget, refinement: float, substeps: int) -> str:
        last = self.levels[-1]
        order = self.growth_of_dofs()
        dofs = int(last.dofs * refinement**order)
        if dofs > goal.max_dofs:
            return f"the next mesh has about {dofs} dofs, accuracy.max_dofs = {goal.max_dofs} allows no more"
        elapsed = max(perf_counter() - self._start, sum(level.seconds for level in self.levels))
        needed = last.seconds * substeps / last.substeps * refinement**order
        if goal.max_seconds is not None and elapsed + needed > goal.max_seconds:
            return (
                f"the next mesh takes about {needed:.0f} s after the {elapsed:.0f} s so far, accuracy.max_seconds = "
                f"{goal.max_seconds:g} allows no more"
            )
        return ""
