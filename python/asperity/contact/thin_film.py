"""Leakage: flow of a thin film through the gap below the flat, by Reynolds' equation div(g^3 grad p) = 0 on the top.

The third of a facet at an edge is closed where the edge touches, as in the area of contact: a map of the contact
and the flow agree on which channels are open. The unknowns are the pressures on the edges (elements of Crouzeix and
Raviart, RAIRO 7 (1973) 33), so that fluid crosses edges and never a point between two spots. Channels between nodes
are neither cut nor made by interpolation.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from asperity.arrays import Flags, Floats, Integers
from asperity.contact.contact_surface import FACET_DEGREE, ContactSurface, FacetRule, facet_numbers
from asperity.mesh import element
from asperity.mesh.block import NEAR
from asperity.runtime.gathered import gather
from asperity.runtime.parallel import on_root_bcast

if TYPE_CHECKING:
    from asperity.surface import Surface

INLET, OUTLET = -1, -2  # in place of the number of an edge on a side


class ThinFilm:
    """Transmissivity of the gap; collective.

    The pressure is 1 on one side of the patch and 0 on the opposite one. Nothing flows through the other two sides,
    and those of a periodic patch are joined. The flow is Q = T/(12 eta) times the pressure difference, with the
    viscosity eta: a parallel gap g has T = g^3.

    Between the nodes the gap has the heights of the surface, with the waves that the mesh leaves out, and the
    displacement of the mesh.

    Args:
        top: of the solid
        surface: the composite one, in its own units
        summit: its greatest height above the base [L]
    """

    columns = ("transmissivity_x", "transmissivity_y", "hydraulic_aperture")

    def __init__(self, top: ContactSurface, surface: Surface, summit: float) -> None:
        self._top, self._rule, L = top, FacetRule(top, FACET_DEGREE), surface.L
        points, _ = element.facet_quadrature(FACET_DEGREE)
        self._third = np.argmin(np.column_stack([1.0 - points.sum(axis=1), points]), axis=1)  # edge next to a point
        at = top.solid.positions(top.nodes)
        x, y, _ = np.moveaxis(np.einsum("fni,qn->fqi", at, self._rule.of_nodes), 2, 0)
        heights = np.asarray(surface.height(L * np.mod(x, 1.0), L * np.mod(y, 1.0))) - surface.maximum()[2]
        self._left_out = self._rule.height - (summit + heights / L)
        self._edges = np.concatenate([_edges(top, at, axis) for axis in (0, 1)], axis=1)
        self._links = _cotangents(at[:, :3, :2])

    def __call__(self, gap: Floats, touched: Flags) -> dict[str, float]:
        """Transmissivities along x and y [L^3], 0 where no channel is open, and the cube root of their mean [L].

        Args:
            gap: at the local nodes (nodes,) [L]
            touched: see `Contact.touched_edges`
        """
        top = self._top
        closed = touched[top.nodes[:, element.BEARING]]
        at_points = np.maximum(self._rule.at_points(gap[top.nodes]) + self._left_out, 0.0)
        weights = ~closed[:, self._third] * self._rule.weights
        share, whole = np.sum(weights * at_points**3, axis=1), weights.sum(axis=1)
        mean = np.divide(share, whole, out=np.zeros(len(whole)), where=whole > 0.0)
        rows = np.column_stack([self._edges, closed, self._links * mean[:, None]])
        comm = top.solid.comm
        found = gather(comm, facet_numbers(top), rows)

        def solve() -> list[float]:
            assert found is not None
            x, y, shut, links = np.split(found[1], 4, axis=1)
            return [transmissivity(edges.astype(np.int64), links, shut > 0.0) for edges in (x, y)]

        x, y = on_root_bcast(comm, solve)
        return dict(zip(self.columns, (x, y, (0.5 * (x + y)) ** (1.0 / 3.0)), strict=True))


def transmissivity(edges: Integers, conductance: Floats, closed: Flags) -> float:
    """Flow through a network of the edges of facets at a unit difference of the pressure.

    Args:
        edges: number of each edge of the facets (F, 3); on the sides -1 at the inlet, -2 at the outlet
        conductance: between the two edges that meet at each corner, which is opposite to the third (F, 3)
        closed: edges that touch (F, 3)
    """
    from scipy import sparse
    from scipy.sparse.csgraph import connected_components
    from scipy.sparse.linalg import splu

    first, second = np.roll(edges, -1, axis=1), np.roll(edges, -2, axis=1)
    shut = np.roll(closed, -1, axis=1) | np.roll(closed, -2, axis=1)
    linked = ~shut & (conductance != 0.0) & (first != second)
    if not linked.any():
        return 0.0
    ends, weights = np.stack([first[linked], second[linked]]), conductance[linked]
    numbers, ends = np.unique(ends, return_inverse=True)
    ends = ends.reshape(2, -1)
    n, inlet, outlet = len(numbers), *np.searchsorted(numbers, (INLET, OUTLET))
    if list(numbers[:2]) != [OUTLET, INLET]:
        return 0.0
    graph = sparse.coo_array((weights, tuple(ends)), shape=(n, n)).tocsr()
    graph = graph + graph.T
    _, part = connected_components(graph, directed=False)
    if part[inlet] != part[outlet]:
        return 0.0
    matrix = sparse.csc_array(sparse.diags_array(graph.sum(axis=1)) - graph)
    inner = np.flatnonzero(part == part[inlet])
    inner = inner[(inner != inlet) & (inner != outlet)]
    right = -np.asarray(matrix[inner][:, [inlet]].todense()).ravel()
    p = np.zeros(n)
    p[inlet] = 1.0
    if len(inner):
        p[inner] = splu(matrix[inner][:, inner]).solve(right)
    return float((matrix @ p)[inlet])


def _edges(top: ContactSurface, at: Floats, axis: int) -> Integers:
    """Number of each edge of the facets for a flow along x or y (F, 3), see `transmissivity`."""
    index_map, nodes = top.solid.V.dofmap.index_map, top.nodes[:, element.BEARING]
    numbers = index_map.local_to_global(np.ascontiguousarray(nodes).ravel()).reshape(nodes.shape)
    place = at[:, element.BEARING, axis]
    on_side = np.abs(place - np.round(place)) < NEAR
    inlet = at[:, :3, axis].mean(axis=1, keepdims=True) > place
    return np.where(on_side, np.where(inlet, INLET, OUTLET), numbers)


def _cotangents(corners: Floats) -> Floats:
    """Twice the cotangent of the angle at each corner of triangles (F, 3, 2): (F, 3)."""
    a, b = np.roll(corners, -1, axis=1) - corners, np.roll(corners, -2, axis=1) - corners
    cross = np.abs(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])
    return np.asarray(2.0 * np.sum(a * b, axis=2) / cross)
