"""Backbone, resonance peak by energy balance, and the onset of every nonlinear phenomenon.

At phase resonance the forcing replaces exactly what the damper takes from a free orbit, so one quadrature
per amplitude gives the resonance peak for every damping level:

    F^ / (2 zeta) = INT g(u) u'^2 dtau / (pi a_1)   (error O(zeta^2)).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from scipy.optimize import brentq, minimize_scalar

from asperity.dynamics.law.law import Array, TaylorLaw
from asperity.dynamics.law.restoring import Restoring
from asperity.dynamics.orbits.free import FreeOrbit, contact_limit, free_orbit
from asperity.errors import RangeError

_LARGEST = 1e6


@dataclass(frozen=True)
class Backbone:
    """Free orbits in order of amplitude, and the forcing that sustains each at resonance.

    Attributes:
        model, law, damping: what it was computed for.
        n_loc: local exponent.
        orbits: the free orbits.
        tolerance: largest estimated relative error of a frequency.
        valid: False for the orbits of a Taylor law that pass u = -1.
    """

    model: str
    law: str
    damping: str
    n_loc: float
    orbits: tuple[FreeOrbit, ...]
    tolerance: float
    valid: tuple[bool, ...]

    @property
    def u_max(self) -> Array:
        """Amplitude of release."""
        return np.array([o.u0 for o in self.orbits])

    @property
    def omega(self) -> Array:
        """Frequency over omega_s."""
        return np.array([o.omega for o in self.orbits])

    @property
    def a1(self) -> Array:
        """First harmonic."""
        return np.array([o.a1 for o in self.orbits])

    @property
    def drive(self) -> Array:
        """F^/(2 zeta) that sustains the orbit at phase resonance."""
        return np.array([o.drive for o in self.orbits])

    @property
    def turns(self) -> tuple[tuple[float, float], ...]:
        """(u_max, omega) where softening turns to hardening or back, from the numerical backbone."""
        w, u = self.omega, self.u_max
        i = np.flatnonzero((np.diff(w)[:-1] > 0) != (np.diff(w)[1:] > 0)) + 1
        return tuple((float(u[j]), float(w[j])) for j in i if abs(w[j] - 1.0) > 1e-12)

    def rows(self) -> Iterator[dict[str, Any]]:
        """One mapping per orbit."""
        for o in self.orbits:
            yield {
                "model": self.model,
                "u_max": o.u0,
                "u_min": o.u_min,
                "omega_ratio": o.omega,
                "a1": o.a1,
                "drive": o.drive,
                "flight": o.flight,
            }


@dataclass(frozen=True)
class Thresholds:
    """Onsets of the nonlinear phenomena of one oscillator; forcing as F^, None where there is no onset.

    Attributes:
        model, law, zeta, damping: what they hold for.
        n_loc, kappa: local exponent; backbone curvature (negative: softening).
        softening: sign of kappa in words.
        u_max, omega_loss: largest release that keeps contact, and its frequency over omega_s.
        drive_loss: F^/(2 zeta) at which resonance begins to lose contact.
        contact_loss: the same as F^.
        hysteresis: F^ of the first vertical tangent (multiple scales, small zeta).
        period_doubling: F^ of the first period doubling near Omega = 2 (small zeta, about 0.5 % for 0.01).
        closing: largest F^ whose resonance the damping still closes (None: it closes every resonance).
        peaks: per forcing asked for: F_hat, Omega, u_max, u_min, a1 of the resonance peak, or None where
            the damping does not close it.
        F_over_mg: factor from F^ to F/(m g), which is n_loc.
        tolerance: relative error of the onsets and peaks, which are first terms in zeta: zeta^2.
        valid: False where a peak of a Taylor law passes u = -1.
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
    closing: float | None
    peaks: tuple[dict[str, float | None], ...]
    F_over_mg: float
    tolerance: float
    valid: bool

    def to_dict(self) -> dict[str, Any]:
        """Section of thresholds.json."""
        return {**asdict(self), "peaks": [dict(p) for p in self.peaks]}


def backbone(restoring: Restoring, *, model: str, damping: str, u_max: float, points: int) -> Backbone:
    """Free orbits up to `u_max`, evenly spaced in amplitude with the contact-loss orbit among them.

    The end is drawn in where the law ends: the rim of a Taylor well, or the last point of a table.
    """
    top = min(u_max, reach(restoring))
    amplitude = np.linspace(top / points, top, points)
    limit = contact_limit(restoring)
    if limit < top:
        amplitude = np.unique(np.append(amplitude, limit))
    orbits = tuple(free_orbit(restoring, float(u), damping) for u in amplitude)
    valid = tuple(restoring.contact or o.u_min >= -1.0 for o in orbits)
    tolerance = max(o.error for o in orbits)
    return Backbone(model, restoring.law.describe(), damping, restoring.n_loc, orbits, tolerance, valid)


