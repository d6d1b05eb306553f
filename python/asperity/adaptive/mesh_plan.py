"""The meshes of a run and their dofs before there is a mesh, the load steps, and what two meshes say of the force.

The meshes of a family differ by one number, their scale: the element sizes over those of `guide.spots_of`. The
force differs from the limit by c scale^p. The order p depends on the scene; the limit is therefore the mean of those
that the ends of a range of orders give, and half their distance is its error bar (Richardson's extrapolation; Roache,
J. Fluids Eng. 116 (1994) 405).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from itertools import product
from math import inf, log, prod
from operator import add
from typing import TYPE_CHECKING

import numpy as np

from asperity.arrays import Floats
from asperity.mesh.generate import build_block
from asperity.mesh.size_field import SizeField, size_field
from asperity.model.load_path import BACKWARD_EULER, MIDPOINT
from asperity.model.settings import H_MAX, MeshSize

if TYPE_CHECKING:
    from asperity.adaptive.guide import Guide
    from asperity.mesh.block import BlockMesh
    from asperity.model.problem import Problem

Size = Callable[[float, float, float], float]

# Range of the order of the force in the scale, also of meshes as coarse as the first one (docs/accuracy.md)
MESH_ORDERS, FIRST_ORDERS = (1.6, 2.4), (1.2, 2.4)
GAP_ORDERS = (0.7, 2.4)  # the same of the mean gap at a given force, the lower end near full contact
FLOW_ORDERS = (0.7, inf)  # and of the flow through the gap: between spots its order is seen from 0.8 to 4
# Lowest order where the pressure is singular at the edge of the contact, as of a flat punch; that of the bar of the
# area, of the edges of spots (docs/theory.md); and dofs and time grow as scale^-2, for the contact alone is refined
EDGE_ORDER, AREA_ORDER, DOFS_ORDER = 1.0, 1.5, 2.0
FIRST = 3.0  # scale of the first mesh
RATIO = 2.0  # of the first two scales
GREATEST_STEP = 3.0  # from a scale to the next: what a bar needs is known to this factor
LEAST_STEP = RATIO ** (1.0 / 3.0)  # least one from a scale to the next
LEAST_RATIO = RATIO / LEAST_STEP  # of two scales: below it scatter hides the order
MARGIN = 0.9  # part of a limit, such as the tolerance, that is planned for
STICK = "stick"  # where nodes are touched within a step (docs/theory.md)
# Order of the force in the load step, and bar over correction, which need not carry over to other meshes. Of the rule
# of first order much more is corrected. With other steps other nodes stick first, so that the order of stick is seen as
# low as 0.5 between two runs, and its correction may even have the wrong sign: 1 + (2^1.5 - 1)/(2^0.5 - 1)
STEP_RULES = {MIDPOINT: (2.0, 0.5), STICK: (1.5, 5.4), BACKWARD_EULER: (1.0, 1.0)}
MOST_SUBSTEPS = 32  # parts of a load step: each doubling is one more run of the first mesh
GROWTH = 0.4  # growth of the element size around the contact at scale 1
# Nodes in a volume h^3 and on a part h^2 of the surface: within 13 % (rms, at most 23 %) of 29 meshes of 60 to 17,000
# nodes, whose growth is from 0.1 to 1.2
NODES, NODES_OF_SURFACE = 3.1, 7.9
# Error of the area of contact over the root of the integral of h^3 along the edges, each over the area, that of the
# half-space for the latter: 0.23 to 0.30 on 21 meshes and steps of caps and grooves that yield
OPEN = 0.27
LARGEST = 0.5 * H_MAX  # greatest edge of a box [L]: a larger one would miss small spots


def shares(
    ratio: float, singular: Floats | float = 0.0, orders: tuple[float, float] = MESH_ORDERS
) -> tuple[Floats, Floats]:
    """Error of the finer of two meshes, and error bar of their limit, both over the difference of the meshes.

    Where the pressure is singular the edge of the contact falls between nodes by chance: the bar holds all from the
    first order to a finer mesh without error.

    Args:
        ratio: of their scales
        singular: part of the edges of spots where the pressure is singular (n,), see `guide.spots_of`
        orders: least and greatest order of the quantity in the scale
    """
    part = np.asarray(singular, dtype=float)
    edge, low, high = (1.0 / (ratio**p - 1.0) for p in (EDGE_ORDER, *orders))
    low, high = low + part * (edge - low), (1.0 - part) * high
    return 0.5 * (low + high), 0.5 * (low - high)


def orders_of(coarse: float) -> tuple[float, float]:
    """Range of the order of the force between the mesh of a scale and a finer one."""
    return FIRST_ORDERS if coarse > RATIO else MESH_ORDERS


def planned_order(singular: float = 0.0, flows: bool = False) -> float:
    """Order of the bar to plan with: the mean of MESH_ORDERS, that of singular pressures, see `shares`, or of scatter.

    Args:
        singular: part of the edges with a singular pressure
        flows: whether the solid yields, and most of the bar is that of the area
    """
    smooth = AREA_ORDER if flows else 0.5 * sum(MESH_ORDERS)
    return smooth + singular * (EDGE_ORDER - smooth)


def second(first: float) -> float:
    """Scale of the second mesh, by that of the first one."""
    return min(FIRST, first) / RATIO


def next_step(excess: float, order: float) -> float:
    """How much finer the next mesh is, by what its bar is to shrink by and the order with which it does.

    Rounded: the rounding of the bar differs with the ranks, and gmsh makes another mesh of any other size.
    """
    return float(np.clip(round((excess / MARGIN) ** (1.0 / order), 2), LEAST_STEP, GREATEST_STEP))


def partner(scales: Sequence[float]) -> int:
    """Place of the mesh to extrapolate the last one from: the nearest coarser by LEAST_RATIO, or the first."""
    enough = [k for k, scale in enumerate(scales[:-1]) if scale >= 0.999 * LEAST_RATIO * scales[-1]]
    return enough[-1] if enough else 0


def step_rule(problem: Problem) -> str:
    """What the error of the load steps follows, a key of STEP_RULES: the rule of plasticity, or that of stick."""
    integrator, sticks = problem.load_path.integrator or BACKWARD_EULER, problem.formulation.sticks
    return STICK if sticks and not (problem.material.plastic and integrator == BACKWARD_EULER) else integrator


def nodes_of(size: Size, height: float, most: float = inf, joined: bool = False) -> float:
    """Nodes of the block: integrals of 1/h^3 over it and of 1/h^2 over its surface, by boxes of at most 2 h.

    Args:
        size: h at (x, y, depth), in units of L
        height: of the block [L]
        most: value beyond which it is given up
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
            along = [edge / h for edge in edges if edge]
            total += (NODES if len(along) == 3 else NODES_OF_SURFACE) * prod(along)
            continue
        halves = tuple(0.5 * edge for edge in edges)
        steps = product(*((-0.5 * half, 0.5 * half) if half else (0.0,) for half in halves))
        boxes += [(tuple(map(add, centre, step)), halves) for step in steps]
    return total


