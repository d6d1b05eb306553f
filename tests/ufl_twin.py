"""The element kernels once more, as UFL forms that are differentiated automatically: what the compiled ones are
compared with.

In finite strain (Miehe, Apel & Lambrecht, Comput. Methods Appl. Mech. Engrg. 191 (2002) 3383) the logarithm is an
integral without eigenvalues, ln(1 + A) = int_0^1 A (1 + s A)^-1 ds, by Gauss' rule (Higham, Functions of Matrices
(2008), section 11.5).
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from asperity.fem.history import History
from asperity.fem.solid import Solid
from asperity.mesh.element import QUADRATURE_DEGREE

Array = npt.NDArray[np.float64]

SYMMETRIC = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))  # order of stored tensor components
POINTS = 8  # of Gauss' rule: relative error 4e-15 for stretches from 0.8 to 1.25, 2e-8 at 0.5 and 2


class UflTwin:
    """What the tests use of `asperity.fem.kernels.ElementKernels`, with the material of a solid on its mesh."""

    def __init__(self, solid: Solid) -> None:
        import basix.ufl
        import ufl
        from dolfinx import fem

        mesh, material = solid.mesh, solid.material
        cells = len(solid.cell_nodes)
        self._cells = np.arange(cells, dtype=np.int32)
        self._u = fem.Function(solid.V)
        dx = ufl.Measure("dx", mesh, metadata={"quadrature_degree": QUADRATURE_DEGREE})
        element = basix.ufl.quadrature_element("tetrahedron", value_shape=(7,), degree=QUADRATURE_DEGREE)
        history = fem.functionspace(mesh, element)
        self._history = fem.Function(history)
        self._at = history.dofmap.list[:cells]
        points = element.custom_quadrature()[0]
        h = self._history
        plastic_strain = ufl.as_matrix([[h[0], h[3], h[4]], [h[3], h[1], h[5]], [h[4], h[5], h[2]]])
        gradient, test = ufl.grad(self._u), ufl.TestFunction(solid.V)
        A = gradient + gradient.T + gradient.T * gradient  # C - 1
        strain = logarithmic_strain(A) if material.finite else ufl.sym(gradient)
        parameters = {name: fem.Constant(mesh, np.float64(value)) for name, value in material.law[1].items()}
        if material.plastic:
            stress, flowed, alpha = return_map(strain, plastic_strain, h[6], **parameters)
        else:
            stress, flowed, alpha = hooke(strain, **parameters), plastic_strain, h[6]
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
        self._outputs = fem.Expression(ufl.as_vector([*tensors, alpha, ufl.det(F)]), points, mesh.comm)
        reference, weights = basix.make_quadrature(basix.CellType.tetrahedron, QUADRATURE_DEGREE)
        J = fem.Expression(ufl.JacobianDeterminant(mesh), reference, mesh.comm)
        self.volumes = np.abs(J.eval(mesh, self._cells).reshape(cells, len(points))) * weights
        self.plastic_points = self.inverted_points = 0
        self._plastic, self.linear, self._sparsity = material.plastic, material.linear, solid.sparsity

    def add_internal_force(self, u: Array, b: Array) -> None:
        from dolfinx.fem import assemble_vector

        self._u.x.array[:] = u.ravel()
        assemble_vector(b.reshape(-1), self._residual)
        state = self._state()
        self.plastic_points = int(np.sum(state.accumulated > self._committed()[..., 6])) if self._plastic else 0
        self.inverted_points = int(np.sum(state.det <= 0.0))

    def tangent(self, u: Array, values: Array) -> None:
        from dolfinx import fem

        self._u.x.array[:] = u.ravel()
        matrix = fem.assemble_matrix(self._tangent).to_scipy().tocsr()
        matrix.sort_indices()
        np.testing.assert_array_equal(matrix.indices, self._sparsity.columns)
        values[:] = matrix.data

    def commit(self) -> None:
        if self._plastic:
            state = self._state()
            values = np.concatenate([state.plastic_strain, state.accumulated[..., None]], axis=-1)
            self._history.x.array.reshape(-1, 7)[self._at] = values

    def history(self) -> History:
        committed = self._committed() if self._plastic else self._committed()[:0]
        return History(plastic_strain=committed[..., :6], accumulated=committed[..., 6])

    def stress(self, u: Array) -> Array:
        self._u.x.array[:] = u.ravel()
        return self._state().cauchy

    def conjugate_stress(self, u: Array) -> Array:
        self._u.x.array[:] = u.ravel()
        return self._state().stress

    def _committed(self) -> Array:
        committed: Array = self._history.x.array.reshape(-1, 7)[self._at]
        return committed

    def _state(self) -> State:
        out = self._outputs.eval(self._u.function_space.mesh, self._cells).reshape(len(self._cells), -1, 20)
        return State(out[..., :6], out[..., 6:12], out[..., 12:18], out[..., 18], out[..., 19])


class State(NamedTuple):
    """Results at the quadrature points (cells, points, ...)."""

    stress: Array  # conjugate to the strain of the law
    plastic_strain: Array
    cauchy: Array
    accumulated: Array
    det: Array  # of the deformation gradient


def logarithmic_strain(A: Any) -> Any:
    """Hencky strain 1/2 ln(1 + A) of A = C - 1."""
    return 0.5 * sum(weight * A * inverse for weight, inverse in _resolvents(A))


def piola_kirchhoff(A: Any, T: Any) -> Any:
    """Second stress of Piola and Kirchhoff 2 dE/dC : T; the derivative of A R along B is R B R, R = (1 + s A)^-1."""
    return sum(weight * inverse * T * inverse for weight, inverse in _resolvents(A))


def _resolvents(A: Any) -> list[tuple[float, Any]]:
    """Weights and (1 + s A)^-1 at the points s of Gauss' rule on [0, 1]."""
    import ufl

    points, weights = np.polynomial.legendre.leggauss(POINTS)
    inverses = [ufl.inv(ufl.Identity(3) + float(0.5 * (1.0 + x)) * A) for x in points]
    return [(float(0.5 * w), inverse) for w, inverse in zip(weights, inverses, strict=True)]


