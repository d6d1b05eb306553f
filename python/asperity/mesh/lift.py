# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

"""Move the nodes of a flat block onto a rough surface without turning an element inside out.

Every node moves vertically to the exact height of the surface. Where elements are larger than the roughness, exact
heights of neighbouring nodes differ so much that some elements turn inside out. The nodes of these elements follow the
surface smoothed by a Gaussian whose width grows until all elements are sound. Elsewhere heights stay exact, so a
surface that its mesh resolves is not changed at all.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from asperity.arrays import Floats, Indices
from asperity.errors import MeshError
from asperity.mesh.block import NEAR, heights_at
from asperity.mesh.copies import Copies
from asperity.mesh.element import EDGES, ON_EDGES, corner_derivatives

if TYPE_CHECKING:
    from asperity.surface import Surface

SOUND = 0.1  # least ratio of the volume elements of a lifted and the flat element, at any point of it
FIRST_WIDTH = 0.1  # standard deviation of the first Gaussian over the element size
WIDER = 1.25  # ratio of the widths of two rounds
SPREAD = 0.25  # fall of the width with the distance from them, like that of the element size, so that no heights jump
SETTLED = 1e-3  # relative change of a width that is not passed on
ROUNDS = 100  # after which the width is beyond the side of any block


def lift(
    points: Floats, tets: Indices, surface: Surface, height: float, copies: Copies | None = None
) -> tuple[Floats, Floats]:
    """Lift the nodes of a flat block so that its top follows a surface; collective where several ranks hold parts.

    The map is z -> z (1 + f/height) with the height f above the mean plane, so base and sides stay plane. All top
    nodes, mid-edge nodes included, lie on the surface, or on the smoothed one.

    Args:
        points: nodes of the block with a flat top at z = height (N, 3) [length]
        tets: their numbers in the tetrahedra, in the order of gmsh (M, 10)
        surface: top of the block
        height: height of the mean plane above the base [length]
        copies: of nodes on several ranks or on joined sides

    Returns:
        Nodes of the lifted block (N, 3) [length], and the standard deviation of the Gaussian at each node, 0 where its
        height is exact (N,) [length].

    Raises:
        MeshError: a valley reaches the base, no smoothing makes the elements sound, or periodic sides do not fit
    """
    copies = copies or Copies()
    mean, gradients = surface.mean(), _vertical_gradients(points, tets)
    size, n = _sizes(points, tets, copies), len(points)
    z_of_flat = points[:, 2]
    width: Floats = np.zeros(n)
    above: Floats = np.empty(n)
    moved: npt.NDArray[np.bool_] = np.ones(n, dtype=bool)
    for _ in range(ROUNDS):
        x, y, _ = points[moved].T
        f = heights_at(surface, x, y, width[moved]) - mean
        lowest = copies.least(float(np.min(f, initial=np.inf)))
        if lowest <= -height:
            raise MeshError(
                f"block.height = {height:g} is less than the depth {-lowest:g} of the deepest valley below the mean "
                "plane: make the block higher or the surface smoother"
            )
        above[moved] = f
        apart = -copies.least(-float(np.max(copies.greatest(above) - above, initial=0.0)))
        if apart > NEAR * surface.L:
            raise MeshError(
                f'block.sides = "periodic": heights at opposite sides of the mesh differ by {apart:.3g}, because the '
                'surface is not periodic; take block.sides = "rollers"'
            )
        bad = tets[_least_stretch(gradients, np.take(z_of_flat * above / height, tets)) < SOUND]
        left = copies.count(len(bad))
        if not left:
            return np.column_stack([points[:, :2], z_of_flat * (1.0 + above / height)]), width
        wider = _widened(width, size, points, tets, bad, copies)
        moved, width = wider > width, wider
    raise MeshError(
        f"the surface is no height field on this block: {left} elements stay turned inside out, however smooth the "
        "heights at their nodes are; filter the surface"
    )


def _widened(width: Floats, size: Floats, points: Floats, tets: Indices, bad: Indices, copies: Copies) -> Floats:
    """Widths (N,) [length] of the next round: larger at the nodes of bad elements, falling with the distance."""
    wider = width.copy()
    own = np.maximum(WIDER * width[bad].max(axis=1), FIRST_WIDTH * size[bad].max(axis=1))
    np.maximum.at(wider, bad, own[:, None])
    wider = copies.greatest(wider)
    changed = wider > width
    while copies.count(int(changed.any())):
        near = tets[changed[tets].any(axis=1)]
        before = wider.copy()
        for middle, ends in enumerate(EDGES[:ON_EDGES], start=4):
            for end in ends:
                i, j = near[:, end], near[:, middle]
                fall = SPREAD * np.linalg.norm(points[i] - points[j], axis=1)
                np.maximum.at(wider, j, before[i] - fall)
                np.maximum.at(wider, i, before[j] - fall)
        wider = copies.greatest(wider)
        changed = wider > (1.0 + SETTLED) * before
    return wider


def _sizes(points: Floats, tets: Indices, copies: Copies) -> Floats:
    """Mean length of the edges that meet at each corner; mean of two corners for a mid-edge node (N,) [length]."""
    ends = tets[:, EDGES]
    lengths = np.linalg.norm(points[ends[:, :, 0]] - points[ends[:, :, 1]], axis=2)
    n = len(points)
    corners = ends.reshape(-1, 2)
    total, count = (
        copies.total(np.asarray(sum(np.bincount(corners[:, k], weights, minlength=n) for k in (0, 1)), dtype=float))
        for weights in (lengths.ravel(), np.ones(lengths.size))
    )
    size = np.divide(total, count, out=np.zeros(n), where=count > 0)
    size[tets[:, 4:]] = size[ends[:, :ON_EDGES]].mean(axis=2)
    return size


def _vertical_gradients(points: Floats, tets: Indices) -> Floats:
    """Derivatives along z of the four barycentric coordinates of straight tetrahedra (M, 4) [1/length]."""
    a = points[tets[:, 0]]
    b, c, d = (points[tets[:, k]] - a for k in (1, 2, 3))
    volume = np.einsum("ij,ij->i", b, np.cross(c, d))
    of_corners = np.stack([np.cross(p, q)[:, 2] for p, q in ((c, d), (d, b), (b, c))], axis=1) / volume[:, None]
    return np.column_stack([-of_corners.sum(axis=1), of_corners])


def _least_stretch(gradients: Floats, rise: Floats) -> Floats:
    """Least vertical stretch of each tetrahedron whose nodes rise by the given amounts (M,).

    A vertical displacement u changes volumes by the factor 1 + du/dz. For an interpolant of u of second order at most,
    this is linear in the element, so it is least at a corner.

    Args:
        gradients: see `_vertical_gradients` (M, 4) [1/length]
        rise: of the nodes (M, 10) [length]
    """
    least = np.full(len(rise), np.inf)
    for derivatives in corner_derivatives():
        slope = np.zeros(len(rise))
        for node, coordinate in np.argwhere(derivatives):
            slope += derivatives[node, coordinate] * rise[:, node] * gradients[:, coordinate]
        least = np.minimum(least, 1.0 + slope)
    return least
