"""The weak form of a solid with a law in UFL, as dolfinx compiles it: virtual work, its linearisation, and values.

Small strain: integral of sigma(eps(u)) : eps(v). Finite strain: a law of a strain is one of the logarithmic strain
(Miehe, Apel & Lambrecht, Comput. Methods Appl. Mech. Engrg. 191 (2002) 3383), whose logarithm is an integral without
eigenvalues, ln(1 + A) = int_0^1 A (1 + s A)^-1 ds, by Gauss' rule (Higham, Functions of Matrices (2008), section 11.5);
an energy of F is differentiated as it stands.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from functools import cached_property
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from asperity.arrays import Floats, Integers
from asperity.errors import CompatError
from asperity.fem.sparsity import SparsityPattern
from asperity.laws.definition import SHAPES, STRENGTH, SYMMETRIC, Law
from asperity.mesh.element import QUADRATURE_DEGREE, quadrature

TIMEOUT = 3600  # for which a rank waits for another's compiler [s]
POINTS = 8  # of Gauss' rule: relative error 4e-15 for stretches from 0.8 to 1.25, 2e-8 at 0.5 and 2


def compiled(kind: Callable[..., Any], *what: Any) -> Any:
    """A form or an expression compiled, and kept in the user's cache folder.

    Raises:
        CompatError: the form compiler cannot work
    """
    cache = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "asperity" / "forms"
    options = {"cache_dir": str(cache), "timeout": TIMEOUT, "cffi_extra_compile_args": ["-O2", "-g0"]}
    options["cffi_libraries"] = []  # whatever a file of options in the working folder names
    try:
        return kind(*what, jit_options=options)
    except (OSError, RuntimeError, ImportError) as error:
        raise CompatError(
            f"solver.kernels = forms compiles C into {cache}, which failed: {' '.join(str(error).split())[:200]}; it "
            "needs a C compiler and a folder that can be written"
        ) from error


class Constants:
    """Numbers in forms and expressions, which may change after these are compiled.

    They are one vector: UFL sorts the constants of a sum or product by their numbers as text, "10" before "9", and a
    form would be compiled again in each process that made another number of constants before.

    Attributes:
        named: scalar of UFL by name, a component of one constant
    """

    def __init__(self, mesh: Any, values: Mapping[str, float]) -> None:
        from dolfinx import fem

        self._place = {name: i for i, name in enumerate(values)}
        self._vector = fem.Constant(mesh, np.array([*values.values(), 0.0]))
        self.named = {name: self._vector[i] for name, i in self._place.items()}

    def __setitem__(self, name: str, value: float) -> None:
        self._vector.value[self._place[name]] = value


def variable(expression: Any, number: int) -> Any:
    """Variable of UFL, to differentiate by; `number`, from 1, is its own among the variables of a form.

    UFL counts the variables of a process, and the count is part of the name of a compiled form: the form of the next
    mesh would be compiled again. Counts of UFL are not negative, so those in the law of a user differ.
    """
    from ufl.classes import Label, Variable

    return Variable(expression, Label(-number))


def measure(mesh: Any, degree: int = QUADRATURE_DEGREE) -> Any:
    """Integral over the block by the rule of the elements."""
    import ufl

    return ufl.Measure("dx", mesh, metadata={"quadrature_degree": degree})


class Values:
    """Values of an expression at the quadrature points of cells; with an argument, by its dofs."""

    def __init__(self, expression: Any, shape: tuple[int, ...], mesh: Any) -> None:
        from dolfinx import fem

        points, _ = quadrature(QUADRATURE_DEGREE)
        self._mesh, self._shape = mesh, (len(points), *shape)
        self._expression = compiled(fem.Expression, expression, points, mesh.comm)

    def __call__(self, cells: Integers) -> Floats:
        """At the current coefficients (cells, points, ...)."""
        values: Floats = self._expression.eval(self._mesh, cells).reshape(len(cells), *self._shape)
        return values


class PointValues:
    """Values of several components at the quadrature points, as coefficients of forms.

    Attributes:
        function: of dolfinx
    """

    def __init__(self, mesh: Any, cells: int, width: int) -> None:
        import basix.ufl
        from dolfinx import fem

        element = basix.ufl.quadrature_element("tetrahedron", value_shape=(width,), degree=QUADRATURE_DEGREE)
        self.function = fem.Function(fem.functionspace(mesh, element))
        self._at = self.function.function_space.dofmap.list[:cells]
        self._stored = self.function.x.array.reshape(-1, width)

    def put(self, values: Any, cells: Any = slice(None), of: Any = slice(None)) -> None:
        """Set some components in some cells."""
        self._stored[self._at[cells], of] = values


class Matrix:
    """Matrix of a form as blocks of the node pattern, this rank's part."""

    def __init__(self, form: Any, sparsity: SparsityPattern) -> None:
        from dolfinx import fem

        self._form, self._sparsity = compiled(fem.form, form), sparsity
        self._matrix: Any = None

    def blocks(self) -> Floats:
        """At the current coefficients (blocks, 3, 3)."""
        from dolfinx import fem
        from scipy import sparse

        if self._matrix is None:
            self._matrix = fem.create_matrix(self._form)
            # its rows have the blocks of other ranks too
            entries, sparsity = np.arange(len(self._matrix.indices)) + 1, self._sparsity
            number = sparse.csr_matrix((entries, self._matrix.indices, self._matrix.indptr))
            row = np.repeat(np.arange(len(sparsity.indptr) - 1), np.diff(sparsity.indptr))
            self._at = np.asarray(number[row, sparsity.indices]).ravel() - 1
        self._matrix.set_value(0.0)
        fem.assemble_matrix(self._matrix, self._form)
        values: Floats = self._matrix.data.reshape(-1, 3, 3)[self._at]
        return values

    def drop(self) -> None:
        """Free the values."""
        self._matrix = None


