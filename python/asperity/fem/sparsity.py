"""Sparsity pattern of the tangent on one rank, three dofs a node."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from asperity.arrays import Indices, Integers


class SparsityPattern:
    """Sparsity pattern of the local matrix. Nodes that share a cell of this rank are coupled, ghost nodes included.

    Attributes:
        indptr, indices: CSR pattern of the nodes (indices ascending)
        size: number of values of the matrix, three dofs a node
    """

    def __init__(self, cell_nodes: Integers, nodes: int) -> None:
        from scipy import sparse

        cells = len(cell_nodes)
        incidence = sparse.csr_array(
            (np.ones(cell_nodes.size, dtype=np.int32), cell_nodes.ravel(), np.arange(cells + 1) * cell_nodes.shape[1]),
            shape=(cells, nodes),
        )
        # the unit matrix keeps the diagonal of nodes that no local cell holds
        graph = (incidence.T @ incidence + sparse.eye_array(nodes, dtype=np.int32)).tocsr()
        graph.sort_indices()
        self.indptr = graph.indptr.astype(np.int32)
        self.indices = graph.indices.astype(np.int32)
        self.size = 9 * len(self.indices)

    def positions(self, rows: Integers, columns: Integers) -> Indices:
        """Positions of pairs of coupled nodes among the blocks."""
        nodes = len(self.indptr) - 1
        keys = np.repeat(np.arange(nodes), np.diff(self.indptr)) * nodes + self.indices
        return np.asarray(np.searchsorted(keys, rows.astype(np.int64) * nodes + columns), dtype=np.int64)

    @cached_property
    def upper(self) -> tuple[Integers, Integers]:
        """Row starts and columns of the upper half of the node pattern; the diagonal comes first in its row."""
        above = self.indices >= np.repeat(np.arange(len(self.indptr) - 1), np.diff(self.indptr))
        starts = np.concatenate([[0], np.cumsum(above)])[self.indptr].astype(np.int32)
        return starts, self.indices[above]

    def diagonals(self, blocks: Indices) -> Indices:
        """Positions of the diagonals of some blocks among the values of the matrix (n, 3)."""
        row = np.searchsorted(self.indptr, blocks, side="right") - 1
        first, width = self.indptr[row].astype(np.int64), np.diff(self.indptr)[row].astype(np.int64)
        return (9 * first + 3 * (blocks - first))[:, None] + (3 * width[:, None] + 1) * np.arange(3)

    @cached_property
    def diagonal(self) -> Integers:
        """Positions of the diagonal among the values of the matrix."""
        row = np.repeat(np.arange(len(self.indptr) - 1), np.diff(self.indptr))
        return self.diagonals(np.flatnonzero(self.indices == row)).ravel().astype(np.int32)

    @property
    def rows(self) -> Integers:
        """Row starts of the CSR pattern of the matrix."""
        return self._expanded[0]

    @property
    def columns(self) -> Integers:
        """Columns of the CSR pattern of the matrix."""
        return self._expanded[1]

    @cached_property
    def _expanded(self) -> tuple[Integers, Integers]:
        """Row starts and columns with three dofs a node; they take half the memory of the values, so made on demand."""
        from scipy import sparse

        nodes, blocks = len(self.indptr) - 1, np.zeros((len(self.indices), 3, 3), dtype=np.int8)
        matrix = sparse.bsr_array((blocks, self.indices, self.indptr), shape=(3 * nodes, 3 * nodes)).tocsr()
        return matrix.indptr.astype(np.int32), matrix.indices.astype(np.int32)
