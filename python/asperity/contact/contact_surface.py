"""Contact surface of a solid below a flat or tool: facets of its top, quadrature, pressure, area and spots."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from asperity.arrays import Flags, Floats, Indices, Integers
from asperity.curve.curve import EDGE
from asperity.fem.solid import Solid, cell_numbers
from asperity.mesh import element
from asperity.mesh.block import Top
from asperity.mesh.distribute import TOP
from asperity.runtime import compat
from asperity.runtime.compiled import solver as _solver
from asperity.runtime.parallel import gather
from asperity.surface import Surface

FACET_DEGREE = 8  # 16 points: four times closer on cut facets than the 6 of degree 4, at no cost
IN_ORDER = (0, 1, 2, 5, 3, 4)  # nodes of a facet, corners and opposite edges, in the order of `element.FACES`
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


@dataclass(frozen=True)
class Area:
    """Area of contact, an estimate of its error, and the area of the facets that its edge crosses [length^2]."""

    value: float
    error: float
    edge: float


class FacetRule:
    """Quadrature points of Gauss' rule of a degree on the facets.

    Attributes:
        facets: data of the facets for the compiled kernels
        weights: projected on the plane of the flat (F, Q) [length^2]
        height: of the composite surface at the points, with that of the tool as the nodes have it (F, Q) [length]
        of_nodes: shape functions of the nodes of a facet at the points (Q, 6)
        cells: of the facets, for the compiled kernels
        of_cells: the linear function through the quadrature points of a cell at those of its facets (4, Q, points)
    """

    def __init__(self, surface: ContactSurface, degree: int) -> None:
        points, weights = element.facet_quadrature(degree)
        solid = surface.solid
        at_facets = [element.at_facet(k, points) for k in range(4)]
        shape = np.stack([element.shape_functions(p) for p in at_facets])
        x = solid.mesh.geometry.x
        x_nodes = np.ascontiguousarray(compat.geometry_dofmap(solid.mesh)[surface.cells])
        normals = np.empty((len(surface.cells), len(weights), 3))
        vectors = element.area_vectors()
        for k, at in enumerate(at_facets):
            mine = surface.local == k
            J = np.einsum("fai,qaj->jfqi", x[x_nodes[mine]], element.shape_gradients(at))
            normals[mine] = sum(vectors[k, i] * np.cross(J[i - 2], J[i - 1]) for i in range(3))
        self.weights = normals[..., 2] * weights
        normals /= normals[..., 2:]
        self.facets = _solver.Facets(surface.cell_nodes, surface.local, shape, normals, self.weights)
        of_cell, in_cell = element.quadrature(element.QUADRATURE_DEGREE)
        self.cells = _solver.Cells(
            x, x_nodes, surface.cell_nodes, element.shape_gradients(of_cell), in_cell, *solid.kernels.relaxation
        )
        self.of_cells = np.stack([element.linear_through(of_cell, p) for p in at_facets])
        self.of_nodes = shape[0][:, element.facet_nodes()[0]]
        self.height = self.at_points(surface.heights[surface.nodes])

    def at_points(self, values: Floats) -> Floats:
        """Values at the quadrature points (F, Q) from those at the nodes of the facets (F, 6)."""
        return values @ self.of_nodes.T


class ContactSurface:
    """Facets of the rough top that belong to cells of this rank.

    All areas are projected on the plane of the flat, so a pressure is the force on the flat per area of the flat.

    Attributes:
        cells, local: cell of each facet and the number of the facet in it (F,)
        cell_nodes: displacement nodes of these cells (F, 10)
        in_cell, nodes: number in the cell of each node of a facet, corners, then the edges opposite to them, and the
            displacement nodes (F, 6)
        area, diameter: of each facet (F,)
        owned_nodes: nodes of the contact surface that this rank owns
        heights: of the undeformed composite surface, that is of the solid and the tool, at its local nodes (nodes,)
        tool: that is above it, None for the flat
        follows: whether the tool meets a node at its deformed place, as in finite strain
    """

    def __init__(self, solid: Solid, tool: Tool | None = None) -> None:
        self.solid, self.tool = solid, tool
        self.follows = tool is not None and solid.material.finite
        mesh = solid.mesh
        mesh.topology.create_connectivity(2, 3)
        mesh.topology.create_connectivity(3, 2)
        to_cell, to_facet = mesh.topology.connectivity(2, 3), mesh.topology.connectivity(3, 2)
        facets = [f for f in solid.tags.find(TOP) if to_cell.links(f)[0] < len(solid.cell_nodes)]
        self.cells = np.array([to_cell.links(f)[0] for f in facets], dtype=np.int32)
        self.local = np.array(
            [np.flatnonzero(to_facet.links(c) == f)[0] for f, c in zip(facets, self.cells, strict=True)], dtype=np.int32
        )
        self.cell_nodes = np.ascontiguousarray(solid.cell_nodes[self.cells])
        self.in_cell = np.array(element.facet_nodes())[self.local]
        self.nodes = np.take_along_axis(self.cell_nodes, self.in_cell, axis=1)
        self.owned_nodes = solid.nodes_on(TOP)
        self.heights = solid.points[:, 2].copy()
        if tool is not None:
            nodes = np.unique(np.concatenate([self.nodes.ravel(), self.owned_nodes]))
            self.heights[nodes] += tool.height(solid.points[nodes, :2])
        rule = FacetRule(self, 2)
        self.area = rule.weights.sum(axis=1)
        corners = solid.positions(self.nodes[:, :3])
        sides = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2)
        self.diameter = np.max(sides, axis=1, initial=0.0)
        # the load of each facet under a pressure of one
        self._unit = np.zeros(self.nodes.shape)
        self._unit[:, element.BEARING] = self.area[:, None] / len(element.BEARING)
        self._corner_area = self.assemble(self.nodes[:, :3], element.to_corners(self._unit))
        self._valence = self.assemble(self.nodes, np.ones(self.nodes.shape))  # facets that meet at a node
        self._projected = element.projected_area(solid.positions(self.nodes))

    def assemble(self, nodes: npt.NDArray[np.int32], values: Floats) -> Floats:
        """Sum facet values into a nodal array over all ranks, ghosts updated; collective."""
        parts, ghosts = np.zeros((self.solid.nodes, 1)), self.solid.ghosts
        np.add.at(parts[:, 0], nodes.ravel(), values.ravel())
        return ghosts.scatter_forward(ghosts.scatter_reverse(parts)).ravel().copy()

    def elevation(self, nodes: Integers) -> Floats:
        """Height of the deformed composite surface above the base at some of its local nodes (n,) [length]."""
        u = self.solid.u.x.array.reshape(-1, 3)[nodes]
        if not self.follows:
            return np.asarray(self.heights[nodes] + u[:, 2])
        assert self.tool is not None
        points = self.solid.points[nodes] + u
        return np.asarray(points[:, 2] + self.tool.height(points[:, :2]))

    @cached_property
    def spacing(self) -> Floats:
        """Mean distance of the nodes around each local node of the facets (nodes,) [length]; collective."""
        whole = self.assemble(self.nodes, np.repeat(0.5 * self.diameter[:, None], self.nodes.shape[1], axis=1))
        return whole / np.maximum(self._valence, 1.0)

    def bearing_area(self) -> Floats:
        """Area of the facets by the nodes that bear a uniform pressure, on edges (nodes,) [length^2]; collective."""
        return self.assemble(self.nodes, self._unit)

    def area_ratio(self) -> Floats:
        """Area of each facet, projected on the flat, over that before deformation (F,); 1 in small strain."""
        solid = self.solid
        if not solid.material.finite:
            return np.ones(len(self.nodes))
        moved = solid.positions(self.nodes) + solid.u.x.array.reshape(-1, 3)[self.nodes]
        return element.projected_area(moved) / self._projected

    def pressure(self, nodal_force: Floats) -> Floats:
        """Pressure at the corner nodes from forces on all nodes, zero elsewhere; collective.

        A second-order facet has no force at its corners under uniform pressure. Tested with the hat functions of
        the corners, each edge force goes half to either end, and the sum over the area of the hat is the
        pressure: free of oscillation and with the exact total force.

        Args:
            nodal_force: force of the flat on each local node, ghosts included (nodes,)

        Returns:
            pressure (nodes,) [force/length^2]
        """
        # a node's force is shared by its facets: split it evenly so that the assembly counts it once
        share, corners = nodal_force / np.maximum(self._valence, 1.0), self.nodes[:, :3]
        force, area = self.assemble(corners, element.to_corners(share[self.nodes])), self._corner_area
        if self.solid.material.finite:
            area = self.assemble(corners, element.to_corners(self._unit * self.area_ratio()[:, None]))
        with np.errstate(invalid="ignore", divide="ignore"):
            return np.where(area > 0.0, force / area, 0.0)

    def linear_on_facets(self, values: Floats) -> Floats:
        """Values at the local nodes (nodes,) with those on the edges of facets the means of their ends; collective."""
        faces = self.nodes[:, IN_ORDER]
        edges, means = faces[:, 3:], element.to_face(values[faces[:, :3]])[:, 3:]
        count = self.assemble(edges, np.ones(edges.shape))
        return np.where(count > 0.0, self.assemble(edges, means) / np.maximum(count, 1.0), values)

    def area_of(self, touched: Flags, weights: Floats) -> Area:
        """Area where points of the facets are touched, and its error; collective.

        The edge of the contact crosses facets, and its place within a facet is practically unknown: a standard
        deviation of 1/sqrt(12) of the area of the facet (that of a uniform share), independent from facet to facet.
        Twice the deviation of the sum scales with (perimeter h^3)^(1/2), and holes of a noisy contact count too. The
        nodes also place the edge too far inside or outside on the whole, by up to EDGE of the facets that it crosses
        (docs/theory.md): an error of the first order. The error is the root of the sum of both squares.

        Args:
            weights: area of each point before deformation (F, Q) [length^2]
        """
        cut, ratio = touched.any(axis=1) & ~touched.all(axis=1), self.area_ratio()
        areas = (weights * ratio[:, None])[touched]
        crossed = (self.area * ratio)[cut]
        area, squares, edge = self.solid.comm.allreduce(np.array([np.sum(areas), np.sum(crossed**2), np.sum(crossed)]))
        return Area(float(area), float(np.hypot((squares / 3.0) ** 0.5, EDGE * edge)), float(edge))

    def mean(self, values: Floats) -> float:
        """Mean over the patch of values at the local nodes (nodes,), projected on the plane of the flat; collective."""
        sums = np.array([np.sum(self._nodal_area * values[self.nodes]), self._nodal_area.sum()])
        total, area = self.solid.comm.allreduce(sums)
        return float(total / area)

    @cached_property
    def _nodal_area(self) -> Floats:
        """Integrals of the shape functions over the projected facets (F, 6) [length^2]."""
        rule = FacetRule(self, 4)  # exact for the product of shape function and projected area
        return rule.weights @ rule.of_nodes


def facet_numbers(surface: ContactSurface) -> Indices:
    """Number of each facet in the built mesh: four times its cell plus its number in the cell (F,)."""
    return 4 * cell_numbers(surface.solid)[surface.cells] + surface.local


def gather_top(surface: ContactSurface, height: float) -> Top | None:
    """Gather the facets of the top on rank 0, in an order independent of the ranks; None elsewhere; collective.

    Args:
        height: of the mean plane above the base [L]
    """
    geometry = surface.solid.mesh.geometry
    numbers = np.asarray(geometry.input_global_indices)[_x_nodes(surface)]
    faces = gather(surface.solid.comm, facet_numbers(surface), numbers)
    points = gather_at_top(surface, geometry.x)
    if faces is None or points is None:
        return None
    _, place = np.unique(faces[1], return_inverse=True)
    return Top(points - [0.0, 0.0, height], place.reshape(faces[1].shape))


def gather_at_top(surface: ContactSurface, values: Floats) -> Floats | None:
    """Values at the points of `gather_top` from those at the local nodes of the geometry; on rank 0; collective."""
    used = np.unique(_x_nodes(surface))
    numbers = np.asarray(surface.solid.mesh.geometry.input_global_indices)[used]
    found = gather(surface.solid.comm, numbers, values[used])
    return found and found[1]


def _x_nodes(surface: ContactSurface) -> Integers:
    """Nodes of the geometry on each facet in the order of `element.FACES` (F, 6)."""
    x_nodes = compat.geometry_dofmap(surface.solid.mesh)[surface.cells]
    return np.take_along_axis(x_nodes, surface.in_cell[:, IN_ORDER], axis=1)


def spots_of(surface: ContactSurface, edges: Flags, areas: Floats) -> tuple[int, float]:
    """Number of contact spots of all ranks and area of the largest one [length^2]; collective.

    A spot consists of touched thirds of facets, each between an edge and the middle of its facet. Those of one facet
    belong to one spot, and so do those that meet at a corner. A map of these thirds shows as many patches.

    Args:
        edges: see `Contact.touched_edges` (nodes,)
        areas: touched area of each facet (F,) [length^2]
    """
    from scipy import sparse

    comm, index_map = surface.solid.comm, surface.solid.V.dofmap.index_map
    touched = edges[surface.nodes[:, element.BEARING]]
    facets = touched.any(axis=1)
    at_corners = np.roll(touched, -1, axis=1) | np.roll(touched, -2, axis=1)  # an edge has the number opposite to it
    corners = index_map.local_to_global(surface.nodes[facets, :3].ravel()).reshape(-1, 3)
    parts = comm.gather((corners, at_corners[facets], areas[facets]), root=0)
    count, largest = 0, 0.0
    if parts is not None and any(len(corners) for corners, *_ in parts):
        corners, ends, areas = (np.concatenate(of_ranks) for of_ranks in zip(*parts, strict=True))
        _, column = np.unique(corners[ends], return_inverse=True)
        meet = sparse.csr_array((np.ones(column.size), (np.nonzero(ends)[0], column.ravel())))
        count, of_facet = sparse.csgraph.connected_components(meet @ meet.T, directed=False)
        largest = np.bincount(of_facet, areas).max()
    return comm.bcast((int(count), float(largest)), root=0)
