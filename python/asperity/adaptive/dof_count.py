"""Degrees of freedom of a mesh from its size field, before there is a mesh."""

from __future__ import annotations

from collections.abc import Callable
from itertools import product
from math import inf, log, prod
from operator import add

from asperity.adaptive.mesh_plan import DOFS_ORDER
from asperity.mesh.size_field import SizeField
from asperity.model.settings import H_MAX

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
