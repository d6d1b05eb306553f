"""Free vibration over the amplitude, and onsets of nonlinear phenomena.

The time on a free orbit is the quadrature of du over the speed, by Gauss points on pieces between corners of the law,
with u = mid + half sin(theta), which removes the singularity of rest; a flight is a parabola. At phase resonance the
forcing supplies exactly the energy that the damper takes from a free orbit:

    F^ / (2 zeta) = INT g(u) u'^2 dtau / (pi a_1)   (error O(zeta^2)).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import brentq

from asperity.arrays import Array
from asperity.errors import ConvergenceError, RangeError
from asperity.model.limits import positives
from asperity.runtime.display import short_repr
from asperity.vibration.equation import Equation, Restoring
from asperity.vibration.law import TaylorLaw, bar_of, bend

_POINTS = 10  # Gauss points on a piece
_PIECES = np.pi * np.concatenate([[0.0], 0.5 ** np.arange(4, 0, -1), 1.0 - 0.5 ** np.arange(2, 15), [1.0]])  # of theta
_FLIGHT = 5e-3  # energy at separation from where a flight is treated apart, as a parabola
_GREATEST = 1e-3  # error of an orbit that is refused, far above that of any amplitude in use
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(_POINTS)
_X, _W = 0.5 * (_NODES + 1.0), 0.5 * _WEIGHTS
_LAST = (2 * _POINTS - 1) * np.polynomial.legendre.Legendre.basis(_POINTS - 1)(_NODES) * _W  # mode
_POWERS = np.arange(1.0, _POINTS + 1.0)
_INTEGRAL = _X[:, None] ** _POWERS / _POWERS @ np.linalg.inv(np.vander(_X, increasing=True))  # from 0 to each point


def column(name: str, words: str) -> property:
    """Array of an attribute of the orbits of a result."""
    return property(lambda self: np.array([getattr(o, name) for o in self.orbits]), doc=f"{words}, shape (orbits,).")


@dataclass(frozen=True)
class FreeOrbit:
    """Undamped free orbit released from rest at u_0 > 0.

    Attributes:
        u0, u_min: turning points (u > 0 is compression)
        omega: frequency over omega_s
        a1: amplitude of the first harmonic of u, a cosine
        v_s: speed at separation (0 if contact is kept)
        dissipation: INT g u'^2 over a period, for the requested damping model
        error: estimated relative error of `omega`
    """

    u0: float
    u_min: float
    omega: float
    a1: float
    v_s: float
    dissipation: float
    error: float

    __repr__ = short_repr

    @property
    def drive(self) -> float:
        """Forcing F^/(2 zeta) that sustains this orbit at phase resonance, by energy balance."""
        return self.dissipation / (np.pi * self.a1)


@dataclass(frozen=True)
class FreeVibration:
    """Natural frequency over amplitude, and the forcing that sustains each orbit at resonance.

    Attributes:
        model: "exact" or "taylor"
        orbits: one `FreeOrbit` per amplitude

    Examples:
        >>> free = asp.ContactOscillator(asp.PowerLaw(1.5)).free([0.2, 0.5])
        >>> free.omega_ratio.round(6), free.valid
        (array([0.998259, 0.987785]), (True, True))
    """

    model: str
    orbits: tuple[FreeOrbit, ...]

    __repr__ = short_repr

    u0 = column("u0", "Amplitudes u_0")
    omega_ratio = column("omega", "Frequencies over omega_s")
    u_min = column("u_min", "Lower turning points")
    a1 = column("a1", "Amplitudes of the first harmonic")

    @property
    def valid(self) -> tuple[bool, ...]:
        """False where a Taylor orbit has u_min < -1, which is unphysical."""
        return tuple(self.model == "exact" or o.u_min >= -1.0 for o in self.orbits)

    @property
    def tolerance(self) -> float:
        """Largest estimated relative error of the frequencies."""
        return max(o.error for o in self.orbits)

    def rows(self) -> Iterator[dict[str, Any]]:
        """Rows of free.csv."""
        for o in self.orbits:
            yield {"model": self.model, "u0": o.u0, "omega_ratio": o.omega, "u_min": o.u_min, "a1": o.a1}


def free_orbits(restoring: Restoring, u0: ArrayLike, damping: str = "always") -> tuple[FreeOrbit, ...]:
    """Compute the orbits released from rest at u0 > 0 (orbits,).

    Raises:
        RangeError: an orbit passes the rim of a Taylor well
        ConvergenceError: an amplitude is lost in round-off
    """
    top, rim, n = np.array(positives("u0", u0)), largest_amplitude(restoring), restoring.n_loc
    if (far := top[top > rim]).size:
        raise RangeError(
            f"u0 = {far[0]:g} is beyond the rim of the Taylor well (u0 = {rim:.6g}): the truncated law lets the motion "
            "escape; use the exact law"
        )
    equation = Equation(restoring, 0.0, damping)
    low, flies = _lowest(restoring, top)
    for _ in range(3):  # where the potential is the same as at the top: by the quadrature itself
        fall = np.where(flies, 0.0, _descent(equation, low, top, flies)[0])
        low = low + fall / np.where(flies, 1.0, -restoring.f(low))
    fall, u, t, dt, loss, error = _descent(equation, low, top, flies)
    beyond = np.maximum(-1.0 - low, 0.0) / n * restoring.contact
    speed = np.sqrt(2.0 * np.where(flies, np.maximum(fall, 0.0), beyond))  # at separation
    flight = np.where(flies, n * speed, 0.0)  # half of a flight that the quadrature leaves out
    half = dt.sum(axis=(1, 2)) + flight
    omega = np.pi / half
    # from its middle: u = u_min + t^2/(2 n)
    lowest = np.where(flies, -1.0 - 0.5 * n * speed**2, low)
    late = flight[:, None] * _X
    a1 = np.sum(dt * u * np.cos(omega[:, None, None] * t), axis=(1, 2))
    a1 -= np.cos(omega[:, None] * late) * (lowest[:, None] + late**2 / (2.0 * n)) @ _W * flight
    drag = equation.rate(-2.0 * np.ones(1), -np.ones(1) / n)[0]  # in flight
    left = np.where(flies, 0.0, np.abs(fall)) / (restoring.f(top) * top)  # of the balance of energy
    error = np.maximum(error / half + left, 1e-15 / n / top)
    if not error.max() < _GREATEST:
        raise ConvergenceError(
            f"u0 = {top[error.argmax()]:g} is too small or too large: the motion is lost in round-off"
        )
    columns = (top, lowest, omega, 2.0 / half * a1, speed, 2.0 * (loss + drag * flight**3 / (3.0 * n**2)), error)
    return tuple(FreeOrbit(*values) for values in np.transpose(columns).tolist())


def _descent(
    equation: Equation, low: Array, top: Array, flies: Array
) -> tuple[Array, Array, Array, Array, Array, Array]:
    """Half periods in contact, from rest at `top` (orbits,) down to `low`, by pieces of theta.

    Returns:
        Potential at `top` less that at `low` (orbits,); u, the time since the release and its weight at the Gauss
        points (orbits, pieces, 10); INT g v dx and the estimated error of the time (orbits,)
    """
    restoring, half = equation.restoring, 0.5 * (top - low)[:, None, None]
    corners = np.union1d(equation.corners, np.asarray(restoring.law.knots, float) / restoring.z_s - 1.0)
    inside = np.clip((top[:, None] - corners) / (top - low)[:, None], 0.0, 1.0)
    pieces = np.broadcast_to(_PIECES, (top.size, _PIECES.size))
    theta = np.sort(np.concatenate([pieces, 2.0 * np.arcsin(np.sqrt(inside))], axis=1), axis=1)
    size = np.diff(theta)[..., None]
    at = theta[:, :-1, None] + size * _X
    # distances from the ends
    u = np.where(
        at < 0.5 * np.pi, top[:, None, None] - 2.0 * half * np.sin(0.5 * at) ** 2,
        low[:, None, None] + 2.0 * half * np.cos(0.5 * at) ** 2,
    )  # fmt: skip
    f, step, weight = restoring.f(u), half * np.sin(at), _W * size  # step: -du/dtheta
    lost = np.sum(weight * f * step, axis=2)
    inner, down = size * ((f * step) @ _INTEGRAL.T), np.cumsum(lost, axis=1)
    rest = np.cumsum(lost[:, ::-1], axis=1)[:, ::-1, None]  # from the low end, where it is small
    late = (at > 0.5 * np.pi) & ~flies[:, None, None]
    speed = np.sqrt(2.0 * np.maximum(inner + np.where(late, -rest, (down - lost)[..., None]), 1e-300))
    pace = step / speed  # dt/dtheta
    steps = np.sum(weight * pace, axis=2)
    t = size * (pace @ _INTEGRAL.T) + (np.cumsum(steps, axis=1) - steps)[..., None]
    loss = np.sum(weight * equation.rate(u, f) * speed * step, axis=(1, 2))
    error = np.abs(np.sum(size[..., 0] * (pace @ _LAST), axis=1)) * 1e-3
    return down[:, -1], u, t, weight * pace, loss, error


def _lowest(restoring: Restoring, top: Array) -> tuple[Array, Array]:
    """Lower ends of orbits released at `top` (orbits,), to 1e-8, and where a flight is apart: they end at -1 there."""
    low: Array = np.full(top.size, -1.0)
    if isinstance(restoring.law, TaylorLaw):
        rim = restoring.law.rims()[0]
        low = np.maximum(rim, -1e3 - 10.0 * top) if np.isfinite(rim) else -10.0 - 10.0 * top
    surplus = _surplus(restoring, top, low)
    flies = (surplus > _FLIGHT) & restoring.contact
    if restoring.contact:
        low = low - restoring.n_loc * np.maximum(surplus, 0.0) - 1e-6
    a: Array = low
    b: Array = np.zeros(top.size)
    for _ in range(44):
        middle = 0.5 * (a + b)
        above = _surplus(restoring, top, middle) < 0.0
        a, b = np.where(above, middle, a), np.where(above, b, middle)
    small = np.where(top < 1e-6, -top * (1.0 + 2.0 / 3.0 * restoring.a2 * top), 0.5 * (a + b))
    return np.where(flies, -1.0, small), flies


def _surplus(restoring: Restoring, u: ArrayLike, level: ArrayLike) -> Array:
    """Potential at a displacement less that at another one."""
    z, other = (restoring.z_s * (1.0 + np.asarray(x, float)) for x in (u, level))
    stored = (restoring.law.potential(z) - restoring.law.potential(other)) / (restoring.scale * restoring.z_s)
    return np.asarray(stored - (np.asarray(u) - np.asarray(level)) / restoring.n_loc)


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

    Those of small damping are leading terms, with a relative error of zeta^2.

    Attributes:
        n_loc, kappa: local exponent and backbone curvature; n_loc is also the factor from F^ to F/(m g)
        softening: sign of kappa in words: "softening", "hardening", "linear", or not resolved within its error bar
        u_max, omega_loss: largest release that keeps contact, and its frequency over omega_s
        contact_loss: F^ at which resonance begins to lose contact (small zeta)
        hysteresis: F^ of the first vertical tangent (multiple scales, small zeta)
        period_doubling: F^ of the first period doubling near Omega = 2 (small zeta; error about 0.5 % for 0.01)
    """

    n_loc: float
    kappa: float
    softening: str
    u_max: float | None
    omega_loss: float | None
    contact_loss: float | None
    hysteresis: float | None
    period_doubling: float | None

    __repr__ = short_repr


def thresholds(equation: Equation) -> Thresholds:
    """Compute the onsets of `Thresholds`."""
    restoring, zeta, kappa = equation.restoring, equation.zeta, equation.restoring.kappa
    limit = contact_limit(restoring)
    orbit = free_orbits(restoring, limit, equation.damping)[0] if np.isfinite(limit) else None
    bar = np.nan_to_num(bar_of(restoring.law, lambda law: Restoring(law, restoring.load).kappa))
    return Thresholds(
        n_loc=restoring.n_loc,
        kappa=kappa,
        softening=bend(float(kappa - bar), float(kappa + bar)),
        u_max=limit if orbit else None,
        omega_loss=orbit.omega if orbit else None,
        contact_loss=2.0 * zeta * orbit.drive if orbit else None,
        hysteresis=float(np.sqrt(32.0 * zeta**3 / (3.0 * np.sqrt(3.0) * abs(kappa)))) if kappa else None,
        period_doubling=6.0 * zeta / abs(restoring.a2) if restoring.a2 else None,
    )
