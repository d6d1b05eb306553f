"""Heights of the top of a mesh on a regular grid."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from asperity.arrays import Floats
from asperity.mesh.block import NEAR, BlockMesh
from asperity.mesh.element import cross, face_functions, outer_faces

if TYPE_CHECKING:
    from asperity.surface import Surface


def heights_of_top(block: BlockMesh, surface: Surface, n: int) -> Floats:
    """Heights of the curved facets of the top, on the scale of the surface, at the centres of n x n cells.

    Args:
        block: mesh of the block
        surface: the top it was made for
        n: cells per side

    Returns:
        Heights (n, n), index [iy, ix] [L]. They are those of `surface` at the nodes whose heights are exact.
    """
    from matplotlib.tri import Triangulation

    L = block.side
    on_top = np.abs(block.heights(surface) - block.points[:, 2]) < NEAR * L
    faces = outer_faces(block.tets)
    faces = faces[on_top[faces].all(axis=1)]
    corners, numbers = np.unique(faces[:, :3], return_inverse=True)
    xy = block.points[:, :2] / L
    finder = Triangulation(xy[corners, 0], xy[corners, 1], numbers.reshape(-1, 3)).get_trifinder()
    centres = (np.arange(n) + 0.5) / n
    x, y = (c.ravel() for c in np.meshgrid(centres, centres))
    nodes = faces[np.asarray(finder(x, y))]
    a, b, c = (xy[nodes[:, k]] for k in range(3))
    p = np.column_stack([x, y])
    area = cross(b - a, c - a)
    second, third = cross(p - a, c - a) / area, cross(b - a, p - a) / area
    first = 1.0 - second - third
    z = (block.points[:, 2] - block.height + surface.mean()) / L
    parts = (face_functions(np.column_stack([first, second, third])) * z[nodes]).T
    return np.asarray(sum(parts[:3]) + sum(parts[3:])).reshape(n, n)
