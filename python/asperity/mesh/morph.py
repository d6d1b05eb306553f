"""Move the nodes of a flat block onto a rough surface without turning an element inside out.

Every node moves vertically to the exact height of the surface. Where elements are larger than the roughness, exact
heights of neighbouring nodes differ so much that some elements turn inside out. The nodes of these elements follow the
surface smoothed by a Gaussian, whose width grows to a part of the element size. What is still not sound then are some
elements of steep places, and nodes inside the block leave their columns for them: the least stretch of an element is
linear in the heights of its nodes, so these are the inequalities of Agmon's relaxation method (Can. J. Math. 6 (1954)
382; Motzkin & Schoenberg, ibid. 393), taken all at once. Only where no such heights are found may the width
grow further, because a wide Gaussian whose width differs from place to place stretches a steep surface itself.
Elsewhere heights stay exact, so a surface that its mesh resolves is not changed at all.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from asperity.arrays import Flags, Floats, Indices
from asperity.errors import MeshError
from asperity.mesh.block import NEAR, heights_at
from asperity.mesh.element import EDGES, ON_EDGES, corner_derivatives
from asperity.mesh.shared_nodes import greatest, total

if TYPE_CHECKING:
    from asperity.surface import Surface

SOUND = 0.1  # least ratio of the volume elements of a lifted and the flat element, at any point of it
# standard deviation of the first Gaussian over the element size; ratio of the widths of two rounds, and of two limits
FIRST_WIDTH, WIDER = 0.1, 1.25
# fall of the width per distance from such elements; relative change that is not passed on
SPREAD, SETTLED = 0.4, 1e-3
WIDEST = 0.2  # greatest width over the element size, before nodes inside have moved; most of the summits stay exact
LIMITS = 45  # number of such limits, each WIDER times the one before, until they are beyond the side of any block
SWEEPS, TRIED = 60, 20  # of the nodes inside for each; until half of the elements must have become sound
OVERSHOOT, AIM = 1.5, 0.2  # of a step over the one that satisfies an inequality; least stretch aimed at
FREE = np.inf  # width at nodes inside that have left their columns


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
        height is exact, FREE where a node inside has moved on its own (N,) [length]

    Raises:
        MeshError: a valley reaches the base, no smoothing makes the elements sound, or periodic sides do not fit
    """
    gradients, size = _vertical_gradients(points, tets), _sizes(points, tets, same)
    width: Floats = np.zeros(len(points))
    free: Flags = np.zeros(len(points), dtype=bool)
    rise = _rise(points, width, surface, height)
    limit = WIDEST
    for _ in range(LIMITS):
        while True:
            _check_joined(rise, surface.L, same)
            bad = tets[_least_stretch(gradients, rise[tets]) < SOUND]
            if not len(bad):
                return points + rise[:, None] * [0.0, 0.0, 1.0], np.where(free, FREE, width)
            wider = np.maximum(width, np.minimum(_widened(width, size, points, tets, bad, same), limit * size))
            moved = wider > (1.0 + SETTLED) * width
            if not moved[bad].any():
                break
            width[moved] = wider[moved]
            rise[moved] = _rise(points[moved], width[moved], surface, height)
            free[moved] = False
        free |= _relax(rise, points, tets, gradients, height, same)
        limit *= WIDER
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


def _relax(
    rise: Floats, points: Floats, tets: Indices, gradients: Floats, height: float, same: Indices | None
) -> Flags:
    """Change `rise` (N,) inside until elements are sound or it hardly helps; which nodes have moved (N,).

    A stretch below SOUND breaks an inequality of the rises of its nodes. The step to AIM along its gradient is the
    shortest; each node takes the mean of its steps.
    """
    n = len(points)
    free = (points[:, 2] > NEAR * height) & (points[:, 2] < (1.0 - NEAR) * height)
    moved: Flags = np.zeros(n, dtype=bool)
    near: Flags = np.asarray(_least_stretch(gradients, rise[tets]) < SOUND)
    derivatives = corner_derivatives()
    before = np.inf
    for sweep in range(SWEEPS):
        nodes = tets[near]
        of_nodes = np.einsum("qnk,mk->mqn", derivatives, gradients[near])  # stretch at the corners q over the rise
        stretch = 1.0 + np.einsum("mqn,mn->mq", of_nodes, rise[nodes])
        broken = stretch < SOUND
        left = int(broken.any(axis=1).sum())
        if not left or (sweep % TRIED == 0 and left > 0.5 * before):
            break
        before = left if sweep % TRIED == 0 else before
        of_nodes = np.where(free[nodes][:, None, :] & broken[:, :, None], of_nodes, 0.0)
        squares = (of_nodes**2).sum(axis=2)
        lengths = np.divide(AIM - stretch, squares, out=np.zeros_like(squares), where=squares > 0.0)
        steps, weights = OVERSHOOT * (lengths[:, :, None] * of_nodes).sum(axis=1), (of_nodes != 0.0).sum(axis=1)
        whole, count = (
            total(np.bincount(nodes.ravel(), values.ravel(), minlength=n).astype(float), same)
            for values in (steps, weights)
        )
        now = count > 0.0
        rise[now] += whole[now] / count[now]
        moved |= now
        near = np.asarray(moved[tets].any(axis=1))
    return moved


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