def hooke(strain: Any, lam: Any, mu: Any) -> Any:
    """Stress of linear isotropic elasticity."""
    import ufl

    return lam * ufl.tr(strain) * ufl.Identity(3) + 2.0 * mu * strain


def return_map(
    strain: Any,
    plastic_strain: Any,
    alpha: Any,
    lam: Any,
    mu: Any,
    yield_stress: Any,
    hardening: Any,
    kinematic_share: Any,
) -> tuple[Any, Any, Any]:
    """Stress, plastic strain and accumulated plastic strain at the end of a step by radial return in closed form.

    Simo & Hughes, Computational Inelasticity (1998), box 3.2, with linear hardening, for which the consistency
    condition is linear in the plastic multiplier.
    """
    import ufl

    bulk = lam + 2.0 * mu / 3.0
    back = 2.0 / 3.0 * kinematic_share * hardening * plastic_strain
    s_trial = 2.0 * mu * (ufl.dev(strain) - plastic_strain) - back
    squared = 1.5 * ufl.inner(s_trial, s_trial)
    size = yield_stress + (1.0 - kinematic_share) * hardening * alpha
    yields = ufl.gt(squared, size * size)
    # the square root is only differentiated where it is far from zero
    q = ufl.sqrt(ufl.conditional(yields, squared, size * size))
    dgamma = (q - size) / (3.0 * mu + hardening)
    stress = bulk * ufl.tr(strain) * ufl.Identity(3) + (1.0 - 3.0 * mu * dgamma / q) * s_trial + back
    return stress, plastic_strain + 1.5 * dgamma / q * s_trial, alpha + dgamma
