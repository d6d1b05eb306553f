"""Resonance peak by energy balance, and onsets of nonlinear phenomena.

At phase resonance the forcing supplies exactly the energy that the damper takes from a free orbit, so one
quadrature per amplitude gives the resonance peak for every damping ratio:

    F^ / (2 zeta) = INT g(u) u'^2 dtau / (pi a_1)   (error O(zeta^2)).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from scipy.optimize import brentq

from asperity.dynamics.equation import Equation, Forcing, Restoring
from asperity.dynamics.free import FreeOrbit, contact_limit, free_orbit, largest_amplitude
from asperity.dynamics.settings import Setting
from asperity.force_law.damping import Damping
from asperity.force_law.law import bend
from asperity.runtime.display import short_repr

_LARGEST = 1e6  # amplitude at which the search for a peak ends


@dataclass(frozen=True)
class Thresholds:
    """Onsets of nonlinear phenomena of one oscillator, as F^; None where there is no onset.

    Attributes:
        model, law, zeta, damping, n_loc, kappa: of the oscillator
        softening: sign of kappa in words: "softening", "hardening", "linear", or "undecided" within its error bar
        u_max, omega_loss: largest release that keeps contact, and its frequency over omega_s
        drive_loss, contact_loss: F^/(2 zeta), and F^, at which resonance begins to lose contact
        hysteresis: F^ of the first vertical tangent (multiple scales, small zeta)
        period_doubling: F^ of the first period doubling near Omega = 2 (small zeta; error about 0.5 % for 0.01)
        peaks: for each requested forcing F_hat, F_over_mg, and Omega, u_max, u_min, a1 of the resonance peak; None
            where the damping does not limit it
        F_over_mg: factor from F^ to F/(m g), equal to n_loc
        tolerance: relative error zeta^2 of onsets and peaks, which are leading terms in zeta
        valid: False if a peak of a Taylor law passes u = -1
    """

    model: str
    law: str
    zeta: float
    damping: str
    n_loc: float
    kappa: float
    softening: str
    u_max: float | None
    omega_loss: float | None
    drive_loss: float | None
    contact_loss: float | None
    hysteresis: float | None
    period_doubling: float | None
    peaks: tuple[dict[str, float | None], ...]
    F_over_mg: float
    tolerance: float
    valid: bool

    __repr__ = short_repr

    def to_dict(self) -> dict[str, Any]:
        """Section of thresholds.json."""
        return asdict(self)


def resonance_peak(
    restoring: Restoring, forcing: Forcing, zeta: float, damping: Damping, *, rough: bool = False
) -> FreeOrbit | None:
    """Free orbit that a forcing sustains at phase resonance; None if there is none. See `free_orbit`."""
    limit, drive = min(largest_amplitude(restoring), _LARGEST), forcing.amplitude / (2.0 * zeta)

    def surplus(u: float) -> float:
        orbit = free_orbit(restoring, u, damping, rough=rough)
        return orbit.drive - float(forcing.at(orbit.omega)) / (2.0 * zeta)

    low = high = min(1e-3, 0.1 * drive, 0.5 * limit)
    while surplus(high) < 0:
        low, high = high, min(4.0 * high, limit)
        if high == low or (high > 1e3 and surplus(high) < surplus(low)):  # the damping does not limit it
            return None
    u = low if high == low else brentq(surplus, low, high, xtol=1e-14, rtol=1e-13)
    return free_orbit(restoring, u, damping, rough=rough)


def thresholds(equation: Equation, settings: Sequence[Setting] = ()) -> Thresholds:
    """Compute the onsets of `Thresholds` and the resonance peak of each setting."""
    restoring, zeta, damping = equation.restoring, equation.zeta, equation.damping
    limit = contact_limit(restoring)
    orbit = free_orbit(restoring, limit, damping) if np.isfinite(limit) else None
    kappa, bar = restoring.kappa, restoring.law.kappa_bar(restoring.z_s)
    peaks: list[dict[str, float | None]] = []
    for setting in settings:
        f = setting.F_hat
        peak = resonance_peak(restoring, setting.forcing, zeta, damping) if zeta > 0 else None
        values = (peak.omega, peak.u0, peak.u_min, peak.a1) if peak else (None,) * 4
        at_peak = dict(zip(("Omega", "u_max", "u_min", "a1"), values, strict=True))
        peaks.append({"F_hat": f, "F_over_mg": restoring.n_loc * f, **at_peak})
    return Thresholds(
        model=restoring.model,
        law=restoring.law.describe(),
        zeta=zeta,
        damping=str(damping),
        n_loc=restoring.n_loc,
        kappa=kappa,
        softening=bend(kappa - bar, kappa + bar),
        u_max=limit if orbit else None,
        omega_loss=orbit.omega if orbit else None,
        drive_loss=orbit.drive if orbit else None,
        contact_loss=2.0 * zeta * orbit.drive if orbit else None,
        hysteresis=float(np.sqrt(32.0 * zeta**3 / (3.0 * np.sqrt(3.0) * abs(kappa)))) if kappa else None,
        period_doubling=6.0 * zeta / abs(restoring.a2) if restoring.a2 else None,
        peaks=tuple(peaks),
        F_over_mg=restoring.n_loc,
        tolerance=zeta**2,
        valid=restoring.contact or all(p["u_min"] is None or p["u_min"] >= -1.0 for p in peaks),
    )
