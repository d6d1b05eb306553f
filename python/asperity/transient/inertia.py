"""Inertia of the block: the generalised-alpha method, and element kernels with the consistent mass.

Units are those of `asperity.transient`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from asperity import _solver
from asperity.arrays import Floats
from asperity.errors import InputError
from asperity.fem.kernels import ElementKernels, History
from asperity.fem.solid import Solid
from asperity.mesh.tet10 import quadrature, shape_functions, shape_gradients
from asperity.runtime import compat

MASS_DEGREE = 6  # of the quadrature of the consistent mass: second-order shapes squared, on curved cells


@dataclass(frozen=True)
class Scheme:
    """Parameters of the generalised-alpha method for a spectral radius at infinite frequency.

    Linear motion far below 1/h is hardly damped for any of them (the damping ratio is of third order in omega h).
    Motion that the step cannot resolve is damped by a factor `rho_inf` per step. With 1, the energy of a linear solid
    is conserved, but the force of a node that meets the plate oscillates from step to step without end, because its
    velocity jumps and no damping removes the jump. With 0, the first modes of the block are damped too.
    docs/transient.md uses 0.8.

    Attributes:
        rho_inf: in [0, 1]

    Raises:
        InputError: rho_inf is outside [0, 1]

    Examples:
        >>> Scheme(1.0).alphas
        (0.5, 0.5)
    """

    rho_inf: float = 0.8

    def __post_init__(self) -> None:
        if not 0.0 <= self.rho_inf <= 1.0:
            raise InputError(f"rho_inf = {self.rho_inf!r} must lie in [0, 1]: 1 damps nothing, 0 all it cannot resolve")

    @property
    def alphas(self) -> tuple[float, float]:
        """alpha_m and alpha_f (Chung & Hulbert 1993, equation 25)."""
        rho = self.rho_inf
        return (2.0 * rho - 1.0) / (rho + 1.0), rho / (rho + 1.0)

    @property
    def newmark(self) -> tuple[float, float]:
        """beta and gamma (Chung & Hulbert 1993, equations 17 and 20)."""
        m, f = self.alphas
        return 0.25 * (1.0 - m + f) ** 2, 0.5 - m + f


@dataclass(frozen=True)
class Motion:
    """Position x, velocity v, acceleration w and averaged acceleration a of a point, or of many (arrays)."""

    x: Any
    v: Any
    w: Any
    a: Any

    def anchor(self, scheme: Scheme, h: float) -> tuple[Any, float]:
        """(x*, c) with which the acceleration after a step h is c (x' - x*)."""
        (m, f), (beta, _) = scheme.alphas, scheme.newmark
        c = (1.0 - m) / ((1.0 - f) * beta * h * h)
        predicted = self.x + h * self.v + h * h * (0.5 - beta) * self.a
        return predicted - (m * self.a - f * self.w) / ((1.0 - f) * c), c

    def at(self, x: Any, scheme: Scheme, h: float) -> Motion:
        """Motion after a step h to the position `x`."""
        beta, gamma = scheme.newmark
        anchor, c = self.anchor(scheme, h)
        a = (x - self.x - h * self.v) / (beta * h * h) - (0.5 / beta - 1.0) * self.a
        return Motion(x, self.v + h * ((1.0 - gamma) * self.a + gamma * a), c * (x - anchor), a)


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

    def add_internal_force(self, u: Floats, b: Floats) -> None:
        """See `fem.kernels.ElementKernels`; so for the methods below."""
        self.inner.add_internal_force(u, b)
        if self.shift:
            b += self.shift * (self.mass @ (u - self.anchor))

    def tangent(self, u: Floats, values: Floats) -> None:
        self.inner.tangent(u, values)
        if self.shift:
            values[self._diagonals] += self.shift * self.mass.data[:, None]

    def commit(self) -> None:
        self.inner.commit()

    def restore(self, history: History) -> None:
        self.inner.restore(history)

    def history(self) -> History:
        return self.inner.history()

    def stress(self, u: Floats) -> Floats:
        return self.inner.stress(u)


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