def reach(restoring: Restoring) -> float:
    """Largest release amplitude the law allows: inf, the end of a table, or just inside a Taylor rim."""
    law = restoring.law
    if isinstance(law, TaylorLaw):
        low, high = law.rim(), law.rim_above()
        edges = [high] if np.isfinite(high) else []
        if np.isfinite(low):
            wall = float(restoring.potential(low))
            ceiling = min(high, 1e3)
            if float(restoring.potential(ceiling)) > wall:
                edges.append(brentq(lambda u: float(restoring.potential(u)) - wall, 0.0, ceiling))
        return 0.999 * min(edges) if edges else np.inf
    return restoring.u_range[1]


def resonance_peak(restoring: Restoring, drive: float, damping: str = "always") -> FreeOrbit | None:
    """Free orbit that a forcing F^ = 2 zeta drive sustains at phase resonance; None when there is none.

    Raises:
        RangeError: the peak lies beyond the end of the law.
    """
    top = reach(restoring)
    limit = min(top, _LARGEST)

    def surplus(u: float) -> float:
        return free_orbit(restoring, u, damping).drive - drive

    low = min(1e-3, 0.1 * drive, 0.5 * limit)
    high = low
    while surplus(high) < 0:
        if high >= limit:
            if damping == "contact" and not np.isfinite(top):
                return None
            raise RangeError(
                f"the resonance peak for F^/(2 zeta) = {drive:g} lies beyond the end of the law at u = {top:.6g}"
            )
        low, high = high, min(1.5 * high, limit)
        if damping == "contact" and high > 1e3 and surplus(high) < surplus(low):
            return None
    if high == low:
        return free_orbit(restoring, low, damping)
    u = brentq(surplus, low, high, xtol=1e-14, rtol=1e-13)
    return free_orbit(restoring, u, damping)


def thresholds(
    restoring: Restoring, *, model: str, zeta: float, damping: str, forcing: tuple[float, ...] = ()
) -> Thresholds:
    """All thresholds of `Thresholds`, and the resonance peak of each F^ in `forcing`."""
    limit = contact_limit(restoring)
    inside = limit <= restoring.u_range[1]
    orbit = free_orbit(restoring, limit, damping) if np.isfinite(limit) and inside else None
    kappa = restoring.kappa
    drive = orbit.drive if orbit else None
    peaks: list[dict[str, float | None]] = []
    for f in forcing:
        peak = None
        if zeta > 0:
            try:
                peak = resonance_peak(restoring, f / (2.0 * zeta), damping)
            except RangeError:
                peak = None
        values = (peak.omega, peak.u0, peak.u_min, peak.a1) if peak else (None,) * 4
        peaks.append(
            {
                "F_hat": f,
                "F_over_mg": restoring.n_loc * f,
                **dict(zip(("Omega", "u_max", "u_min", "a1"), values, strict=True)),
            }
        )
    word = "softening" if kappa < 0 else "hardening" if kappa > 0 else "linear"
    return Thresholds(
        model,
        restoring.law.describe(),
        zeta,
        damping,
        restoring.n_loc,
        kappa,
        word,
        limit if orbit else None,
        orbit.omega if orbit else None,
        drive,
        2.0 * zeta * drive if drive is not None else None,
        float(np.sqrt(32.0 * zeta**3 / (3.0 * np.sqrt(3.0) * abs(kappa)))) if kappa else None,
        6.0 * zeta / abs(restoring.a2) if restoring.a2 else None,
        _closing(restoring, zeta, damping),
        tuple(peaks),
        restoring.n_loc,
        zeta**2,
        restoring.contact or all(p["u_min"] is None or p["u_min"] >= -1.0 for p in peaks),
    )


def _closing(restoring: Restoring, zeta: float, damping: str) -> float | None:
    """Largest F^ that the damping in contact alone still balances."""
    if damping != "contact" or not restoring.contact or np.isfinite(restoring.u_range[1]) or zeta == 0:
        return None
    grid = np.geomspace(0.1, 1e4, 26)
    drive = np.array([free_orbit(restoring, u, damping).drive for u in grid])
    j = int(drive.argmax())
    if j in (0, grid.size - 1):
        return None
    best = minimize_scalar(
        lambda x: -free_orbit(restoring, float(np.exp(x)), damping).drive,
        bounds=(np.log(grid[j - 1]), np.log(grid[j + 1])),
        method="bounded",
    )
    return float(-2.0 * zeta * best.fun)
