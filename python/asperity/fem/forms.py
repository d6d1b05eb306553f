"""The element kernels as forms of UFL that dolfinx compiles: any law, by the interface of `fem.kernels`."""

from __future__ import annotations

from functools import cached_property
from typing import Any

import numpy as np

from asperity.arrays import Floats, Integers, Singles
from asperity.errors import InputError
from asperity.fem.cell_flow import CellFlow
from asperity.fem.history import History
from asperity.fem.kernels import ElementKernels, relaxation_of
from asperity.fem.law_check import doubt_of_points
from asperity.fem.sparsity import SparsityPattern
from asperity.fem.weak_form import Constants, PointValues, WeakForm
from asperity.laws.definition import SHAPES, USUAL
from asperity.mesh.element import volumes
from asperity.model.material import Material
from asperity.runtime import compat
from asperity.runtime.compiled import solver as _solver


class FormKernels(ElementKernels):
    """Internal force, tangent and history of a solid by forms.

    Args:
        V: space of the displacement
        cell_nodes: displacement nodes of the owned cells (cells, 10)
        material: with stresses in units of E
        sparsity: of the local matrix
    """

    _law: Any  # the weak form that is assembled

    def __init__(self, V: Any, cell_nodes: Integers, material: Material, sparsity: SparsityPattern) -> None:
        from dolfinx import fem

        self._given, self._material, self._sparsity = material.in_ufl, material, sparsity
        self.linear, self._cell_nodes = material.linear, cell_nodes
        self.plastic_points = self.inverted_points = 0
        self._all = np.arange(len(cell_nodes), dtype=np.int32)
        self._u, state = fem.Function(V), self._given.state
        self._state = PointValues(V.mesh, len(cell_nodes), sum(SHAPES[s] for s in state.values())) if state else None
        self._constants = Constants(V.mesh, self._given.constants)
        self.volumes = volumes(V.mesh.geometry.x, compat.geometry_dofmap(V.mesh)[: len(cell_nodes)])
        self.relaxation = relaxation_of(material)
        self._cell: CellFlow | None = None
        if np.isfinite(self.relaxation).all():
            bulk = material.E / (3.0 * (1.0 - 2.0 * material.nu))
            self._cell = CellFlow(V.mesh, self.volumes, bulk, self.relaxation)
        self._law = self._secant = self._weak_form(held=False)
        more = {name: (SHAPES[s],) if s else () for name, s in state.items() if name not in USUAL}
        self._committed, self._trial = (
            History.zeros(len(cell_nodes) if state else 0, self.volumes.shape[1], **more) for _ in range(2)
        )

    def _weak_form(self, held: bool) -> WeakForm:
        state, cell = (at and at.function for at in (self._state, self._cell and self._cell.coefficients))
        finite = self._material.finite
        return WeakForm(self._u, state, self._given, self._constants.named, self._sparsity, finite, held, cell)

    @cached_property
    def _held(self) -> Any:
        if not self._given.state:
            return self._law
        if self._given.declared.elastic is None:
            raise InputError(
                f'material.law = "{self._given.source}" does not say what it is without flow, which stiffness and '
                "slip need: declare @asp.law(state=..., elastic=...)"
            )
        return self._weak_form(held=True)

    def compile(self) -> None:
        """Compile what a load path needs; collective."""
        forms = self._law
        _ = forms.residual, forms.matrix, forms.stresses, forms.kinematics
        _ = self._given.state and forms.after, self._cell and (forms.measures, forms.measure_rows)

    def add_internal_force(self, u: Floats, b: Floats) -> None:
        """Add the internal force of the nodal displacement u (nodes, 3) to b; writes the trial history."""
        from dolfinx.fem import assemble_vector

        self._set(self._law, u, self._committed)
        assemble_vector(b.reshape(-1), self._law.residual)
        if self._material.finite:
            self.inverted_points = int(np.sum(self._law.kinematics(self._all)[..., 9] <= 0.0))
        if self._state is None:
            return
        values, at = self._law.after(self._all), 0
        for name, shape in self._given.state.items():
            part = values[..., at : at + SHAPES[shape]]
            np.copyto(getattr(self._trial, name), part if shape else part[..., 0])
            at += SHAPES[shape]
        if self._cell is not None:
            np.copyto(self._trial.dilatation, self._cell.permanent)
        self.plastic_points = int(np.sum(self._trial.accumulated > self._committed.accumulated))

    @cached_property
    def _at_rest(self) -> Floats:
        """Blocks of the tangent at rest, the elastic stiffness in small strain."""
        virgin = History(**{name: 0.0 * values for name, values in self._committed.arrays().items()})
        self._set(self._law, 0.0 * self._u.x.array, virgin)
        return self._law.matrix.blocks()

    def _write(self, law: Any, history: History, u: Floats, values: Floats | Singles, shift: float = 0.0) -> None:
        from scipy import sparse

        added = shift * self._at_rest if shift > 0.0 and self._material.finite else None
        self._set(law, u, history)
        blocks, pattern = law.matrix.blocks(), self._sparsity
        if added is not None:
            blocks += added
        if self._cell is not None and not law.held:
            rows, cells = law.measure_rows, self._cell.flowing  # compiled together, flowing or not
            flow, nodes = self._cell.stiffness(rows(cells)), self._cell_nodes[cells]
            at = pattern.positions(nodes[:, :, None], nodes[:, None, :])
            np.add.at(blocks, at, flow.reshape(len(cells), 10, 3, 10, 3).swapaxes(2, 3))
        size = 3 * (len(pattern.indptr) - 1)
        full = sparse.bsr_array((blocks, pattern.indices, pattern.indptr), shape=(size, size)).tocsr().data
        if values.dtype == np.float32:
            _solver.upper_half(pattern.indptr, pattern.indices, full, values)
        else:
            values[:] = full

    def drop_matrices(self) -> None:
        """Free stored matrices; they are made again when they are needed."""
        for forms in {self._law, self.__dict__.get("_held", self._law)}:
            forms.matrix.drop()
        self.__dict__.pop("_at_rest", None)

    def energy(self, u: Floats) -> Floats:
        """Energy per volume before deformation (cells, points) [E], where the law is one."""
        self._u.x.array[:] = u.ravel()
        return self._law.energy(self._all)[..., 0]

    def strain(self, u: Floats) -> Floats:
        """Strain of u, in finite strain the logarithmic one (cells, points, 3, 3)."""
        self._u.x.array[:] = u.ravel()
        return self._law.kinematics(self._all)[..., :9].reshape(*self.volumes.shape, 3, 3)

    def _stress(self, u: Floats, history: History | None, conjugate: bool) -> Floats:
        self._set(self._law, u, self._committed if history is None else history)
        return self._law.stresses(self._all)[..., 6:] if conjugate else self._law.stresses(self._all)[..., :6]

    def doubt(self, u: Floats) -> str:
        """What is wrong with a law of the user at the points of u over the committed history, empty for nothing."""
        if self._material.law is None:
            return ""
        strains = self.strain(u).reshape(-1, 3, 3)
        if self._given.hyperelastic:  # stretches, which an energy cannot tell from deformation gradients
            stretch, axes = np.linalg.eigh(np.nan_to_num(strains))
            strains = np.einsum("nij,nj,nkj->nik", axes, np.exp(stretch), axes)
        stresses, n = self.stress(u).reshape(len(strains), -1), len(strains)
        stored = self._stored(self._committed).reshape(n, -1) if self._state is not None else np.zeros((n, 0))
        return doubt_of_points(self._given, strains, stored, stresses, self.dt)

    def _stored(self, history: History) -> Floats:
        """Components of the state at the quadrature points (cells, points, k)."""
        return np.concatenate([np.atleast_3d(getattr(history, name)) for name in self._given.state], axis=2)

    def _set(self, forms: WeakForm, u: Floats, history: History) -> None:
        """Set the coefficients of some forms."""
        self._u.x.array[:] = u.ravel()
        if self._given.declared.time:
            self._constants["dt"] = self.dt
        if self._state is not None:
            self._state.put(self._stored(history))
        if self._cell is not None:
            self._cell.settle(history.dilatation, None if forms.held else forms.measures)
