"""The meshes of a problem: their element sizes over those of the guide, and their dofs before there is a mesh."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import product
from math import inf, log, prod
from operator import add
from typing import TYPE_CHECKING

import numpy as np

from asperity.adaptive.mesh_plan import DOFS_ORDER, LEAST_RATIO, MOST_SCALE, growth, widest
from asperity.mesh.generate import build_block
from asperity.mesh.size_field import SizeField, size_field
from asperity.model.settings import H_MAX, MeshSize

if TYPE_CHECKING:
    from asperity.adaptive.guide import Guide
    from asperity.mesh.block import BlockMesh
    from asperity.model.problem import Problem


Size = Callable[[float, float, float], float]

# Nodes in a volume h^3 and on a part h^2 of the surface: within 13 % (rms, at most 23 %) of 29 meshes of 60 to 17,000
# nodes, whose growth is from 0.1 to 1.2
NODES, NODES_OF_SURFACE = 3.1, 7.9
LARGEST = 0.5 * H_MAX  # greatest edge of a box [L]: a larger one would miss small spots


def dofs_of(field: SizeField, refinements: int, height: float, most: float = inf) -> int:
    """Dofs of a mesh of a block, whose height is in units of L; beyond `most` they are not counted."""
    size = field.coarser(refinements).at
    return round(3 * nodes_of(size, height, most / 3, 2**refinements, field.periodic))


def finest_within(scale: float, most: float, coarsest: float, dofs_at: Callable[[float], int]) -> tuple[float, int]:
    """Scale and dofs of the finest mesh of a family that is no larger than allowed, or of the coarsest one tried.

    Args:
        scale, most: scale that is wanted, and dofs that are allowed
        coarsest: scale from which on no coarser one is tried
        dofs_at: dofs of a mesh by its scale
    """
    dofs, order = dofs_at(scale), DOFS_ORDER
    while dofs > most and scale < coarsest:
        finer, before = scale, dofs
        scale *= 1.02 * (dofs / most) ** (1.0 / order)
        dofs = dofs_at(scale)
        if dofs < before:  # of a coarse mesh most elements are elsewhere than in the contact
            order = min(max(log(before / dofs) / log(scale / finer), 1.0), DOFS_ORDER)
    return scale, dofs


def nodes_of(size: Size, height: float, most: float = inf, split: int = 1, joined: bool = False) -> float:
    """Nodes of the block: integrals of 1/h^3 over it and of 1/h^2 over its surface, by boxes of at most 2 h.

    Args:
        size: h at (x, y, depth), in units of L
        height: of the block [L]
        most: value beyond which it is given up
        split: parts of each edge
        joined: whether opposite sides are, which have their nodes in common
    """
    solid = (1.0, 1.0, height)
    boxes: list[tuple[tuple[float, ...], tuple[float, ...]]] = [((0.5, 0.5, 0.5 * height), solid)]
    for k, edge in enumerate(solid):  # the faces have no thickness
        across = tuple(0.0 if i == k else e for i, e in enumerate(solid))
        ends = (0.0,) if joined and k < 2 else (0.0, edge)
        boxes += [(tuple(end if i == k else 0.5 * e for i, e in enumerate(solid)), across) for end in ends]
    total = 0.0
    while boxes and total <= most:
        centre, edges = boxes.pop()
        h = size(*centre)
        if max(edges) <= min(2.0 * h, LARGEST):
            along = [edge * split / h for edge in edges if edge]
            total += (NODES if len(along) == 3 else NODES_OF_SURFACE) * prod(along)
            continue
        halves = tuple(0.5 * edge for edge in edges)
        steps = product(*((-0.5 * half, 0.5 * half) if half else (0.0,) for half in halves))
        boxes += [(tuple(map(add, centre, step)), halves) for step in steps]
    return total


@dataclass(frozen=True)
class MeshFamily:
    """Meshes by their scale, the element sizes over those of the guide; in one process.

    Attributes:
        problem: what is pressed; of its element sizes the refinements are used
        depth: greatest approach [length]
        guide: half-space with all waves
    """

    problem: Problem
    depth: float
    guide: Guide

    def first(self, scale: float, most: float, made: Callable[[float], int] | None = None) -> tuple[float, int]:
        """The first mesh, with room for a second one.

        Args:
            scale: wanted
            most: dofs that are allowed
            made: makes a mesh of a scale and returns its dofs; None counts them by the size field

        Returns:
            scale and dofs of the mesh, too many where not even the coarsest is allowed
        """
        room = LEAST_RATIO**DOFS_ORDER if scale < MOST_SCALE else 1.0
        return self.within(scale, MOST_SCALE, most / room, made)

    def within(
        self, scale: float, coarsest: float, most: float, made: Callable[[float], int] | None = None
    ) -> tuple[float, int]:
        """The mesh of a scale, or the finest allowed one up to the coarsest that is tried; see `first`."""
        allowed = most if made is None else 1.5 * most  # no mesh is made that is much too large
        scale, dofs = finest_within(scale, allowed, coarsest, lambda scale: self.dofs(scale, 4.0 * most))
        return (scale, dofs) if made is None else finest_within(scale, most, coarsest, made)

    def h(self, scale: float) -> float:
        """Greatest size of an element in the contact [length]."""
        sizes = scale * self.guide.sizes
        return min(float(sizes[np.isfinite(sizes)].max()), widest(scale)) * self.problem.surface.L

    def size(self, scale: float) -> MeshSize:
        """Element sizes of a mesh."""
        L, parts = self.problem.surface.L, self.problem.size.refinements
        cells = scale * self.guide.sizes * L
        return MeshSize(self.h(scale), growth(scale), widest(scale) * L, cells=cells, refinements=parts)

    def block(self, scale: float) -> BlockMesh:
        """Mesh of a scale."""
        problem, field, parts = self.problem, self._field(scale), self.problem.size.refinements
        return build_block(problem.surface, problem.height, field.coarser(parts).at, field.periodic, parts)

    def dofs(self, scale: float, most: float = inf) -> int:
        """Dofs of a mesh by its size field; beyond so many they are not counted."""
        problem = self.problem
        return dofs_of(self._field(scale), problem.size.refinements, problem.height / problem.surface.L, most)

    def _field(self, scale: float) -> SizeField:
        return size_field(self.problem.surface, self.depth, self.size(scale), self.problem.sides)
