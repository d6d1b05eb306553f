"""Inertia of the solid: what a contact that vibrates radiates into a half-space."""

from __future__ import annotations

import math

LONG_WAVES = 0.3  # greatest side of a patch over the length of shear waves for which it counts as a point


def radiation_loss(k: float, omega: float, *, E: float, nu: float, density: float) -> float:
    """Loss factor of a contact of stiffness k by radiation into a half-space, twice the damping ratio at resonance.

    Valid while the waves at the angular frequency omega are far longer than the patch. Lysmer's analogue of a disc, a
    dashpot of 0.85 K a/c_s (Lysmer & Richart, J. Soil Mech. Found. Div. ASCE 92 (1966) 65), is within 10 % of Lamb's
    half-space, whatever the pressure (Miller & Pursey, Proc. R. Soc. Lond. A 223 (1954) 521).
    """
    shear_modulus = 0.5 * E / (1.0 + nu)
    return 0.2125 * (1.0 - nu) * k * omega / (shear_modulus * math.sqrt(shear_modulus / density))
