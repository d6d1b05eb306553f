"""Settings of the slip of a joint. Each default is here, and the section [slip] of a case takes it from here."""

from __future__ import annotations

from dataclasses import dataclass

from asperity.errors import InputError
from asperity.model.limits import bounds, check

#: Amplitudes over the limit of friction: below, a ring narrower than a facet slips; above, the displacement is
#: arbitrary.
AMPLITUDES = "[0.001, 0.99]"
METHODS = ("curve", "solid")


def check_motion(sides: str, direction: float, rigid: bool) -> None:
    """Refuse (InputError) a direction in which a flat, `rigid` if it has friction, cannot move."""
    if sides == "rollers" and rigid:
        raise InputError(
            'block.sides = "rollers" stand for mirror images, which admit no motion of a flat with friction: take '
            '"periodic" or "free"'
        )
    if sides == "rollers" and direction % 90.0 != 0.0:
        raise InputError(
            f"slip.direction = {direction:g} is not possible between rollers, which stand for mirror images: give a "
            'multiple of 90, or block.sides = "free" or "periodic"'
        )


@dataclass(frozen=True)
class SlipSettings:
    """Friction of a joint and the loops to compute, forces on the patch.

    Attributes:
        friction: Coulomb's coefficient mu
        amplitudes: of the tangential force over the limit of friction mu P, each in [0.001, 0.99]
        preload: normal force P (force); default that of the vibration, or half of the greatest force of the curve
        steps: of the first loading; a loop has four times as many
        method: "curve" follows from the normal curve, "solid" moves the flat on the solid
        direction: of the motion, from the x axis towards the y axis (degrees)

    Raises:
        InputError: a value is not legal
    """

    friction: float
    amplitudes: tuple[float, ...] = (0.1, 0.3, 0.6, 0.9)
    preload: float | None = None
    steps: int = 3
    method: str = "curve"
    direction: float = 0.0

    def __post_init__(self) -> None:
        check(self, "slip", friction="(0, inf)", preload="(0, inf)", steps="[1, inf)", method=METHODS)
        object.__setattr__(self, "amplitudes", tuple(sorted({float(t) for t in self.amplitudes})))
        low, high = bounds(AMPLITUDES).values()
        if not self.amplitudes or not all(low <= t <= high for t in self.amplitudes):
            raise InputError(
                f"slip.amplitudes = {list(self.amplitudes)} must be one or more numbers in {AMPLITUDES}: they are the "
                "tangential force over the limit of friction"
            )
