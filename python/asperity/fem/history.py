"""Internal variables of the material."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Self

import numpy as np

from asperity.arrays import Floats, Indices
from asperity.model.material import PAIRS


class History(SimpleNamespace):
    """Internal variables of the material at the quadrature points: a row per cell, or per facet of the contact surface.

    The program copies, extrapolates, saves and restores all variables alike; energies, measures and the direction of
    the extrapolation use those of plasticity by name. A law in UFL may have more. Checkpoints hold them by name.

    Attributes:
        plastic_strain: xx, yy, zz, xy, xz, yz (rows, points, 6)
        accumulated: accumulated plastic strain (rows, points)
        dilatation: volumetric strain that flow has made permanent, in the cells only (solver/relaxation.hpp)
            (rows, points)
    """

    plastic_strain: Floats
    accumulated: Floats
    dilatation: Floats

    @classmethod
    def zeros(cls, rows: int, points: int, /, **more: tuple[int, ...]) -> Self:
        """History of a material that never yielded, with more variables of these shapes; an elastic one has no rows."""
        shapes = {"plastic_strain": (6,), "accumulated": (), "dilatation": ()} | more
        return cls(**{name: np.zeros((rows, points, *shape)) for name, shape in shapes.items()})

    def arrays(self) -> dict[str, Floats]:
        """Variables by name; the arrays themselves, not copies."""
        return vars(self)

    def copy(self) -> Self:
        """Copy that later steps do not change."""
        return type(self)(**{name: values.copy() for name, values in self.arrays().items()})

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


def extrapolate(before: History, after: History, extrapolation: float) -> History:
    """Extrapolate the plastic history beyond a step by a part of its flow; the arguments are unchanged.

    Where the plastic strain is large compared with that of yield, the midpoint rule does not damp: an error of the
    direction of flow changes sign with every step and persists, and its work accumulates. So the part is multiplied by
    the cosine of the angle between the flow and the plastic strain, which is one to second order where flow is steady.
    """
    strain = before.plastic_strain
    flow = after.plastic_strain - strain
    along, flows, strains = (
        np.einsum("...i,...i,i->...", a, b, PAIRS) for a, b in ((flow, strain), (flow, flow), (strain, strain))
    )
    sizes = np.sqrt(flows * strains)
    # a point that yields for the first time has no direction yet
    part = extrapolation * np.clip(np.divide(along, sizes, out=np.ones_like(along), where=sizes > 0.0), 0.0, 1.0)
    begin, end = before.arrays(), after.arrays()
    parts = {name: part.reshape(part.shape + (1,) * (end[name].ndim - part.ndim)) for name in end}
    return History(**{name: end[name] + parts[name] * (end[name] - begin[name]) for name in end})
