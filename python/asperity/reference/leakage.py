"""Leakage through a gap on a regular grid, and flow through a network."""

from __future__ import annotations

import numpy as np

from asperity.arrays import Array, Floats, Indices

INLET, OUTLET = -1, -2  # numbers of the places where fluid enters and leaves a network


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
    n = len(gap)
    cubed, cells = np.asarray(gap, dtype=float) ** 3, np.arange(n * n).reshape(n, n)
    pairs = [(cells[:, :-1], cells[:, 1:]), (cells[:-1], cells[1:])]
    if periodic:
        pairs.append((cells[-1], cells[0]))
    a, b = (np.concatenate([np.ravel(pair[i]) for pair in pairs]) for i in (0, 1))
    sums = cubed.ravel()[a] + cubed.ravel()[b]
    links = np.divide(2.0 * cubed.ravel()[a] * cubed.ravel()[b], sums, out=np.zeros(len(a)), where=sums > 0.0)
    a, b = np.concatenate([a, cells[:, 0], cells[:, -1]]), np.concatenate([b, np.repeat([INLET, OUTLET], n)])
    return network_flow(a, b, np.concatenate([links, 2.0 * cubed[:, 0], 2.0 * cubed[:, -1]]))


def network_flow(first: Indices, second: Indices, conductance: Floats) -> float:
    """Flow from INLET to OUTLET through the links of a network at a unit difference of the pressure.

    Args:
        first, second: numbers of the places at the ends of each link, INLET and OUTLET among them (m,)
        conductance: of the links, 0 for a closed one (m,)
    """
    from scipy import sparse
    from scipy.sparse.csgraph import connected_components
    from scipy.sparse.linalg import splu

    open_ = (conductance != 0.0) & (first != second)
    numbers, ends = np.unique(np.stack([first[open_], second[open_]]), return_inverse=True)
    if list(numbers[:2]) != [OUTLET, INLET]:
        return 0.0
    outlet, inlet, n = 0, 1, len(numbers)
    graph = sparse.coo_array((conductance[open_], tuple(ends.reshape(2, -1))), shape=(n, n)).tocsr()
    graph = graph + graph.T
    _, part = connected_components(graph, directed=False)
    if part[inlet] != part[outlet]:
        return 0.0
    matrix = sparse.csc_array(sparse.diags_array(graph.sum(axis=1)) - graph)
    inner, p = 2 + np.flatnonzero(part[2:] == part[inlet]), np.zeros(n)
    p[inlet] = 1.0
    if len(inner):
        p[inner] = splu(matrix[inner][:, inner]).solve(-(matrix[inner] @ p))  # its ordering MMD takes minutes
    return float((matrix @ p)[inlet])
