"""Free vibration by quadrature: period, first harmonic and dissipation of undamped orbits.

The period of motion between the turning points is ``T = 2 INT du / sqrt(2 [V(u_0) - V(u)])``. The substitution
``u = mid + half sin(theta)`` removes both end singularities, Gauss panels are split at knots of the law and at
contact loss, and free flight (``u'' = 1/n_loc``) is added in closed form.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.polynomial import legendre
from numpy.typing import ArrayLike
from scipy.optimize import brentq

from asperity.arrays import Array
from asperity.dynamics.equation import Equation, Restoring, rate
from asperity.errors import ConvergenceError, RangeError
from asperity.force_law.checks import positive, positives
from asperity.force_law.damping import Damping
from asperity.force_law.taylor import TaylorLaw
from asperity.runtime.display import short_repr

_ORDERS = (24, 48, 96, 192, 384)  # of the Gauss rule of a panel, until two of them agree
_RTOL = 2e-13  # in which they agree: some hundred times round-off
_SHORT = 1e-12  # a knot this close to a turning point, over half the stroke, has no panel of its own
_TOUCHING = 1e-5  # distance from a turning point, over that of this from separation, where potentials cancel


@dataclass(frozen=True)
class FreeOrbit:
    """Undamped free orbit released from rest at u_0 > 0.

    Attributes:
        u0, u_min: turning points (u > 0 is compression)
        omega: frequency over omega_s
        a1, a2: amplitudes of the first and second harmonic of u, cosines
        v_s: speed at separation (0 if contact is kept)
        flight: share of the period out of contact
        dissipation: INT g u'^2 over a period, for the requested damping model
        error: estimated relative error of `omega`
    """

    u0: float
    u_min: float
    omega: float
    a1: float
    a2: float
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


def contact_limit(restoring: Restoring) -> float:
    """Largest release that keeps contact, V(u_max) = V(-1); (n+1)^(1/n) - 1 for a power law.

    It is inf for a law without contact loss.
    """
    if not restoring.contact:
        return np.inf
    wall, high = restoring.wall, 1.0
    while restoring.level(high) < wall:
        high *= 2.0
        if high > 1e9:
            return np.inf
    return float(brentq(lambda u: restoring.level(u) - wall, 0.0, high, xtol=1e-15, rtol=1e-14))


def free_orbit(restoring: Restoring, u0: float, damping: Damping = "always", *, rough: bool = False) -> FreeOrbit:
    """Compute the orbit released from rest at `u0`, to 1e-12 where the law is smooth, or to about 1e-4 if `rough`.

    Raises:
        RangeError: the orbit passes the rim of a Taylor well
        ConvergenceError: the quadrature does not converge (the law is too rough between its knots)
    """
    half = _half_period(restoring, positive("u0", u0), _ORDERS[: 1 if rough else None])
    if not (rough or half.error < 1e-6):
        raise ConvergenceError(
            f"the period at u0 = {u0:g} converges only to {half.error:.1e}: the amplitude is lost in round-off, or "
            "the law is too rough; fit a power law to it"
        )
    a1, a2 = (float(a) for a in _harmonics(half, np.array([1, 2])))
    return FreeOrbit(
        u0, half.u_min, 2.0 * np.pi / half.period, a1, a2, half.v_s, 2.0 * half.flight / half.period,
        _dissipation(restoring, half, damping), max(half.error, 1e-15),
    )  # fmt: skip


class _HalfPeriod(NamedTuple):
    """Samples of the contact part from u0 downwards: displacements, time weights, times, speeds."""

    u: Array
    dt: Array
    t: Array
    speed: Array
    u_min: float
    v_s: float
    flight: float  # half of the flight time
    n_loc: float
    period: float
    error: float


def _half_period(restoring: Restoring, u0: float, orders: tuple[int, ...]) -> _HalfPeriod:
    u_min, v_s = _turning_point(restoring, u0)
    mid, half = 0.5 * (u0 + u_min), 0.5 * (u0 - u_min)
    low = -1.0 if v_s > 0 else u_min
    inner = restoring.law.knots / restoring.z_s - 1.0
    short = _SHORT * half
    knots = np.concatenate([[low], inner[(inner > low + short) & (inner < u0 - short)], [u0]])
    theta = np.arcsin(np.clip((knots - mid) / half, -1.0, 1.0))
    theta[-1] = 0.5 * np.pi
    depth = 0.5 * restoring.n_loc * v_s**2  # of the flight below u = -1
    theta[0] = -0.5 * np.pi + 2.0 * np.arcsin(np.sqrt(0.5 * depth / half))
    v0 = restoring.level(u0)
    time, error = np.nan, np.inf
    for order in orders:
        u, dt, t, speed = _contact_part(restoring, theta, u_min, u0, v0, order)
        previous, time = time, float(dt.sum())
        error = abs(time - previous) / time
        if error < _RTOL:
            break
    flight = restoring.n_loc * v_s
    return _HalfPeriod(u, dt, t, speed, u_min, v_s, flight, restoring.n_loc, 2.0 * (time + flight), error)


def _dissipation(restoring: Restoring, half: _HalfPeriod, damping: Damping) -> float:
    """INT g u'^2 over the period."""
    loss = 2.0 * float((rate(restoring, damping, half.u) * half.speed**2) @ half.dt)
    if half.v_s > 0 and damping == "always":  # it also acts in flight
        loss += 2.0 * restoring.n_loc * half.v_s**3 / 3.0
    return loss


