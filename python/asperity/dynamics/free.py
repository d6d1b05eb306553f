"""Free vibration over the amplitude, the resonance peak by energy balance, and onsets of nonlinear phenomena.

A free orbit is half a period of the period map without damping, from rest to rest, integrated to round-off. At phase
resonance the forcing supplies exactly the energy that the damper takes from a free orbit:

    F^ / (2 zeta) = INT g(u) u'^2 dtau / (pi a_1)   (error O(zeta^2)).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import brentq

from asperity.arrays import Array
from asperity.dynamics.equation import Equation, Restoring, motions
from asperity.vibration.settings import Setting
from asperity.errors import ConvergenceError, RangeError
from asperity.vibration.checks import positives
from asperity.vibration.damping import Damping
from asperity.vibration.law import TaylorLaw, bend
from asperity.runtime.display import short_repr

_RTOL = 1e-14  # of the integrator: round-off alone is left
_EARLY = 1e-6  # share of half a period before rest from where the last step of Newton's method goes
_ROUND_OFF = 1e-15  # relative round-off of the contact force
_ALMOST, _INFINITE = -0.99, 1e-9  # displacement below which an infinite stiffness at contact loss has this error
_GREATEST = 1e-3  # of that error, far above that of any amplitude in use
_LARGEST = 1e6  # amplitude at which the search for a peak ends


@dataclass(frozen=True)
class FreeOrbit:
    """Undamped free orbit released from rest at u_0 > 0.

    Attributes:
        u0, u_min: turning points (u > 0 is compression)
        omega: frequency over omega_s
        a1: amplitude of the first harmonic of u, a cosine
        v_s: speed at separation (0 if contact is kept)
        flight: share of the period out of contact
        dissipation: INT g u'^2 over a period, for the requested damping model
        error: estimated relative error of `omega`
    """

    u0: float
    u_min: float
    omega: float
    a1: float
    v_s: float
    flight: float
    dissipation: float
    error: float

    __repr__ = short_repr

    @property
    def drive(self) -> float:
        """Forcing F^/(2 zeta) that sustains this orbit at phase resonance, by energy balance."""
        return self.dissipation / (np.pi * self.a1)


def _column(name: str, words: str) -> property:
    return property(lambda self: np.array([getattr(o, name) for o in self.orbits]), doc=f"{words}, shape (orbits,).")


@dataclass(frozen=True)
class FreeVibration:
    """Natural frequency over amplitude, and the forcing that sustains each orbit at resonance.

    Attributes:
        model, law, n_loc, kappa, omega_s: of the oscillator
        orbits: one `FreeOrbit` per amplitude
        valid: False where a Taylor orbit has u_min < -1, which is unphysical
        tolerance: largest estimated relative error of the frequencies

    Examples:
        >>> free = asp.ContactOscillator(asp.PowerLaw(1.5)).free([0.2, 0.5])
        >>> free.omega_ratio.round(6), free.valid
        (array([0.998259, 0.987785]), (True, True))
    """

    model: str
    law: str
    n_loc: float
    kappa: float
    omega_s: float
    orbits: tuple[FreeOrbit, ...]
    valid: tuple[bool, ...]
    tolerance: float

    __repr__ = short_repr

    u0 = _column("u0", "Amplitudes u_0")
    omega_ratio = _column("omega", "Frequencies over omega_s")
    u_min = _column("u_min", "Lower turning points")
    a1 = _column("a1", "Amplitudes of the first harmonic")

    def rows(self) -> Iterator[dict[str, Any]]:
        """Rows of free.csv."""
        for o in self.orbits:
            yield {"model": self.model, "u0": o.u0, "omega_ratio": o.omega, "u_min": o.u_min, "a1": o.a1}


def free_orbits(restoring: Restoring, u0: ArrayLike, damping: Damping = "always") -> tuple[FreeOrbit, ...]:
    """Compute the orbits released from rest at u0 > 0 (orbits,).

    Raises:
        RangeError: an orbit passes the rim of a Taylor well
        ConvergenceError: an amplitude is lost in round-off
    """
    start, rim, n = np.array(positives("u0", u0)), largest_amplitude(restoring), restoring.n_loc
    if (far := start[start > rim]).size:
        raise RangeError(
            f"u0 = {far[0]:g} is beyond the rim of the Taylor well (u0 = {rim:.6g}): the truncated law lets the motion "
            "escape; use the exact law"
        )
    equation, rest = Equation(restoring, 0.0, damping), np.column_stack([start, np.zeros(start.size)])
    half = _half_periods(equation, rest)
    once = motions(equation, rest, np.pi / half, 0.0, length=np.pi, rtol=_RTOL, derivatives=False)
    low = np.minimum(once.low[:, 0], once.end[:, 0])
    error = np.maximum(once.error / (start - low), _ROUND_OFF / n / start)
    if restoring.contact and equation.cells[0][0] > -1.0:  # the stiffness at contact loss is infinite
        error = np.maximum(error, np.where(low < _ALMOST, _INFINITE, 0.0))
    if not error.max() < _GREATEST:
        raise ConvergenceError(
            f"u0 = {start[error.argmax()]:g} is too small or too large: the motion is lost in round-off"
        )
    speed = np.sqrt(2.0 * np.maximum(-1.0 - low, 0.0) / n) if restoring.contact else 0.0 * low
    columns = (
        start, low, np.pi / half, once.wave[:, 0, 0] * 2.0 / np.pi, speed, n * speed / half, 2.0 * once.loss, error,
    )  # fmt: skip
    return tuple(FreeOrbit(*values) for values in np.transpose(columns).tolist())


def _half_periods(equation: Equation, rest: Array) -> Array:
    """Times from the states of rest (orbits, 2) to rest on the other side."""
    contact, at = equation.restoring.contact, equation.restoring.f(rest[:, 0])
    # a stretch that no orbit can pass twice; then twice as long ones, until the first turn is inside
    length = 1.5 * np.minimum(np.sqrt(rest[:, 0] / at), 1.0)
    half: Array = np.empty(len(rest))
    left: Array = np.arange(len(rest))
    while left.size:
        m = motions(equation, rest[left], 1.0, 0.0, length=length[left], rtol=1e-9, derivatives=False)
        turned, flies = ~(m.end[:, 1] <= 0.0), contact & (m.end[:, 0] < -1.0)
        half[left] = np.where(flies & ~turned, length[left], m.lowest)
        turned |= flies  # in flight the step of Newton's method is exact
        left = left[~turned]
        length[left] *= 2.0
    for early in (0.0, _EARLY):
        half = (1.0 - early) * half
        u, v = motions(equation, rest, 1.0 / half, 0.0, length=1.0, rtol=_RTOL, derivatives=False).end.T
        half = half + v / equation.restoring.f(u)
    return half


def _surplus(restoring: Restoring, u: float, level: float) -> float:
    """Potential at a displacement less that at another one."""
    z, other = (restoring.z_s * (1.0 + x) for x in (u, level))
    stored = float(restoring.law.potential(z) - restoring.law.potential(other)) / (restoring.scale * restoring.z_s)
    return stored - (u - level) / restoring.n_loc


def contact_limit(restoring: Restoring) -> float:
    """Largest release that keeps contact, V(u_max) = V(-1); (n+1)^(1/n) - 1 for a power law.

    It is inf for a law without contact loss.
    """
    high = 1.0 if restoring.contact else np.inf
    while high < 1e9 and _surplus(restoring, high, -1.0) < 0.0:
        high *= 2.0
    if high > 1e9:
        return np.inf
    return float(brentq(lambda u: _surplus(restoring, u, -1.0), 0.0, high, xtol=1e-15, rtol=1e-14))


def largest_amplitude(restoring: Restoring) -> float:
    """Largest release amplitude: inf, or just inside a Taylor rim."""
    law = restoring.law
    if not isinstance(law, TaylorLaw):
        return np.inf
    low, high = law.rims()
    edge, ceiling = high, min(high, 1e3)
    if np.isfinite(low) and _surplus(restoring, ceiling, low) > 0.0:
        edge = brentq(lambda u: _surplus(restoring, u, low), 0.0, ceiling)
    return 0.999 * edge


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


def resonance_peak(equation: Equation, setting: Setting) -> FreeOrbit | None:
    """Free orbit that a forcing sustains at phase resonance; None if there is none."""
    restoring, zeta, damping = equation.restoring, equation.zeta, equation.damping
    limit, drive = min(largest_amplitude(restoring), _LARGEST), setting.F_hat / (2.0 * zeta)

    def surplus(u: float) -> float:
        (orbit,) = free_orbits(restoring, u, damping)
        return orbit.drive - float(setting.forcing(orbit.omega)) / (2.0 * zeta)

    low = high = min(1e-3, 0.1 * drive, 0.5 * limit)
    try:
        while surplus(high) < 0:
            low, high = high, min(4.0 * high, limit)
            if high == low or (high > 1e3 and surplus(high) < surplus(low)):  # the damping does not limit it
                return None
    except ConvergenceError:  # beyond any amplitude that can be integrated
        return None
    u = low if high == low else brentq(surplus, low, high, xtol=1e-14, rtol=1e-13)
    return free_orbits(restoring, u, damping)[0]


def thresholds(equation: Equation, settings: Sequence[Setting] = ()) -> Thresholds:
    """Compute the onsets of `Thresholds` and the resonance peak of each setting."""
    restoring, zeta, damping = equation.restoring, equation.zeta, equation.damping
    limit = contact_limit(restoring)
    orbit = free_orbits(restoring, limit, damping)[0] if np.isfinite(limit) else None
    kappa, bar = restoring.kappa, restoring.law.kappa_bar(restoring.z_s)
    peaks: list[dict[str, float | None]] = []
    for setting in settings:
        f = setting.F_hat
        peak = resonance_peak(equation, setting) if zeta > 0 else None
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
