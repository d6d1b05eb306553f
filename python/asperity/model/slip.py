"""Micro-slip of a joint: friction, preload and the loops to compute."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from asperity.runtime.declaration import FORCE, SEVERAL, Choices, Positive, Real, Whole, declared, key

# below, a ring narrower than a facet slips; above, the displacement is arbitrary
Share = Annotated[Real, Field(ge=0.001, le=0.99)]


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
