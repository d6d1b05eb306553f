# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

"""What a patch of contact becomes in a joint: nominal area, preload, mass, and the numbers of its small vibration."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from typing import Any

from asperity.dynamics.law.checks import positive
from asperity.errors import InputError
from asperity.units import per_cent, quantity

#: Keys of which at most one is given.
EXCLUSIVE = (("preload", "pressure"), ("mass", "frequency"))


@dataclass(frozen=True)
class Joint:
    """A joint whose faces are like the patch of a curve; all in the units of the curve.

    Attributes:
        nominal_area: of the joint (length^2); default that of the patch.
        preload: static force of the joint, of a bolt for example (force).
        pressure: static nominal pressure instead of `preload` (force/length^2).
        mass: of what vibrates (mass). It does not follow from the preload.
        frequency: of small vibration instead of `mass`, for a joint that was measured (1/time).
        gravity: acceleration that adds the weight of the mass to the preload (length/time^2); none by default.
        damping: damping ratio of small motion, 0 <= damping < 1.

    Raises:
        InputError: a value is out of range, or two of them contradict each other.

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
    frequency: float | None = None
    gravity: float | None = None
    damping: float | None = None

    def __post_init__(self) -> None:
        for item in fields(self):
            value = getattr(self, item.name)
            if value is not None:
                positive(f"joint.{item.name}", value, zero=item.name == "damping")
        for one, other in EXCLUSIVE:
            if getattr(self, one) is not None and getattr(self, other) is not None:
                raise InputError(f"joint.{one} and joint.{other} are both given; give one of them")
        if self.gravity is not None and self.mass is None:
            raise InputError("joint.gravity needs joint.mass, whose weight it adds to the preload")
        if self.damping is not None and self.damping >= 1:
            raise InputError(f"joint.damping = {self.damping:g} is not legal: it must be below 1")

    def replaced(self, given: Mapping[str, Any]) -> Joint:
        """Return the joint with other values; a value removes the one that it contradicts.

        Args:
            given: values by name; None keeps that of the joint.
        """
        new = {name: value for name, value in given.items() if value is not None}
        for pair in EXCLUSIVE:
            for one, other in (pair, pair[::-1]):
                if one in new and other not in new:
                    new[other] = None
        return replace(self, **new)

    def factor(self, patch: float | None) -> float:
        """Return by what the force of a patch of nominal area `patch` (length^2) is multiplied.

        Raises:
            InputError: the joint has an area, and that of the patch is not known.
        """
        if self.nominal_area is None:
            return 1.0
        return self.nominal_area / self._known(patch, "nominal_area")

    def load(self, patch: float | None) -> float | None:
        """Return the static force of the joint, weight included (force); None if nothing gives it.

        Raises:
            InputError: the joint has a pressure, and no area is known.
        """
        force = self.preload
        if self.pressure is not None:
            area = self.nominal_area if self.nominal_area is not None else self._known(patch, "pressure")
            force = self.pressure * area
        if self.gravity is not None and self.mass is not None:
            force = (force or 0.0) + self.mass * self.gravity
        return force

    def mass_at(self, stiffness: float) -> float | None:
        """Return the mass at a stiffness k_n of the joint (force/length); None if nothing gives it."""
        if self.frequency is not None:
            return stiffness / (2 * math.pi * self.frequency) ** 2
        return self.mass

    @staticmethod
    def _known(patch: float | None, name: str) -> float:
        if patch is None:
            raise InputError(
                f"joint.{name} needs the nominal area of the patch, which a curve without a case does not give: name "
                "the folder of the run"
            )
        return patch


def loads_of_case(
    preload: float | None, overload: float | None, joint: Joint | None, patch: float | None
) -> tuple[float | None, float | None]:
    """Return preload and overload of a case, those of the patch scaled to the joint; None where not given.

    Args:
        preload, overload: of the section [dynamics], forces on the patch.
        joint: of the case; its own preload comes first, and is not scaled.
        patch: nominal area of the patch (length^2).

    Examples:
        >>> from asperity.dynamics.joint import loads_of_case
        >>> loads_of_case(1.0, 2.0, asp.Joint(nominal_area=4.0), patch=2.0)
        (2.0, 4.0)
    """

    def of_joint(force: float | None) -> float | None:
        return force if force is None or joint is None else joint.factor(patch) * force

    load = None if joint is None else joint.load(patch)
    return of_joint(preload) if load is None else load, of_joint(overload)


@dataclass(frozen=True)
class Numbers:
    """The numbers of a joint's small vibration, in the units of the curve.

    Attributes:
        stiffness: k_n at the preload (force/length).
        mass: what vibrates (mass), NaN if unknown.
        frequency: natural frequency of small vibration (1/time), NaN if unknown.
        approach: static approach z_s (length).
        damping: damping ratio.
        frequency_bar: error bar of the frequency (1/time), NaN if unknown.
        given: whether the frequency is an input, from which the mass follows, with the bar of the stiffness.

    Examples:
        >>> from asperity.dynamics.joint import Numbers
        >>> print(Numbers(2e5, 0.5, 100.66, 4e-9, 0.01, 0.42).sentence("SI"))
        k_n = 200 kN/m ± 0.83 %, m = 0.5 kg, f = 100.7 Hz ± 0.42 %, z_s = 4 nm, zeta = 0.01
        >>> print(Numbers(2e5, 0.5, 100.66, 4e-9, 0.01, given=True).sentence("SI", bar=0.08))
        k_n = 200 kN/m ± 8 %, m = 0.5 kg ± 8 %, f = 100.66 Hz, z_s = 4 nm, zeta = 0.01
    """

    stiffness: float
    mass: float
    frequency: float
    approach: float
    damping: float
    frequency_bar: float = math.nan
    given: bool = False

    def sentence(self, units: str | None, bar: float = math.nan) -> str:
        """Return them as one line.

        Args:
            units: "SI" shows SI units.
            bar: error bar of the stiffness over it; default twice that of the frequency, sqrt(k_n/m)/(2 pi).
        """
        si = units == "SI"
        bar = bar if math.isfinite(bar) else 2.0 * self.frequency_bar / self.frequency
        parts = [f"k_n = {quantity(self.stiffness, 'N/m' if si else '', 5, bar=bar)}"]
        if math.isfinite(self.mass):
            mass = f"{self.mass:.5g}{' kg' if si else ''}"
            parts.append(f"m = {mass}{f' ± {per_cent(bar)}' if self.given and bar > 0.0 else ''}")
            of_f = math.nan if self.given else 0.5 * bar
            parts.append(f"f = {quantity(self.frequency, 'Hz' if si else '', 5, bar=of_f)}")
        else:
            parts.append("m and f unknown (give joint.mass)")
        parts += [f"z_s = {quantity(self.approach, 'm' if si else '')}", f"zeta = {self.damping:.5g}"]
        return ", ".join(parts)

    def to_dict(self) -> dict[str, float | None]:
        """Return the section "numbers" of thresholds.json, None where unknown."""
        names = ("k_n", "m", "f", "z_s", "zeta", "f_bar")
        values = (self.stiffness, self.mass, self.frequency, self.approach, self.damping, self.frequency_bar)
        return {n: v if math.isfinite(v) else None for n, v in zip(names, values, strict=True)}
