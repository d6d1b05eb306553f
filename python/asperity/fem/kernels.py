# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

"""Interface of the element kernels, compiled or as UFL forms, and the history that they own."""

from __future__ import annotations

from dataclasses import dataclass, field, fields, replace
from typing import Protocol, Self

import numpy as np

from asperity.arrays import Floats, Indices, Singles


@dataclass(frozen=True, eq=False)
class History:
    """Internal variables of the material at the quadrature points: a row per cell, or per facet of the contact surface.

    The program copies, extrapolates, saves and restores all variables alike; energies, measures and the direction of
    the extrapolation use those of plasticity by name. A new variable, zero in the virgin material, needs a field here
    and an argument of the same name in `_solver.History`. Checkpoints hold the variables under these names.

    Attributes:
        plastic_strain: xx, yy, zz, xy, xz, yz (rows, points, 6)
        accumulated: accumulated plastic strain (rows, points)

    Examples:
        >>> history = History.zeros(rows=2, points=4)
        >>> {name: values.shape for name, values in history.arrays().items()}
        {'plastic_strain': (2, 4, 6), 'accumulated': (2, 4)}
        >>> history.accumulated[1] = 0.01
        >>> history.changed()
        array([1])
    """

    # the shape is that of the components at one quadrature point
    plastic_strain: Floats = field(metadata={"shape": (6,)})
    accumulated: Floats = field(metadata={"shape": ()})

    @classmethod
    def zeros(cls, rows: int, points: int) -> Self:
        """History of a material that never yielded; with no rows, that of an elastic one."""
        return cls(**{f.name: np.zeros((rows, points, *f.metadata["shape"])) for f in fields(cls)})

    @classmethod
    def names(cls) -> tuple[str, ...]:
        """Names of the variables."""
        return tuple(f.name for f in fields(cls))

    def arrays(self) -> dict[str, Floats]:
        """Variables by name; the arrays themselves, not copies."""
        return {name: getattr(self, name) for name in self.names()}

    def copy(self) -> Self:
        """Copy that later steps do not change."""
        return replace(self, **{name: values.copy() for name, values in self.arrays().items()})

    def assign(self, other: Self) -> None:
        """Overwrite the values with those of a history of the same shape."""
        for name, values in self.arrays().items():
            np.copyto(values, getattr(other, name))

    @property
    def rows(self) -> int:
        """Number of rows; 0 for an elastic material."""
        return len(self.accumulated)

    def changed(self) -> Indices:
        """Rows with a variable other than zero at any point."""
        changed = [values.any(axis=tuple(range(1, values.ndim))) for values in self.arrays().values()]
        return np.flatnonzero(np.any(changed, axis=0))


class ElementKernels(Protocol):
    """Internal force, tangent and history of a solid, cell by cell; the part of this rank.

    Lengths are in units of L, stresses in units of E.
    """

    linear: bool  # whether the tangent never changes
    halves: bool  # whether they can write the upper half of a tangent alone

    @property
    def plastic_points(self) -> int:
        """Quadrature points of this rank that yielded in the last residual."""

    @property
    def inverted_points(self) -> int:
        """Quadrature points of this rank that finite strain turned inside out in the last residual: no valid state."""

    @property
    def volumes(self) -> Floats:
        """Volumes of the quadrature points of this rank before deformation (cells, points) [L^3]."""

    def add_internal_force(self, u: Floats, b: Floats) -> None:
        """Add the internal force [E L^2] of the nodal displacement u (nodes, 3) to b; writes the trial history."""

    def tangent(self, u: Floats, values: Floats | Singles) -> None:
        """Write the local matrix at u, the state of the last residual.

        Args:
            u: nodal displacement (nodes, 3) [L]
            values: of the CSR matrix; or, where `halves`, the upper half in single precision, by the columns of its
                blocks in the order of `SparsityPattern.upper`
        """

    def elastic_tangent(self, u: Floats, values: Floats | Singles) -> None:
        """Write the local matrix at u for a motion without plastic flow, see `tangent`."""

    def drop_matrices(self) -> None:
        """Free stored matrices; they are made again when they are needed."""

    def commit(self) -> None:
        """Make the trial history the committed one."""

    def restore(self, history: History) -> None:
        """Restore a committed history returned by `history`."""

    def history(self) -> History:
        """Committed history of this rank's cells; without rows for an elastic material."""

    def softened(self, before: History) -> bool:
        """Whether a cell of this rank takes its mean volumetric strain in the committed history but not in `before`."""

    def stress(self, u: Floats) -> Floats:
        """Cauchy's stress (cells, points, 6) [E] of u over the committed history."""

    def conjugate_stress(self, u: Floats) -> Floats:
        """Stress (cells, points, 6) [E] whose product with the strain rate of the law is the power per volume before
        deformation: in small strain the stress, in finite strain that of logarithmic strain."""
