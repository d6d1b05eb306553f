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
    return float(flow(gap, periodic)[0].mean())


def flow(gap: Array, periodic: bool = False) -> Floats:
    """Flow in each cell along x and y (2, n, n), the means of its faces; args as in `transmissivity`.

    The unit is that of the transmissivity, which is the mean of the flow along x over every column [length^3].
    """
    n = len(gap)
    cells = np.arange(n * n).reshape(n, n)
    with np.errstate(divide="ignore"):
        resistance = np.asarray(gap, dtype=float) ** -3
    across = np.pad(cells, ((0, 0), (1, 1)), constant_values=((0, 0), (INLET, OUTLET)))
    of_half = np.pad(resistance, ((0, 0), (1, 1)))
    along_x = 2.0 / (of_half[:, :-1] + of_half[:, 1:])
    along_y = 2.0 / (np.roll(resistance, 1, axis=0) + resistance)
    if not periodic:
        along_y[0] = 0.0
    first, second, links = (
        np.concatenate([x.ravel(), y.ravel()])
        for x, y in ((across[:, :-1], np.roll(cells, 1, axis=0)), (across[:, 1:], cells), (along_x, along_y))
    )
    x, y = np.split(n * network_flow(first, second, links), [along_x.size])
    x, y = x.reshape(n, n + 1), y.reshape(n, n)
    return 0.5 * np.stack([x[:, :-1] + x[:, 1:], y + np.roll(y, -1, axis=0)])


def network_flow(first: Indices, second: Indices, conductance: Floats) -> Floats:
    """Flow through each link of a network (m,), from its first end to its second, at pressures 1 at INLET, 0 at OUTLET.

    Args:
        first, second: numbers of the places at the ends of each link, INLET and OUTLET among them (m,)
        conductance: of the links, 0 for a closed one (m,)
    """
    from scipy import sparse
    from scipy.sparse.csgraph import connected_components
    from scipy.sparse.linalg import splu

    through, open_ = np.zeros(len(first)), (conductance != 0.0) & (first != second)
    numbers, ends = np.unique(np.stack([first[open_], second[open_]]), return_inverse=True)
    if list(numbers[:2]) != [OUTLET, INLET]:
        return through
    a, b = ends.reshape(2, -1)
    outlet, inlet, n = 0, 1, len(numbers)
    graph = sparse.coo_array((conductance[open_], (a, b)), shape=(n, n)).tocsr()
    graph = graph + graph.T
    _, part = connected_components(graph, directed=False)
    if part[inlet] != part[outlet]:
        return through
    matrix = sparse.csc_array(sparse.diags_array(graph.sum(axis=1)) - graph)
    inner, p = 2 + np.flatnonzero(part[2:] == part[inlet]), np.zeros(n)
    p[inlet] = 1.0
    if len(inner):
        p[inner] = splu(matrix[inner][:, inner]).solve(-(matrix[inner] @ p))  # its ordering MMD takes minutes
    through[open_] = conductance[open_] * (p[a] - p[b])
    return through
