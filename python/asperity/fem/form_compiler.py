"""Forms and expressions of UFL that dolfinx compiles, and matrices of forms on the node pattern of the solid."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from asperity.arrays import Floats, Integers
from asperity.errors import CompatError
from asperity.fem.sparsity import SparsityPattern
from asperity.mesh.element import QUADRATURE_DEGREE, quadrature

TIMEOUT = 3600  # for which a rank waits for another's compiler [s]


def compiled(kind: Callable[..., Any], *what: Any) -> Any:
    """A form or an expression compiled, and kept in the user's cache folder.

    Raises:
        CompatError: the form compiler cannot work
    """
    cache = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "asperity" / "forms"
    options = {"cache_dir": str(cache), "timeout": TIMEOUT, "cffi_extra_compile_args": ["-O2", "-g0"]}
    try:
        return kind(*what, jit_options=options)
    except (OSError, RuntimeError, ImportError) as error:
        raise CompatError(
            f"solver.kernels = forms compiles C into {cache}, which failed: {' '.join(str(error).split())[:200]}; it "
            "needs a C compiler and a folder that can be written"
        ) from error


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
    data = Matrix(form, sparsity).blocks()[:, 0, 0].copy()
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
