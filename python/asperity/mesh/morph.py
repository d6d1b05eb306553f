"""Move the nodes of a flat block onto a rough surface without turning an element inside out.

Every node moves vertically to the exact height of the surface. Where elements are larger than the roughness, exact
heights of neighbouring nodes differ so much that some elements turn inside out. The nodes of these elements follow the
surface smoothed by a Gaussian, whose width grows to a part of the element size, and further where that is not enough.
Elsewhere heights stay exact, so a surface that its mesh resolves is not changed at all. Self-affine surfaces with an
rms slope of 1 lose up to 7 % of the approach where the flat meets them, steeper ones more: `resolution` warns of the
former and refuses the latter.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from asperity.arrays import Floats, Indices
from asperity.errors import MeshError
from asperity.mesh.block import NEAR, heights_at
from asperity.mesh.element import EDGES, ON_EDGES, corner_derivatives
from asperity.mesh.shared_nodes import greatest, total

if TYPE_CHECKING:
    from asperity.surface import Surface

SOUND = 0.1  # least ratio of the volume elements of a lifted and the flat element, at any point of it
# width of the first Gaussian over the element size; ratio of the widths of two rounds, and of two limits
FIRST_WIDTH, WIDER = 0.1, 1.25
# fall of the width per distance from such elements; relative change that is not passed on
SPREAD, SETTLED = 0.4, 1e-3
WIDEST = 0.2  # greatest width over the element size, until it does not help; most of the summits stay exact
ROUNDS = 300  # of widening, after which the surface is refused


def lift(
    points: Floats, tets: Indices, surface: Surface, height: float, same: Indices | None = None
) -> tuple[Floats, Floats]:
    """Lift the nodes of a flat block so that its top follows a surface.

    The map is z -> z (1 + f/height) with the height f above the mean plane, so base and sides stay plane. All top
    nodes, mid-edge nodes included, lie on the surface, or on the smoothed one.

    Args:
        points: nodes of the block with a flat top at z = height (N, 3) [length]
        tets: their numbers in the tetrahedra, in the order of gmsh (M, 10)
        height: height of the mean plane above the base [length]
        same: number that the copies of a node on joined sides have in common (N,)

    Returns:
        Nodes of the lifted block (N, 3) [length], and the standard deviation of the Gaussian at each node, 0 where its
        height is exact (N,) [length]

    Raises:
        MeshError: a valley reaches the base, no smoothing makes the elements sound, or periodic sides do not fit
    """
    gradients, size = _vertical_gradients(points, tets), _sizes(points, tets, same)
    width: Floats = np.zeros(len(points))
    rise, limit = _rise(points, width, surface, height), WIDEST
    for _ in range(ROUNDS):
        _check_joined(rise, surface.L, same)
        bad = tets[_least_stretch(gradients, rise[tets]) < SOUND]
        if not len(bad):
            return points + rise[:, None] * [0.0, 0.0, 1.0], width
        wider = np.maximum(width, np.minimum(_widened(width, size, points, tets, bad, same), limit * size))
        moved = wider > (1.0 + SETTLED) * width
        if not moved[bad].any():
            limit *= WIDER
            continue
        width[moved] = wider[moved]
        rise[moved] = _rise(points[moved], width[moved], surface, height)
    raise MeshError(
        f"the surface is no height field on this block: {len(bad)} elements stay turned inside out, however smooth the "
        "heights at their nodes are; filter the surface"
    )


def _rise(points: Floats, width: Floats, surface: Surface, height: float) -> Floats:
    """Rise (n,) [length] of some nodes of the flat block, in proportion to the smoothed surface above."""
    x, y, z_of_flat = points.T
    above = heights_at(surface, x, y, width) - surface.mean()
    lowest = float(above.min(initial=np.inf))
    if lowest <= -height:
        raise MeshError(
            f"block.height = {height:g} is less than the depth {-lowest:g} of the deepest valley below the mean "
            "plane: make the block higher or the surface smoother"
        )
    return np.asarray(z_of_flat * above / height)


def _check_joined(rise: Floats, L: float, same: Indices | None) -> None:
    """Refuse copies of a node that do not rise alike (MeshError)."""
    apart = float(np.max(greatest(rise, same) - rise))
    if apart > NEAR * L:
        raise MeshError(
            f'block.sides = "periodic": heights at opposite sides of the mesh differ by {apart:.3g}, because the '
            'surface is not periodic; take block.sides = "rollers"'
        )


def _widened(width: Floats, size: Floats, points: Floats, tets: Indices, bad: Indices, same: Indices | None) -> Floats:
    """Widths (N,) [length] of the next round: larger at the nodes of bad elements, falling with the distance."""
    wider = width.copy()
    own = np.maximum(WIDER * width[bad].max(axis=1), FIRST_WIDTH * size[bad].max(axis=1))
    np.maximum.at(wider, bad, own[:, None])
    wider = greatest(wider, same)
    changed = wider > width
    while changed.any():
        near = tets[changed[tets].any(axis=1)]
        before = wider.copy()
        for middle, ends in enumerate(EDGES[:ON_EDGES], start=4):
            for end in ends:
                i, j = near[:, end], near[:, middle]
                fall = SPREAD * np.linalg.norm(points[i] - points[j], axis=1)
                np.maximum.at(wider, j, before[i] - fall)
                np.maximum.at(wider, i, before[j] - fall)
        wider = greatest(wider, same)
        changed = wider > (1.0 + SETTLED) * before
    return wider


def _sizes(points: Floats, tets: Indices, same: Indices | None) -> Floats:
    """Mean length of the edges that meet at each corner; mean of two corners for a mid-edge node (N,) [length]."""
    ends = tets[:, EDGES]
    lengths = np.linalg.norm(points[ends[:, :, 0]] - points[ends[:, :, 1]], axis=2)
    n = len(points)
    corners = ends.reshape(-1, 2)
    whole, count = (
        total(np.asarray(sum(np.bincount(corners[:, k], weights, minlength=n) for k in (0, 1)), dtype=float), same)
        for weights in (lengths.ravel(), np.ones(lengths.size))
    )
    size = np.divide(whole, count, out=np.zeros(n), where=count > 0)
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
    """Least vertical stretch 1 + du/dz of tetrahedra whose nodes rise by u (M,): linear, so least at a corner."""
    least = np.full(len(rise), np.inf)
    for derivatives in corner_derivatives():
        slope = np.zeros(len(rise))
        for node, coordinate in np.argwhere(derivatives):
            slope += derivatives[node, coordinate] * rise[:, node] * gradients[:, coordinate]
        least = np.minimum(least, 1.0 + slope)
    return least
