"""What is known of a run when its assumptions are judged."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import inf, pi, sqrt
from typing import TYPE_CHECKING

from asperity.curve import Curve
from asperity.model.problem import Problem
from asperity.output.patches import Spread
from asperity.reference import LONG_WAVES, radiation_loss
from asperity.surface.base import FLAT

if TYPE_CHECKING:
    from asperity.dynamics.joint import Numbers


@dataclass(frozen=True)
class Evidence:
    """What is known of a run.

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
        return sqrt(area / (pi * spots)) if spots else float("nan")

    @property
    def summit_radius(self) -> float:
        """Radius of the mean curvature of the summit [length]; inf for a plane one."""
        x, y, _ = self.problem.surface.maximum()
        xx, _, yy = self.problem.surface.hessian(x, y)
        curvature = -0.5 * float(xx + yy)
        return 1.0 / curvature if curvature > 0.0 else inf

    @cached_property
    def radiated(self) -> dict[str, float]:
        """Section "radiation" of summary.json: the loss factor eta where the waves are long; empty where unknown."""
        if self.vibration is None or self.density is None:
            return {}
        solid, frequency = self.problem.material, self.vibration.frequency
        over = (self.side or self.problem.surface.L) * frequency / sqrt(solid.lame[1] / self.density)
        if over > LONG_WAVES:
            return {"side_over_wavelength": over}
        k, omega = self.vibration.stiffness, 2.0 * pi * frequency
        eta = radiation_loss(k, omega, E=solid.E, nu=solid.nu, density=self.density)
        return {"side_over_wavelength": over, "eta": eta}
