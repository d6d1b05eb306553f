"""The meshes of a problem: their element sizes over those of the guide, and their dofs before there is a mesh."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import inf
from typing import TYPE_CHECKING

import numpy as np

from asperity.adaptive.dof_count import dofs_of, finest_within
from asperity.adaptive.mesh_plan import DOFS_ORDER, LEAST_RATIO, MOST_SCALE, growth, widest
from asperity.arrays import Floats
from asperity.mesh.generate import build_block
from asperity.mesh.size_field import SizeField, size_field
from asperity.model.settings import MeshSize

if TYPE_CHECKING:
    from asperity.adaptive.guide import Guide
    from asperity.mesh.block import BlockMesh
    from asperity.model.problem import Problem


@dataclass(frozen=True)
class MeshFamily:
    """Meshes by their scales, the element sizes over those of the guide at its cells (n, n); in one process.

    Attributes:
        problem: what is pressed; of its element sizes the refinements are used
        depth: greatest approach [length]
        guide: half-space with all waves
    """

    problem: Problem
    depth: float
    guide: Guide

    def first(self, scale: float, most: float, made: Callable[[Floats], int] | None = None) -> tuple[Floats, int]:
        """The first mesh, with room for a second one.

        Args:
            scale: wanted
            most: dofs that are allowed
            made: makes a mesh of a scale and returns its dofs; None counts them by the size field

        Returns:
            scale and dofs of the mesh, too many where not even the coarsest is allowed
        """
        room = LEAST_RATIO**DOFS_ORDER if scale < MOST_SCALE else 1.0
        ones = np.ones(self.guide.sizes.shape)
        return self._within(lambda factor: factor * scale * ones, most / room, MOST_SCALE / scale, made)

    def next(
        self, scale: Floats, finer: Floats | float, most: float, made: Callable[[Floats], int] | None = None
    ) -> tuple[Floats, int]:
        """A mesh finer than another one, or the finest between the two that is allowed.

        Args:
            scale: of the other one
            finer: at the approaches of the guide (k,) or at all
            most, made: see `first`
        """
        return self._within(lambda factor: self.finer(scale, finer, factor), most, float(np.max(finer)), made)

    def finer(self, scale: Floats, finer: Floats | float, factor: float = 1.0) -> Floats:
        """Scale of a mesh finer than another one, times a factor, nowhere above that of the other one; see `next`."""
        return np.minimum(scale, factor * scale / self.guide.of_spots(finer))

    def _within(
        self, at: Callable[[float], Floats], most: float, coarsest: float, made: Callable[[Floats], int] | None
    ) -> tuple[Floats, int]:
        # no mesh is made that is much too large
        allowed = most if made is None else 1.5 * most
        factor, dofs = finest_within(1.0, allowed, coarsest, lambda factor: self.dofs(at(factor), 4.0 * most))
        if made is not None:
            factor, dofs = finest_within(factor, most, coarsest, lambda factor: made(at(factor)))
        return at(factor), dofs

    def h(self, scale: Floats) -> float:
        """Greatest size of an element in the contact [length]."""
        sizes = scale * self.guide.sizes
        return min(float(sizes[np.isfinite(sizes)].max()), widest(float(scale.min()))) * self.problem.surface.L

    def size(self, scale: Floats) -> MeshSize:
        """Element sizes of a mesh."""
        L, least = self.problem.surface.L, float(scale.min())
        cells, parts = scale * self.guide.sizes * L, self.problem.size.refinements
        return MeshSize(self.h(scale), growth(least), widest(least) * L, cells=cells, refinements=parts)

    def block(self, scale: Floats) -> BlockMesh:
        """Mesh of a scale."""
        problem, field, parts = self.problem, self._field(scale), self.problem.size.refinements
        return build_block(problem.surface, problem.height, field.coarser(parts).at, field.periodic, parts)

    def dofs(self, scale: Floats, most: float = inf) -> int:
        """Dofs of a mesh by its size field; beyond so many they are not counted."""
        problem = self.problem
        return dofs_of(self._field(scale), problem.size.refinements, problem.height / problem.surface.L, most)

    def _field(self, scale: Floats) -> SizeField:
        return size_field(self.problem.surface, self.depth, self.size(scale), self.problem.sides)
