"""Reference solutions, each with its source, for the verification of the solver.

Lengths, forces and stresses in any consistent system of units.

Examples:
    >>> hertz = asp.reference.Hertz(R=1e-3, E_prime=asp.reference.reduced_modulus(200e9, 0.3))
    >>> print(f"{hertz.force(1e-6):.3f} N")
    9.267 N
"""

from __future__ import annotations

from asperity.reference.elastic import (
    Hertz,
    Westergaard,
    block_modulus,
    patch_test_slope,
    reduced_modulus,
)
from asperity.reference.halfspace import HalfSpaceContact, RoughCurve, RoughHalfSpace, half_space_contact
from asperity.reference.leakage import flow, transmissivity
from asperity.reference.neglected import LONG_WAVES, pull_off, radiation_loss, stickiness, tabor_parameter

__all__ = [
    "LONG_WAVES",
    "HalfSpaceContact",
    "Hertz",
    "RoughCurve",
    "RoughHalfSpace",
    "Westergaard",
    "block_modulus",
    "flow",
    "half_space_contact",
    "patch_test_slope",
    "pull_off",
    "radiation_loss",
    "reduced_modulus",
    "stickiness",
    "tabor_parameter",
    "transmissivity",
]
