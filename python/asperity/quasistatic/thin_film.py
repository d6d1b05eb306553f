"""Leakage, a probe of accepted steps: the flow of a thin film through the gap below the flat.

Reynolds' equation div(g^3 grad p) = 0 holds on the top.

The third of a facet at an edge is closed where the edge touches, as in the area of contact: a map of the contact
and the flow agree on which channels are open. The unknowns are the pressures on the edges of triangles (elements of
Crouzeix and Raviart, RAIRO 7 (1973) 33), so that fluid crosses edges and never a point between two spots. Coarse facets
are divided, for the flow needs smaller triangles than the displacement.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import product
from typing import TYPE_CHECKING

import numpy as np

from asperity.arrays import Flags, Floats, Indices, Integers
from asperity.contact.contact_surface import IN_ORDER, ContactSurface, facet_numbers
from asperity.mesh import element
from asperity.mesh.block import NEAR
from asperity.reference.leakage import INLET, OUTLET, network_flow
from asperity.runtime.parallel import gather, on_root_bcast

if TYPE_CHECKING:
    from asperity.quasistatic.contact_solver import ContactSolver
    from asperity.surface import Surface

TRIANGLES, FINEST = 40_000, 8  # wanted on the top, and most along the edge of a facet
RULE = 6  # degree of the quadrature, that of the cube of a second-order gap


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
        self._top, L = top, surface.L
        facets = top.solid.comm.allreduce(len(top.cells))
        self._parts = parts = Division(int(np.clip((TRIANGLES / facets) ** 0.5, 1, FINEST)))
        places = top.solid.positions(top.nodes)[..., :2]
        x, y = (parts.at_points(places[..., axis]) for axis in (0, 1))
        heights = np.asarray(surface.height(L * np.mod(x, 1.0), L * np.mod(y, 1.0))) - surface.maximum()[2]
        self._left_out = parts.at_points(top.heights[top.nodes]) - (summit + heights / L)
        found = gather(top.solid.comm, facet_numbers(top), places[:, :3])
        if found is not None:
            self._links = _cotangents(found[1])
            self._edges = [parts.edges(found[1], axis, top.solid.sides == "periodic") for axis in (0, 1)]

    def __call__(self, solver: ContactSolver) -> dict[str, float]:
        """Columns at the last solve, see `through`."""
        return self.through(solver.gap(), solver.contact.touched_edges())

    def through(self, gap: Floats, touched: Flags) -> dict[str, float]:
        """Transmissivities along x and y [L^3], 0 where no channel is open, and the cube root of their mean [L].

        Args:
            gap: at the local nodes (nodes,) [L]
            touched: see `Contact.touched_edges`
        """
        top, parts = self._top, self._parts
        closed = touched[top.nodes[:, element.BEARING]]
        cubed = np.maximum(parts.at_points(gap[top.nodes]) + self._left_out, 0.0) ** 3
        found = gather(top.solid.comm, facet_numbers(top), np.column_stack([closed, parts.mean(cubed, closed)]))

        def solve() -> list[float]:
            assert found is not None
            closed, mean = found[1][:, :3] > 0.0, found[1][:, 3:]
            links = (self._links[:, None] * mean[..., None]).reshape(-1, 3)
            return [transmissivity(edges, links, parts.closed(closed)) for edges in self._edges]

        x, y = on_root_bcast(top.solid.comm, solve)
        return dict(zip(self.columns, (x, y, (0.5 * (x + y)) ** (1.0 / 3.0)), strict=True))


@dataclass(frozen=True)
class Division:
    """Division of facets into n x n similar triangles; their corners are in the order of the facet, turned or not."""

    n: int

    @cached_property
    def _corners(self) -> Indices:
        """Barycentric coordinates of the corners, times n (n^2, corners, 3)."""
        whole = range(self.n)
        one = np.eye(3, dtype=int)
        upright = [one + np.array([a, b, self.n - 1 - a - b]) for a, b in product(whole, whole) if a + b < self.n]
        turned = [
            1 - one + np.array([a, b, self.n - 2 - a - b]) for a, b in product(whole, whole) if a + b < self.n - 1
        ]
        return np.array(upright + turned)

    @cached_property
    def _points(self) -> tuple[Floats, Floats, Integers]:
        """Shape functions of a facet at the points (n^2, Q, 6), weights (Q,), and the third of each point (n^2, Q)."""
        points, weights = element.facet_quadrature(RULE)
        inside = np.column_stack([1.0 - points.sum(axis=1), points])
        at = np.einsum("qk,ski->sqi", inside, self._corners / self.n)
        shape = element.face_functions(at.reshape(-1, 3))[:, np.argsort(IN_ORDER)]
        return shape.reshape(*at.shape[:2], 6), weights / weights.sum(), at.argmin(axis=2)

    @property
    def _twice(self) -> Indices:
        """Barycentric coordinates of the middles of the edges opposite to the corners, times 2 n (n^2, edges, 3)."""
        return self._corners.sum(axis=1, keepdims=True) - self._corners

    @cached_property
    def _thirds(self) -> Flags:
        """Thirds of the facet that the middle of each edge lies in, also on their boundary (n^2, edges, 3)."""
        return np.asarray(self._twice == self._twice.min(axis=2, keepdims=True))

    def at_points(self, values: Floats) -> Floats:
        """Values at the quadrature points (F, n^2, Q) from those at the nodes of the facets (F, 6)."""
        return np.einsum("fi,sqi->fsq", values, self._points[0])

    def mean(self, values: Floats, closed: Flags) -> Floats:
        """Mean over what is open of each triangle (F, n^2), of values at the points, by the touched edges (F, 3)."""
        _, weights, third = self._points
        share = ~closed[:, third] * weights
        whole = share.sum(axis=2)
        return np.divide(np.sum(share * values, axis=2), whole, out=np.zeros(whole.shape), where=whole > 0.0)

    def closed(self, touched: Flags) -> Flags:
        """Edges of the triangles (F n^2, 3) that lie in a closed third, by the touched edges of the facets (F, 3)."""
        return np.asarray((touched[:, None, None] & self._thirds).any(axis=3)).reshape(-1, 3)

    def edges(self, corners: Floats, axis: int, periodic: bool) -> Indices:
        """Number of each edge of the triangles (F n^2, 3), the same from both sides; INLET and OUTLET across an axis.

        Args:
            corners: of the facets, seen from above (F, 3, 2) [L]
            periodic: whether the other sides are joined
        """
        from scipy.spatial import KDTree

        middles = np.einsum("sek,fkd->fsed", self._twice / (2.0 * self.n), corners)
        places, numbers = middles.reshape(-1, 2), np.arange(middles.size // 2)
        same = KDTree(places - np.floor(places + NEAR) * periodic).query_pairs(NEAR, output_type="ndarray")
        numbers[same[:, 1]] = same[:, 0]
        place, numbers = middles[..., axis], numbers.reshape(middles.shape[:-1])
        inwards = corners[..., axis].mean(axis=1)[:, None, None] > place
        on_side = np.abs(place - np.round(place)) < NEAR
        return np.where(on_side, np.where(inwards, INLET, OUTLET), numbers).reshape(-1, 3)


def transmissivity(edges: Indices, conductance: Floats, closed: Flags) -> float:
    """Flow through the network of the edges of triangles at a unit difference of the pressure.

    Args:
        edges: number of each edge of the triangles (F, 3), INLET and OUTLET for those at the sides
        conductance: between the two edges that meet at each corner, which is opposite to the third (F, 3)
        closed: edges that touch (F, 3)
    """
    first, second = np.roll(edges, -1, axis=1), np.roll(edges, -2, axis=1)
    shut = np.roll(closed, -1, axis=1) | np.roll(closed, -2, axis=1)
    # nothing flows through a closed edge: its pressure is eliminated, and two thirds of the triangle conduct
    others = [np.roll(conductance, -k, axis=1) for k in (1, 2)]
    through = np.divide(
        conductance * sum(others) + others[0] * others[1], sum(others), out=np.zeros_like(conductance),
        where=closed & (conductance.any(axis=1, keepdims=True)),
    )  # fmt: skip
    conductance = np.where(closed, 2.0 / 3.0 * through, conductance)
    flow = network_flow(first.ravel(), second.ravel(), np.where(shut, 0.0, conductance).ravel())
    return float(flow[first.ravel() == INLET].sum() - flow[second.ravel() == INLET].sum())


def _cotangents(corners: Floats) -> Floats:
    """Twice the cotangent of the angle at each corner of triangles (F, 3, 2), seen from above: (F, 3)."""
    a, b = (np.roll(corners, -k, axis=1) - corners for k in (1, 2))
    cross = np.abs(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])
    return np.asarray(2.0 * (a[..., 0] * b[..., 0] + a[..., 1] * b[..., 1]) / cross)
