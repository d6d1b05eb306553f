"""The definition of the element against basix: both orders of its nodes, faces, derivatives, weights of its facets."""

from __future__ import annotations

import numpy as np

from asperity.mesh import element
from asperity.runtime import compat

CORNERS = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
RANDOM = np.random.default_rng(0)


def in_order_of_gmsh() -> np.ndarray:
    """Points of the nodes on the reference tetrahedron (NODES, 3)."""
    middles = [CORNERS[list(ends)].mean(axis=0) for ends in element.EDGES[: element.ON_EDGES]]
    return np.concatenate([CORNERS, np.reshape(middles, (-1, 3))])


def test_each_shape_function_is_one_at_its_node_only() -> None:
    nodes = in_order_of_gmsh()[compat.gmsh_to_dolfinx(element.NODES)]
    np.testing.assert_allclose(element.shape_functions(nodes), np.eye(element.NODES), atol=1e-14)
    np.testing.assert_allclose(CORNERS[element.node_ends()].mean(axis=1), nodes, atol=1e-15)


def test_functions_of_a_face_are_those_of_the_cell_on_it() -> None:
    order, nodes = compat.gmsh_to_dolfinx(element.NODES), in_order_of_gmsh()
    coordinates = RANDOM.dirichlet((1.0, 1.0, 1.0), 20)
    for face in element.FACES:
        points = coordinates @ nodes[list(face[:3])]
        of_cell = np.empty((len(points), element.NODES))
        of_cell[:, order] = element.shape_functions(points)
        np.testing.assert_allclose(of_cell[:, face], element.face_functions(coordinates), atol=1e-13)
        linear = RANDOM.normal(size=(1, 3)) @ nodes.T  # at the nodes of the cell
        np.testing.assert_allclose(linear[:, face], element.to_face(linear[:, face[:3]]), atol=1e-15)


def test_functions_of_a_facet_in_the_order_of_dolfinx() -> None:
    for facet, nodes in enumerate(element.facet_nodes()):
        found = element.shape_functions(element.at_facet(facet, element.FACET_POINTS))
        np.testing.assert_allclose(found[:, nodes], np.eye(len(nodes)), atol=1e-14)


def test_derivatives_at_the_corners() -> None:
    """The gradient of a function is the sum of its derivatives times the gradients of the barycentric coordinates."""
    of_coordinates = np.array([[-1.0, -1.0, -1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
    found = np.empty((4, element.NODES, 3))
    found[:, compat.gmsh_to_dolfinx(element.NODES)] = element.shape_gradients(CORNERS)
    np.testing.assert_allclose(element.corner_derivatives() @ of_coordinates, found, atol=1e-13)


def test_a_uniform_pressure_is_carried_by_the_bearing_nodes() -> None:
    """And its load, tested with the hats of the corners, is a third of the facet each."""
    points, weights = element.facet_quadrature(4)
    load = 2.0 * weights @ element.shape_functions(element.at_facet(0, points))[:, element.facet_nodes()[0]]
    expected = np.zeros(len(load))
    expected[list(element.BEARING)] = 1.0 / len(element.BEARING)
    np.testing.assert_allclose(load, expected, atol=1e-14)
    np.testing.assert_allclose(element.to_corners(load[None]), np.full((1, 3), 1.0 / 3.0), atol=1e-14)


def test_linear_parts_fill_the_face() -> None:
    face = in_order_of_gmsh()[list(element.FACES[0])][:, :2]
    a, b, c = np.moveaxis(face[np.array(element.FACE_TRIANGLES)], 1, 0)
    np.testing.assert_allclose(element.cross(b - a, c - a).sum(), element.cross(face[1] - face[0], face[2] - face[0]))
