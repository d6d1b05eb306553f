"""The tangent of a solid, this rank's part: a matrix in double precision, or its upper half in single."""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property, partial

import numpy as np

from asperity.arrays import Flags, Floats, Singles
from asperity.fem.kernels import ElementKernels
from asperity.fem.sparsity import SparsityPattern
from asperity.runtime.compiled import solver as _solver
from asperity.runtime.usage import Phases

#: Writes a matrix at a nodal displacement, see `ElementKernels.tangent`.
Write = Callable[[Floats, Floats | Singles], None]


class Tangent:
    """Tangent of a solid; that of the whole solid is the sum of the parts of all ranks, which nobody adds up.

    Args:
        kernels: of the solid
        sparsity: of this rank's part
        u: displacement of the local dofs, read when a matrix is written (3 nodes,) [L]
        phases: collects the time

    Attributes:
        halved: whether a matrix without a stiffness of the contact is written as its half alone, a quarter of the
            memory
        version: number of matrices written
    """

    def __init__(self, kernels: ElementKernels, sparsity: SparsityPattern, u: Floats, phases: Phases) -> None:
        self._kernels, self._sparsity, self._u, self._phases = kernels, sparsity, u.reshape(-1, 3), phases
        self.halved, self.version = False, 0
        self._write: Write | None = None  # wrote the last one
        self._alone = False  # whether the last one is that of the solid, without the contact
        self._versions = {"values": 0, "half": 0}  # that the two hold
        self._slopes: Floats | None = None  # see `tilt`

    @property
    def constant(self) -> bool:
        """Whether the tangent of the solid, without that of the contact, never changes."""
        return self._kernels.linear

    def assemble(self, add: Callable[[], None] | None = None, shift: float = 0.0, secant: bool = False) -> None:
        """Write the tangent at the state of the last internal force; `add` adds that of the contact to `values()`.

        For `shift` and `secant` see `ElementKernels.tangent`.
        """
        self._assemble(partial(self._kernels.tangent, shift=shift, secant=secant), add)

    def assemble_elastic(self, add: Callable[[], None] | None = None) -> None:
        """Write the stiffness without plastic flow; `add` adds that of the contact to `values()`."""
        self._assemble(self._kernels.elastic_tangent, add)

    def _assemble(self, write: Write, add: Callable[[], None] | None) -> None:
        if self._alone and self.constant and add is None:
            return
        self.version += 1
        self._slopes = None
        self._write, self._alone = write, add is None
        with self._phases.phase("tangent"):
            if self.halved and add is None:
                self._write_to("half", self._half)
                return
            self._write_to("values", self._values)
            if add is not None:
                add()

    def _write_to(self, which: str, matrix: Floats | Singles) -> None:
        assert self._write is not None
        self._write(self._u, matrix)
        self._versions[which] = self.version

    def values(self) -> Floats:
        """Values of the last matrix, in the order of `sparsity`; where there is the half alone they are written now,
        at the displacement of now."""
        if self._write is not None and self._versions["values"] != self.version:
            with self._phases.phase("tangent"):
                self._write_to("values", self._values)
        return self._values

    @property
    def tilted(self) -> bool:
        """Whether the last matrix is one of `tilt`."""
        return self._slopes is not None

    def untilt(self, step: Floats) -> Floats:
        """Change of the displacement from one of the unknowns of the last matrix, at the owned dofs (3 owned,)."""
        assert self._slopes is not None
        moved = step.reshape(-1, 3).copy()
        moved[:, 2] -= np.einsum("ni,ni->n", self._slopes[: len(moved)], moved[:, :2])
        return moved.ravel()

    def tilt(self, slopes: Floats) -> None:
        """Take n . u, n = (slopes, 1), in place of u_z as an unknown of each local node, slopes (nodes, 2)."""
        self._slopes = slopes
        indptr, columns = self._sparsity.indptr.astype(np.int64), self._sparsity.indices
        moved: Flags = np.asarray(slopes.any(axis=1))
        rows = np.repeat(np.arange(len(moved)), np.diff(indptr))
        blocks = np.flatnonzero(moved[rows] | moved[columns])
        rows, columns = rows[blocks], columns[blocks]
        first, width = indptr[rows], np.diff(indptr)[rows]
        i = np.arange(3)
        at = (9 * first + 3 * (blocks - first))[:, None, None] + 3 * width[:, None, None] * i[:, None] + i
        found = self.values()[at]
        found[:, :, :2] -= found[:, :, 2:] * slopes[columns][:, None, :]
        found[:, :2] -= slopes[rows][:, :, None] * found[:, 2:]
        self.values()[at] = found

    def half(self) -> Singles:
        """Upper half of the last matrix by the columns of its blocks (9 blocks + 1,), see `SparsityPattern.upper`.

        The lower half counts for nothing. The next matrix overwrites it.
        """
        half, sparsity = self._half, self._sparsity
        if self._versions["half"] != self.version:
            _solver.upper_half(sparsity.indptr, sparsity.indices, self.values(), half)
            self._versions["half"] = self.version
        return half

    @cached_property
    def _values(self) -> Floats:
        return np.zeros(self._sparsity.size)

    @cached_property
    def _half(self) -> Singles:
        return np.zeros(9 * len(self._sparsity.upper[1]) + 1, dtype=np.float32)  # 1: read with the last

    def drop(self) -> None:
        """Free the matrices, most of the memory of a solid; the next tangent makes them again."""
        self.__dict__.pop("_values", None)
        self.__dict__.pop("_half", None)
        self._write, self._alone, self._versions = None, False, {"values": 0, "half": 0}
        self._kernels.drop_matrices()
