"""Sparse matrices with three dofs a node: the part of a process, and the sum of all parts as a matrix of PETSc."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

if TYPE_CHECKING:
    from asperity.fem.solid import Solid

Integers = npt.NDArray[np.int32]


class NodeGraph:
    """Sparsity of the local matrix: nodes that share a cell of this process, ghost nodes included.

    Attributes:
        indptr, indices: CSR graph of the nodes (indices ascending)
        rows, columns: CSR of the matrix with three dofs a node
        diagonal: positions of its diagonal among its values
    """

    def __init__(self, cell_nodes: Integers, nodes: int) -> None:
        from scipy import sparse

        cells = len(cell_nodes)
        incidence = sparse.csr_array(
            (
                np.ones(cell_nodes.size, dtype=np.int32),
                cell_nodes.ravel(),
                np.arange(cells + 1) * cell_nodes.shape[1],
            ),
            shape=(cells, nodes),
        )
        # the unit matrix keeps the diagonal of nodes that no local cell holds
        graph = (incidence.T @ incidence + sparse.eye_array(nodes, dtype=np.int32)).tocsr()
        graph.sort_indices()
        self.indptr = graph.indptr.astype(np.int32)
        self.indices = graph.indices.astype(np.int32)
        width = np.diff(self.indptr)
        self.rows = np.concatenate([[0], np.cumsum(np.repeat(3 * width, 3))]).astype(np.int32)
        self.columns = self._columns(width)
        self.diagonal = self._diagonal()

    def _columns(self, width: Integers) -> Integers:
        """Column numbers of the dofs: each node's list of columns, expanded and repeated for its three rows."""
        expanded = (3 * self.indices[:, None] + np.arange(3, dtype=np.int32)).ravel()
        out = np.empty(3 * len(expanded), dtype=np.int32)
        start = 3 * self.indptr[:-1].astype(np.int64)
        row_of = np.repeat(np.arange(len(width)), 3 * width)
        local = np.arange(len(expanded)) - start[row_of]
        for i in range(3):
            out[3 * start[row_of] + i * 3 * width[row_of].astype(np.int64) + local] = expanded
        return out

    def _diagonal(self) -> Integers:
        node = np.arange(len(self.indptr) - 1)
        row_of = np.repeat(node, np.diff(self.indptr))
        at = np.flatnonzero(self.indices == row_of) - self.indptr[:-1]
        out = self.rows[:-1].reshape(-1, 3) + 3 * at[:, None] + np.arange(3)
        return out.ravel().astype(np.int32)


class NodeMatrix:
    """PETSc matrix over the local CSR: shared memory in one process, added up from the parts of several.

    Args:
        graph: sparsity of this process's part
        index_map: of the nodes
        comm: of the processes

    Attributes:
        values: of this process's part, in the order of `graph.columns`
        A: the matrix; in one process it works on `values`, and an elimination changes them
    """

    def __init__(self, graph: NodeGraph, index_map: Any, comm: Any) -> None:
        from petsc4py import PETSc

        self.graph, self._comm = graph, comm
        self.values = np.zeros(len(graph.columns))
        sizes = (3 * index_map.size_local, 3 * index_map.size_global)
        if comm.size == 1:
            csr = graph.rows, graph.columns, self.values
            self.A = PETSc.Mat().createAIJWithArrays(sizes, csr, bsize=3, comm=comm)
            return
        self.A = PETSc.Mat().create(comm)
        self.A.setSizes((sizes, sizes), bsize=3)
        self.A.setType("aij")
        self.A.setUp()
        nodes = np.arange(len(graph.indptr) - 1, dtype=np.int32)
        numbers = index_map.local_to_global(nodes).astype(PETSc.IntType)
        lgmap = PETSc.LGMap().create(numbers, bsize=3, comm=comm)
        self.A.setLGMap(lgmap, lgmap)

    def assemble(self) -> None:
        """Bring `values` to the matrix; collective."""
        from petsc4py import PETSc

        if self._comm.size > 1:
            self.A.zeroEntries()
            self.A.setValuesLocalCSR(self.graph.rows, self.graph.columns, self.values, PETSc.InsertMode.ADD)
        self.A.assemble()


def assembled(solid: Solid) -> Any:
    """The current tangent of a solid as a matrix of PETSc of its own; collective."""
    matrix = NodeMatrix(solid.graph, solid.V.dofmap.index_map, solid.comm)
    np.copyto(matrix.values, solid.values)
    matrix.assemble()
    return matrix.A


def set_rigid_modes(A: Any, points: npt.NDArray[np.float64]) -> None:
    """Give A the rigid-body modes of its nodes `points` (n, 3), ghosts last, as the near-null space multigrid needs."""
    from petsc4py import PETSc

    basis: list[Any] = []
    for mode in rigid_modes(points):
        v = A.createVecRight()
        v.array = mode.ravel()[: v.getLocalSize()]
        for b in basis:
            v.axpy(-v.dot(b), b)
        v.normalize()
        basis.append(v)
    A.setNearNullSpace(PETSc.NullSpace().create(vectors=basis, comm=A.getComm()))


def rigid_modes(points: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """Three translations and three rotations about the middle of the unit cube at points (n, 3): (6, n, 3)."""
    x = points - 0.5
    modes = np.zeros((6, len(x), 3))
    for k in range(3):
        modes[k, :, k] = 1.0
        i, j = (k + 1) % 3, (k + 2) % 3
        modes[3 + k, :, i], modes[3 + k, :, j] = -x[:, j], x[:, i]
    return modes
