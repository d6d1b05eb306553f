"""Exchange of nodal values between processes."""

from __future__ import annotations

from typing import Any, TypeVar

import numpy as np
import numpy.typing as npt

Real = TypeVar("Real", np.float32, np.float64)


class Ghosts:
    """Nodes that several processes hold: one owns a node, it is a ghost on the others.

    Results are views of buffers, overwritten by the next exchange of the same width and precision; in one process
    they are the arguments.

    Args:
        index_map: of the nodes
    """

    def __init__(self, index_map: Any) -> None:
        self._map, self._alone = index_map, index_map.comm.size == 1
        self._buffers: dict[Any, Any] = {}  # setting up an exchange is collective and slow beside one

    def scatter_forward(self, owned: npt.NDArray[Real]) -> npt.NDArray[Real]:
        """Values of the owned nodes (owned, k) with those of the ghosts behind them (nodes, k); collective."""
        if self._alone:
            return owned
        vector, values = self._buffer(owned)
        values[: len(owned)] = owned
        vector.scatter_forward()
        return values

    def scatter_reverse(self, values: npt.NDArray[Real]) -> npt.NDArray[Real]:
        """Nodal values (nodes, k) summed over the processes that hold a node: at owned ones (owned, k); collective."""
        if self._alone:
            return values
        from dolfinx import la

        vector, sums = self._buffer(values)
        sums[:] = values
        vector.scatter_reverse(la.InsertMode.add)
        return sums[: self._map.size_local]

    def _buffer(self, like: npt.NDArray[Real]) -> tuple[Any, npt.NDArray[Real]]:
        from dolfinx import la

        width = like.shape[1]
        key = width, like.dtype
        if key not in self._buffers:
            self._buffers[key] = la.vector(self._map, width, like.dtype)
        vector = self._buffers[key]
        return vector, vector.array.reshape(-1, width)
