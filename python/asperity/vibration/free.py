"""Free vibration over the amplitude, and onsets of nonlinear phenomena.

The time on a free orbit is the quadrature of du over the speed, by Gauss points on pieces between corners of the law,
with u = mid + half sin(theta), which removes the singularity of rest. At phase resonance the forcing supplies exactly
the energy that the damper takes from a free orbit:

    F^ / (2 zeta) = INT g(u) u'^2 dtau / (pi a_1)   (error O(zeta^2)).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import brentq

from asperity.arrays import Array, Flags
from asperity.errors import ConvergenceError, RangeError
from asperity.model.limits import positives
from asperity.runtime.display import short_repr
from asperity.vibration.equation import Equation
from asperity.vibration.law import TaylorLaw, bar_of, bend

_POINTS = 10  # Gauss points on a piece
_PIECES = np.pi * np.concatenate([[0.0], 0.5 ** np.arange(4, 0, -1), 1.0 - 0.5 ** np.arange(2, 15), [1.0]])  # of theta
_NEAR = 0.25 ** np.arange(1, 15)  # distances from separation over that of the release at which more pieces begin
_GREATEST = 1e-3  # error of an orbit that is refused, far above that of any amplitude in use
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(_POINTS)
_X, _W = 0.5 * (_NODES + 1.0), 0.5 * _WEIGHTS
_LAST = (2 * _POINTS - 1) * np.polynomial.legendre.Legendre.basis(_POINTS - 1)(_NODES) * _W  # mode
_POWERS = np.arange(1.0, _POINTS + 1.0)
_INTEGRAL = _X[:, None] ** _POWERS / _POWERS @ np.linalg.inv(np.vander(_X, increasing=True))  # from 0 to each point


@dataclass(frozen=True, eq=False)
class FreeVibration:
    """Undamped free orbits released from rest at u_0 > 0, each array of shape (orbits,).

    Attributes:
        model: "exact" or "taylor"
        u0, u_min: turning points (u > 0 is compression)
        omega_ratio: natural frequency over omega_s
        a1: amplitude of the first harmonic of u, a cosine
        drive: forcing F^/(2 zeta) that sustains the orbit at phase resonance, by energy balance
        error: estimated relative error of `omega_ratio`

    Examples:
        >>> free = asp.ContactOscillator(asp.PowerLaw(1.5)).free([0.2, 0.5])
        >>> free.omega_ratio.round(6), free.valid
        (array([0.998259, 0.987785]), array([ True,  True]))
    """

    model: str
    u0: Array
    u_min: Array
    omega_ratio: Array
    a1: Array
    drive: Array
    error: Array

    __repr__ = short_repr

    @property
    def valid(self) -> Flags:
        """False where a Taylor orbit has u_min < -1, which is unphysical."""
        return np.asarray((self.model == "exact") | (self.u_min >= -1.0))

    def rows(self) -> Iterator[dict[str, Any]]:
        """Rows of free.csv."""
        names = ("u0", "omega_ratio", "u_min", "a1")
        for values in zip(*(getattr(self, name).tolist() for name in names), strict=True):
            yield {"model": self.model} | dict(zip(names, values, strict=True))


def free_vibration(equation: Equation, u0: ArrayLike) -> FreeVibration:
    """Compute the orbits released from rest at u0 > 0 (orbits,).

    Raises:
        RangeError: an orbit passes the rim of a Taylor well
        ConvergenceError: an amplitude is lost in round-off
    """
    top, rim = np.array(positives("u0", u0)), largest_amplitude(equation)
    if (far := top[top > rim]).size:
        raise RangeError(
            f"u0 = {far[0]:g} is beyond the rim of the Taylor well (u0 = {rim:.6g}): the truncated law lets the motion "
            "escape; use the exact law"
        )
    low = _lowest(equation, top)
    for _ in range(3):  # where the potential is the same as at the top: by the quadrature itself
        low = low - _descent(equation, low, top)[0] / equation.f(low)
    fall, u, t, dt, loss, error = _descent(equation, low, top)
    half = dt.sum(axis=(1, 2))
    omega = np.pi / half
    a1 = 2.0 / half * np.sum(dt * u * np.cos(omega[:, None, None] * t), axis=(1, 2))
    left = np.abs(fall) / (equation.f(top) * top)  # of the balance of energy
    error = np.maximum(error / half + left, 1e-15 / equation.n_loc / top)
    if not error.max() < _GREATEST:
        raise ConvergenceError(
            f"u0 = {top[error.argmax()]:g} is too small or too large: the motion is lost in round-off"
        )
    return FreeVibration(equation.model, top, low, omega, a1, 2.0 * loss / (np.pi * a1), error)


def _descent(equation: Equation, low: Array, top: Array) -> tuple[Array, Array, Array, Array, Array, Array]:
    """Half periods, from rest at `top` (orbits,) down to `low`, by pieces of theta.

    Returns:
        Potential at `top` less that at `low` (orbits,); u, the time since the release and its weight at the Gauss
        points (orbits, pieces, 10); INT g v dx and the estimated error of the time (orbits,)
    """
    half = 0.5 * (top - low)[:, None, None]
    knots = np.union1d(equation.corners, np.asarray(equation.law.knots, float) / equation.z_s - 1.0)
    near = -1.0 + (1.0 + top[:, None]) * _NEAR
    corners = np.concatenate([np.broadcast_to(knots, (top.size, knots.size)), near], axis=1)
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
    f, step, weight = equation.f(u), half * np.sin(at), _W * size  # step: -du/dtheta
    lost = np.sum(weight * f * step, axis=2)
    inner, down = size * ((f * step) @ _INTEGRAL.T), np.cumsum(lost, axis=1)
    rest = np.cumsum(lost[:, ::-1], axis=1)[:, ::-1, None]  # from the low end, where it is small
    energy = inner + np.where(at > 0.5 * np.pi, -rest, (down - lost)[..., None])
    speed = np.sqrt(2.0 * np.maximum(energy, 1e-300))
    pace = step / speed  # dt/dtheta
    steps = np.sum(weight * pace, axis=2)
    t = size * (pace @ _INTEGRAL.T) + (np.cumsum(steps, axis=1) - steps)[..., None]
    loss = np.sum(weight * equation.rate(u, f) * speed * step, axis=(1, 2))
    error = np.abs(np.sum(size[..., 0] * (pace @ _LAST), axis=1)) * 1e-3
    return down[:, -1], u, t, weight * pace, loss, error


def _lowest(equation: Equation, top: Array) -> Array:
    """Lower ends of orbits released at `top` (orbits,), to 1e-8."""
    low: Array = np.full(top.size, -1.0)
    if isinstance(equation.law, TaylorLaw):
        rim = equation.law.rims()[0]
        low = np.maximum(rim, -1e3 - 10.0 * top) if np.isfinite(rim) else -10.0 - 10.0 * top
    else:  # a flight has a constant force
        low = low - equation.n_loc * np.maximum(_surplus(equation, top, low), 0.0) - 1e-6
    a: Array = low
    b: Array = np.zeros(top.size)
    for _ in range(44):
        middle = 0.5 * (a + b)
        above = _surplus(equation, top, middle) < 0.0
        a, b = np.where(above, middle, a), np.where(above, b, middle)
    return np.where(top < 1e-6, -top * (1.0 + 2.0 / 3.0 * equation.a2 * top), 0.5 * (a + b))


def _surplus(equation: Equation, u: ArrayLike, level: ArrayLike) -> Array:
    """Potential at a displacement less that at another one."""
    z, other = (equation.z_s * (1.0 + np.asarray(x, float)) for x in (u, level))
    stored = (equation.law.potential(z) - equation.law.potential(other)) / (equation.scale * equation.z_s)
    return np.asarray(stored - (np.asarray(u) - np.asarray(level)) / equation.n_loc)


def contact_limit(equation: Equation) -> float:
    """Largest release that keeps contact, V(u_max) = V(-1); (n+1)^(1/n) - 1 for a power law.

    It is inf for a law without contact loss.
    """
    high = 1.0 if equation.contact else np.inf
    while high < 1e9 and _surplus(equation, high, -1.0) < 0.0:
        high *= 2.0
    if high > 1e9:
        return np.inf
    return float(brentq(lambda u: _surplus(equation, u, -1.0), 0.0, high, xtol=1e-15, rtol=1e-14))


def largest_amplitude(equation: Equation) -> float:
    """Largest release amplitude: inf, or just inside a Taylor rim."""
    law = equation.law
    if not isinstance(law, TaylorLaw):
        return np.inf
    low, high = law.rims()
    edge, ceiling = high, min(high, 1e3)
    if np.isfinite(low) and _surplus(equation, ceiling, low) > 0.0:
        edge = brentq(lambda u: _surplus(equation, u, low), 0.0, ceiling)
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
    zeta, kappa = equation.zeta, equation.kappa
    limit = contact_limit(equation)
    orbit = free_vibration(equation, limit) if np.isfinite(limit) else None
    bar = np.nan_to_num(bar_of(equation.law, lambda law: law.at_load(equation.load))[3])
    return Thresholds(
        n_loc=equation.n_loc,
        kappa=kappa,
        softening=bend(float(kappa - bar), float(kappa + bar)),
        u_max=limit if orbit else None,
        omega_loss=float(orbit.omega_ratio[0]) if orbit else None,
        contact_loss=2.0 * zeta * float(orbit.drive[0]) if orbit else None,
        hysteresis=float(np.sqrt(32.0 * zeta**3 / (3.0 * np.sqrt(3.0) * abs(kappa)))) if kappa else None,
        period_doubling=6.0 * zeta / abs(equation.a2) if equation.a2 else None,
    )
