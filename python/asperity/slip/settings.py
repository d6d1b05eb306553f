"""Settings of the slip of a joint. Each default is here, and the section [slip] of a case takes it from here."""

from __future__ import annotations

from dataclasses import dataclass

from asperity.errors import InputError
from asperity.model.limits import bounds, check

#: Amplitudes over the limit of friction: below, a ring narrower than a facet slips; above, the displacement is
#: arbitrary.
AMPLITUDES = "[0.001, 0.99]"
DIRECTIONS = ("x", "y")


@dataclass(frozen=True)
class SlipSettings:
    """Friction of a joint and the loops to compute, forces on the patch.

    Attributes:
        friction: Coulomb's coefficient mu
        amplitudes: of the tangential force over the limit of friction mu P, each in [0.001, 0.99]
        preload: normal force P (force); default that of the vibration, or half of the greatest force of the curve
        steps: of the first loading; a loop has four times as many
        direction: of the motion, "x" or "y"

    Raises:
        InputError: a value is not legal
    """

    friction: float
    amplitudes: tuple[float, ...] = (0.1, 0.3, 0.6, 0.9)
    preload: float | None = None
    steps: int = 3
    direction: str = "x"

    def __post_init__(self) -> None:
        check(self, "slip", friction="(0, 10]", preload="(0, inf)", steps="[1, inf)", direction=DIRECTIONS)
        object.__setattr__(self, "amplitudes", tuple(sorted({float(t) for t in self.amplitudes})))
        low, high = bounds(AMPLITUDES).values()
        if not self.amplitudes or not all(low <= t <= high for t in self.amplitudes):
            raise InputError(
                f"slip.amplitudes = {list(self.amplitudes)} must be one or more numbers in {AMPLITUDES}: they are the "
                "tangential force over the limit of friction"
            )