class WeakForm:
    """Weak form of a law, each of its parts compiled at its first use.

    Args:
        u: displacement, a function of dolfinx
        state: its stored components at the quadrature points, a function of dolfinx; None without a state
        law: with stresses in units of E
        parameters: constants by name
        sparsity: of the matrix
        finite: whether strains may be large
        held: whether the state stays as it is
        cell: coefficients of `CellFlow`, where the volumetric strain within a cell relaxes
    """

    def __init__(
        self,
        u: Any,
        state: Any,
        law: Law,
        parameters: dict[str, Any],
        sparsity: SparsityPattern,
        finite: bool,
        held: bool = False,
        cell: Any = None,
    ) -> None:
        import ufl

        self._u, self._law, self._sparsity, self._finite, self.held = u, law, sparsity, finite, held
        self._F = variable(ufl.Identity(3) + ufl.grad(u), 1)
        self._log = _LogStrain(ufl.grad(u)) if finite else None
        self._strain = strain = variable(self._log.strain if self._log else ufl.sym(ufl.grad(u)), 2)
        if law.hyperelastic:
            self._energy = law.energy(self._F, parameters)
            self._nominal = ufl.diff(self._energy, self._F)
            return
        if cell is not None:
            self._relief = variable(cell[3], 3)
            permanent = cell[0] + (1.0 - cell[2]) * (ufl.tr(strain) - cell[1] - cell[0])
            strain = strain - permanent / 3.0 * ufl.Identity(3)
            parameters = parameters | {STRENGTH: parameters[STRENGTH] - law.unit * self._relief}
        self._before = unpacked(law, state)
        self._stress, self._after = law.stress(strain, self._before, parameters, held)
        self._nominal = self._nominal_of(self._stress)

    def _nominal_of(self, stress: Any) -> Any:
        """First stress of Piola and Kirchhoff of a stress conjugate to the strain."""
        return self._F * self._log.second_stress(stress) if self._log else stress

    def _work(self, nominal: Any) -> Any:
        """Of a stress along a virtual displacement."""
        import ufl

        of_v = ufl.grad(ufl.TestFunction(self._u.function_space))
        return ufl.inner(nominal, of_v if self._finite else ufl.sym(of_v))

    def _at_points(self, parts: list[Any], *shape: int) -> Values:
        import ufl

        return Values(ufl.as_vector(parts), (len(parts), *shape), self._u.function_space.mesh)

    @cached_property
    def residual(self) -> Any:
        """Virtual work of the stresses."""
        from dolfinx import fem

        return compiled(fem.form, self._work(self._nominal) * measure(self._u.function_space.mesh))

    @cached_property
    def matrix(self) -> Matrix:
        """Linearisation of `residual`; by hand about the logarithm, which takes the form compiler a tenth."""
        import ufl

        V = self._u.function_space
        w, of_v = ufl.TrialFunction(V), ufl.grad(ufl.TestFunction(V))
        if self._law.hyperelastic or self._log is None:
            integrand = ufl.derivative(self._work(self._nominal), self._u, w)
        else:
            stiffness = self._log.stiffness(self._stress, ufl.diff(self._stress, self._strain))
            of_C = [self._F.T * of + of.T * self._F for of in (ufl.grad(w), of_v)]
            rates = [ufl.as_vector([of[ij] for ij in SYMMETRIC]) for of in of_C]
            integrand = ufl.inner(stiffness * rates[0], rates[1])
            integrand += ufl.inner(ufl.grad(w) * self._log.second_stress(self._stress), of_v)
        return Matrix(integrand * measure(V.mesh), self._sparsity)

    @cached_property
    def stresses(self) -> Values:
        """Components of Cauchy's stress, and of the one that is conjugate to the strain of the law (12,)."""
        import ufl

        kirchhoff = self._nominal * self._F.T if self._finite else self._nominal
        cauchy = kirchhoff / ufl.det(self._F) if self._finite else kirchhoff
        conjugate = kirchhoff if self._law.hyperelastic else self._stress
        return self._at_points([tensor[ij] for tensor in (cauchy, conjugate) for ij in SYMMETRIC])

    @cached_property
    def kinematics(self) -> Values:
        """Strain, in finite strain the logarithmic one, and the volume after deformation over that before (10,)."""
        import ufl

        return self._at_points([*(self._strain[i, j] for i in range(3) for j in range(3)), ufl.det(self._F)])

    @cached_property
    def energy(self) -> Values:
        """Energy per volume of a hyperelastic law (1,)."""
        return self._at_points([self._energy])

    @cached_property
    def after(self) -> Values:
        """Stored components of the new state (k,)."""
        return self._at_points(packed(self._law, self._after))

    @cached_property
    def measures(self) -> Values:
        """Dilatation, increment of the accumulated plastic strain, and its derivative by a relief (3,)."""
        import ufl

        return self._at_points([ufl.tr(self._strain), self._flow, ufl.diff(self._flow, self._relief)])

    @cached_property
    def measure_rows(self) -> Values:
        """Derivatives of dilatation and flow along a virtual displacement, by the dofs of the cell (2, 30)."""
        import ufl

        driving = ufl.sym(ufl.diff(self._flow, self._strain))
        return self._at_points([self._work(self._nominal_of(of)) for of in (ufl.Identity(3), driving)], 30)

    @property
    def _flow(self) -> Any:
        return self._after["accumulated"] - self._before["accumulated"]


