"""Compiled constitutive part: one pass over the cells for stress, tangent and history (solver/)."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from asperity import _solver
from asperity.arrays import Floats
from asperity.fem.kernels import QUADRATURE_DEGREE
from asperity.fem.sparsity import NodeGraph
from asperity.mesh.tet10 import quadrature, shape_gradients
from asperity.model.material import Material


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
        at, weights = quadrature(QUADRATURE_DEGREE)
        self._cells = _solver.Cells(x, x_nodes, cell_nodes, shape_gradients(at), weights)
        self._elastic_law = _solver.Elastic(*material.lame)
        self._law = _solver.J2(*material.parameters)
        self.linear = not material.plastic
        cells, points = len(cell_nodes), len(weights)
        self.points = cells * points
        self.plastic_points = 0
        self._pattern = _solver.BlockPattern(cell_nodes, graph.indptr, graph.indices)
        self._elastic = np.zeros(len(graph.columns))
        _solver.stiffness_elastic(self._cells, self._elastic_law, self._pattern, self._elastic)
        held = cells if material.plastic else 0  # an elastic material has no history
        shape = (held, points)
        self._committed = (np.zeros((*shape, 6)), np.zeros(shape))
        self._trial = (np.zeros((*shape, 6)), np.zeros(shape))
        self._flowing = np.zeros(cells, dtype=bool)
        self.volumes = np.empty((cells, points))
        _solver.volumes(self._cells, self.volumes)

    def add_internal_force(self, u: Floats, b: Floats) -> None:
        if self.linear:
            _solver.residual_elastic(self._cells, self._elastic_law, u, b)
            return
        self.plastic_points = _solver.residual_j2(
            self._cells,
            self._law,
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
                self._law,
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
        history = (np.zeros_like(out), np.zeros(out.shape[:2])) if self.linear else self._committed
        _solver.stress(self._cells, self._law, u, _solver.History(*history), out)
        return out
