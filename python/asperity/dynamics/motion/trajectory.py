# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

"""Event-accurate time integration.

Contact is integrated by an explicit Runge-Kutta method of order 8 (DOP853) up to the instant of separation, flight
in closed form up to the instant of landing, so no step contains a contact loss. In Lienard's variable (see
`asperity.dynamics.equation`) the vector field is continuous there, and perturbations need no jump condition.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import cos, sin
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

from asperity.arrays import Array
from asperity.dynamics.equation import Equation, primitive, rate
from asperity.dynamics.forcing import Setting
from asperity.dynamics.law.damping import in_flight
from asperity.dynamics.motion.flight import Flight
from asperity.errors import ConvergenceError, RangeError
from asperity.runtime.display import short_repr

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

    __repr__ = short_repr


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
    equation: Equation,
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
        equation: the oscillator.
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
    arc = integrate_arc(
        equation, omega, forcing, augmented_state(equation, u, v), start, start + duration, rtol, samples
    )
    final = np.array([arc.state[0], arc.state[1] - equation.loss(arc.state[0])])
    return Trajectory(arc.tau, arc.u, arc.v, np.array(arc.flight).reshape(-1, 2)), final


def augmented_state(equation: Equation, u: float, v: float) -> Array:
    """Return the augmented state (8,) of (u, v); sensitivities are with respect to (u, w)."""
    return np.array([u, v + equation.loss(u), 1.0, 0.0, 0.0, 1.0, 0.0, 0.0])


def integrate_arc(
    equation: Equation, omega: float, forcing: float, y: Array, start: float, stop: float, rtol: float, samples: int
) -> Arc:
    """Integrate the augmented state from `start` to `stop`, alternating between contact and flight.

    Args:
        equation: the oscillator.
        omega, forcing: Omega and F^.
        y: augmented state, see `augmented_state`; sensitivities and Fourier integrals start again.
        start, stop: times.
        rtol: tolerance of the integrator.
        samples: output points per unit of time.

    Raises:
        ConvergenceError: the integrator fails.
        RangeError: the motion escapes from a Taylor well.
    """
    tau, u, v, flights = [np.array([start])], [y[:1]], [np.array([y[1] - equation.loss(y[0])])], []
    low = high = float(y[0])
    t = start
    y = y.copy()
    y[2:] = (1.0, 0.0, 0.0, 1.0, 0.0, 0.0)
    for _ in range(100000):
        if t >= stop:
            break
        speed = y[1] - equation.loss(y[0])
        flying = equation.restoring.contact and (y[0] < -1.0 - 1e-13 or (y[0] <= -1.0 + 1e-13 and speed < 0))
        if flying:
            end, y, path = _in_flight(equation, omega, forcing, y, t, stop, samples)
            flights.append((t, end))
        else:
            end, y, path = _in_contact(equation, omega, forcing, y, t, stop, rtol, samples)
        for part, whole in zip(path, (tau, u, v), strict=True):
            whole.append(part)
        low, high = min(low, float(path[1].min())), max(high, float(path[1].max()))
        t = end
    return Arc(y, low, high, np.concatenate(tau), np.concatenate(u), np.concatenate(v), flights)


def _in_contact(
    equation: Equation, omega: float, forcing: float, y: Array, start: float, stop: float, rtol: float, samples: int
) -> tuple[float, Array, tuple[Array, Array, Array]]:
    """Integrate in contact until separation or `stop`: end time, state there, and samples with the extremes."""
    r = equation.restoring
    run = _integrated(equation, _field(equation, omega, forcing), y, start, stop, rtol, samples, np.pi / omega / 8.0)
    if run.t_events[0].size:
        t, state = float(run.t_events[0][0]), run.y_events[0][0]
        if not r.contact:
            raise RangeError(f"the motion escapes from the Taylor well near tau = {t:g}: use the exact law")
        state = state.copy()
        state[0] = -1.0
    else:
        t, state = float(run.t[-1]), run.y[:, -1]
    turns, states = run.t_events[1], run.y_events[1]
    inside = (run.t <= t) if samples else np.zeros(run.t.size, bool)
    tau = np.concatenate([run.t[inside], turns[turns <= t], [t]])
    extremes = states[turns <= t] if turns.size else np.empty((0, 8))
    table = np.concatenate([run.y[:, inside].T, extremes, state[None]])
    order = np.argsort(tau, kind="stable")
    u = table[order, 0]
    return t, state, (tau[order], u, table[order, 1] - 2.0 * equation.zeta * primitive(r, equation.damping, u))


def _field(equation: Equation, omega: float, forcing: float) -> Callable[[float, Array], list[float]]:
    """Return the derivative of the augmented state in contact, as a function of time and state."""
    r, zeta, damping = equation.restoring, equation.zeta, equation.damping
    soft, always, weight = not r.singular, damping == "always", 1.0 / r.n_loc

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

    return field


def _integrated(
    equation: Equation,
    field: Callable[[float, Array], list[float]],
    y: Array,
    start: float,
    stop: float,
    rtol: float,
    samples: int,
    longest: float,
) -> Any:
    """Integrate a field from the state `y` until separation or `stop`; SciPy's result with both kinds of events.

    Args:
        equation: the oscillator.
        field: see `_field`.
        y, start, stop, rtol, samples: as in `integrate_arc`.
        longest: step of the integrator, a sixteenth of the forcing period.
    """
    r = equation.restoring

    def separation(t: float, s: Array) -> float:
        if r.contact:
            return float(s[0]) + 1.0
        return float(_ESCAPE - abs(s[0]))

    def turning(t: float, s: Array) -> float:
        return float(s[1]) - equation.loss(s[0])

    separation.terminal, separation.direction = True, -1.0  # type: ignore[attr-defined]
    end = stop
    for _ in range(8):
        run = solve_ivp(
            field,
            (start, end),
            y,
            method="DOP853",
            rtol=rtol,
            atol=1e-2 * rtol,
            t_eval=np.linspace(start, end, max(2, int(samples * (end - start)) + 2)) if samples else None,
            events=(separation, turning),
            max_step=min(0.25, longest),
        )
        if not run.success:
            raise ConvergenceError(f"time integration failed at tau = {run.t[-1]:g}: {run.message}")
        # a step may pass over a grazing contact loss: integrate only to the minimum that reveals it
        turns = zip(run.t_events[1], run.y_events[1], strict=True)
        missed = [t for t, s in turns if r.contact and s[0] < -1.0 - 1e-14 and t > start + 1e-12]
        if not missed or missed[0] >= (run.t_events[0][0] if run.t_events[0].size else np.inf):
            break
        end = float(missed[0])
    return run


def _in_flight(
    equation: Equation, omega: float, forcing: float, y: Array, start: float, stop: float, samples: int
) -> tuple[float, Array, tuple[Array, Array, Array]]:
    """Compute the flight in closed form until landing or `stop`: as `_in_contact`."""
    zeta = equation.zeta if in_flight(equation.damping) else 0.0
    speed = y[1] - equation.loss(y[0])
    flight = Flight(equation.restoring.n_loc, 2.0 * zeta, omega, forcing, start, y[0], speed)
    landing = flight.landing(stop - start)
    inner = np.linspace(0, landing, int(samples * landing) + 2)[1:-1]
    s = np.sort(np.concatenate([inner, flight.turns(landing), [landing]]))
    u, v = flight.position(s), flight.velocity(s)
    out = y.copy()
    out[0] = -1.0 if landing < stop - start else float(u[-1])
    out[1] = float(v[-1]) + equation.loss(out[0])
    decay, growth = 1.0, landing
    if zeta:
        decay, growth = np.exp(-flight.c * landing), float(flight.decay_integrals(np.array(landing))[0])
    out[2], out[3] = decay * y[2] + growth * y[4], decay * y[3] + growth * y[5]
    cosine, sine = flight.fourier_integrals(landing)
    out[6] += cosine
    out[7] += sine
    return start + landing, out, (start + s, u, v)
