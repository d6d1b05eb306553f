# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

"""Element kernels as UFL forms: the readable twin of the compiled kernels, differentiated automatically."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from asperity.arrays import Floats, Singles
from asperity.errors import InputError
from asperity.fem.kernels import History
from asperity.fem.log_strain import displacement_measure, logarithmic_strain, piola_kirchhoff
from asperity.fem.sparsity import SparsityPattern
from asperity.mesh.element import QUADRATURE_DEGREE
from asperity.model.material import Material
from asperity.runtime import compat

SYMMETRIC = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))  # order of stored tensor components


class UflKernels:
    """Internal force and tangent by FFCx from `Material.respond_ufl`; compiled at first use.

    Args:
        V: displacement space
        material: with stresses in units of E
        sparsity: of the local matrix
    """

    halves = False

    def __init__(self, V: Any, material: Material, sparsity: SparsityPattern) -> None:
        import basix.ufl
        import ufl
        from dolfinx import fem

        mesh = V.mesh
        cells = mesh.topology.index_map(3).size_local
        self._cells = np.arange(cells, dtype=np.int32)
        self._u = fem.Function(V)
        dx = ufl.Measure("dx", mesh, metadata={"quadrature_degree": QUADRATURE_DEGREE})
        element = basix.ufl.quadrature_element("tetrahedron", value_shape=(7,), degree=QUADRATURE_DEGREE)
        history = fem.functionspace(mesh, element)
        self._history = fem.Function(history)
        self._at = history.dofmap.list[:cells]
        points = element.custom_quadrature()[0]
        h = self._history
        plastic_strain = ufl.as_matrix([[h[0], h[3], h[4]], [h[3], h[1], h[5]], [h[4], h[5], h[2]]])
        gradient, test = ufl.grad(self._u), ufl.TestFunction(V)
        A = displacement_measure(gradient)
        strain = logarithmic_strain(A) if material.finite else ufl.sym(gradient)
        parameters = {name: fem.Constant(mesh, np.float64(value)) for name, value in material.law[1].items()}
        stress, flowed, alpha = material.respond_ufl(strain, plastic_strain, h[6], parameters)
        F, cauchy = ufl.Identity(3) + gradient, stress
        if material.finite:
            S = piola_kirchhoff(A, stress)
            residual = ufl.inner(F * S, ufl.grad(test)) * dx
            cauchy = F * S * F.T / ufl.det(F)
        else:
            residual = ufl.inner(stress, ufl.sym(ufl.grad(test))) * dx
        self._residual = fem.form(residual)
        self._tangent = fem.form(ufl.derivative(residual, self._u))
        tensors = [tensor[ij] for tensor in (stress, flowed, cauchy) for ij in SYMMETRIC]
        outputs = [*tensors, alpha, ufl.det(F)]
        self._outputs = fem.Expression(ufl.as_vector(outputs), points, mesh.comm)
        self._matrix = fem.create_matrix(self._tangent)
        self._from, self._to = _positions(self._matrix, sparsity)
        self.volumes = self._quadrature_volumes(len(points))
        self.plastic_points = self.inverted_points = 0
        self._plastic, self._finite, self.linear = material.plastic, material.finite, material.linear

    def _quadrature_volumes(self, points: int) -> Floats:
        import basix
        import ufl
        from dolfinx import fem

        mesh = self._u.function_space.mesh
        reference, weights = basix.make_quadrature(basix.CellType.tetrahedron, QUADRATURE_DEGREE)
        J = fem.Expression(ufl.JacobianDeterminant(mesh), reference, mesh.comm)
        return np.abs(J.eval(mesh, self._cells).reshape(len(self._cells), points)) * weights

    def add_internal_force(self, u: Floats, b: Floats) -> None:
        self._u.x.array[:] = u.ravel()
        compat.assemble_vector_into(b.reshape(-1), self._residual)
        if not self.linear:
            state = self._state()
            self.plastic_points = int(np.sum(state.accumulated > self._committed()[..., 6])) if self._plastic else 0
            self.inverted_points = int(np.sum(state.det <= 0.0)) if self._finite else 0

    def tangent(self, u: Floats, values: Floats | Singles) -> None:
        from dolfinx import fem

        self._u.x.array[:] = u.ravel()
        self._matrix.data[:] = 0.0
        fem.assemble_matrix(self._matrix, self._tangent)
        values[:] = 0.0
        values[self._to] = self._matrix.data[self._from]

    def elastic_tangent(self, u: Floats, values: Floats | Singles) -> None:
        if self._finite:
            if self._plastic:
                raise InputError(
                    'output.stiffness of a plastic material in finite strain needs solver.kernels = "compiled"'
                )
            self.tangent(u, values)
            return
        state = [(f.x.array, f.x.array.copy()) for f in (self._u, self._history)]
        self._history.x.array[:] = 0.0
        self.tangent(np.zeros_like(u), values)  # the virgin material does not flow at rest
        for array, before in state:  # a commit needs the displacement of the last residual
            array[:] = before

    def drop_matrices(self) -> None:
        """Nothing is freed: assembly needs the matrix, and its positions, in place."""

    def commit(self) -> None:
        if self._plastic:
            values = self._history.x.array.reshape(-1, 7)
            state = self._state()
            values[self._at] = np.concatenate([state.plastic_strain, state.accumulated[..., None]], axis=-1)

    def restore(self, history: History) -> None:
        if self._plastic:
            values = self._history.x.array.reshape(-1, 7)
            values[self._at] = np.concatenate([history.plastic_strain, history.accumulated[..., None]], axis=-1)

    def history(self) -> History:
        committed = self._committed()
        if not self._plastic:
            committed = committed[:0]
        return History(plastic_strain=committed[..., :6], accumulated=committed[..., 6])

    def softened(self, before: History) -> bool:
        return False

    def stress(self, u: Floats) -> Floats:
        self._u.x.array[:] = u.ravel()
        return self._state().cauchy

    def conjugate_stress(self, u: Floats) -> Floats:
        self._u.x.array[:] = u.ravel()
        return self._state().stress

    def _committed(self) -> Floats:
        return self._history.x.array.reshape(-1, 7)[self._at]

    def _state(self) -> _State:
        out = self._outputs.eval(self._u.function_space.mesh, self._cells).reshape(len(self._cells), -1, 20)
        return _State(out[..., :6], out[..., 6:12], out[..., 12:18], out[..., 18], out[..., 19])


class _State(NamedTuple):
    """Results at the quadrature points (cells, points, ...)."""

    stress: Floats  # conjugate to the strain of the law
    plastic_strain: Floats
    cauchy: Floats
    accumulated: Floats
    det: Floats  # of the deformation gradient


def _positions(matrix: Any, sparsity: SparsityPattern) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int64]]:
    """Positions of values in a dolfinx matrix (3 x 3 blocks), and their positions in the local CSR matrix.

    The dolfinx matrix also holds blocks to which only other ranks contribute, some of them in columns that are no node
    of this rank. The sparsity pattern does not have them; they are left out.
    """
    nodes = len(sparsity.indptr) - 1
    n = max(nodes, int(matrix.indices.max(initial=0)) + 1)
    row = np.repeat(np.arange(len(matrix.indptr) - 1), np.diff(matrix.indptr)).astype(np.int64)
    keys = np.repeat(np.arange(nodes), np.diff(sparsity.indptr)).astype(np.int64) * n + sparsity.indices
    wanted = row * n + matrix.indices
    at = np.searchsorted(keys, wanted)
    held = np.flatnonzero(keys[np.minimum(at, len(keys) - 1)] == wanted)
    at, row = at[held], row[held]
    width = np.diff(sparsity.indptr).astype(np.int64)[row]
    column = at - sparsity.indptr[row]
    i, j = np.divmod(np.arange(9), 3)
    first = 9 * sparsity.indptr[row].astype(np.int64) + 3 * column
    return (9 * held[:, None] + np.arange(9)).ravel(), (first[:, None] + i * 3 * width[:, None] + j).ravel()
