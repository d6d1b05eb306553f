"""Compiled constitutive part: one pass over the cells for stress, tangent and history (solver/)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from asperity import _solver
from asperity.model.material import Material

if TYPE_CHECKING:
    from asperity.fem.solid import Floats
    from asperity.fem.sparsity import NodeGraph

QUADRATURE_DEGREE = 2  # four points; degree 4 moved the force by less than 0.1 %


def reference_gradients(degree: int) -> tuple[Floats, Floats]:
    """Gradients of the ten shape functions (points, 10, 3) at a Gauss rule of that degree, and its weights."""
    import basix

    points, weights = basix.make_quadrature(basix.CellType.tetrahedron, degree)
    return shape_gradients(points), weights


def shape_gradients(points: Floats) -> Floats:
    """Gradients of the ten shape functions at reference points: (points, 10, 3)."""
    import basix

    element = basix.create_element(
        basix.ElementFamily.P, basix.CellType.tetrahedron, 2, basix.LagrangeVariant.gll_warped
    )
    return np.ascontiguousarray(np.moveaxis(element.tabulate(1, points)[1:4, :, :, 0], 0, -1))


class CompiledBulk:
    """Internal force and tangent by the kernels of `asperity._solver`.

    The elastic stiffness is assembled once; a tangent is its copy plus the correction of the cells that flow.
    """

    def __init__(
        self,
        x: Floats,
        x_nodes: npt.NDArray[np.int32],
        cell_nodes: npt.NDArray[np.int32],
        material: Material,
        graph: NodeGraph,
    ) -> None:
        gradients, weights = reference_gradients(QUADRATURE_DEGREE)
        self._cells = _solver.Cells(x, x_nodes, cell_nodes, gradients, weights)
        self._material = material
        self.linear = not material.plastic
        cells, points = len(cell_nodes), len(weights)
        self.points = cells * points
        self.plastic_points = 0
        self._pattern = _solver.BlockPattern(cell_nodes, graph.indptr, graph.indices)
        self._elastic = np.zeros(len(graph.columns))
        _solver.stiffness_elastic(self._cells, *material.lame, self._pattern, self._elastic)
        held = cells if material.plastic else 0  # an elastic material has no history
        shape = (held, points)
        self._committed = (np.zeros((*shape, 6)), np.zeros(shape))
        self._trial = (np.zeros((*shape, 6)), np.zeros(shape))
        self._flowing = np.zeros(cells, dtype=bool)
        self.volumes = np.empty((cells, points))
        _solver.volumes(self._cells, self.volumes)

    def add_internal_force(self, u: Floats, b: Floats) -> None:
        if not self._material.plastic:
            _solver.residual_elastic(self._cells, *self._material.lame, u, b)
            return
        self.plastic_points = _solver.residual_j2(
            self._cells,
            self._material.parameters,
            u,
            _solver.History(*self._committed),
            _solver.History(*self._trial),
            self._flowing,
            b,
        )

    def tangent(self, u: Floats, values: Floats) -> None:
        np.copyto(values, self._elastic)
        if self._flowing.any():
            _solver.stiffness_plastic(
                self._cells,
                self._material.parameters,
                u,
                _solver.History(*self._committed),
                self._flowing,
                self._pattern,
                values,
            )

    def commit(self) -> None:
        for committed, trial in zip(self._committed, self._trial, strict=True):
            np.copyto(committed, trial)

    def restore(self, plastic_strain: Floats, accumulated: Floats) -> None:
        for kept, values in zip(self._committed, (plastic_strain, accumulated), strict=True):
            np.copyto(kept, values)

    def history(self) -> tuple[Floats, Floats]:
        return self._committed

    def stress(self, u: Floats) -> Floats:
        cells = len(self._flowing)
        out = np.zeros((cells, self.points // max(cells, 1), 6))
        history = self._committed if self._material.plastic else (np.zeros_like(out), np.zeros(out.shape[:2]))
        _solver.stress(self._cells, self._material.parameters, u, _solver.History(*history), out)
        return out


def least_jacobians(x: Floats, x_nodes: npt.NDArray[np.int32]) -> Floats:
    """Smallest Jacobian determinant of each curved cell over a lattice of 35 points (cells,).

    Args:
        x: node coordinates (nodes, 3)
        x_nodes: geometry dofmap (cells, 10)
    """
    import basix

    lattice = basix.create_lattice(basix.CellType.tetrahedron, 4, basix.LatticeType.equispaced, exterior=True)
    cells = _solver.Cells(x, x_nodes, x_nodes, shape_gradients(lattice), np.ones(len(lattice)))
    out = np.empty(len(x_nodes))
    _solver.min_jacobian(cells, out)
    return out