def _harmonics(half: _HalfPeriod, k: Array) -> Array:
    """Cosine coefficients of the orbit for the harmonics `k`."""
    omega = 2.0 * np.pi / half.period
    out = np.cos(omega * np.outer(k, half.t)) @ (half.u * half.dt)
    if half.v_s > 0:
        x, w = _gauss(48 + 2 * int(k.max()))
        s = 0.5 * (1.0 + x) * half.flight  # from separation to the top of the flight
        path = -1.0 - half.v_s * s + s * s / (2.0 * half.n_loc)
        phase = omega * np.outer(k, 0.5 * half.period - half.flight + s)
        out = out + np.cos(phase) @ (path * w) * 0.5 * half.flight
    return np.where(k == 0, 2.0, 4.0) / half.period * out


def free_vibration(equation: Equation, amplitudes: ArrayLike, omega_s: float) -> FreeVibration:
    """Compute the natural frequency at each release amplitude; see `free_orbit`."""
    r = equation.restoring
    orbits = tuple(free_orbit(r, u, equation.damping) for u in positives("u0", amplitudes))
    valid = tuple(r.contact or o.u_min >= -1.0 for o in orbits)
    return FreeVibration(
        r.model, r.law.describe(), r.n_loc, r.kappa, omega_s, orbits, valid, max(o.error for o in orbits)
    )


def largest_amplitude(restoring: Restoring) -> float:
    """Largest release amplitude: inf, or just inside a Taylor rim."""
    law = restoring.law
    if not isinstance(law, TaylorLaw):
        return np.inf
    low, high = law.rims()
    edge, ceiling = high, min(high, 1e3)
    if np.isfinite(low):
        wall = restoring.level(low)
        if restoring.level(ceiling) > wall:
            edge = brentq(lambda u: restoring.level(u) - wall, 0.0, ceiling)
    return 0.999 * edge


def _turning_point(restoring: Restoring, u0: float) -> tuple[float, float]:
    """Lower turning point and the speed at separation (0 if contact is kept)."""
    law = restoring.law
    energy = restoring.level(u0)
    if not isinstance(law, TaylorLaw):
        surplus = energy - restoring.wall
        if surplus > 0:
            return -1.0 - surplus * restoring.n_loc, float(np.sqrt(2.0 * surplus))
        low = -1.0
    else:
        low, rim = law.rims()[0], largest_amplitude(restoring)
        if u0 > rim:
            raise RangeError(
                f"u0 = {u0:g} is beyond the rim of the Taylor well (u0 = {rim:.6g}): the truncated law lets the motion "
                "escape; use the exact law"
            )
        if not np.isfinite(low):
            low = -u0
            while restoring.level(low) < energy:
                low *= 2.0
    root = brentq(lambda u: restoring.level(u) - energy, low, -1e-3 * min(u0, 1.0), xtol=1e-16, rtol=1e-14)
    return float(root), 0.0


def _contact_part(
    restoring: Restoring, theta: Array, u_min: float, u0: float, v0: float, order: int
) -> tuple[Array, Array, Array, Array]:
    """Displacements, time weights, times from the compressed end and speeds over half a period."""
    mid, half = 0.5 * (u0 + u_min), 0.5 * (u0 - u_min)
    x, w = _gauss(order)
    width = 0.5 * np.diff(theta)[:, None]
    angle = 0.5 * (theta[1:] + theta[:-1])[:, None] + width * x
    u = mid + half * np.sin(angle)
    gain = v0 - restoring.potential(u)
    # near an end the difference of potentials cancels: integrate the force instead
    below = 2.0 * half * np.sin(0.25 * np.pi - 0.5 * angle) ** 2
    near = below < 0.02 * half
    gain[near] = -restoring.work(np.full(near.sum(), u0), -below[near])
    above = 2.0 * half * np.sin(0.25 * np.pi + 0.5 * angle) ** 2
    if restoring.contact and u_min < -0.5:  # measured from the flight side, exact down to u = -1
        near = u < -0.5
        stored = restoring.pulled(u[near]) - restoring.pulled(u_min)
        gain[near] = above[near] / restoring.n_loc - stored
        near = above < _TOUCHING * (1.0 + u_min)
    else:
        near = above < 0.02 * half
    gain[near] = -restoring.work(np.full(near.sum(), u_min), above[near])
    if not gain.min() > 0:
        raise ConvergenceError("the amplitude is too small: V(u) is lost in round-off")
    speed = np.sqrt(2.0 * gain)
    slope = half * np.cos(angle) / speed  # dt / dtheta
    panels = (slope * w) * width
    start = panels.sum(axis=1)[::-1].cumsum()[::-1]  # time from the left end of each panel to u0
    t = start[:, None] - width * (slope @ _integration(order).T)
    return u.ravel(), panels.ravel(), t.ravel(), speed.ravel()


@lru_cache(maxsize=16)
def _gauss(order: int) -> tuple[Array, Array]:
    return legendre.leggauss(order)


@lru_cache(maxsize=16)
def _integration(order: int) -> Array:
    """Matrix that integrates values at the Gauss points from -1 to each of them."""
    x, w = _gauss(order)
    k = np.arange(order)
    coefficients = (k + 0.5)[:, None] * (legendre.legvander(x, order - 1) * w[:, None]).T
    return np.asarray(legendre.legvander(x, order) @ legendre.legint(np.eye(order), lbnd=-1) @ coefficients)
