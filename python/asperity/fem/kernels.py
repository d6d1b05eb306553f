"""Element kernels: one pass over the cells for stress, tangent and history, compiled in solver/."""

from __future__ import annotations

from functools import cached_property

import numpy as np
import numpy.typing as npt

from asperity.arrays import Floats, Singles
from asperity.fem.history import History
from asperity.fem.sparsity import SparsityPattern
from asperity.mesh.element import QUADRATURE_DEGREE, quadrature, shape_gradients, volumes
from asperity.model.material import Material
from asperity.runtime.compiled import solver as _solver


def compiled(history: History) -> _solver.History:
    """The arrays of a history as the compiled kernels receive them; they write into these arrays."""
    return _solver.History(**history.arrays())


def law_of(material: Material, flows: bool = True, secant: bool = False) -> _solver.J2:
    """The material as the compiled kernels receive it.

    Args:
        flows: False keeps the plastic strain as it is, for the stiffness against small vibration
        secant: whether its stiffness is stress over strain
    """
    return _solver.J2(**material.compiled | ({} if flows else {"yield_stress": np.inf}), secant=secant)


#: S of solver/relaxation.hpp over the yield strength, T over that after work (docs/theory.md); infinite: no relaxation.
RELAXATION = (0.2, 0.04)


def relaxation_of(material: Material) -> tuple[float, float]:
    """The stresses S and T of solver/relaxation.hpp [E]; infinite where nothing relaxes."""
    strength = material.yield_strength if material.relaxes else None
    return RELAXATION[0] * (strength or np.inf), RELAXATION[1] * material.worked_strength


