"""A joint whose faces are like the patch of a curve: nominal area, preload, mass."""

from __future__ import annotations

from asperity.errors import InputError
from asperity.runtime.declaration import FORCE, STRESS, Positive, Real, declared, key


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
