# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

"""Approach of the rough interface alone: the compression of the block below it is subtracted."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from math import inf
from typing import Any

import numpy as np
from numpy.typing import NDArray

from asperity.adaptive.mesh_plan import extrapolate
from asperity.case import Case
from asperity.curve import Curve
from asperity.power_law import interface_approach

FULL = 0.9  # contact area over the patch beyond which the interface is practically closed
BULK = 0.5  # plastic part of the volume that is exceeded only when the block as a whole yields
FINEST, COARSEST = 0.03, 0.1  # element sizes of the flat block [L]
RATIO, ORDER = 1.4, 1.3  # of the sizes of its two meshes; of its stiffness in the size: the clamped edge is singular


@dataclass(frozen=True)
class Block:
    """The block as an elastic spring below the interface.

    Attributes:
        side: L (length)
        height: h_b (length)
        modulus: mean pressure over mean strain of the flat block (force/length^2)
        yields_at: mean pressure at which the block yields (force/length^2), inf if it is elastic
    """

    side: float
    height: float
    modulus: float
    yields_at: float = inf

    @staticmethod
    def of(case: Case) -> Block:
        """Block of a case; with free sides, solves a flat block of the same shape, once per process."""
        solid, side, height = case.material.solid, case.surface.L, case.block.height
        yields_at = solid.yield_pressure(case.block.sides)
        if case.block.sides != "free":
            return Block(side, height, solid.confined_modulus, yields_at)
        return Block(side, height, solid.E * free_block_modulus(solid.nu, height / side), yields_at)

    def interface(self, curve: Curve) -> NDArray[Any]:
        """Approach of the interface alone over L, for each step of the curve (n,)."""
        of_block = dict(height=self.height, area=self.side**2, modulus=self.modulus)
        return interface_approach(curve.delta, curve.force, **of_block) / self.side

    def void(self, curve: Curve) -> str:
        """Why the approach of the interface alone is meaningless for a loading; empty if it is meaningful."""
        if not len(curve):
            return ""
        load = float(np.max(curve.force)) / (self.side**2 * self.yields_at)
        if load >= 1:
            return f"the block has yielded: the mean pressure is {load:.2g} times its yield pressure"
        if (plastic := float(np.max(curve.plastic_fraction))) > BULK:
            return f"the block has yielded: {plastic:.0%} of it is plastic"
        if (area := float(np.max(curve.area_fraction))) > FULL:
            return f"contact is nearly full: A/A0 = {area:.2f}"
        return ""


@lru_cache(maxsize=64)
def free_block_modulus(nu: float, height: float) -> float:
    """Mean pressure over mean strain of a flat block with free sides on a clamped base, over E: greater than 1.

    The base prevents lateral expansion; there is no closed form. Computed by finite elements in this process, with an
    error of about 0.1 % if the height is at least half the side.

    Args:
        nu: Poisson's ratio
        height: of the block [L]
    """
    from mpi4py import MPI

    from asperity.adaptive.solve_contact import solve_contact
    from asperity.model.material import Material
    from asperity.model.settings import MeshSize
    from asperity.surface import Flat

    def pressed(h: float) -> Any:
        size = MeshSize(h, h_max=h if height <= 2.0 else None)
        return solve_contact(
            Flat(L=1.0), Material(1.0, nu), height=height, sides="free", delta_max=1e-3 * height, steps=1, size=size,
            comm=MPI.COMM_SELF,
        ).curve.force / 1e-3  # fmt: skip

    h = min(max(0.3 * height, FINEST), COARSEST)
    limit, _ = extrapolate(pressed(RATIO * h), pressed(h), RATIO, ORDER)
    return float(limit[-1])