def packed(law: Law, state: Mapping[str, Any], transposed: bool = False) -> list[Any]:
    """Stored components of state variables, the inverse of `unpacked`; of their transposed tensors where wanted."""
    parts: list[Any] = []
    for name, shape in law.state.items():
        value = state[name]
        places: Any = [ij[::-1] if transposed else ij for ij in SYMMETRIC] if shape == (3, 3) else range(3)
        parts += [value] if shape == () else [value[at] for at in places]
    return parts


def unpacked(law: Law, state: Any) -> dict[str, Any]:
    """State variables by name of their stored components."""
    import ufl

    out: dict[str, Any] = {}
    at = 0
    for name, shape in law.state.items():
        h = [state[at + i] for i in range(SHAPES[shape])]
        if shape == (3, 3):
            out[name] = ufl.as_matrix([[h[0], h[3], h[4]], [h[3], h[1], h[5]], [h[4], h[5], h[2]]])
        else:
            out[name] = ufl.as_vector(h) if shape else h[0]
        at += SHAPES[shape]
    return out


class _LogStrain:
    """Logarithmic strain E = 1/2 ln C of a displacement gradient, and what its derivatives make of stresses."""

    def __init__(self, gradient: Any) -> None:
        import ufl

        A = gradient + gradient.T + gradient.T * gradient  # C - 1
        at, weights = np.polynomial.legendre.leggauss(POINTS)
        self._rule = [(float(0.5 * (1.0 + s)), float(0.5 * w)) for s, w in zip(at, weights, strict=True)]
        self._R = [ufl.inv(ufl.Identity(3) + s * A) for s, _ in self._rule]
        self.strain = 0.5 * sum(w * A * R for (_, w), R in zip(self._rule, self._R, strict=True))

    def second_stress(self, T: Any) -> Any:
        """Second stress of Piola and Kirchhoff 2 dE/dC : T; the derivative of A R along B is R B R."""
        return sum(w * R * T * R for (_, w), R in zip(self._rule, self._R, strict=True))

    def stiffness(self, T: Any, M: Any) -> Any:
        """dE/dC : M : dE/dC + T : d2E/dC2 for M = dT/dE, as a matrix of the components of two rates of C (6, 6)."""
        import ufl

        def both(ij: tuple[int, int]) -> set[tuple[int, int]]:
            return {ij, ij[::-1]}

        def upper(R: Any, i: int, j: int) -> Any:  # the same node for both halves of a symmetric tensor
            return R[min(i, j), max(i, j)]

        rule = [(s, w, R, R * T * R) for (s, w), R in zip(self._rule, self._R, strict=True)]
        of_C, moduli, curvature = ([[0.0] * 6 for _ in range(6)] for _ in range(3))
        for (a, (i, j)), (b, second) in product(enumerate(SYMMETRIC), enumerate(SYMMETRIC)):
            of_C[a][b] = sum(0.5 * w * upper(R, i, k) * upper(R, m, j) for _, w, R, _ in rule for k, m in both(second))
            moduli[a][b] = len(both((i, j))) * sum(M[i, j, k, m] for k, m in both(second))
            curvature[a][b] = curvature[b][a] if b < a else sum(
                -0.5 * w * s * (upper(Q, m, p) * upper(R, q, k) + upper(R, m, p) * upper(Q, q, k))
                for s, w, R, Q in rule for p, q in both((i, j)) for k, m in both(second)
            )  # fmt: skip
        first = ufl.as_matrix(of_C)
        return first.T * ufl.as_matrix(moduli) * first + ufl.as_matrix(curvature)
