# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

"""Degrees of freedom of a mesh from its size field, before there is a mesh."""

from __future__ import annotations

from collections.abc import Callable
from math import inf

from asperity.mesh.size_field import SizeField

Size = Callable[[float, float, float], float]

# Nodes in a volume h^3: the first for equal elements, the second times mesh.growth, because a mesh cannot be graded as
# fast as a field may ask; from 15 meshes, within 15 %
NODES, NODES_OF_GROWTH = 4.5, 19.0


def dofs_of(field: SizeField, refinements: int, height: float, most: float = inf) -> int:
    """Dofs of a mesh.

    Args:
        field: sizes of its elements
        refinements: see `MeshSize`
        height: of the block [L]
        most: number beyond which they are not counted
    """
    field = field.coarser(refinements)
    nodes = 8**refinements * (NODES + NODES_OF_GROWTH * field.growth)
    return round(3 * nodes * integral(field.compiled().at, height, most / (3 * nodes)))


def integral(size: Size, height: float, most: float = inf) -> float:
    """Integral of 1/h^3 over the block, by cubes of at most 2 h.

    Args:
        size: h at (x, y, depth), in units of L
        height: of the block [L]
        most: value beyond which it is given up
    """
    total = 0.0
    layers = max(round(8 * height), 1)
    edges = (1 / 8, 1 / 8, height / layers)
    todo = [((i + 0.5) / 8, (j + 0.5) / 8, (k + 0.5) * edges[2], edges)
            for i in range(8) for j in range(8) for k in range(layers)]  # fmt: skip
    while todo and total <= most:
        x, y, z, (a, b, c) = todo.pop()
        h = size(x, y, z)
        if max(a, b, c) <= 2.0 * h:
            total += a * b * c / h**3
            continue
        todo += [(x + sx * a / 4, y + sy * b / 4, z + sz * c / 4, (a / 2, b / 2, c / 2))
                 for sx in (-1, 1) for sy in (-1, 1) for sz in (-1, 1)]  # fmt: skip
    return total
