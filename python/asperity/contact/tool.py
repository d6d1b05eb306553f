"""The rigid body above the solid, in the units of the solver."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from asperity.arrays import Floats
from asperity.surface import Surface

SHARP = 1.0  # change of the slope from node to node at a tip that they do not follow
BLUNT = 0.25  # radius of what is blunt there, over the distance of the nodes


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

    def shape(self, points: Floats, spacing: Floats) -> tuple[Floats, Floats, Floats]:
        """Heights at points (n, 2) [L], slopes, and second derivatives: (n,) [L], (n, 2), (n, 2, 2) [1/L].

        A tip that is sharper than the `spacing` of the nodes (n,) [L] is blunt for the node below it, which would be
        sent from one flank to the other: it has the mean of four points around.
        """
        height, slope, curvature = found = self._shape(points)
        sharp = np.flatnonzero(np.abs(curvature).max(axis=(1, 2), initial=0.0) * spacing > SHARP)
        ring = BLUNT * spacing[sharp, None, None] * np.concatenate([np.eye(2), -np.eye(2)])
        around = self._shape((points[sharp, None] + ring).reshape(-1, 2))
        for whole, part in zip(found, around, strict=True):
            whole[sharp] = part.reshape(-1, 4, *part.shape[1:]).mean(axis=1)
        return height, slope, curvature

    def _shape(self, points: Floats) -> tuple[Floats, Floats, Floats]:
        at = self._at(points)
        xx, xy, yy = self.surface.hessian(*at)
        curvature = self.surface.L * np.stack([xx, xy, xy, yy], axis=-1).reshape(-1, 2, 2)
        return self.height(points), np.stack(self.surface.gradient(*at), axis=-1), curvature
