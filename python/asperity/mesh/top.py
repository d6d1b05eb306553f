"""The curved facets of the top of a mesh, and their heights on a regular grid."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from asperity.arrays import Floats, Indices
from asperity.mesh.element import at_inside, shares
from asperity.runtime.display import short_repr

if TYPE_CHECKING:
    from asperity.surface import Surface


@dataclass(frozen=True)
class Top:
    """Facets of the top of a block, in one process.

    Attributes:
        points: nodes (N, 3), in the plane and above the mean plane of the surface [L]
        faces: their numbers in each facet, ordered as in `element.FACES` (F, 6)
    """

    points: Floats
    faces: Indices

    __repr__ = short_repr


def heights_of_top(top: Top, surface: Surface, n: int, nodal: bool = False, tool: Surface | None = None) -> Floats:
    """Heights of the curved facets of the top, on the scale of the surface, at the centres of n x n cells.

    Args:
        tool: whose heights at the nodes are added, see `surface.composite`
        nodal: no point is higher than the nodes of its facet: the contact, which nodes meet, does not feel it

    Returns:
        Heights (n, n), index [iy, ix] [L]. They are those of `surface` at the nodes whose heights are exact.
    """
    from matplotlib.tri import Triangulation

    faces, xy = top.faces, top.points[:, :2]
    corners, numbers = np.unique(faces[:, :3], return_inverse=True)
    finder = Triangulation(xy[corners, 0], xy[corners, 1], numbers.reshape(-1, 3)).get_trifinder()
    centres = (np.arange(n) + 0.5) / n
    x, y = (c.ravel() for c in np.meshgrid(centres, centres))
    nodes = faces[np.asarray(finder(x, y))]
    inside = shares(np.column_stack([x, y]), *(xy[nodes[:, k]] for k in range(3)))
    z = top.points[:, 2] + surface.mean() / surface.L
    if tool is not None:
        z = z + tool.height(*(surface.L * xy.T)) / surface.L
    heights = at_inside(inside, z[nodes])
    return (np.minimum(heights, z[nodes].max(axis=1)) if nodal else heights).reshape(n, n)
