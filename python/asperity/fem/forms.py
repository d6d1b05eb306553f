"""The element kernels as forms of UFL that dolfinx compiles: any law, by the interface of `fem.kernels`."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import field, make_dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from asperity.arrays import Floats, Integers, Singles
from asperity.errors import CompatError, InputError
from asperity.fem.cell_flow import CellFlow
from asperity.fem.history import History
from asperity.fem.kernels import relaxation_of
from asperity.fem.sparsity import SparsityPattern
from asperity.fem.weak_form import WeakForm, measure
from asperity.laws.definition import SHAPES, USUAL, Law
from asperity.laws.shipped import hooke
from asperity.mesh.element import QUADRATURE_DEGREE
from asperity.model.material import Material
from asperity.runtime.compiled import solver as _solver

TIMEOUT = 3600  # for which a rank waits for another's compiler [s]


def jit_options() -> dict[str, Any]:
    """Options of the form compiler: compiled forms are kept in the user's cache folder."""
    cache = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "asperity" / "forms"
    return {"cache_dir": str(cache), "timeout": TIMEOUT, "cffi_extra_compile_args": ["-O2", "-g0"]}


@contextmanager
def compiling() -> Iterator[None]:
    """Say what is missing where the form compiler cannot work."""
    try:
        yield
    except (OSError, RuntimeError, ImportError) as error:
        raise CompatError(
            f"solver.kernels = forms compiles C into {jit_options()['cache_dir']}, which failed: "
            f"{' '.join(str(error).split())[:200]}; it needs a C compiler and a folder that can be written"
        ) from error


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
        import basix
        import basix.ufl
        from dolfinx import fem

        mesh, self._law = V.mesh, material.in_ufl
        self._finite, self.linear, self._sparsity = material.finite, material.linear, sparsity
        self._cell_nodes, self._cells = cell_nodes, np.arange(len(cell_nodes), dtype=np.int32)
        self._points, self._weights = basix.make_quadrature(basix.CellType.tetrahedron, QUADRATURE_DEGREE)
        self._u = fem.Function(V)
        self._state: Any = None
        if self._law.state:
            self._width = sum(SHAPES[shape] for shape in self._law.state.values())
            element = basix.ufl.quadrature_element("tetrahedron", value_shape=(self._width,), degree=QUADRATURE_DEGREE)
            self._state = fem.Function(fem.functionspace(mesh, element))
            self._at = self._state.function_space.dofmap.list[: len(cell_nodes)]
        self._moduli = fem.Constant(mesh, np.float64(material.E)), fem.Constant(mesh, np.float64(material.nu))
        self._constants = {name: fem.Constant(mesh, np.float64(value)) for name, value in self._law.parameters}
        self.relaxation = relaxation_of(material)
        self._cell: CellFlow | None = None
        if np.isfinite(self.relaxation).all():
            bulk = material.E / (3.0 * (1.0 - 2.0 * material.nu))
            self._cell = CellFlow(mesh, self.volumes, bulk, self.relaxation)
        self._flowing = self._now = self._forms(held=False)
        rows = len(cell_nodes) if self._law.state else 0
        kind = history_of(self._law)
        self._committed, self._trial = (kind.zeros(rows, len(self._weights)) for _ in range(2))
        self._stale = False  # whether the trial history is of an earlier force

    def _forms(self, held: bool) -> _Compiled:
        cell = self._cell and self._cell.coefficients
        weak = WeakForm(self._u, self._state, self._law, self._constants, self._finite, held, cell)
        return _Compiled(weak, self._sparsity, self._cells, self._points)

    def compile(self, elastic: bool = False) -> None:
        """Compile what a load path needs, and with `elastic` its stiffness without flow; collective."""
        for of in [self._flowing, *([self._without_flow] if elastic else [])]:
            _ = of.residual, of.matrix, of.stresses, of.after if self._law.state else None
        if self._cell is not None:
            _ = self._flowing.measures, self._flowing.measure_rows
        _ = self.volumes, self._flowing.gradient

    @cached_property
    def _without_flow(self) -> _Compiled:
        if not self._law.state:
            return self._flowing
        if self._law.elastic is None:
            raise InputError(
                f'material.law = "{self._law.source}" does not say what it is without flow, which stiffness and '
                "slip need: declare @asp.law(state=..., elastic=...)"
            )
        return self._forms(held=True)

    @cached_property
    def volumes(self) -> Floats:
        """Of the quadrature points before deformation (cells, points) [L^3]."""
        import ufl

        mesh = self._u.function_space.mesh
        J = _Values(ufl.JacobianDeterminant(mesh), (1,), mesh, self._points)
        return np.abs(J(self._cells)[..., 0]) * self._weights

    @property
    def plastic_points(self) -> int:
        """Points that yielded in the last internal force."""
        return int(np.sum(self._find_trial().accumulated > self._committed.accumulated))

    @property
    def inverted_points(self) -> int:
        """Points that finite strain turned inside out there: no valid state."""
        return int(np.sum(np.linalg.det(np.eye(3) + self._gradient()) <= 0.0)) if self._finite else 0

    def _gradient(self) -> Floats:
        return self._flowing.gradient(self._cells)

    def strain(self, u: Floats) -> Floats:
        """Strain of u, in finite strain the logarithmic one (cells, points, 3, 3)."""
        self._find_trial()
        self._u.x.array[:] = u.ravel()
        gradient = self._gradient()
        if not self._finite:
            return 0.5 * (gradient + np.swapaxes(gradient, 2, 3))
        F = np.eye(3) + gradient
        squares, axes = np.linalg.eigh(np.swapaxes(F, 2, 3) @ F)
        return np.einsum("...ik,...k,...jk->...ij", axes, 0.5 * np.log(np.maximum(squares, 1e-300)), axes)

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
    def _small_elastic(self) -> _Matrix:
        """Elastic stiffness in small strain."""
        import ufl

        V = self._u.function_space
        w, v = ufl.TrialFunction(V), ufl.TestFunction(V)
        stress = hooke(ufl.sym(ufl.grad(w)), *self._moduli)
        return _Matrix(ufl.inner(stress, ufl.sym(ufl.grad(v))) * measure(V.mesh), self._sparsity)

    def elastic_tangent(self, u: Floats, values: Floats | Singles) -> None:
        """Write the local matrix at u for a motion without plastic flow."""
        self._write(self._without_flow, self._find_trial(), u, values)

    def _write(
        self, forms: _Compiled, history: History, u: Floats, values: Floats | Singles, shift: float = 0.0
    ) -> None:
        from scipy import sparse

        self._set(forms, u, history)
        blocks, pattern = forms.matrix.blocks(), self._sparsity
        if shift > 0.0 and self._finite:
            blocks += shift * self._small_elastic.blocks()
        if self._cell is not None and len(cells := self._cell.flowing):
            self._add(cells, self._cell.stiffness(forms.measure_rows(cells)), blocks)
        nodes = len(pattern.indptr) - 1
        full = sparse.bsr_array((blocks, pattern.indices, pattern.indptr), shape=(3 * nodes, 3 * nodes)).tocsr().data
        if values.dtype == np.float32:
            _solver.upper_half(pattern.indptr, pattern.indices, full, values)
        else:
            values[:] = full

    def _add(self, cells: Integers, matrices: Floats, blocks: Floats) -> None:
        """Add matrices of cells (n, 30, 30) to the blocks of the node pattern."""
        nodes = self._cell_nodes[cells]
        at = self._sparsity.positions(nodes[:, :, None], nodes[:, None, :])
        np.add.at(blocks, at, matrices.reshape(len(cells), 10, 3, 10, 3).swapaxes(2, 3))

    def drop_matrices(self) -> None:
        """Free stored matrices; they are made again when they are needed."""
        for forms in {self._flowing, self._now, self.__dict__.get("_without_flow", self._now)}:
            forms.matrix.drop()

    @property
    def last(self) -> History:
        """History of the last internal force, not a copy."""
        return self._find_trial()

    def commit(self) -> None:
        """Make the trial history the committed one."""
        self._committed.assign(self._find_trial())

    def restore(self, history: History) -> None:
        """Overwrite the committed history."""
        self._find_trial()
        self._committed.assign(history)

    @contextmanager
    def holding(self) -> Iterator[None]:
        """Keep the plastic strain as it is in a block."""
        self._find_trial()
        self._now = self._without_flow
        try:
            yield
        finally:
            self._find_trial()
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
        self._find_trial()
        self._set(self._now, u, self._committed if history is None else history)
        return self._now.stresses(self._cells)

    def _set(self, forms: _Compiled, u: Floats, history: History) -> None:
        """Set the coefficients of some forms."""
        self._u.x.array[:] = u.ravel()
        if self._state is not None:
            stored = [np.atleast_3d(getattr(history, name)) for name in self._law.state]
            self._state.x.array.reshape(-1, self._width)[self._at] = np.concatenate(stored, axis=2)
        if self._cell is not None:
            self._cell.settle(history.dilatation, forms.measures if forms is self._flowing else None)

    def _find_trial(self) -> History:
        """History after the last internal force, whose displacement and committed history are still set."""
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


