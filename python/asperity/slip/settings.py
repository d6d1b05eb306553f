"""Settings of the slip of a joint. Each default is here, and the section [slip] of a case takes it from here."""

from __future__ import annotations

from dataclasses import dataclass

from asperity.errors import InputError
from asperity.force_law.checks import positive
from asperity.model.argument_checks import Judgement

LARGEST = 0.99  # amplitude over the limit of friction: beyond, the displacement is arbitrary
SMALLEST = 1e-3  # below it a ring narrower than a facet slips
METHODS = ("curve", "solid")


def wrong_motion(sides: str, direction: float, rigid: bool) -> Judgement:
    """Reason why a flat cannot move in a direction; `rigid` for one with friction, whose pressures change."""
    if sides == "rollers" and rigid:
        return "block.sides", (
            '= "rollers" stand for mirror images, which admit no motion of a flat with friction: take "periodic" or '
            '"free"'
        )
    if sides == "rollers" and direction % 90.0 != 0.0:
        return "slip.direction", (
            f"= {direction:g} is not possible between rollers, which stand for mirror images: give a multiple of 90, "
            'or block.sides = "free" or "periodic"'
        )
    return None


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

    Examples:
        >>> from asperity.slip import SlipSettings
        >>> SlipSettings(friction=0.3).amplitudes
        (0.1, 0.3, 0.6, 0.9)
    """

    friction: float
    amplitudes: tuple[float, ...] = (0.1, 0.3, 0.6, 0.9)
    preload: float | None = None
    steps: int = 3
    method: str = "curve"
    direction: float = 0.0

    def __post_init__(self) -> None:
        positive("slip.friction", self.friction)
        if self.preload is not None:
            positive("slip.preload", self.preload)
        object.__setattr__(self, "amplitudes", tuple(sorted({float(t) for t in self.amplitudes})))
        for t in self.amplitudes:
            if not SMALLEST <= t <= LARGEST:
                raise InputError(
                    f"slip.amplitudes = {t:g} must lie in [{SMALLEST:g}, {LARGEST:g}]: it is the tangential force over "
                    "the limit of friction"
                )
        if not self.amplitudes or self.steps < 1:
            raise InputError("slip.amplitudes is empty, or slip.steps is below 1")
        if self.method not in METHODS:
            raise InputError(f'slip.method = "{self.method}" is unknown: choose one of {", ".join(METHODS)}')
