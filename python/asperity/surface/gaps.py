"""Missing heights of a map filled by the harmonic function through their neighbours."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from asperity.arrays import Array


def harmonic_fill(z: Array, gaps: NDArray[np.bool_]) -> Array:
    """Heights (ny, nx) in which each missing value is the mean of its neighbours on the grid (length)."""
    from scipy.sparse import coo_matrix
    from scipy.sparse.linalg import cg

    number = np.full(z.shape, -1)
    number[gaps] = np.arange(gaps.sum())
    numbers, heights = np.pad(number, 1, constant_values=-2), np.pad(z, 1)  # -1: known, -2: beyond the edge
    iy, ix = np.nonzero(np.pad(gaps, 1))
    me = numbers[iy, ix]
    diagonal, right = np.zeros(me.size), np.zeros(me.size)
    rows, columns = [], []
    for place in ((iy, ix + 1), (iy, ix - 1), (iy + 1, ix), (iy - 1, ix)):
        other = numbers[place]
        diagonal += other != -2
        right += np.where(other == -1, heights[place], 0.0)
        rows.append(me[other >= 0])
        columns.append(other[other >= 0])
    i, j = np.concatenate(rows), np.concatenate(columns)
    matrix = coo_matrix((-np.ones(i.size), (i, j)), shape=(me.size, me.size)).tocsr()
    matrix.setdiag(diagonal)
    full, middle = np.array(z), float(np.mean(z[~gaps]))
    start = np.full(me.size, middle)
    full[gaps], _ = cg(matrix, right, start, rtol=1e-12, maxiter=10_000)
    return full
