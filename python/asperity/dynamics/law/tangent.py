# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

"""Law of a contact whose stiffness is known at some forces."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import CubicHermiteSpline

from asperity.arrays import Array
from asperity.dynamics.law.table import TableLaw

_STEEPEST = 0.9  # largest exponent of the stiffness over the force with which a law begins at zero approach
_AROUND = float(np.log(2.0))  # distance in ln F within which the exponent of the stiffness is fitted


@dataclass(frozen=True, eq=False)
class TangentLaw(TableLaw):
    """Law whose stiffness at each force is that of the states of a branch, dz = dF/k.

    Between two points the stiffness is a power of the force, and so it is below the first one. The approach is measured
    from where the force vanishes on this law. Unlike those of a `TableLaw`, stiffness and local exponent at a load are
    not fitted: they are the values given.

    Attributes:
        k: stiffness at the points (force/length), shape (m,).

    Examples:
        A Hertzian contact, K = 2 and k = 3 z^(1/2) = 3 (F/2)^(1/3):

        >>> force = np.linspace(0.1, 2.0, 20)
        >>> law = asp.dynamics.TangentLaw.of(force, 3.0 * (force / 2.0) ** (1 / 3))
        >>> round(law.deflection(2.0), 9), round(law.n_loc(1.0), 9), round(law.kappa(1.0), 6)
        (1.0, 1.5, -0.041667)
    """

    k: Array = field(kw_only=True)

    @classmethod
    def of(cls, force: ArrayLike, k: ArrayLike, **options: Any) -> TangentLaw:
        """Integrate the stiffness `k` (force/length) over rising forces `force`, both of shape (m,).

        Args:
            force: at least five positive ones.
            k: positive.
            **options: `name`, `extrapolate`.
        """
        F, stiffness = np.asarray(force, float), np.asarray(k, float)
        p = np.diff(np.log(stiffness)) / np.diff(np.log(F))
        flat = np.abs(1 - p) < 1e-6  # there F/k is constant, and z a logarithm
        power = np.diff(F / stiffness) / np.where(flat, 1.0, 1 - p)
        steps = np.where(flat, F[:-1] / stiffness[:-1] * np.diff(np.log(F)), power)
        start = F[0] / stiffness[0] / (1 - np.clip(p[0], 0.0, _STEEPEST))
        return cls(start + np.append(0.0, np.cumsum(steps)), F, k=stiffness, **options)

    def derivatives(self, z: float) -> tuple[float, float, float]:
        force = float(self.both(np.array([z]))[0][0])
        x, y = np.log(self.F / force), np.log(self.k)
        k = float(np.exp(np.interp(0.0, x, y)))
        near = np.flatnonzero(np.abs(x) <= _AROUND)
        if near.size < 4:
            near = np.argsort(np.abs(x), kind="stable")[:4]
        p = float(np.polyfit(x[near], y[near], 1)[0])  # k ~ F^p: F'' = p k^2/F, F''' = p (2 p - 1) k^3/F^2
        return k, p * k**2 / force, p * (2 * p - 1) * k**3 / force**2

    @cached_property
    def _curve(self) -> Any:
        spline = CubicHermiteSpline(np.log(self.z), np.log(self.F), self.z * self.k / self.F)
        return spline, spline.derivative()
