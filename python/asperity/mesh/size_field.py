"""Element sizes of the block: fine where the flat touches the surface, growing with the distance from there."""

from __future__ import annotations

from dataclasses import dataclass
from math import hypot
from typing import TYPE_CHECKING

import numpy as np
from scipy.ndimage import distance_transform_edt
from scipy.spatial import cKDTree

from asperity.arrays import Floats
from asperity.mesh.block import H_MAX

if TYPE_CHECKING:
    from asperity.surface import Surface

FLAT = 1e-12  # difference of depths below which a surface counts as touched at once [L]
#: Exponent of the size in the depth, and least size over h_contact. A spot grows with the root of the depth; where it
#: is known what was touched when, more makes the errors of the steps of a rough surface alike (docs/accuracy.md).
GRADING, GUIDED = (0.5, 0.2), (0.75, 0.15)
NEIGHBOURS = 6  # corners and edges of a facet: a margin of an element around what was touched


@dataclass(frozen=True)
class FirstContactMap:
    """What a coarse solution touched: it tells a fine mesh better than the geometry where to be fine.

    Attributes:
        xy: positions of the top nodes (N, 2) [length]
        touched_at: deflection that first touched each of them, inf for never (N,) [length]
    """

    xy: Floats
    touched_at: Floats

    def depth(self, x: Floats, y: Floats) -> Floats:
        """Deflection that touches each point, the least of its NEIGHBOURS nearest nodes [length]."""
        _, nearest = cKDTree(self.xy).query(np.stack([x.ravel(), y.ravel()], axis=1), k=NEIGHBOURS)
        return self.touched_at[nearest].min(axis=1).reshape(x.shape)


@dataclass(frozen=True)
class SizeField:
    """Element size around the part of a surface that a flat reaches.

    On the surface the size is h_contact (gap/delta_max)^p, gap being the depth below the summit: a
    contact spot that has just been touched is small, so the summit needs the finest elements, while what is touched
    last only has to be as fine as h_contact. It is kept between `h_min` and h_contact there and grows by `growth` per
    unit of distance elsewhere, up to h_max.

    All lengths are in units of L and free of the round-off of other units: gmsh makes another mesh of a size that
    differs in the last digit, and the curve of a case shall not depend on whether it is in metres or micrometres.

    Attributes:
        levels: sizes on the surface, ascending (K,) [L]
        distances: horizontal distance of each node of a regular grid from where a level applies, row along y,
            column along x (n, n, K) [L]
        window: x0, y0 and side of the square the grid covers; it holds all that is reached [L]
        growth: increase of size per unit of distance
        h_max: greatest size [L]
    """

    levels: Floats
    distances: Floats
    window: tuple[float, float, float]
    growth: float
    h_max: float

    @staticmethod
    def of(
        surface: Surface,
        delta_max: float,
        h_contact: float,
        h_min: float | None = None,
        growth: float = 0.25,
        h_max: float | None = None,
        first_contact: FirstContactMap | None = None,
        grading: tuple[float, float] | None = None,
        levels: int = 8,
        grid: int = 257,
    ) -> SizeField:
        """Build the field for a flat that moves by `delta_max` from first touch.

        The sizes are given as lengths like those of the surface. With a `reach` the deflection that touched a point
        takes the place of its depth below the summit, which is only the least deflection that can touch it. The
        `grading` is the power p and the least size over h_contact: GRADING, or GUIDED with a reach.
        """
        L = surface.L
        delta_max, h_contact = rounded(delta_max / L), rounded(h_contact / L)
        x0, y0, side, gap = _reached_window(surface, delta_max, grid)
        if first_contact is not None:
            t = np.linspace(0.0, side, grid)
            gap = np.maximum(gap, first_contact.depth(*np.meshgrid((x0 + t) * L, (y0 + t) * L)) / L)
        at_once = float(gap.max() - gap.min()) <= FLAT  # there is no small spot
        power, least = grading or (GRADING if first_contact is None else GUIDED)
        if h_min is None:  # what a reach tells of the first spots ends with the first step of the guide
            h_min = h_contact * (1.0 if at_once else min(max(least, (float(gap.min()) / delta_max) ** power), 1.0))
        else:
            h_min = min(rounded(h_min / L), h_contact)
        sizes = np.linspace(h_min ** (1.0 / power), h_contact ** (1.0 / power), levels) ** power
        spacing = side / (grid - 1)
        distances = np.empty((grid, grid, levels))
        for k, size in enumerate(sizes):
            reached = gap <= _just_above(max((size / h_contact) ** (1.0 / power) * delta_max, float(gap.min())))
            distances[:, :, k] = distance_transform_edt(~reached) * spacing
        greatest = H_MAX if h_max is None else rounded(h_max / L)
        return SizeField(sizes, distances, (x0, y0, side), growth, greatest)

    def at(self, x: float, y: float, depth: float) -> float:
        """Size at a point `depth` below the mean plane of the top, all in units of L."""
        x0, y0, side = self.window
        inside_x = min(max(x, x0), x0 + side)
        inside_y = min(max(y, y0), y0 + side)
        scale = (self.distances.shape[0] - 1) / side
        d = self.distances[round((inside_y - y0) * scale), round((inside_x - x0) * scale)]
        d = d + hypot(x - inside_x, y - inside_y)
        size = float(np.min(self.levels + self.growth * np.sqrt(d * d + depth * depth)))
        return min(size, self.h_max)


def _reached_window(surface: Surface, delta_max: float, grid: int) -> tuple[float, float, float, Floats]:
    """Square (x0, y0, side) around all that lies less than delta_max below the summit, and gaps on its grid.

    The square shrinks until what is reached spans a good part of it, so that a small spot is resolved too. All
    lengths are in units of L.
    """
    L, summit = surface.L, surface.maximum()[2]
    x0, y0, side = 0.0, 0.0, 1.0
    while True:
        t = np.linspace(0.0, side, grid)
        height = surface.height((x0 + t[None, :]) * L, (y0 + t[:, None]) * L)
        gap: Floats = np.asarray((summit - height) / L, dtype=np.float64)
        rows, columns = np.nonzero(gap <= _just_above(max(delta_max, float(gap.min()))))
        low = np.maximum(np.array([columns.min(), rows.min()]) - 2, 0)
        high = np.minimum(np.array([columns.max(), rows.max()]) + 2, grid - 1)
        width = int(np.max(high - low))
        if width > grid // 4:
            return x0, y0, side, gap
        spacing = side / (grid - 1)
        low = np.minimum(low, grid - 1 - width)
        x0, y0, side = x0 + low[0] * spacing, y0 + low[1] * spacing, width * spacing


def rounded(value: float) -> float:
    """The value without the last digits, where the round-off of a change of units is."""
    return float(f"{value:.12g}")


def _just_above(limit: float) -> float:
    """A limit that values equal but for round-off do not exceed."""
    return limit * (1.0 + 1e-9) + 1e-15
