"""Fields of the top of a solid on a regular grid."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from asperity.arrays import Array
from asperity.mesh.element import at_inside, shares

PIXELS = 400  # of a map, along each side
OPEN = 1e-12  # least gap out of contact over the side


class Raster:
    """Values at the nodes of the top, at the middles of n x n equal squares; index [iy, ix].

    Attributes:
        top: arrays of top.npz
        box: lower and upper corner of what the squares cover, by default the patch (2, 2) [length]
        edge_nodes: node on the edge of a facet whose third each square lies in (n, n)
    """

    def __init__(self, top: Any, box: Array | None = None, n: int = PIXELS) -> None:
        from matplotlib.tri import Triangulation

        points, triangles = top["points"], top["triangles"]
        self.top, self.box = top, np.array([points.min(axis=0), points.max(axis=0)]) if box is None else box
        mesh = Triangulation(points[:, 0], points[:, 1], triangles)
        middles = (np.arange(n) + 0.5) / n
        at = np.meshgrid(*(low + middles * (high - low) for low, high in self.box.T))
        found: Any = mesh.get_trifinder()(*at)
        self._at, self._facets = np.stack(at, axis=-1), found % (len(triangles) // 4)
        self._nodes = triangles[found]
        self._shares = shares(self._at, *np.moveaxis(points[self._nodes], 2, 0))
        # of four triangles of a facet three begin at a corner, see `element.FACE_TRIANGLES`
        at_corner = (np.arange(3) == 0) & (found < 3 * len(triangles) // 4)[..., None]
        nearest = np.where(at_corner, -np.inf, self._shares).argmax(axis=-1)[..., None]
        self.edge_nodes = np.take_along_axis(self._nodes, nearest, axis=-1)[..., 0]

    def __call__(self, values: Array) -> Array:
        """Values that are linear in the triangles between the nodes."""
        return np.asarray((values[self._nodes] * self._shares).sum(axis=-1))

    def touching(self, i: int) -> NDArray[np.bool_]:
        """Where a snapshot is in contact: the touched thirds of facets, whose patches are the spots that count."""
        return np.asarray(self.top["touched"][i][self.edge_nodes], dtype=bool)

    def pressure(self, i: int) -> Array:
        """Pressure of a snapshot, NaN out of contact."""
        return np.where(self.touching(i), self(self.top["pressure"][i]), np.nan)

    def gap(self, i: int) -> Array:
        """Gap of a snapshot, of second order in the facets, 0 in contact and there alone [length]."""
        corners, edges = facets(self.top)
        inside = shares(self._at, *self.top["points"][corners[:, self._facets]])
        nodes = np.concatenate([corners, edges])[:, self._facets.ravel()].T
        values = at_inside(inside.reshape(-1, 3), self.top["gap"][i][nodes]).reshape(self._facets.shape)
        return np.where(self.touching(i), 0.0, np.maximum(values, OPEN * np.ptp(self.box[:, 0])))


def facets(top: Any) -> tuple[NDArray[Any], NDArray[Any]]:
    """Corners (3, facets) of the facets of a top, and the nodes on the edges that begin at them."""
    thirds = top["triangles"][: 3 * len(top["triangles"]) // 4].reshape(3, -1, 3)  # see `element.FACE_TRIANGLES`
    return thirds[..., 0], thirds[..., 1]
