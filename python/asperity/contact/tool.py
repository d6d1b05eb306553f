"""The rigid body above the solid, in the units of the solver."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from asperity.arrays import Flags, Floats
from asperity.surface import Surface

TIP, AROUND = 0.01, 0.25  # fall of the heights around a tip over their distance; that over the distance of the nodes


@dataclass(frozen=True)
class Tool:
    """Heights of a rigid body, towards the solid, at points in units of L.

    Attributes:
        surface: with these heights [length]
        periodic: whether a point beyond the patch is the one a period away; otherwise that on the edge counts
    """

    surface: Surface
    periodic: bool = False

    def _at(self, points: Floats) -> Floats:
        inside = points % 1.0 if self.periodic else np.clip(points, 0.0, 1.0)
        return np.asarray(self.surface.L * inside.T)

    def height(self, points: Floats) -> Floats:
        """Heights at points (n, 2) [L]: (n,) [L]."""
        return np.asarray(self.surface.height(*self._at(points)) / self.surface.L)

    def shape(self, points: Floats) -> tuple[Floats, Floats]:
        """Slopes and second derivatives at points (n, 2) [L]: (n, 2), (n, 2, 2) [1/L]."""
        at = self._at(points)
        xx, xy, yy = self.surface.hessian(*at)
        curvature = self.surface.L * np.stack([xx, xy, xy, yy], axis=-1).reshape(-1, 2, 2)
        return np.stack(self.surface.gradient(*at), axis=-1), curvature

    def tips(self, points: Floats, spacing: Floats) -> Flags:
        """Whether the heights fall on all sides of points (n, 2) [L], within the `spacing` of nodes (n,) [L]."""
        ring = AROUND * spacing[:, None, None] * np.concatenate([np.eye(2), -np.eye(2)])
        around = self.height((points[:, None] + ring).reshape(-1, 2)).reshape(-1, 4).max(axis=1)
        return np.asarray(self.height(points) - around > TIP * AROUND * spacing)
