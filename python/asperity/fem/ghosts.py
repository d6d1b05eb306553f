"""Ghost updates: exchange of nodal values between ranks, by the names of dolfinx."""

from __future__ import annotations

from typing import Any, TypeVar

import numpy as np
import numpy.typing as npt

Real = TypeVar("Real", np.float32, np.float64)


class Ghosts:
    """Ghost update of nodal values. A node of several ranks is owned by one of them and a ghost on the others.

    Results are views of buffers, which the next exchange of the same width and precision overwrites. On a single rank
    the result is the argument.
    """

    def __init__(self, index_map: Any) -> None:
        self._map, self._alone = index_map, index_map.comm.size == 1
        self._buffers: dict[Any, Any] = {}  # setting up an exchange is collective and slower than an exchange

    def scatter_forward(self, owned: npt.NDArray[Real]) -> npt.NDArray[Real]:
        """Append the values of the ghosts to those of the owned nodes (owned, k): (nodes, k); collective."""
        if self._alone:
            return owned
        vector, values = self._buffer(owned)
        values[: len(owned)] = owned
        vector.scatter_forward()
        return values

    def scatter_reverse(self, values: npt.NDArray[Real]) -> npt.NDArray[Real]:
        """Sum nodal values (nodes, k) over the ranks that hold a node; at the owned nodes (owned, k); collective."""
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
