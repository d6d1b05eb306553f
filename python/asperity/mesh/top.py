# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

"""Heights of the top of a mesh on a regular grid, and their mean."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from asperity.arrays import Floats, Indices
from asperity.mesh.block import NEAR, BlockMesh
from asperity.mesh.element import BEARING, cross, face_functions, outer_faces

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
    faces = _faces_of_top(block, surface)
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


def mean_plane(block: BlockMesh, surface: Surface) -> float:
    """Height of the mean plane of the facets of the top above that of the surface [length].

    Facets that miss waves have another mean height than the surface; that of the summit is exact.

    Args:
        block: mesh of the block
        surface: the top it was made for

    Examples:
        >>> from asperity.mesh.generate import build_block
        >>> wave = asp.Surface.from_spec("sinusoid", L=1.0, amplitude=0.01)
        >>> block = build_block(wave, 0.5, lambda x, y, depth: 0.2)
        >>> abs(mean_plane(block, wave)) < 1e-3
        True
    """
    faces = _faces_of_top(block, surface)
    xy, z = block.points[:, :2], block.points[:, 2]
    a, b, c = (xy[faces[:, k]] for k in range(3))
    area = np.abs(cross(b - a, c - a))
    # exact where the edges are straight in the plan: the weights of the integral of a facet
    return float(area @ z[faces[:, BEARING]].mean(axis=1) / area.sum()) - block.height


def _faces_of_top(block: BlockMesh, surface: Surface) -> Indices:
    """Nodes of the facets of the top (F, 6), corners first."""
    on_top = np.abs(block.heights(surface) - block.points[:, 2]) < NEAR * block.side
    faces = outer_faces(block.tets)
    return faces[on_top[faces].all(axis=1)]
