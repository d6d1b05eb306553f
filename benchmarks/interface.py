"""Approach of the rough interface alone: the compression of the block below it is subtracted."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from math import inf

from mpi4py import MPI

from asperity.adaptive.mesh_plan import extrapolate
from asperity.adaptive.solve_contact import solve_contact
from asperity.arrays import Array
from asperity.case import Case
from asperity.curve import Curve
from asperity.model.material import Material
from asperity.model.settings import MeshSize
from asperity.power_law import interface_approach
from asperity.surface import Flat

FULL = 0.9  # contact area over the patch beyond which the interface is practically closed
BULK = 0.5  # plastic part of the volume that is exceeded only when the block as a whole yields
FINEST, COARSEST = 0.03, 0.1  # element sizes of the flat block [L]
RATIO, ORDER = 1.4, 1.3  # of the sizes of its two meshes; of its stiffness in the size: the clamped edge is singular


@dataclass(frozen=True)
class Block:
    """The block as an elastic spring below the interface.

    Attributes:
        side, height: L and h_b (length)
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
        free = case.block.sides == "free"
        modulus = solid.E * free_block_modulus(solid.nu, height / side) if free else solid.confined_modulus
        return Block(side, height, modulus, solid.yield_pressure(case.block.sides))

    def interface(self, curve: Curve) -> Array:
        """Approach of the interface alone over L, for each step of the curve (n,)."""
        of_block = dict(height=self.height, area=self.side**2, modulus=self.modulus)
        return interface_approach(curve.delta, curve.force, **of_block) / self.side

    def void(self, curve: Curve) -> bool:
        """Whether the approach of the interface alone is void: the block has yielded, or contact is nearly full."""
        pressure = curve.force.max(initial=0.0) / self.side**2
        full, plastic = curve.area_fraction.max(initial=0.0) > FULL, curve.plastic_fraction.max(initial=0.0) > BULK
        return bool(pressure >= self.yields_at or full or plastic)


@cache
def free_block_modulus(nu: float, height: float) -> float:
    """Mean pressure over mean strain of a flat block of a height [L] with free sides on a clamped base, over E.

    The base prevents lateral expansion: it is greater than 1, and there is no closed form. Computed by finite elements,
    with an error of about 0.1 % if the height is at least half the side.
    """

    def pressed(h: float) -> Array:
        return solve_contact(
            Flat(L=1.0), Material(1.0, nu), height=height, sides="free", delta_max=1e-3 * height, steps=1,
            size=MeshSize(h, h_max=h if height <= 2.0 else None), comm=MPI.COMM_SELF,
        ).curve.force / 1e-3  # fmt: skip

    h = min(max(0.3 * height, FINEST), COARSEST)
    limit, _ = extrapolate(pressed(RATIO * h), pressed(h), RATIO, ORDER)
    return float(limit[-1])