def dofs_of(field: SizeField, height: float, most: float = inf) -> int:
    """Dofs of a mesh of a block, whose height is in units of L; beyond `most` they are not counted."""
    return round(3 * nodes_of(field.at, height, most / 3, field.periodic))


@dataclass(frozen=True)
class MeshFamily:
    """Meshes by their scale, the element sizes over those of the guide; in one process.

    Growth and greatest size go with the root of the scale: the surroundings are refined with the contact, or they
    would keep an error that no refinement of the contact shows.

    Attributes:
        problem: what is pressed
        guide: half-space with all waves
    """

    problem: Problem
    guide: Guide

    def first(self, most: float, made: Callable[[float], int] | None = None) -> tuple[float, int]:
        """The first mesh, with room for a second one; see `finest`. The coarsest has its greatest size everywhere."""
        return self.finest(FIRST, H_MAX / float(self.guide.sizes.min()), most / LEAST_RATIO**DOFS_ORDER, made)

    def finest(
        self, scale: float, coarsest: float, most: float, made: Callable[[float], int] | None = None
    ) -> tuple[float, int]:
        """Scale and dofs of the finest mesh that is no larger than allowed, or of the coarsest one tried.

        Args:
            scale, most: scale that is wanted, and dofs that are allowed
            coarsest: scale from which on no coarser one is tried
            made: makes a mesh of a scale and returns its dofs; None counts them by the size field
        """
        passes: list[tuple[float, Callable[[float], int]]] = [(most, lambda scale: self.dofs(scale, 4.0 * most))]
        if made is not None:  # no mesh is made that is much too large
            passes = [(1.5 * most, passes[0][1]), (most, made)]
        for allowed, dofs_at in passes:
            dofs, order = dofs_at(scale), DOFS_ORDER
            while dofs > allowed and scale < coarsest:
                finer, before = scale, dofs
                scale = min(1.02 * scale * (dofs / allowed) ** (1.0 / order), coarsest)
                dofs = dofs_at(scale)
                if dofs < before:  # of a coarse mesh most elements are elsewhere than in the contact
                    order = min(max(log(before / dofs) / log(scale / finer), 1.0), DOFS_ORDER)
        return scale, dofs

    def h(self, scale: float) -> float:
        """Greatest size of an element in the contact [length]."""
        h = self.size(scale).h_contact
        assert h is not None
        return h

    def size(self, scale: float) -> MeshSize:
        """Element sizes of a mesh; the greatest is H_MAX on the coarsest first mesh."""
        L, growth, part = self.problem.surface.L, GROWTH * scale**0.5, min(1.0, scale / FIRST)
        widest, most = H_MAX * part**0.5, H_MAX * part
        sizes = np.where(np.isfinite(self.guide.sizes), np.minimum(scale * self.guide.sizes, most), np.inf)
        h = float(sizes[np.isfinite(sizes)].max())
        return MeshSize(h * L, growth, widest * L, cells=sizes * L)

    def block(self, scale: float) -> BlockMesh:
        """Mesh of a scale."""
        field, problem = self._field(scale), self.problem
        return build_block(problem.surface, problem.height, field.at, field.periodic, problem.composite.maximum()[:2])

    def dofs(self, scale: float, most: float = inf) -> int:
        """Dofs of a mesh by its size field; beyond so many they are not counted."""
        problem = self.problem
        return dofs_of(self._field(scale), problem.height / problem.surface.L, most)

    def open_area(self, scale: float) -> float:
        """Greatest error of the area of contact over the area at three of the steps, before there is a mesh.

        It is that of `ContactSurface.area_of`: the edges cut facets of an area ~ h^2 at distances ~ h.
        """
        at, steps = self._field(scale).at, self.guide.edges()
        cut = ((length * sum(at(x, y, 0.0) ** 3 for x, y in places), area) for places, length, area in steps)
        return max((OPEN * squares**0.5 / area for squares, area in cut), default=0.0)

    @cached_property
    def _field(self) -> Callable[[float], SizeField]:
        """Size field of a scale; the last one is kept, for a mesh is counted before it is made."""
        problem, depth = self.problem, self.guide.depth
        return lru_cache(maxsize=1)(lambda scale: size_field(problem.composite, depth, self.size(scale), problem.sides))
