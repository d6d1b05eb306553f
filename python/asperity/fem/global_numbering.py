# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

"""Gather and scatter fields in a rank-independent numbering: that of the mesh as built."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from asperity.arrays import Array
from asperity.runtime import compat

if TYPE_CHECKING:
    from asperity.fem.solid import Solid


def node_numbers(solid: Solid) -> npt.NDArray[np.int64]:
    """Number in the built mesh of each local displacement node, of one of them where nodes are joined (nodes,)."""
    x_nodes = compat.geometry_dofmap(solid.mesh)
    out = np.full(solid.nodes, -1, dtype=np.int64)
    numbers = solid.mesh.geometry.input_global_indices
    out[solid.V.dofmap.list.ravel()] = np.asarray(numbers)[x_nodes.ravel()]
    return out


def collect_nodes(solid: Solid, values: Array) -> Array | None:
    """Nodal values in the order of the mesh as built on rank 0; None elsewhere; collective.

    Args:
        solid: on the mesh
        values: at the displacement nodes, ghosts included (nodes, ...)
    """
    numbers = np.asarray(solid.mesh.geometry.input_global_indices)
    node = np.empty(len(numbers), dtype=np.int64)
    node[compat.geometry_dofmap(solid.mesh).ravel()] = solid.V.dofmap.list.ravel()
    return collect(solid.comm, numbers, values[node])


def cell_numbers(solid: Solid) -> npt.NDArray[np.int64]:
    """Number in the built mesh of each owned cell (cells,)."""
    return np.asarray(solid.mesh.cell_numbers)[: len(solid.cell_nodes)]


def collect(comm: Any, numbers: npt.NDArray[np.int64], values: Array) -> Array | None:
    """Assemble values on rank 0 in the order of `numbers`; None elsewhere; collective.

    Args:
        comm: communicator
        numbers: global position of each row (n,), every position at least once
        values: rows (n, ...), the same on all ranks that have one
    """
    parts = comm.gather((numbers, values), root=0)
    if parts is None:
        return None
    total = 1 + max(int(n.max(initial=-1)) for n, _ in parts)
    out = np.empty((total, *values.shape[1:]), dtype=values.dtype)
    for n, v in parts:
        out[n] = v
    return out


def spread(comm: Any, numbers: npt.NDArray[np.int64], values: Array | None) -> Array:
    """Scatter the rows `numbers` of an array on rank 0; collective."""
    wanted = comm.gather(numbers, root=0)
    parts = None if wanted is None or values is None else [values[n] for n in wanted]
    return np.asarray(comm.scatter(parts, root=0))


def collect_some(
    comm: Any, numbers: npt.NDArray[np.int64], values: Array
) -> tuple[npt.NDArray[np.int64], Array] | None:
    """Gather the rows of some positions on rank 0, with their numbers in ascending order; None elsewhere; collective.

    Args:
        comm: communicator
        numbers: global position of each row (n,), every position on one rank at most
        values: rows (n, ...)
    """
    parts = comm.gather((numbers, values), root=0)
    if parts is None:
        return None
    all_numbers = np.concatenate([n for n, _ in parts])
    order = np.argsort(all_numbers)
    return all_numbers[order], np.concatenate([v for _, v in parts])[order]


def spread_some(
    comm: Any,
    wanted: npt.NDArray[np.int64],
    rows: tuple[npt.NDArray[np.int64], Array] | None,
    fill: float = 0.0,
) -> Array:
    """Scatter the rows `wanted` of the result of `collect_some`, `fill` where there is none; collective."""
    requests = comm.gather(wanted, root=0)
    parts = None
    if requests is not None and rows is not None:
        parts = [_look_up(*rows, request, fill) for request in requests]
    return np.asarray(comm.scatter(parts, root=0))


def _look_up(numbers: npt.NDArray[np.int64], values: Array, wanted: npt.NDArray[np.int64], fill: float) -> Array:
    out = np.full((len(wanted), *values.shape[1:]), fill)
    if len(numbers):
        at = np.minimum(np.searchsorted(numbers, wanted), len(numbers) - 1)
        found = numbers[at] == wanted
        out[found] = values[at[found]]
    return out
