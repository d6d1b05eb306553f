# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

"""Sparsity pattern of the tangent on one rank, three dofs a node."""

from __future__ import annotations

import numpy as np

from asperity.arrays import Integers


class SparsityPattern:
    """Sparsity pattern of the local matrix. Nodes that share a cell of this rank are coupled, ghost nodes included.

    Attributes:
        indptr, indices: CSR pattern of the nodes (indices ascending)
        rows, columns: CSR pattern of the matrix with three dofs a node
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
