"""A joint whose faces are like the patch of a curve: nominal area, preload, mass."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, fields, replace
from typing import Any

from asperity.errors import InputError
from asperity.vibration.checks import positive


@dataclass(frozen=True)
class Joint:
    """A joint whose faces are like the patch of a curve; all in the units of the curve.

    Attributes:
        nominal_area: of the joint (length^2); default that of the patch
        preload, pressure: static force, of a bolt for example (force), or nominal pressure (force/length^2)
        mass: of what vibrates (mass)
        overload: greatest force that the joint has met over the preload; a case without a greatest load takes it

    Raises:
        InputError: a value is out of range, or two of them contradict each other

    Examples:
        >>> joint = asp.Joint(nominal_area=1e-4, pressure=5e6, mass=0.5)
        >>> joint.load(patch=1e-12), joint.factor(patch=1e-12)
        (500.0, 100000000.0)
        >>> asp.Joint(preload=10.0, pressure=1e6)
        Traceback (most recent call last):
            ...
        asperity.errors.InputError: joint.preload and joint.pressure are both given; give one of them
    """

    nominal_area: float | None = None
    preload: float | None = None
    pressure: float | None = None
    mass: float | None = None
    overload: float = 1.2

    def __post_init__(self) -> None:
        for item in fields(self):
            value = getattr(self, item.name)
            if value is not None:
                positive(f"joint.{item.name}", value)
        if self.overload < 1.0:
            raise InputError(f"joint.overload = {self.overload:g} is not legal: it must be at least 1")
        if self.preload is not None and self.pressure is not None:
            raise InputError("joint.preload and joint.pressure are both given; give one of them")

    def replaced(self, given: Mapping[str, Any]) -> Joint:
        """Joint with other values, None for no change; of preload and pressure a value removes the other."""
        new = {name: value for name, value in given.items() if value is not None}
        if new.keys() & {"preload", "pressure"}:
            new = {"preload": None, "pressure": None} | new
        known_keys(new, self, "joint.")
        return replace(self, **new)

    def factor(self, patch: float | None) -> float:
        """By what the force of a patch of nominal area `patch` (length^2) is multiplied; refused if it is unknown."""
        return 1.0 if self.nominal_area is None else self.nominal_area / _known(patch, "nominal_area")

    def load(self, patch: float | None) -> float | None:
        """Static force of the joint (force); None if nothing gives it."""
        if self.pressure is None:
            return self.preload
        return self.pressure * (self.nominal_area or _known(patch, "pressure"))


def known_keys(given: Iterable[str], settings: Any, section: str = "") -> None:
    """Refuse keys that are no attributes of the settings of a section, as an old case may have them."""
    names = [item.name for item in fields(settings)]
    if unknown := set(given) - set(names):
        raise InputError(
            f"{section}{min(unknown)} is no setting of the vibration: choose from {', '.join(names)}; for keys of a "
            "former version see CHANGELOG.md"
        )


def _known(patch: float | None, name: str) -> float:
    if patch is None:
        raise InputError(
            f"joint.{name} needs the nominal area of the patch, which a curve without a case does not give: name the "
            "folder of the run"
        )
    return patch