def _compiled(form: Any) -> Any:
    from dolfinx import fem

    with compiling():
        return fem.form(form, jit_options=jit_options())


class _Values:
    """Values of an expression at the quadrature points of cells; with an argument, by its dofs."""

    def __init__(self, expression: Any, shape: tuple[int, ...], mesh: Any, points: Floats) -> None:
        from dolfinx import fem

        self._mesh, self._shape = mesh, (len(points), *shape)
        with compiling():
            self._expression = fem.Expression(expression, points, mesh.comm, jit_options=jit_options())

    def __call__(self, cells: Integers) -> Floats:
        """At the current coefficients (cells, points, ...)."""
        values: Floats = self._expression.eval(self._mesh, cells).reshape(len(cells), *self._shape)
        return values


class _Compiled:
    """A weak form compiled, each of its parts at first use."""

    def __init__(self, weak: WeakForm, sparsity: SparsityPattern, cells: Integers, points: Floats) -> None:
        self._weak, self._sparsity, self._at = weak, sparsity, (weak.mesh, points)

    @cached_property
    def residual(self) -> Any:
        return _compiled(self._weak.residual)

    @cached_property
    def matrix(self) -> _Matrix:
        return _Matrix(self._weak.tangent, self._sparsity)

    @cached_property
    def stresses(self) -> _Values:
        return _Values(self._weak.stresses, (12,), *self._at)

    @cached_property
    def after(self) -> _Values:
        after = self._weak.after
        return _Values(after, after.ufl_shape, *self._at)

    @cached_property
    def gradient(self) -> _Values:
        return _Values(self._weak.gradient, (3, 3), *self._at)

    @cached_property
    def measures(self) -> _Values:
        return _Values(self._weak.measures, (3,), *self._at)

    @cached_property
    def measure_rows(self) -> _Values:
        return _Values(self._weak.measure_rows, (2, 30), *self._at)


