"""Two rough bodies as one rough body under a rigid flat: E' and z1 + z2.

Two elastic half-spaces with small slopes and no friction deform at a point under a pressure p there in proportion to
1/E'_1 and 1/E'_2, so only the sum of the displacements and the sum of the heights matter (Johnson, Contact
Mechanics, 1985, section 4.1 and 13.3): the pressure, the contact area and the approach are those of one body of
modulus E' with the surface z1 + z2 under a rigid flat. Of two bodies of one metal that yields the one has half the
modulus and half the slope beyond yield, and the same strength: under the same stress it deforms twice as far.
docs/measured.md lists the limits.
"""

from __future__ import annotations

from dataclasses import replace

from asperity.errors import InputError
from asperity.model.material import Material


def equivalent_block(
    first: Material, second: Material, heights: tuple[float, float], *, sides: str = "rollers", nu: float = 0.3
) -> tuple[Material, float]:
    """Material and height [length] of the one block that represents two, as compliant under a uniform pressure.

    Args:
        first, second: the bodies; elastic, or of one metal that yields
        heights: of their blocks [length]
        sides: of all blocks, "rollers" or "free"
        nu: Poisson's ratio to give an elastic equivalent one; free to choose, because only E' enters the contact

    Raises:
        InputError: one yields and the other is of another metal, a body has finite strain, or a height is not positive

    Examples:
        >>> steel = asp.Material(E=200e9, nu=0.3)
        >>> material, height = equivalent_block(steel, steel, (1e-6, 1e-6))
        >>> round(material.E / 1e9, 6), round(height * 1e6, 6)
        (100.0, 1.0)
    """
    if not first.kinematics == second.kinematics == "small":
        raise InputError("two bodies have an equivalent single one in small strain only; leave material.kinematics out")
    if first.law is not None or second.law is not None:
        raise InputError("bodies with a law in UFL have no equivalent single one here; leave material.law out")
    yields = first.yield_strength is not None or second.yield_strength is not None
    if yields and first != second:
        raise InputError(
            "two bodies of which one yields have an equivalent single one only if they are of the same metal; with "
            "twice the yield strength in one of them its force is 2 to 6 % too small (docs/measured.md)"
        )
    if min(heights) <= 0:
        raise InputError(f"heights = {heights} must be positive lengths")
    if yields:
        material = replace(first, E=0.5 * first.E, tangent_modulus=0.5 * first.tangent_modulus)
    else:
        E_prime = 1.0 / (1.0 / first.reduced_modulus + 1.0 / second.reduced_modulus)
        material = Material(E_prime * (1 - nu**2), nu)
    compliance = sum(h / body.block_modulus(sides) for h, body in zip(heights, (first, second), strict=True))
    return material, compliance * material.block_modulus(sides)
