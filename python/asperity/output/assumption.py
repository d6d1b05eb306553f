"""A line of the ledger of a run: an assumption of the model, its value, its limit and the verdict; and its evidence."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import inf, nan, pi, sqrt
from typing import TYPE_CHECKING, Any

import numpy as np

from asperity.curve import Curve
from asperity.model.problem import Problem
from asperity.output.patches import Spread
from asperity.surface.base import FLAT

if TYPE_CHECKING:
    from asperity.vibration.numbers import Numbers

FINE, DOUBTFUL = "fine", "doubtful"


@dataclass(frozen=True)
class Assumption:
    """A line of the ledger.

    Attributes:
        name: of the assumption
        value: in this run [unit]
        limit: that the value must not exceed, or not fall below where `least` is set [unit]
        unit: of both, empty for a ratio
        source: of the limit
        advice: what to do where it is doubtful
        detail: what else is known
        least: whether the limit is a lower one
        warns: whether a run warns of its doubt, because it violates an assumption of its own model
        warned: whether another warning of the run has the same doubt

    Examples:
        >>> line = Assumption("approach over depth", 1.2, 1.0, "", "geometry", "a smaller load")
        >>> line.verdict, describe(line.to_dict())
        ('doubtful', 'approach over depth: 1.2, at most 1; a smaller load')
    """

    name: str
    value: float
    limit: float
    unit: str
    source: str
    advice: str
    detail: str = ""
    least: bool = False
    warns: bool = False
    warned: bool = False

    @property
    def verdict(self) -> str:
        """Whether the value is within the limit: "fine" or "doubtful"."""
        slack = 1e-9 * abs(self.limit)  # rounding differs between systems of units
        fine = self.value >= self.limit - slack if self.least else self.value <= self.limit + slack
        return FINE if fine else DOUBTFUL

    def to_dict(self) -> dict[str, Any]:
        """Record of summary.json."""
        return {
            "name": self.name, "value": self.value, "limit": self.limit, "bound": "least" if self.least else "most",
            "unit": self.unit, "source": self.source, "verdict": self.verdict, "advice": self.advice,
            "detail": self.detail, "warned": self.warned or self.warns,
        }  # fmt: skip


def describe(record: Mapping[str, Any]) -> str:
    """A record of summary.json in one line for the terminal."""
    value, limit = (f"{record[name]:.3g} {record['unit']}".rstrip() for name in ("value", "limit"))
    return f"{record['name']}: {value}, at {record['bound']} {limit}; {record['advice']}"


@dataclass(frozen=True)
class Evidence:
    """What is known of a run when its assumptions are judged.

    Attributes:
        curve: its curve
        problem: what was solved, with the kinematics of the run
        si: whether lengths are in m and stresses in Pa
        tolerance: of the force, None on one mesh
        h: size of the finest elements in the contact [length]; None where unknown
        roughness: greatest part of the bar, over the force, of waves that the finest mesh leaves out; None on one mesh
        small_strain: greatest change of the force by small strain and its limit [per cent]; None where unknown
        density: of the solid [mass/length^3]; None where unknown
        vibration: stiffness, frequency and damping of the small vibration; None where there is none
        side: of the nominal area of what vibrates [length]; None takes that of the patch
        patches: what others change of the stiffness of a joint; None without a joint or without others
    """

    curve: Curve
    problem: Problem
    si: bool = False
    tolerance: float | None = None
    h: float | None = None
    roughness: float | None = None
    small_strain: tuple[float, float] | None = None
    density: float | None = None
    vibration: Numbers | None = None
    side: float | None = None
    patches: Spread | None = None

    def greatest(self, column: str) -> float:
        """Greatest value in a column of the curve, 0 where it is unknown."""
        return float(np.nan_to_num(getattr(self.curve, column)).max())

    @property
    def plane(self) -> bool:
        """Whether the top is a plane, in full contact from the start."""
        surface = self.problem.surface
        return surface.maximum()[2] - surface.mean() <= FLAT * surface.L

    @property
    def top(self) -> int:
        """Row of the greatest force."""
        return int(self.curve.force.argmax())

    @property
    def contact_radius(self) -> float:
        """Radius of the mean contact spot at the greatest force, taken as a circle [length]; nan where unknown."""
        spots = int(self.curve.spots[self.top])
        area = float(self.curve.area_fraction[self.top]) * self.problem.surface.L**2
        return sqrt(area / (pi * spots)) if spots else nan

    @property
    def summit_radius(self) -> float:
        """Radius of the mean curvature of the summit [length]; inf for a plane one."""
        x, y, _ = self.problem.surface.maximum()
        xx, _, yy = self.problem.surface.hessian(x, y)
        curvature = -0.5 * float(xx + yy)
        return 1.0 / curvature if curvature > 0.0 else inf