class ElementKernels:
    """Internal force, tangent and history of a solid, cell by cell; the part of this rank, in units of L and E.

    In small strain a tangent is a copy of the elastic stiffness plus the correction of the cells that yield. A matrix
    takes most of the memory, so no copy is kept of an elastic solid whose tangent is written only once.

    A matrix is written as the values of the CSR pattern; or its upper half in single precision, by the columns of its
    blocks in the order of `SparsityPattern.upper`.

    Args:
        x: nodes of the geometry (n, 3) [L]
        x_nodes: nodes of the geometry of each cell (cells, 10)
        cell_nodes: displacement nodes of each cell (cells, 10)
        material: with stresses in units of E
        sparsity: of the local matrix

    Attributes:
        linear: whether the tangent never changes
        relaxation: the stresses S and T of solver/relaxation.hpp [E]; infinite where nothing flows
        volumes: of the quadrature points before deformation (cells, points) [L^3]
        plastic_points: that yielded in the last internal force
        inverted_points: that finite strain turned inside out there: no valid state
        dt: length of the step of the next internal force and tangent, for a law with time [s]; `commit` ends the step
    """

    dt = 0.0

    def __init__(
        self,
        x: Floats,
        x_nodes: npt.NDArray[np.int32],
        cell_nodes: npt.NDArray[np.int32],
        material: Material,
        sparsity: SparsityPattern,
    ) -> None:
        at, weights = quadrature(QUADRATURE_DEGREE)
        self.relaxation = relaxation_of(material)
        self._cells = _solver.Cells(x, x_nodes, cell_nodes, shape_gradients(at), weights, *self.relaxation)
        self._law, self._held = law_of(material), law_of(material, flows=False)
        self._secant = law_of(material, secant=True)
        self._finite, self.linear = material.finite, material.linear
        cells, points = len(cell_nodes), len(weights)
        self.plastic_points = self.inverted_points = 0
        self._cell_nodes, self._sparsity = cell_nodes, sparsity
        self._elastic: dict[np.dtype, Floats | Singles] = {}  # stiffness without plastic flow, by precision
        self._once: set[np.dtype] = set()  # where it has been assembled
        rows = cells if material.plastic else 0  # an elastic material has no history
        self._committed, self._trial = History.zeros(rows, points), History.zeros(rows, points)
        self._flowing = np.zeros(cells, dtype=bool)
        self.volumes = volumes(x, x_nodes)

    def add_internal_force(self, u: Floats, b: Floats) -> None:
        """Add the internal force of the nodal displacement u (nodes, 3) to b; writes the trial history."""
        self.plastic_points, self.inverted_points = _solver.residual(
            self._cells, self._law, self._finite, u, compiled(self._committed), compiled(self._trial), self._flowing, b
        )

    @cached_property
    def _full(self) -> _solver.BlockPattern:
        return _solver.BlockPattern(self._cell_nodes, self._sparsity.indptr, self._sparsity.indices)

    @cached_property
    def _half(self) -> _solver.HalfPattern:
        return _solver.HalfPattern(self._cell_nodes, *self._sparsity.upper)

    def _pattern(self, values: Floats | Singles) -> _solver.BlockPattern | _solver.HalfPattern:
        return self._half if values.dtype == np.float32 else self._full

    def tangent(self, u: Floats, values: Floats | Singles, shift: float = 0.0, secant: bool = False) -> None:
        """Write the local matrix at u, the state of the last internal force.

        Args:
            shift: in finite strain, part of the elastic stiffness in small strain that is added
            secant: whether it is that of the chords, stress over strain; a law in UFL has none
        """
        self._write(self._secant if secant else self._law, self._committed, u, values, shift)

    def elastic_tangent(self, u: Floats, values: Floats | Singles) -> None:
        """Write the local matrix at u for a motion without plastic flow."""
        self._write(self._held, self._trial, u, values)

    def _write(
        self,
        law: _solver.J2,
        history: History,
        u: Floats,
        values: Floats | Singles,
        shift: float = 0.0,
    ) -> None:
        flowing = self._flowing
        if self._finite:
            values[:] = 0.0
            if shift > 0.0:
                self._write_elastic(values)
                values *= shift
            flowing = np.ones_like(flowing)
        else:
            self._write_elastic(values)
            if law is self._held or not flowing.any():
                return
        pattern, over = self._pattern(values), compiled(history)
        _solver.stiffness_consistent(self._cells, law, self._finite, u, over, flowing, pattern, values)

    def _write_elastic(self, values: Floats | Singles) -> None:
        """Write the stiffness without plastic flow in small strain."""
        kept = self._elastic.get(values.dtype)
        if kept is not None:
            np.copyto(values, kept)
            return
        values[:] = 0.0
        _solver.stiffness_elastic(self._cells, self._law, self._pattern(values), values)
        if values.dtype in self._once or not self.linear:
            self._elastic[values.dtype] = values.copy()
        self._once.add(values.dtype)

    def drop_matrices(self) -> None:
        """Free stored matrices; they are made again when they are needed."""
        self._elastic.clear()
        self._once.clear()

    @property
    def last(self) -> History:
        """History of the last internal force, not a copy."""
        return self._trial

    def commit(self) -> None:
        """Make the trial history the committed one."""
        self._committed.assign(self._trial)
        self.dt = 0.0

    def restore(self, history: History) -> None:
        """Overwrite the committed history."""
        self._committed.assign(history)

    def history(self) -> History:
        """Committed history itself, not a copy; without rows for an elastic material."""
        return self._committed

    def stress(self, u: Floats, history: History | None = None) -> Floats:
        """Cauchy's stress (cells, points, 6) [E] of u over a history, None for the committed one."""
        return self._stress(u, history, conjugate=False)

    def conjugate_stress(self, u: Floats, history: History | None = None) -> Floats:
        """Stress whose product with the strain rate of the law is the power per volume before deformation: in small
        strain Cauchy's, in finite strain that of logarithmic strain."""
        return self._stress(u, history, conjugate=True)

    def doubt(self, u: Floats) -> str:
        """What is wrong with a law of the user at the points of u over the committed history, empty for nothing."""
        return ""

    def _stress(self, u: Floats, history: History | None, conjugate: bool) -> Floats:
        out = np.zeros((*self.volumes.shape, 6))
        over = compiled(self._committed if history is None else history)
        _solver.stress(self._cells, self._law, self._finite, conjugate, u, over, out)
        return out
