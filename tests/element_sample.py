"""Meshes of cubes, and a small mesh under given nodal displacements, for the tests of the element kernels."""

from __future__ import annotations

import itertools
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from conftest import here
from scipy import sparse

from asperity.fem.solid import Solid
from asperity.mesh.block import BlockMesh
from asperity.mesh.distribute import distribute
from asperity.mesh.element import EDGES
from asperity.model.material import Material
from asperity.surface import Flat, Surface

Array = npt.NDArray[np.float64]

PAIRS = [[0, 3, 4], [3, 1, 5], [4, 5, 2]]  # of the components (xx, yy, zz, xy, xz, yz)


@dataclass(frozen=True)
class Sample:
    """A small mesh driven by nodal displacements through the compiled element kernels, or through forms."""

    solid: Solid
    kernels: Any

    def force(self, u: Array) -> Array:
        b = np.zeros((self.solid.nodes, 3))
        self.kernels.add_internal_force(u, b)
        return b

    def tangent(self, u: Array) -> sparse.csr_array:
        """Tangent of the last force."""
        values = np.empty(self.solid.sparsity.size)
        self.kernels.tangent(u, values)
        return matrix_of(self.solid, values)

    def bring(self, history: Iterable[Array], u: Array) -> Array:
        """Commit a history of displacements; the force of another one over it."""
        for earlier in history:
            self.force(earlier)
            self.kernels.commit()
        return self.force(u)

    def affine(self, gradient: npt.ArrayLike) -> Array:
        """Displacement of a uniform gradient, or strain (3, 3)."""
        return self.solid.points @ np.asarray(gradient, float).T

    def follow(self, gradients: Iterable[Array]) -> tuple[Array, Array]:
        """Cauchy's stress (m, 3, 3) and accumulated plastic strain (m,) along uniform gradients, each a step."""
        stress, accumulated = [], []
        near = 1e-12 if self.solid.material.finite else 1e-12 * (self.solid.material.yield_strength or 1.0)
        for gradient in gradients:
            u = self.affine(gradient)
            self.force(u)
            points = self.kernels.stress(u).reshape(-1, 6)
            np.testing.assert_allclose(points, np.broadcast_to(points[0], points.shape), rtol=0, atol=near)
            stress.append(points[0][PAIRS])
            self.kernels.commit()
            accumulated.append(np.max(self.kernels.history().accumulated, initial=0.0))
        return np.array(stress), np.array(accumulated)


def sample(block: BlockMesh | None, material: Material, forms: bool = False, pointwise: bool = False) -> Sample:
    """A sample; `pointwise` without the relaxation of volumetric strain in a cell."""
    with pytest.MonkeyPatch.context() as patch:
        if pointwise:
            patch.setattr("asperity.fem.kernels.RELAXATION", (np.inf, np.inf))
        solid = Solid(*distribute(here(), block, 1.0), material, forms=forms)
    return Sample(solid, solid.kernels)


def matrix_of(solid: Solid, values: Array) -> sparse.csr_array:
    """Matrix of the dofs of a solid on one rank, with these entries."""
    graph, n = solid.sparsity, 3 * solid.nodes
    return sparse.csr_array((values.copy(), graph.columns, graph.rows), shape=(n, n))


def difference(a: Any, b: Any) -> float:
    """Largest difference relative to the largest magnitude."""
    change, size = (np.max(np.abs(array), initial=0.0) for array in (np.asarray(a) - np.asarray(b), np.asarray(b)))
    return float(change / max(size, 1e-300))


def cubes(n: int, surface: Surface | None = None) -> BlockMesh:
    """A block of unit side under a surface, by default a flat one: n^3 cubes of six tetrahedra, nodes on the edges."""
    surface = surface or Flat(L=1.0)
    corner = np.stack(np.meshgrid(*3 * [np.arange(n + 1)], indexing="ij"), axis=-1).reshape(-1, 3)
    of_cube = []
    for order in itertools.permutations(range(3)):
        axes = np.eye(3, dtype=int)[list(order)]
        path = np.concatenate([[[0, 0, 0]], axes.cumsum(axis=0)])
        of_cube.append(path if np.linalg.det(axes) > 0.0 else path[[0, 2, 1, 3]])  # none is turned inside out
    corners = 2 * (corner[(corner < n).all(axis=1)][:, None, None] + np.array(of_cube)).reshape(-1, 4, 3)
    nodes = np.concatenate([corners, corners[:, EDGES].mean(axis=2).astype(int)], axis=1)
    found, tets = np.unique(nodes.reshape(-1, 3), axis=0, return_inverse=True)
    x, y, z = found.T / (2 * n)
    points = np.stack([x, y, z * (1.0 + surface.height(x, y) - surface.mean())], axis=1)
    return BlockMesh(points, tets.reshape(-1, 10), 1.0, 1.0)
