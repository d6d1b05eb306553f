"""Inertia of the solid by the consistent mass.

Lengths in L, stresses in E, any unit of time T; the density is in E T^2/L^2.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from asperity.arrays import Floats
from asperity.fem.form_compiler import nodal_matrix
from asperity.fem.solid import Solid

MASS_DEGREE = 6  # of the quadrature of the consistent mass: second-order shapes squared, on curved cells


class Inertia:
    """Force of inertia c M (u - u*) of a solid, M the consistent mass, which its attribute `body_force` takes.

    Args:
        solid: the block
        density: mass density [E T^2/L^2]

    Attributes:
        shift: c [1/T^2]
        anchor: u* at the local nodes (nodes, 3) [L]
        mass: M of one component, of the cells of this rank (nodes, nodes) [E L T^2]
        heaviest: greatest sum of the magnitudes in a row of `mass`, the same on all ranks
    """

    def __init__(self, solid: Solid, density: float) -> None:
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

    def add_force(self, u: Floats, b: Floats) -> None:
        """See `fem.tangent.BodyForce`."""
        if self.shift:
            b += self.shift * (self.mass @ (u - self.anchor))

    def add_stiffness(self, values: Floats) -> None:
        """See `fem.tangent.BodyForce`."""
        values[self._diagonals] += self.shift * self.mass.data[:, None]


def consistent_mass(solid: Solid) -> Any:
    """Integrals of products of shape functions over the cells of this rank, SciPy CSR (nodes, nodes) [L^3]."""
    import ufl

    return nodal_matrix(solid.V, solid.sparsity, ufl.inner, MASS_DEGREE)
