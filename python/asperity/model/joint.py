"""A joint of two rough bodies: area, preload, mass and slip of like ones, and the one body that represents both.

Two elastic half-spaces with small slopes and no friction deform at a point under a pressure p there in proportion to
1/E'_1 and 1/E'_2, so only the sum of the displacements and the sum of the heights matter (Johnson, Contact
Mechanics, 1985, section 4.1 and 13.3): the pressure, the contact area and the approach are those of one body of
modulus E' with the surface z1 + z2 under a rigid flat. Of two bodies of one metal that yields the one has half the
modulus and half the slope beyond yield, and the same strength: under the same stress it deforms twice as far.
docs/measured.md lists the limits.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Annotated

from pydantic import Field

from asperity.errors import InputError
from asperity.model.material import Material
from asperity.runtime.declaration import FORCE, SEVERAL, STRESS, Choices, Positive, Real, Whole, declared, key

# below, a ring narrower than a facet slips; above, the displacement is arbitrary
Share = Annotated[Real, Field(ge=0.001, le=0.99)]


@declared("joint")
class Joint:
    """A joint whose faces are like the patch, for numbers in N, m, kg and Hz.

    Examples:
        >>> joint = asp.Joint(nominal_area=1e-4, pressure=5e6, mass=0.5)
        >>> joint.load(patch=1e-12), joint.factor(patch=1e-12)
        (500.0, 100000000.0)
        >>> asp.Joint(preload=10.0, pressure=1e6)
        Traceback (most recent call last):
            ...
        asperity.errors.InputError: joint.preload and joint.pressure are both given; give one of them
    """

    nominal_area: Positive | None = key("nominal area of the joint", "length^2", default=None, shown="L^2")
    preload: Positive | None = key(
        "static force, of a bolt for example (or pressure)", FORCE, default=None, shown="half of the greatest force"
    )
    pressure: Positive | None = key("static nominal pressure (or preload)", STRESS, default=None)
    mass: Positive | None = key("mass that vibrates", "mass", default=None)
    overload: Real = key(
        "greatest force that the joint has met, over the preload: the greatest load where [loading] gives none",
        default=1.2,
        ge=1.0,
        le=1e3,
    )

    def __post_init__(self) -> None:
        if self.preload is not None and self.pressure is not None:
            raise InputError("joint.preload and joint.pressure are both given; give one of them")

    def factor(self, patch: float | None) -> float:
        """By what the force of a patch of nominal area `patch` (length^2) is multiplied; refused if it is unknown."""
        return 1.0 if self.nominal_area is None else self.nominal_area / _known(patch, "nominal_area")

    def load(self, patch: float | None) -> float | None:
        """Static force of the joint (force); None if nothing gives it."""
        if self.pressure is None:
            return self.preload
        return self.pressure * (self.nominal_area or _known(patch, "pressure"))


def _known(patch: float | None, name: str) -> float:
    if patch is None:
        raise InputError(
            f"joint.{name} needs the nominal area of the patch, which a curve without a case does not give: name the "
            "folder of the run"
        )
    return patch


@declared("slip")
class SlipSettings:
    """Micro-slip of the joint of two like bodies: tangential loops with Coulomb friction about a preload."""

    friction: Real = key("Coulomb's coefficient mu", hint="0.1 to 0.6 for dry metals", gt=0, le=10)
    amplitudes: Annotated[tuple[Share, ...], SEVERAL] = key(
        "amplitudes of the tangential force over mu P, in any order",
        default=(0.1, 0.3, 0.6, 0.9),
        min_length=1,
        max_length=100,
    )
    preload: Positive | None = key("normal force P on the patch", FORCE, default=None, shown="that of the vibration")
    steps: Whole = key("steps from rest to an amplitude; a loop has four times as many", default=16, ge=1, le=1000)
    direction: Annotated[str, Choices("x", "y")] = key("of the motion", default="x")

    def __post_init__(self) -> None:
        object.__setattr__(self, "amplitudes", tuple(sorted(set(self.amplitudes))))


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
