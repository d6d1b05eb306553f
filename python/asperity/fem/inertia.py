# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

"""Inertia of the solid: element kernels with the consistent mass.

Lengths in L, stresses in E, any unit of time T; the density is in E T^2/L^2.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from asperity.arrays import Floats, Singles
from asperity.fem.kernels import ElementKernels, History
from asperity.fem.solid import Solid
from asperity.mesh.element import quadrature, shape_functions, shape_gradients
from asperity.runtime import compat
from asperity.runtime.compiled import solver as _solver

MASS_DEGREE = 6  # of the quadrature of the consistent mass: second-order shapes squared, on curved cells


class InertialKernels:
    """Element kernels whose internal force includes that of inertia, c M (u - u*), M the consistent mass.

    Args:
        inner: kernels of the material
        solid: that they belong to
        density: mass density [E T^2/L^2]

    Attributes:
        shift: c [1/T^2]; with 0 the kernels are those of the material
        anchor: u* at the local nodes (nodes, 3) [L]
        linear: False, because the tangent changes with the shift
        heaviest: greatest sum of the magnitudes in a row of `mass`, the same on all ranks
        mass: M of one component, of the cells of this rank (nodes, nodes) [E L T^2]
    """

    halves = False

    def __init__(self, inner: ElementKernels, solid: Solid, density: float) -> None:
        self.inner = inner
        self.linear = False
        self.shift = 0.0
        self.anchor = np.zeros((solid.nodes, 3))
        self.mass = density * consistent_mass(solid)
        self.heaviest = max(solid.comm.allgather(float(abs(self.mass).sum(axis=1).max(initial=0.0))))
        # where the values of `mass` go in the local CSR of three dofs a node: the diagonals of its blocks
        width = np.diff(solid.sparsity.indptr).astype(np.int64)
        row = np.repeat(np.arange(solid.nodes), width)
        first = solid.sparsity.indptr[row].astype(np.int64)
        column = np.arange(len(row)) - first
        i = np.arange(3)
        self._diagonals = 9 * first[:, None] + 3 * width[row][:, None] * i + 3 * column[:, None] + i

    @property
    def volumes(self) -> Floats:
        """Of the quadrature points."""
        return self.inner.volumes

    @property
    def plastic_points(self) -> int:
        """Quadrature points flowing at the last residual."""
        return self.inner.plastic_points

    @property
    def inverted_points(self) -> int:
        """Quadrature points turned inside out at the last residual."""
        return self.inner.inverted_points

    def add_internal_force(self, u: Floats, b: Floats) -> None:
        """See `fem.kernels.ElementKernels`; so for the methods below."""
        self.inner.add_internal_force(u, b)
        if self.shift:
            b += self.shift * (self.mass @ (u - self.anchor))

    def tangent(self, u: Floats, values: Floats | Singles) -> None:
        self.inner.tangent(u, values)
        self._add_mass(values)

    def elastic_tangent(self, u: Floats, values: Floats | Singles) -> None:
        self.inner.elastic_tangent(u, values)
        self._add_mass(values)

    def _add_mass(self, values: Floats | Singles) -> None:
        if self.shift:
            values[self._diagonals] += self.shift * self.mass.data[:, None]

    def drop_matrices(self) -> None:
        self.inner.drop_matrices()

    def commit(self) -> None:
        self.inner.commit()

    def restore(self, history: History) -> None:
        self.inner.restore(history)

    def history(self) -> History:
        return self.inner.history()

    def softened(self, before: History) -> bool:
        return self.inner.softened(before)

    def stress(self, u: Floats) -> Floats:
        return self.inner.stress(u)

    def conjugate_stress(self, u: Floats) -> Floats:
        return self.inner.conjugate_stress(u)


def consistent_mass(solid: Solid) -> Any:
    """Integrals of products of shape functions over the cells of this rank, SciPy CSR (nodes, nodes) [L^3]."""
    from scipy import sparse

    points, weights = quadrature(MASS_DEGREE)
    N = shape_functions(points)
    nodes, x_nodes = solid.cell_nodes, compat.geometry_dofmap(solid.mesh)[: len(solid.cell_nodes)]
    cells = _solver.Cells(solid.mesh.geometry.x, x_nodes, nodes, shape_gradients(points), weights)
    volumes = np.empty((len(nodes), len(weights)))
    _solver.volumes(cells, volumes)
    local = np.einsum("cq,qa,qb->cab", volumes, N, N)
    sparsity = solid.sparsity
    keys = np.repeat(np.arange(solid.nodes), np.diff(sparsity.indptr)) * solid.nodes + sparsity.indices
    wanted = nodes[:, :, None].astype(np.int64) * solid.nodes + nodes[:, None, :]
    data = np.bincount(np.searchsorted(keys, wanted).ravel(), local.ravel(), minlength=len(keys))
    return sparse.csr_array((data, sparsity.indices, sparsity.indptr), shape=(solid.nodes, solid.nodes))
