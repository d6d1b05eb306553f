"""What the model assumes, judged on a curve: a sentence for each assumption that a run leaves, with the value.

The functions are pure: a curve, a material, a surface in; a sentence out, empty while the assumption holds.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from asperity.curve import Curve
    from asperity.model.material import Material
    from asperity.surface import Surface

FLAT = 1e-12  # depth below which a surface counts as a plane [L]
#: Plastic strain up to which the solid counts as one of small strain. The change of length over the length before and
#: the logarithmic strain, e and ln(1 + e), differ by e/2 of themselves to first order: 5 % here.
SMALL_STRAIN = 0.1


def large_strain(curve: Curve) -> str:
    """Judge the greatest accumulated plastic strain by the limit of small strain."""
    greatest = float(np.max(np.nan_to_num(curve.max_plastic_strain), initial=0.0))
    if not greatest > SMALL_STRAIN:
        return ""
    return (
        f"the plastic strain reaches {greatest:.2g}, beyond {SMALL_STRAIN:g}: the solid is computed in small strain, "
        "and approximate where it yields most"
    )


def yield_pressure(material: Material, sides: str) -> float:
    """Mean pressure at which the block itself yields [force/length^2]; infinite for an elastic material.

    Between rollers it is in uniaxial strain, with the lateral stress nu/(1 - nu) of the pressure p and the equivalent
    stress p (1 - 2 nu)/(1 - nu); with free sides in uniaxial stress (von Mises' criterion: Johnson, Contact Mechanics,
    1985, eq. 6.1).

    Args:
        material: of the block
        sides: "rollers" or "free"
    """
    if material.yield_strength is None:
        return float("inf")
    if sides == "free":
        return material.yield_strength
    return material.yield_strength * (1.0 - material.nu) / (1.0 - 2.0 * material.nu)


def bulk_yield(curve: Curve, material: Material, side: float, sides: str) -> str:
    """Judge the greatest mean pressure by that at which the block below the surface yields.

    Args:
        curve: of the run
        material: of the block
        side: L [length]
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
    """Judge the greatest approach by the depth of the mean plane below the summit.

    A rigid flat reaches the mean plane of a rough solid at full contact, when nothing but the block gives way. A plane
    is in full contact at once, and not judged.

    Args:
        curve: of the run
        surface: that was pressed
    """
    delta, depth = float(np.max(curve.delta, initial=0.0)), surface.maximum()[2] - surface.mean()
    if depth <= FLAT * surface.L or not delta > depth:
        return ""
    return (
        f"the flat has come {delta:.3g} down, beyond the mean plane of the surface, {depth:.3g} below its summit: the "
        "compression of the whole block is a large part of the curve"
    )


def departures(curve: Curve, material: Material, surface: Surface, sides: str) -> list[str]:
    """All sentences on a curve.

    Args:
        curve: of the run
        material: of the block
        surface: that was pressed
        sides: "rollers" or "free"
    """
    found = (
        large_strain(curve),
        bulk_yield(curve, material, surface.L, sides),
        beyond_mean_plane(curve, surface),
    )
    return [text for text in found if text]