class _Matrix:
    """Matrix of a form as blocks of the node pattern, this rank's part."""

    def __init__(self, form: Any, sparsity: SparsityPattern) -> None:
        self._form, self._sparsity = _compiled(form), sparsity
        self._matrix: Any = None

    def blocks(self) -> Floats:
        """At the current coefficients (blocks, 3, 3)."""
        from dolfinx import fem

        if self._matrix is None:
            self._matrix = fem.create_matrix(self._form)
            self._at = _positions(self._matrix, self._sparsity)
        self._matrix.set_value(0.0)
        fem.assemble_matrix(self._matrix, self._form)
        values: Floats = self._matrix.data.reshape(-1, 3, 3)[self._at]
        return values

    def drop(self) -> None:
        """Free the values."""
        self._matrix = None


def nodal_matrix(V: Any, sparsity: SparsityPattern, of: Callable[[Any, Any], Any], degree: int) -> Any:
    """Matrix of one component of a form that treats the components alike, SciPy CSR (nodes, nodes), this rank's part.

    Args:
        of: integrand of trial and test function
        degree: of the quadrature
    """
    import ufl
    from scipy import sparse

    form = of(ufl.TrialFunction(V), ufl.TestFunction(V)) * measure(V.mesh, degree)
    data = _Matrix(form, sparsity).blocks()[:, 0, 0].copy()
    nodes = len(sparsity.indptr) - 1
    return sparse.csr_array((data, sparsity.indices, sparsity.indptr), shape=(nodes, nodes))


def _positions(matrix: Any, sparsity: SparsityPattern) -> Integers:
    """Where the blocks of a node pattern are in a matrix of dolfinx, whose rows have those of other ranks too."""
    rows, columns = matrix.index_map(0), matrix.index_map(1)
    of_rows, of_columns = (
        m.local_to_global(np.arange(m.size_local + m.num_ghosts, dtype=np.int32)) for m in (rows, columns)
    )
    width = columns.size_global
    theirs = np.repeat(np.arange(len(matrix.indptr) - 1), np.diff(matrix.indptr)) * width + of_columns[matrix.indices]
    order = np.argsort(theirs)
    nodes = np.repeat(np.arange(len(sparsity.indptr) - 1), np.diff(sparsity.indptr))
    ours = nodes * width + of_rows[sparsity.indices]
    return order[np.searchsorted(theirs, ours, sorter=order)].astype(np.int32)
