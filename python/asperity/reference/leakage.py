"""Leakage through a gap on a regular grid."""

from __future__ import annotations

import numpy as np

from asperity.arrays import Array


def transmissivity(gap: Array, periodic: bool = False) -> float:
    """Transmissivity along x of the gaps of square cells, by finite volumes with harmonic means [length^3].

    The pressure is 1 at the first column and 0 at the last one; see `Results.gap_grid` for the gap of a run.

    Args:
        gap: of the cells, 0 in contact (n, n), index [iy, ix] [length]
        periodic: whether the first and the last row are joined; otherwise nothing flows through these sides

    Examples:
        A wave across the flow: the mean of the cubes is harmonic.

        >>> gap = np.tile([1.0, 2.0], (8, 4))
        >>> round(asp.reference.transmissivity(gap), 6), round(2.0 / (1.0 + 1.0 / 8.0), 6)
        (1.777778, 1.777778)
    """
    from scipy import sparse
    from scipy.sparse.csgraph import connected_components
    from scipy.sparse.linalg import splu

    n = len(gap)
    cubed, cells = np.asarray(gap, dtype=float) ** 3, np.arange(n * n).reshape(n, n)
    inlet, outlet = n * n, n * n + 1
    pairs = [(cells[:, :-1], cells[:, 1:]), (cells[:-1], cells[1:])]
    if periodic:
        pairs.append((cells[-1], cells[0]))
    a, b = (np.concatenate([np.ravel(pair[i]) for pair in pairs]) for i in (0, 1))
    of = cubed.ravel()
    sums = of[a] + of[b]
    links = np.divide(2.0 * of[a] * of[b], sums, out=np.zeros(len(a)), where=sums > 0.0)
    a, b = np.concatenate([a, cells[:, 0], cells[:, -1]]), np.concatenate([b, np.repeat([inlet, outlet], n)])
    links = np.concatenate([links, 2.0 * cubed[:, 0], 2.0 * cubed[:, -1]])
    open_ = links > 0.0
    graph = sparse.coo_array((links[open_], (a[open_], b[open_])), shape=(n * n + 2, n * n + 2)).tocsr()
    graph = graph + graph.T
    _, part = connected_components(graph, directed=False)
    if part[inlet] != part[outlet]:
        return 0.0
    inner, p = np.flatnonzero(part[: n * n] == part[inlet]), np.zeros(n * n + 2)
    matrix = sparse.csc_array(sparse.diags_array(graph.sum(axis=1)) - graph)
    p[inlet] = 1.0
    right = -(matrix[inner] @ p)
    p[inner] = splu(matrix[inner][:, inner]).solve(right)
    return float((matrix @ p)[inlet])
