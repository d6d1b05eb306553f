# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

"""The curves of a run with a tolerance, one mesh after the other, within limits of size and time."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import log
from time import perf_counter
from typing import TYPE_CHECKING

import numpy as np

from asperity.adaptive.mesh_plan import DOFS_ORDER, growth
from asperity.errors import InputError
from asperity.mesh.block import BlockMesh
from asperity.mesh.size_field import FirstContactMap
from asperity.model.problem import Problem
from asperity.model.settings import MEAN, POINT, AccuracyTarget, ApproachMap, MeshSize, wrong_dilatation
from asperity.quasistatic.contact_result import ContactResult, PartialResult
from asperity.quasistatic.hooks import Hooks
from asperity.quasistatic.make import make_block
from asperity.quasistatic.solve_problem import estimate_approach, solve_problem

if TYPE_CHECKING:
    from mpi4py import MPI


@dataclass(frozen=True)
class Level:
    """One computed curve: element size [length], dofs, equal parts of each load step, seconds, `Problem.dilatation`."""

    h: float
    dofs: int
    substeps: int
    seconds: float
    dilatation: str


class LevelSolver:
    """Solves one level after the other and keeps the account; collective.

    Args:
        problem: what to solve; its load path has the planned steps, its element sizes are not used
        max_dofs: size no mesh may exceed
        comm: communicator
        hooks: see `solve_contact.Hooks`; each level has a checkpoint of its own

    Attributes:
        comm: communicator
        side, height: of the block [length]
        compliance: of the block under a uniform pressure, compression over P* [length]
        plastic: whether the solid yields
        levels: what was computed, in order
    """

    def __init__(self, problem: Problem, max_dofs: int, comm: MPI.Comm, hooks: Hooks) -> None:
        self._problem, self._max_dofs, self._hooks = problem, max_dofs, hooks
        self.comm, self.side, self.height = comm, problem.surface.L, problem.height
        material = problem.material
        self.plastic = material.plastic
        self.compliance = problem.height * material.reduced_modulus / material.block_modulus(problem.sides)
        self._start = perf_counter()
        self._reach: ApproachMap | None = None
        self._flowing = False  # spots of a rough surface
        self._depth = problem.load_path.delta_max  # that meshes are made for [length]
        self._made: tuple[float, BlockMesh | None] | None = None  # the last mesh and its size [length]
        self._guide: ContactResult | None = None  # until the first mesh that it guides
        self.levels: list[Level] = []

    def aim(self, guide: ContactResult, spots: ApproachMap | None = None, rough: bool = False) -> None:
        """Make the meshes from here on for what is touched.

        Args:
            guide: result of the first mesh
            spots: what is touched, on rank 0; None takes what the guide touched
            rough: whether the meshes leave out waves of the surface: where its spots flow, elements as large as they
                are would lock, and what surrounds them takes fewer elements
        """
        L = self.side
        xy, touched_at = guide.touched_at()
        period = L if self._problem.sides == "periodic" else None
        if spots is None and np.isfinite(touched_at).any():  # on rank 0, which makes the meshes
            spots = FirstContactMap(xy * L, touched_at * L, period)
        self._reach = spots
        self._depth = float(guide.curve.loading().delta[-1])
        self._made, self._guide, self._flowing = None, guide, rough and self.plastic
        problem = self._problem
        if self._flowing and problem.dilatation is None:
            possible = not wrong_dilatation(MEAN, problem.kernels, problem.formulation.method)
            self._problem = replace(problem, dilatation=MEAN if possible else POINT)

    @property
    def dilatation(self) -> str:
        """Volumetric strain of the elements."""
        return self._problem.dilatation or POINT

    def _mesh(self, h: float) -> tuple[BlockMesh | None, float]:
        """Mesh of size h [length], or the finest that the greatest number of dofs allows, and its size; collective.

        Raises:
            InputError: not even the guide is allowed
            PartialResult: nothing else is
        """
        if self._made is not None and self._made[0] == h:  # once more, in other steps
            return self._made[1], h
        comm, surface = self.comm, self._problem.surface
        if self._depth is None:
            self._depth = estimate_approach(self._problem, comm)
        while True:
            rate, refinements = growth(h / self.side, self._flowing), self._problem.size.refinements
            size = MeshSize(h, rate, reach=self._reach, refinements=refinements)
            block = make_block(comm, surface, self._problem.height, self._depth, size, self._problem.sides)
            dofs = comm.bcast(None if block is None else 3 * block.counts()[0], root=0)
            if dofs <= self._max_dofs:
                self._made, self._guide = (h, block), None
                return block, h
            small = (
                f"accuracy.max_dofs = {self._max_dofs} is too small, a coarse mesh of this block has {dofs} dofs: "
                "raise it, or choose the mesh by mesh.h_contact"
            )
            if not self.levels:
                raise InputError(small)
            if self._guide is not None:
                raise PartialResult(f"the force has no error bar: {small}", self._guide)
            h *= 1.02 * (dofs / self._max_dofs) ** (1.0 / DOFS_ORDER)

    def __call__(self, h: float, substeps: int = 1) -> ContactResult:
        """Curve with elements of size h [L], or of the smallest allowed, and load steps in so many parts."""
        start = perf_counter()
        L, hooks = self.side, self._hooks
        block, h = self._mesh(h * L)
        if hooks.checkpoint is not None:  # other limits than those of a run continued may give another size
            hooks = replace(
                hooks, checkpoint=hooks.checkpoint.part(f"level-{len(self.levels) + 1}-{h / L:.6g}-{substeps}")
            )
        level = f"h = {h / L:.3g} L" + (f", {substeps} substeps" if substeps > 1 else "")
        hooks = replace(hooks, on_stage=lambda name: self._hooks.stage(f"{level}: {name}"))
        path = replace(self._problem.load_path, substeps=substeps)
        problem = replace(self._problem, load_path=path, size=MeshSize(h, growth(h / L, self._flowing)))
        result = solve_problem(problem, block=block, comm=self.comm, hooks=hooks)
        # facets that miss waves have another mean height than the surface; that of the summit is exact
        top, of_solid = result.solver.contact_surface, result.solver.solid.points
        plane = L * top.mean(of_solid[:, 2]) - self.height
        result = replace(result, curve=replace(result.curve, mean_gap=result.curve.mean_gap + plane))
        seconds = max(perf_counter() - start, float(result.curve.seconds.sum()))  # of a run continued too
        self.levels.append(Level(h, result.dofs, substeps, seconds, self.dilatation))
        return result

    def growth_of_dofs(self) -> float:
        """Order of the dofs in 1/h, from the last two guided meshes; no less than the usual one."""
        before, last = self.levels[-2:]
        if len(self.levels) < 3 or not last.h < before.h:
            return DOFS_ORDER
        return max(DOFS_ORDER, log(last.dofs / before.dofs) / log(before.h / last.h))

    def limit(self, goal: AccuracyTarget, size: float, finer: float, substeps: int) -> str:
        """Why the next level must not be computed; empty when it may; collective, by the clock of rank 0.

        Args:
            goal: with the limits
            size, finer: elements of the last level and of the next [L]
            substeps: of the next level
        """
        reason = self._limit(goal, size / finer, substeps)
        return str(self.comm.bcast(reason, root=0))

    def _limit(self, goal: AccuracyTarget, refinement: float, substeps: int) -> str:
        last = self.levels[-1]
        order = self.growth_of_dofs()
        dofs = int(last.dofs * refinement**order)
        if dofs > goal.max_dofs:
            return f"the next mesh has about {dofs} dofs, accuracy.max_dofs = {goal.max_dofs} allows no more"
        elapsed = max(perf_counter() - self._start, sum(level.seconds for level in self.levels))
        needed = last.seconds * substeps / last.substeps * refinement ** (1.2 * order)
        if goal.max_seconds is not None and elapsed + needed > goal.max_seconds:
            return (
                f"the next mesh takes about {needed:.0f} s after the {elapsed:.0f} s so far, accuracy.max_seconds = "
                f"{goal.max_seconds:g} allows no more"
            )
        return ""
