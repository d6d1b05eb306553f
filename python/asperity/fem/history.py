"""Internal variables of the material."""

from __future__ import annotations

from dataclasses import dataclass, field, fields, replace
from typing import Self

import numpy as np

from asperity.arrays import Floats, Indices


@dataclass(frozen=True, eq=False)
class History:
    """Internal variables of the material at the quadrature points: a row per cell, or per facet of the contact surface.

    The program copies, extrapolates, saves and restores all variables alike; energies, measures and the direction of
    the extrapolation use those of plasticity by name. A new variable, zero in the virgin material, needs a field here
    and an argument of the same name in `_solver.History`. Checkpoints hold the variables under these names.

    Attributes:
        plastic_strain: xx, yy, zz, xy, xz, yz (rows, points, 6)
        accumulated: accumulated plastic strain (rows, points)
        dilatation: volumetric strain that flow has made permanent, in the cells only (solver/relaxation.hpp)
            (rows, points)
    """

    # the shape is that of the components at one quadrature point
    plastic_strain: Floats = field(metadata={"shape": (6,)})
    accumulated: Floats = field(metadata={"shape": ()})
    dilatation: Floats = field(metadata={"shape": ()})

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
