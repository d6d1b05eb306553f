"""Check the assumptions of the model on the curve of a run.

Each function returns a sentence with the value that violates an assumption, or an empty string while it holds.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from asperity.curve import Curve
    from asperity.model.material import Material
    from asperity.surface import Surface

FLAT = 1e-12  # depth below which a surface counts as a plane [L]
#: Plastic strain up to which small-strain theory applies. The engineering strain e and the logarithmic strain
#: ln(1 + e) have a relative difference of e/2 to first order: 5 % here.
SMALL_STRAIN = 0.1


def large_strain(curve: Curve) -> str:
    """Compare the greatest accumulated plastic strain with the limit of small strain."""
    greatest = float(np.max(np.nan_to_num(curve.max_plastic_strain), initial=0.0))
    if not greatest > SMALL_STRAIN:
        return ""
    return (
        f"the plastic strain reaches {greatest:.2g}, beyond {SMALL_STRAIN:g}: the solid is computed in small strain, "
        'and approximate where it yields most; material.kinematics = "finite" has no such limit'
    )


def yield_pressure(material: Material, sides: str) -> float:
    """Mean pressure at which the block itself yields [force/length^2]; infinite for an elastic material.

    Between rollers the block is in uniaxial strain: under the pressure p the lateral stress is p nu/(1 - nu) and the
    equivalent stress p (1 - 2 nu)/(1 - nu). With free sides it is in uniaxial stress. The criterion is that of von
    Mises (Johnson, Contact Mechanics, 1985, eq. 6.1).

    Args:
        material: material of the block
        sides: "rollers" or "free"
    """
    if material.yield_strength is None:
        return float("inf")
    if sides == "free":
        return material.yield_strength
    return material.yield_strength * (1.0 - material.nu) / (1.0 - 2.0 * material.nu)


def bulk_yield(curve: Curve, material: Material, side: float, sides: str) -> str:
    """Compare the greatest mean pressure with that at which the block below the surface yields.

    Args:
        curve: curve of the run
        material: material of the block
        side: side L of the patch [length]
        sides: "rollers" or "free"
    """
    pressure, limit = float(np.max(curve.force, initial=0.0)) / side**2, yield_pressure(material, sides)
    if not pressure > limit:
        return ""
    return (
        f"the mean pressure reaches {pressure:.3g}, beyond {limit:.3g} where the block yields as a whole, not only "
        "under its contacts"
    )


def beyond_mean_plane(curve: Curve, surface: Surface) -> str:
    """Compare the greatest approach with the depth of the mean plane below the summit.

    A rigid flat reaches the mean plane of a rough solid at full contact, beyond which only the block deforms. A plane
    surface is in full contact from the start and is not checked.

    Args:
        curve: curve of the run
        surface: top of the block
    """
    delta, depth = float(np.max(curve.delta, initial=0.0)), surface.maximum()[2] - surface.mean()
    if depth <= FLAT * surface.L or not delta > depth:
        return ""
    return (
        f"the flat has moved {delta:.3g} down, beyond the mean plane of the surface, {depth:.3g} below its summit: the "
        "compression of the whole block is a large part of the curve"
    )


def departures(curve: Curve, material: Material, surface: Surface, sides: str) -> list[str]:
    """Return the sentences on all violated assumptions.

    Args:
        curve: curve of the run
        material: material of the block
        surface: top of the block
        sides: "rollers" or "free"
    """
    found = (
        "" if material.finite else large_strain(curve),
        bulk_yield(curve, material, surface.L, sides),
        beyond_mean_plane(curve, surface),
    )
    return [text for text in found if text]
