"""Element sizes of the block: fine where the flat touches the surface, growing with the distance from there."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from asperity.arrays import Flags, Floats, Integers
from asperity.model.settings import H_CONTACT, H_MAX, WIDEST_JOINED, MeshSize
from asperity.runtime.compiled import solver as _solver
from asperity.surface.base import FLAT

if TYPE_CHECKING:
    from asperity.surface import Surface

POWER, LEAST = 0.5, 0.2  # of the size in the depth, for a spot grows with its root; least size over h_contact
GRID = 257  # nodes per side of the grid on which the region of each size is found
GRADED = 8  # different sizes around a summit
LAYER = 1.0  # depth of the elements of the size wanted by cells, over that size
LEVELS = 10  # different sizes on cells: with geometric steps each is within a few per cent of what a cell wants


@dataclass(frozen=True)
class SizeField:
    """Element size around the part of a surface that touches the flat.

    On that part the size is h_contact (gap/delta_max)^(1/2), gap being the depth below the summit. A contact spot that
    has just formed is small, so the summit needs the finest elements, and the points that touch last need h_contact.
    It has a lower limit. Elsewhere the size grows by `growth` per unit of distance, up to h_max; on cells it begins to
    grow `layer` of these sizes away, for large elements below place the edge of the contact too far inside.

    All lengths are in units of L and rounded: gmsh generates a different mesh if a size differs in the last digit, and
    the curve of a case must not depend on whether its lengths are in metres or micrometres.

    Attributes:
        sizes: sizes on the surface, ascending (K,) [L]
        distances: horizontal distance of each node of a regular grid from the region of each size, row along y,
            column along x (n, n, K) [L]
        window: x0, y0 and side of the square covered by the grid; it contains all points that touch [L]
        growth: increase of size per unit of distance
        h_max: greatest size [L]
        periodic: whether distances pass through the sides
        layer: distance from where the size is wanted up to which it does not grow, over the size

    Examples:
        >>> sphere = asp.Surface.from_spec("sphere", L=1.0, radius=1.0)
        >>> field = SizeField.of(sphere, delta_max=0.01, h_contact=0.04)
        >>> round(field.at(0.5, 0.5, 0.0), 4), round(field.at(0.0, 0.0, 0.0), 4)
        (0.008, 0.1779)
    """

    sizes: Floats
    distances: Floats
    window: tuple[float, float, float]
    growth: float
    h_max: float
    periodic: bool = False
    layer: float = 0.0

    @staticmethod
    def of(
        surface: Surface,
        delta_max: float,
        h_contact: float,
        growth: float = 0.25,
        h_max: float | None = None,
        periodic: bool = False,
    ) -> SizeField:
        """Build the field for a flat that moves by `delta_max` from first contact.

        Args:
            delta_max: greatest approach [length]
            h_contact: size at the points that touch last [length]
            h_max: greatest size [length]; default H_MAX, and WIDEST_JOINED at most with periodic sides
            periodic: whether the sides of the block are
        """
        L = surface.L
        delta_max, h_contact = rounded(delta_max / L), rounded(h_contact / L)
        x0, y0, side, gap = _contact_window(surface, delta_max)
        at_once = float(gap.max() - gap.min()) <= FLAT  # no small contact spot
        h_min = h_contact * (1.0 if at_once else min(max(LEAST, (float(gap.min()) / delta_max) ** POWER), 1.0))
        sizes = np.linspace(h_min ** (1.0 / POWER), h_contact ** (1.0 / POWER), GRADED) ** POWER
        spacing = side / (GRID - 1)
        distances = np.empty((GRID, GRID, GRADED))
        for k, size in enumerate(sizes):
            reached = gap <= _just_above(max((size / h_contact) ** (1.0 / POWER) * delta_max, float(gap.min())))
            distances[:, :, k] = _distances(reached, periodic and side == 1.0) * spacing
        greatest = H_MAX if h_max is None else rounded(h_max / L)
        if periodic:
            greatest = min(greatest, WIDEST_JOINED)
        return SizeField(sizes, distances, (x0, y0, side), growth, greatest, periodic)

    @staticmethod
    def on_cells(sizes: Floats, growth: float, h_max: float | None = None, periodic: bool = False) -> SizeField:
        """Build the field from sizes at the cells of a regular grid on the patch.

        Args:
            sizes: of each cell, inf where none is wanted (n, n), index [iy, ix], in L
            h_max: greatest size [L]
            periodic: see `of`, for the default of `h_max` too
        """
        from scipy.ndimage import minimum_filter  # here, for it is 10 MiB, and only rank 0 makes a mesh

        n = len(sizes)
        greatest = min(H_MAX if h_max is None else h_max, WIDEST_JOINED if periodic else np.inf)
        grid = max(n + 1, GRID)
        cells = np.minimum((np.linspace(0.0, 1.0, grid) * n).astype(int), n - 1)
        near = minimum_filter(sizes, size=3, mode="wrap" if periodic else "nearest")[np.ix_(cells, cells)]
        wanted = np.isfinite(near)
        near = np.minimum(near, greatest)
        least, most = rounded(float(near.min())), rounded(float(near[wanted].max(initial=0.0)))
        levels: Floats = np.geomspace(least, max(most, least), LEVELS).astype(float)
        distances = np.empty((grid, grid, LEVELS))
        for k, size in enumerate(levels):
            distances[:, :, k] = _distances(wanted & (near <= _just_above(float(size))), periodic) / (grid - 1)
        return SizeField(levels, distances, (0.0, 0.0, 1.0), growth, greatest, periodic, LAYER)

    @cached_property
    def at(self) -> Callable[[float, float, float], float]:
        """Size [L] at (x, y) and a depth below the mean plane of the top [L]; compiled, since gmsh calls it often."""
        arrays = self.sizes, self.distances, self.window
        return _solver.SizeField(*arrays, self.growth, self.layer, self.h_max, self.periodic).at


def size_field(surface: Surface, delta_max: float, size: MeshSize, sides: str) -> SizeField:
    """Element sizes of a block for an approach [length]."""
    periodic = sides == "periodic"
    if size.cells is not None:
        most = None if size.h_max is None else size.h_max / surface.L
        return SizeField.on_cells(np.asarray(size.cells / surface.L), size.growth, most, periodic)
    h = H_CONTACT * surface.L if size.h_contact is None else size.h_contact
    return SizeField.of(surface, delta_max, h, size.growth, size.h_max, periodic)


def _distances(reached: Flags, periodic: bool) -> Floats:
    """Distance of each node (n, n) of a grid, periodic or not, from those that are reached, in spacings of the grid."""
    from scipy.ndimage import distance_transform_edt

    n = len(reached)
    margin = n // 2 if periodic else 0
    if periodic:
        reached = np.pad(reached[:-1, :-1], (margin, margin + 1), mode="wrap")
    nearest: Integers = distance_transform_edt(~reached, return_distances=False, return_indices=True)
    here = slice(margin, margin + n)
    down, along = nearest[0, here, here], nearest[1, here, here]
    place = np.arange(margin, margin + n)
    return np.asarray(np.sqrt((down - place[:, None]) ** 2 + (along - place) ** 2))


def _contact_window(surface: Surface, delta_max: float) -> tuple[float, float, float, Floats]:
    """Square (x0, y0, side) [L] around all points less than delta_max below the summit, and gaps (n, n) on its grid.

    It shrinks until these points span more than a quarter of it, so that a small spot is resolved too.
    """
    L, summit = surface.L, surface.maximum()[2]
    x0, y0, side = 0.0, 0.0, 1.0
    while True:
        t = np.linspace(0.0, side, GRID)
        height = surface.on_product((x0 + t) * L, (y0 + t) * L)
        gap: Floats = np.asarray((summit - height) / L, dtype=np.float64)
        rows, columns = np.nonzero(gap <= _just_above(max(delta_max, float(gap.min()))))
        low = np.maximum(np.array([columns.min(), rows.min()]) - 2, 0)
        high = np.minimum(np.array([columns.max(), rows.max()]) + 2, GRID - 1)
        width = int(np.max(high - low))
        if width > GRID // 4:
            return x0, y0, side, gap
        spacing = side / (GRID - 1)
        low = np.minimum(low, GRID - 1 - width)
        x0, y0, side = x0 + low[0] * spacing, y0 + low[1] * spacing, width * spacing


def rounded(value: float) -> float:
    """Round off the last digits, which depend on the unit of length."""
    return float(f"{value:.12g}")


def _just_above(limit: float) -> float:
    """Limit increased by the round-off of the values compared with it."""
    return limit * (1.0 + 1e-9) + 1e-15
