"""The element kernels as forms of UFL that dolfinx compiles: any law, by the interface of `fem.kernels`."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import field, make_dataclass
from functools import cached_property
from typing import Any

import numpy as np

from asperity.arrays import Floats, Integers, Singles
from asperity.errors import InputError
from asperity.fem.cell_flow import CellFlow
from asperity.fem.form_compiler import Matrix, PointValues, Values, measure
from asperity.fem.history import History
from asperity.fem.kernels import relaxation_of
from asperity.fem.sparsity import SparsityPattern
from asperity.fem.weak_form import WeakForm
from asperity.laws.definition import SHAPES, USUAL, Law
from asperity.laws.shipped import hooke
from asperity.mesh.element import QUADRATURE_DEGREE, quadrature
from asperity.model.material import Material
from asperity.runtime.compiled import solver as _solver


def history_of(law: Law) -> type[History]:
    """History that holds the state variables of a law besides those of plasticity."""
    more = [(name, Floats, field(metadata={"shape": (SHAPES[shape],) if shape else ()}))
            for name, shape in law.state.items() if name not in USUAL]  # fmt: skip
    return make_dataclass("LawHistory", more, bases=(History,), frozen=True, eq=False) if more else History


class FormKernels:
    """Internal force, tangent and history of a solid by forms; see `fem.kernels.ElementKernels` for the members.

    Args:
        V: space of the displacement
        cell_nodes: displacement nodes of the owned cells (cells, 10)
        material: with stresses in units of E
        sparsity: of the local matrix
    """

    def __init__(self, V: Any, cell_nodes: Integers, material: Material, sparsity: SparsityPattern) -> None:
        from dolfinx import fem

        self._law, self._material, self._sparsity = material.in_ufl, material, sparsity
        self.linear, self._cell_nodes = material.linear, cell_nodes
        self._cells = np.arange(len(cell_nodes), dtype=np.int32)
        self._u, shapes = fem.Function(V), self._law.state.values()
        self._state = PointValues(V.mesh, len(cell_nodes), sum(SHAPES[shape] for shape in shapes)) if shapes else None
        self._constants = {name: fem.Constant(V.mesh, np.float64(value)) for name, value in self._law.parameters}
        self.relaxation = relaxation_of(material)
        self._cell: CellFlow | None = None
        if np.isfinite(self.relaxation[1]):
            bulk = material.E / (3.0 * (1.0 - 2.0 * material.nu))
            self._cell = CellFlow(V.mesh, self.volumes, bulk, self.relaxation, material.yield_strength)
        self._flowing = self._now = self._weak_form(held=False)
        self._committed, self._trial = (
            history_of(self._law).zeros(len(cell_nodes) if shapes else 0, self.volumes.shape[1]) for _ in range(2)
        )
        self._stale = False  # whether the trial history is of an earlier force

    def _weak_form(self, held: bool) -> WeakForm:
        state, cell = (at and at.function for at in (self._state, self._cell and self._cell.coefficients))
        finite = self._material.finite
        return WeakForm(self._u, state, self._law, self._constants, self._sparsity, finite, held, cell)

    @cached_property
    def _without_flow(self) -> WeakForm:
        if not self._law.state:
            return self._flowing
        if self._law.elastic is None:
            raise InputError(
                f'material.law = "{self._law.source}" does not say what it is without flow, which stiffness and '
                "slip need: declare @asp.law(state=..., elastic=...)"
            )
        return self._weak_form(held=True)

    def compile(self) -> None:
        """Compile what a load path needs; collective."""
        forms = self._flowing
        _ = forms.residual, forms.matrix, forms.stresses, forms.kinematics
        _ = self._law.state and forms.after, self._cell and (forms.measures, forms.measure_rows)

    @cached_property
    def volumes(self) -> Floats:
        """Of the quadrature points before deformation (cells, points) [L^3]."""
        import ufl

        mesh = self._u.function_space.mesh
        J = Values(ufl.JacobianDeterminant(mesh), (), mesh)
        return np.abs(J(self._cells)) * quadrature(QUADRATURE_DEGREE)[1]

    @property
    def plastic_points(self) -> int:
        """Points that yielded in the last internal force."""
        return int(np.sum(self.last.accumulated > self._committed.accumulated))

    @property
    def inverted_points(self) -> int:
        """Points that finite strain turned inside out there: no valid state."""
        return int(np.sum(self._flowing.kinematics(self._cells)[..., 9] <= 0.0)) if self._material.finite else 0

    def energy(self, u: Floats) -> Floats:
        """Energy per volume before deformation (cells, points) [E], where the law is one."""
        self._u.x.array[:] = u.ravel()
        return self._flowing.energy(self._cells)[..., 0]

    def strain(self, u: Floats) -> Floats:
        """Strain of u, in finite strain the logarithmic one (cells, points, 3, 3)."""
        _ = self.last
        self._u.x.array[:] = u.ravel()
        return self._flowing.kinematics(self._cells)[..., :9].reshape(*self.volumes.shape, 3, 3)

    def add_internal_force(self, u: Floats, b: Floats) -> None:
        """Add the internal force of the nodal displacement u (nodes, 3) to b."""
        from dolfinx.fem import assemble_vector

        self._set(self._now, u, self._committed)
        assemble_vector(b.reshape(-1), self._now.residual)
        self._stale = True

    def tangent(self, u: Floats, values: Floats | Singles, shift: float = 0.0) -> None:
        """Write the local matrix at u, the state of the last internal force; with a shift as compiled kernels do."""
        self._write(self._now, self._committed, u, values, shift)

    @cached_property
    def _small_elastic(self) -> Matrix:
        """Elastic stiffness in small strain."""
        import ufl
        from dolfinx import fem

        V = self._u.function_space
        moduli = (fem.Constant(V.mesh, np.float64(value)) for value in (self._material.E, self._material.nu))
        of_w, of_v = (ufl.sym(ufl.grad(of(V))) for of in (ufl.TrialFunction, ufl.TestFunction))
        return Matrix(ufl.inner(hooke(of_w, *moduli), of_v) * measure(V.mesh), self._sparsity)

    def elastic_tangent(self, u: Floats, values: Floats | Singles) -> None:
        """Write the local matrix at u for a motion without plastic flow."""
        self._write(self._without_flow, self.last, u, values)

    def _write(
        self, forms: WeakForm, history: History, u: Floats, values: Floats | Singles, shift: float = 0.0
    ) -> None:
        from scipy import sparse

        self._set(forms, u, history)
        blocks, pattern = forms.matrix.blocks(), self._sparsity
        if shift > 0.0 and self._material.finite:
            blocks += shift * self._small_elastic.blocks()
        if self._cell is not None and forms is self._flowing:
            rows, cells = forms.measure_rows, self._cell.flowing  # compiled together, flowing or not
            added, nodes = self._cell.stiffness(rows(cells)), self._cell_nodes[cells]
            at = pattern.positions(nodes[:, :, None], nodes[:, None, :])
            np.add.at(blocks, at, added.reshape(len(cells), 10, 3, 10, 3).swapaxes(2, 3))
        size = 3 * (len(pattern.indptr) - 1)
        full = sparse.bsr_array((blocks, pattern.indices, pattern.indptr), shape=(size, size)).tocsr().data
        if values.dtype == np.float32:
            _solver.upper_half(pattern.indptr, pattern.indices, full, values)
        else:
            values[:] = full

    def drop_matrices(self) -> None:
        """Free stored matrices; they are made again when they are needed."""
        for forms in {self._flowing, self.__dict__.get("_without_flow", self._flowing)}:
            forms.matrix.drop()

    def commit(self) -> None:
        """Make the trial history the committed one."""
        self._committed.assign(self.last)

    def restore(self, history: History) -> None:
        """Overwrite the committed history."""
        _ = self.last
        self._committed.assign(history)

    @contextmanager
    def holding(self) -> Iterator[None]:
        """Keep the plastic strain as it is in a block."""
        _ = self.last
        self._now = self._without_flow
        try:
            yield
        finally:
            _ = self.last
            self._now = self._flowing

    def history(self) -> History:
        """Committed history itself, not a copy; without rows where the law has no state."""
        return self._committed

    def stress(self, u: Floats, history: History | None = None) -> Floats:
        """Cauchy's stress (cells, points, 6) [E] of u over a history, None for the committed one."""
        return self._stresses(u, history)[..., :6]

    def conjugate_stress(self, u: Floats, history: History | None = None) -> Floats:
        """Stress conjugate to the strain of the law; Kirchhoff's of an energy."""
        return self._stresses(u, history)[..., 6:]

    def _stresses(self, u: Floats, history: History | None) -> Floats:
        _ = self.last
        self._set(self._now, u, self._committed if history is None else history)
        return self._now.stresses(self._cells)

    def _set(self, forms: WeakForm, u: Floats, history: History) -> None:
        """Set the coefficients of some forms."""
        self._u.x.array[:] = u.ravel()
        if self._state is not None:
            self._state.put(np.concatenate([np.atleast_3d(getattr(history, name)) for name in self._law.state], axis=2))
        if self._cell is not None:
            self._cell.settle(history.dilatation, forms.measures if forms is self._flowing else None)

    @property
    def last(self) -> History:
        """History of the last internal force, not a copy; to be asked for before the coefficients are set anew."""
        if self._stale and self._state is not None:
            values, at = self._now.after(self._cells), 0
            for name, shape in self._law.state.items():
                part = values[..., at : at + SHAPES[shape]]
                np.copyto(getattr(self._trial, name), part if shape else part[..., 0])
                at += SHAPES[shape]
            if self._cell is not None:
                np.copyto(self._trial.dilatation, self._cell.permanent)
        self._stale = False
        return self._trial
