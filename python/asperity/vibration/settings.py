"""Settings of a forced result."""

from __future__ import annotations

import cmath
import math
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Setting:
    """Model ("exact" or "taylor"), law, damping and forcing of a forced result.

    F_hat is F/(n_loc W) of a force, b/z_s of a displacement of the base, and m b''/(n_loc W) of its acceleration.
    """

    model: str
    law: str
    n_loc: float
    zeta: float
    damping: str
    F_hat: float
    excitation: str = "force"

    def forcing(self, omega: Any) -> Any:
        """F^ at frequencies Omega: that of a displacement of the base grows with their square."""
        return self.F_hat * omega ** (2 if self.excitation == "base" else 0)

    def growth(self, omega: Any) -> Any:
        """Its derivative with respect to Omega."""
        return 2.0 * self.F_hat * omega if self.excitation == "base" else 0.0 * omega

    @property
    def amplitude(self) -> str:
        """Amplitude of the excitation, in words."""
        name = {"force": "F^", "base": "base b/z_s", "acceleration": "base b''/(omega_s^2 z_s)"}[self.excitation]
        return f"{name} = {self.F_hat:g}"

    def transmissibility(self, omega: float, a1: float, phase: float) -> float:
        """Motion of the mass over that of the base, both at the forcing frequency; NaN for a force.

        The base moves by -F^/Omega^2 times the second derivative of its motion: as cos(Omega tau), like the force.
        """
        if self.excitation == "force":
            return math.nan
        base = self.forcing(omega) / omega**2
        return abs(a1 * cmath.exp(1j * math.radians(phase)) + base) / base

    @property
    def F_over_mg(self) -> float:
        """Forcing amplitude over the preload (sigma in the Hertz literature)."""
        return self.n_loc * self.F_hat

    def row(
        self, branch: int, omega: float, u_max: float, u_min: float, a1: float, stable: bool, phase: float = math.nan
    ) -> dict[str, Any]:
        """Row of response.csv."""
        return {
            "model": self.model, "F_hat": self.F_hat, "zeta": self.zeta, "Omega": omega, "u_max": u_max,
            "u_min": u_min, "a1": a1, "stable": stable, "branch": branch, "contact_loss": bool(u_min < -1.0),
            "phase": phase, "transmissibility": self.transmissibility(omega, a1, phase),
        }  # fmt: skip
