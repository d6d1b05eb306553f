"""Event-accurate time integration.

Contact is integrated by an explicit Runge-Kutta method of order 8 (DOP853) up to the instant of separation, flight
in closed form up to the instant of landing, so no step contains a contact loss. In Lienard's variable (see
`asperity.dynamics.law.damping`) the vector field is continuous there, and perturbations need no jump condition.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import cos, sin
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from asperity.arrays import Array
from asperity.dynamics.forcing import Setting
from asperity.dynamics.law.damping import in_flight, primitive, rate
from asperity.dynamics.orbits.harmonic_balance import Balance
from asperity.errors import ConvergenceError, RangeError

_ESCAPE = 1e3  # displacement beyond which motion has left a Taylor well


@dataclass(frozen=True)
class Trajectory:
    """Motion in time, in units of 1/omega_s.

    Attributes:
        tau: times, including every separation and landing, shape (times,).
        u, v: displacement and speed at these times, shape (times,).
        flight: time intervals without contact, shape (flights, 2).
        setting: law, damping and forcing, if the motion is that of an oscillator.
        tolerance: relative tolerance of the integrator.
        valid: False if a Taylor law passes u = -1.

    Examples:
        >>> path = asp.ContactOscillator(asp.PowerLaw(1.5), zeta=0.0).simulate(1.0, 0.0, u=1.0, periods=1)
        >>> len(path.flight), path.flight.round(4)
        (1, array([[2.5587, 4.3343]]))
    """

    tau: Array
    u: Array
    v: Array
    flight: Array
    setting: Setting | None = None
    tolerance: float = np.nan
    valid: bool = True


@dataclass(frozen=True)
class Arc:
    """End state (u, w, 4 sensitivities, 2 Fourier integrals), extremes, samples and flights of an integration."""

    state: Array
    low: float
    high: float
    tau: Array
    u: Array
    v: Array
    flight: list[tuple[float, float]]


def integrate(
    balance: Balance,
    omega: float,
    forcing: float,
    u: float,
    v: float,
    duration: float,
    *,
    start: float = 0.0,
    rtol: float = 1e-10,
    samples: int = 0,
) -> tuple[Trajectory, Array]:
    """Integrate from (u, v) at time `start` for `duration` (both in 1/omega_s).

    Args:
        balance: the oscillator.
        omega, forcing: Omega and F^.
        u, v: initial state.
        duration: time to run.
        start: initial time; the forcing is F^ cos(Omega tau).
        rtol: tolerance of the integrator.
        samples: output points per unit of time (events are always included).

    Returns:
        The trajectory, and the final (u, v).

    Raises:
        RangeError: the motion escapes from a Taylor well.
    """
    arc = integrate_arc(balance, omega, forcing, augmented_state(balance, u, v), start, start + duration, rtol, samples)
    final = np.array([arc.state[0], arc.state[1] - damping_term(balance, arc.state[0])])
    return Trajectory(arc.tau, arc.u, arc.v, np.array(arc.flight).reshape(-1, 2)), final


def damping_term(balance: Balance, u: float) -> float:
    """Return 2 zeta G(u), the difference between w and the speed."""
    return 2.0 * balance.zeta * float(primitive(balance.restoring, balance.damping, np.array([u]))[0])


def augmented_state(balance: Balance, u: float, v: float) -> Array:
    """Return the augmented state (8,) of (u, v); sensitivities are with respect to (u, w)."""
    return np.array([u, v + damping_term(balance, u), 1.0, 0.0, 0.0, 1.0, 0.0, 0.0])


def integrate_arc(
    balance: Balance, omega: float, forcing: float, y: Array, start: float, stop: float, rtol: float, samples: int
) -> Arc:
    """Integrate the augmented state from `start` to `stop`, alternating between contact and flight.

    Args:
        balance: the oscillator.
        omega, forcing: Omega and F^.
        y: augmented state, see `augmented_state`; sensitivities and Fourier integrals start again.
        start, stop: times.
        rtol: tolerance of the integrator.
        samples: output points per unit of time.

    Raises:
        ConvergenceError: the integrator fails.
        RangeError: the motion escapes from a Taylor well.
    """
    tau, u, v, flights = [np.array([start])], [y[:1]], [np.array([y[1] - damping_term(balance, y[0])])], []
    low = high = float(y[0])
    t = start
    y = y.copy()
    y[2:] = (1.0, 0.0, 0.0, 1.0, 0.0, 0.0)
    for _ in range(100000):
        if t >= stop:
            break
        speed = y[1] - damping_term(balance, y[0])
        flying = balance.restoring.contact and (y[0] < -1.0 - 1e-13 or (y[0] <= -1.0 + 1e-13 and speed < 0))
        if flying:
            end, y, path = _in_flight(balance, omega, forcing, y, t, stop, samples)
            flights.append((t, end))
        else:
            end, y, path = _in_contact(balance, omega, forcing, y, t, stop, rtol, samples)
        for part, whole in zip(path, (tau, u, v), strict=True):
            whole.append(part)
        low, high = min(low, float(path[1].min())), max(high, float(path[1].max()))
        t = end
    return Arc(y, low, high, np.concatenate(tau), np.concatenate(u), np.concatenate(v), flights)


def _in_contact(
    balance: Balance, omega: float, forcing: float, y: Array, start: float, stop: float, rtol: float, samples: int
) -> tuple[float, Array, tuple[Array, Array, Array]]:
    """Integrate in contact until separation or `stop`: end time, state there, and samples with the extremes."""
    r, zeta, damping = balance.restoring, balance.zeta, balance.damping
    soft = not balance.restoring.singular

    always, weight = damping == "always", 1.0 / r.n_loc

    def field(t: float, s: Array) -> list[float]:
        numbers: Any = s.tolist()
        u, w, uu, uw, wu, ww, *_ = numbers
        pull, k = r.pull_at(u)
        if not soft:
            k = 0.0
        if always:
            g, lost = 2.0 * zeta, 2.0 * zeta * u
        else:
            at = np.array([u])
            g = 2.0 * zeta * float(rate(r, damping, at)[0])
            lost = 2.0 * zeta * float(primitive(r, damping, at)[0])
        c, d = cos(omega * t), sin(omega * t)
        return [
            w - lost,
            forcing * c - pull + weight,
            wu - g * uu,
            ww - g * uw,
            -k * uu,
            -k * uw,
            u * c,
            u * d,
        ]

    def separation(t: float, s: Array) -> float:
        if r.contact:
            return float(s[0]) + 1.0
        return float(_ESCAPE - abs(s[0]))

    def turning(t: float, s: Array) -> float:
        return float(s[1]) - 2.0 * zeta * float(primitive(r, damping, np.array([s[0]]))[0])

    separation.terminal, separation.direction = True, -1.0  # type: ignore[attr-defined]
    limit = min(0.25, 2.0 * np.pi / omega / 16.0)
    end = stop
    for _ in range(8):
        times = np.linspace(start, end, max(2, int(samples * (end - start)) + 2)) if samples else None
        run = solve_ivp(
            field,
            (start, end),
            y,
            method="DOP853",
            rtol=rtol,
            atol=1e-2 * rtol,
            t_eval=times,
            events=(separation, turning),
            max_step=limit,
        )
        if not run.success:
            raise ConvergenceError(f"time integration failed at tau = {run.t[-1]:g}: {run.message}")
        turns, states = run.t_events[1], run.y_events[1]
        # a step may pass over a grazing contact loss: integrate only to the minimum that reveals it
        missed = [
            t for t, s in zip(turns, states, strict=True) if r.contact and s[0] < -1.0 - 1e-14 and t > start + 1e-12
        ]
        if not missed or missed[0] >= (run.t_events[0][0] if run.t_events[0].size else np.inf):
            break
        end = float(missed[0])
    if run.t_events[0].size:
        t, state = float(run.t_events[0][0]), run.y_events[0][0]
        if not r.contact:
            raise RangeError(f"the motion escapes from the Taylor well near tau = {t:g}: use the exact law")
        state = state.copy()
        state[0] = -1.0
    else:
        t, state = float(run.t[-1]), run.y[:, -1]
    inside = run.t <= t
    tau = np.concatenate([run.t[inside] if samples else run.t[:0], turns[turns <= t], [t]])
    table = np.concatenate(
        [
            run.y[:, inside].T if samples else run.y.T[:0],
            states[turns <= t] if turns.size else np.empty((0, 8)),
            state[None],
        ]
    )
    order = np.argsort(tau, kind="stable")
    u = table[order, 0]
    return t, state, (tau[order], u, table[order, 1] - 2.0 * zeta * primitive(r, damping, u))


def _in_flight(
    balance: Balance, omega: float, forcing: float, y: Array, start: float, stop: float, samples: int
) -> tuple[float, Array, tuple[Array, Array, Array]]:
    """Compute the flight in closed form until landing or `stop`: as `_in_contact`."""
    n = balance.restoring.n_loc
    zeta = balance.zeta if in_flight(balance.damping) else 0.0
    c = 2.0 * zeta
    speed = y[1] - damping_term(balance, y[0])
    # u'' + c u' = 1/n + F cos(Omega tau): particular solution and free part
    response = forcing / complex(-omega * omega, c * omega)
    wave0 = response * np.exp(1j * omega * start)
    v0 = speed - (1j * omega * wave0).real

    def phi(s: Array) -> tuple[Array, Array]:
        """Return the first and second integral of exp(-c s)."""
        x = c * s
        small = np.abs(x) < 1e-3
        safe = np.where(small, 1.0, x)
        one = np.where(small, 1 - x / 2 + x * x / 6 - x**3 / 24, -np.expm1(-safe) / safe)
        two = np.where(small, 0.5 - x / 6 + x * x / 24 - x**3 / 120, (1.0 - one) / safe)
        return s * one, s * s * two

    def position(s: Array) -> Array:
        p1, p2 = phi(s)
        wave = response * np.exp(1j * omega * (start + s))
        return np.asarray(y[0] + v0 * p1 + p2 / n + (wave - wave0).real)

    def velocity(s: Array) -> Array:
        wave = response * np.exp(1j * omega * (start + s))
        return np.asarray(v0 * np.exp(-c * s) + phi(s)[0] / n + (1j * omega * wave).real)

    length = stop - start
    scale = 2.0 * np.pi / omega
    landing, s0 = length, 0.0
    first = min(length, max(1e-9, 0.02 * abs(speed) * n))
    grid_step = min(scale / 64.0, 0.1)
    previous = None
    while s0 < length:
        grid = np.unique(
            np.concatenate(
                [[first] if s0 == 0.0 else [s0], np.linspace(max(s0, first), min(length, s0 + 64 * grid_step), 65)]
            )
        )
        if previous is not None:
            grid = np.concatenate([[previous], grid])
        values = position(grid) + 1.0
        rates = velocity(grid)
        up = values > 0
        # a short contact between samples is a maximum of u above -1
        hump = np.flatnonzero((rates[:-1] > 0) & (rates[1:] < 0) & ~up[:-1] & ~up[1:])
        crossing = int(np.argmax(up)) if up.any() else grid.size
        hit = None
        for j in hump:
            if j >= crossing:
                break
            top = brentq(lambda s: float(velocity(np.array(s))), grid[j], grid[j + 1], xtol=1e-15)
            if float(position(np.array(top))) + 1.0 > 0:
                hit = (grid[j], top)
                break
        if hit is None and crossing < grid.size:
            hit = (grid[crossing - 1] if crossing else 0.0, grid[crossing])
        if hit is not None:
            if float(position(np.array(hit[0]))) + 1.0 < 0:
                landing = brentq(lambda s: float(position(np.array(s))) + 1.0, *hit, xtol=1e-15, rtol=1e-14)
            else:
                landing = float(hit[1])
            break
        s0, previous = float(grid[-1]), float(grid[-1])
    turns = np.linspace(0.0, landing, max(3, int(64 * landing / scale) + 3))
    rates = velocity(turns)
    roots = [
        brentq(lambda s: float(velocity(np.array(s))), turns[j], turns[j + 1], xtol=1e-15)
        for j in np.flatnonzero((rates[:-1] > 0) != (rates[1:] > 0))
    ]
    s = np.sort(np.concatenate([np.linspace(0, landing, int(samples * landing) + 2)[1:-1], roots, [landing]]))
    u, v = position(s), velocity(s)
    out = y.copy()
    landed = landing < length
    out[0] = -1.0 if landed else float(u[-1])
    out[1] = float(v[-1]) + damping_term(balance, out[0])
    if zeta:
        decay, p1 = np.exp(-c * landing), float(phi(np.array(landing))[0])
    else:
        decay, p1 = 1.0, landing
    out[2], out[3] = decay * y[2] + p1 * y[4], decay * y[3] + p1 * y[5]
    pieces = max(1, int(np.ceil(4 * landing / scale)))
    x, w = np.polynomial.legendre.leggauss(20)
    edges = np.linspace(0.0, landing, pieces + 1)
    nodes = (0.5 * (edges[1:] + edges[:-1])[:, None] + 0.5 * np.diff(edges)[:, None] * x).ravel()
    weights = (0.5 * np.diff(edges)[:, None] * w).ravel()
    path = position(nodes) * weights
    out[6] += float(path @ np.cos(omega * (start + nodes)))
    out[7] += float(path @ np.sin(omega * (start + nodes)))
    return start + landing, out, (start + s, u, v)
