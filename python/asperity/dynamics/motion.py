"""Motion in time: one motion with located separations and landings, and many with fixed steps.

Both integrate Lienard's variable (see `asperity.dynamics.equation`): a single motion by SciPy's DOP853 from one
separation or landing to the next, many by the Runge-Kutta method of order 4, each a lane of the arrays.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import cos
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

from asperity.arrays import Array
from asperity.dynamics.cubic import hermite, value
from asperity.dynamics.equation import Equation, primitive
from asperity.dynamics.settings import Setting
from asperity.errors import ConvergenceError, RangeError
from asperity.force_law.taylor import TaylorLaw
from asperity.runtime.display import short_repr

STEP = 0.14  # longest step over the shortest local time scale: sweeps are within 2e-5 of the balance
ESCAPE = 1e3  # displacement beyond which motion has left a Taylor well
_ESCAPE_LANES = 1e4  # the same of motions in parallel, which may also fly that far
_FEW = 16  # largest number of lanes for which plain floats are faster
_SHORTEST = 1e-8  # contact or flight, which makes grazing end


@dataclass(frozen=True)
class Trajectory:
    """Motion in time, in units of 1/omega_s.

    Attributes:
        tau: times, including every separation, landing and turning point, shape (times,)
        u, v: displacement and speed at these times, shape (times,)
        flight: time intervals without contact, shape (flights, 2)
        setting: law, damping and forcing, if the motion is that of an oscillator
        tolerance: relative tolerance of the integrator
        valid: False if a Taylor law passes u = -1
    """

    tau: Array
    u: Array
    v: Array
    flight: Array
    setting: Setting | None = None
    tolerance: float = np.nan
    valid: bool = True

    __repr__ = short_repr


def integrate(
    equation: Equation,
    omega: float,
    forcing: float,
    u: float,
    v: float,
    duration: float,
    *,
    rtol: float = 1e-10,
    samples: float = 0.0,
) -> Trajectory:
    """Integrate from (u, v) at forcing phase 0 over a duration (1/omega_s), with `samples` points per unit of time.

    Raises:
        ConvergenceError: the integrator fails
        RangeError: the motion escapes from a Taylor well
    """
    t, state, contact = 0.0, (u, v + equation.loss(u)), equation.restoring.contact
    times, states = [0.0], [state]
    flights: list[tuple[float, float]] = []
    while t < duration:
        speed = state[1] - equation.loss(state[0])
        flying = contact and (state[0] < -1.0 - 1e-13 or (state[0] <= -1.0 + 1e-13 and speed < 0.0))
        end, found = _phase(equation, omega, forcing, state, t, duration, flying, rtol, samples)
        if flying:
            flights.append((t, end))
        times += [time for time, _ in found]
        states += [s for _, s in found]
        t, state = end, states[-1]
    y = np.array(states)
    lost = 2.0 * equation.zeta * primitive(equation.restoring, equation.damping, y[:, 0])
    return Trajectory(np.array(times), y[:, 0], y[:, 1] - lost, np.array(flights).reshape(-1, 2))


def _phase(
    equation: Equation, omega: float, forcing: float, state: tuple[float, float], start: float, stop: float,
    flying: bool, rtol: float, samples: float
) -> tuple[float, list[tuple[float, tuple[float, float]]]]:  # fmt: skip
    """Integrate until contact changes, or to `stop`: the end, and times with states (samples, turning points, end)."""
    r, side, rest = equation.restoring, -1.0 if flying else 1.0, 1.0 / equation.restoring.n_loc

    def field(t: float, s: Array) -> list[float]:
        numbers: Any = s.tolist()
        x, w = numbers
        pull = 0.0 if flying else r.law.at(r.z_s * (1.0 + x))[0] / r.scale
        return [w - equation.loss(x), forcing * cos(omega * t) - pull + rest]

    def change(t: float, s: Array) -> float:
        if not r.contact:
            return ESCAPE - abs(float(s[0]))
        return side * (float(s[0]) + 1.0) if t > start + _SHORTEST else 1.0

    def turn(t: float, s: Array) -> float:
        return float(s[1]) - equation.loss(s[0])

    change.terminal, change.direction = True, -1.0  # type: ignore[attr-defined]
    end = stop
    while True:
        grid = np.linspace(start, end, max(2, int(samples * (end - start)) + 2)) if samples else np.array([start, end])
        run = solve_ivp(
            field, (start, end), state, method="DOP853", rtol=0.1 * rtol, atol=1e-3 * rtol, t_eval=grid,
            events=(change, turn), max_step=min(0.25, np.pi / omega / 8.0)
        )  # fmt: skip
        if not run.success:
            raise ConvergenceError(f"time integration failed at tau = {run.t[-1]:g}: {run.message}")
        changes = run.t_events[0]
        turns = list(zip(run.t_events[1], run.y_events[1], strict=True))
        # a step may pass over a short loss of contact, or a short contact: integrate only to the turn that reveals it
        missed = [t for t, s in turns if r.contact and side * (s[0] + 1.0) < -1e-14 and t > start + _SHORTEST]
        if not missed or (changes.size and changes[0] <= missed[0]):
            break
        end = float(missed[0])
    found = [(float(t), (float(s[0]), float(s[1]))) for t, s in [*zip(run.t[1:], run.y.T[1:], strict=True), *turns]]
    if changes.size:
        end = float(changes[0])
        if not r.contact:
            raise RangeError(f"the motion escapes from the Taylor well near tau = {end:g}: use the exact law")
        found = [one for one in found if one[0] < end]
        found.append((end, (-1.0, float(run.y_events[0][0][1]))))
    return end, sorted(found)


def steps_for(equation: Equation, omega: Array, u: Array) -> int:
    """Number of steps per period that resolve the stiffest contact at displacements `u`."""
    stiff = equation.restoring.df(np.maximum(u, 0.0))
    rate = np.sqrt(np.maximum(1.0, np.where(np.isfinite(stiff), stiff, 1.0)))
    return int(np.clip(2 * np.ceil(np.max(np.pi / omega * rate / STEP)), 64, 4096))


def has_escaped(equation: Equation, u: Array, low: Array) -> Array:
    """Which lanes have left the Taylor well and cannot return."""
    bad = ~np.isfinite(u) | (np.abs(u) > _ESCAPE_LANES)
    law = equation.restoring.law
    if isinstance(law, TaylorLaw):
        bad |= ~(low > law.rims()[0] - 2.0)
    return bad


def path_of(
    equation: Equation, u: Array, w: Array, omega: Array, forcing: Array, steps: int
) -> tuple[Array, Array, Array]:
    """Displacements and speeds (steps + 1, lanes) over one forcing period, and w at its end.

    State, Omega and F^ of each lane have the shape (lanes,).
    """
    r, damping, twice = equation.restoring, equation.damping, 2.0 * equation.zeta
    h, wave = 2.0 * np.pi / omega / steps, np.cos(np.pi / steps * np.arange(2 * steps + 1))

    def loss(u: Any) -> Any:
        return twice * (u if damping == "always" else primitive(r, damping, u))

    if u.size > _FEW or damping != "always":
        with np.errstate(over="ignore", invalid="ignore"):
            drive = list(wave[:, None] * forcing + 1.0 / r.n_loc)
            us, vs = _runge_kutta(u, w, h, drive, lambda x: r.law.push(r.z_s * (1.0 + x)) / r.scale, loss)
            return np.array(us[:-1]), np.array(vs), us[-1]
    at, scale, z_s = r.law.at, 1.0 / r.scale, r.z_s
    out, ends = np.full((2, steps + 1, u.size), np.nan), np.full(u.size, np.nan)
    for lane in range(u.size):
        drive = (wave * forcing[lane] + 1.0 / r.n_loc).tolist()
        try:
            us, vs = _runge_kutta(
                float(u[lane]), float(w[lane]), float(h[lane]), drive, lambda x: scale * at(z_s * (1.0 + x))[0], loss
            )
        except OverflowError:  # it has escaped
            continue
        out[0, :, lane], out[1, :, lane], ends[lane] = us[:-1], vs, us[-1]
    return out[0], out[1], ends


def _runge_kutta(
    u: Any, w: Any, h: Any, drive: list[Any], pull: Callable[[Any], Any], loss: Callable[[Any], Any]
) -> tuple[list[Any], list[Any]]:
    """Displacements of all steps and then w, and speeds, of one lane in floats or of all in arrays.

    `drive` is the force at the ends and in the middle of each step, `pull` the contact force, `loss` 2 zeta G(u).
    """
    half, sixth = 0.5 * h, h / 6.0
    us, vs = [], []
    for j in range(0, len(drive) - 1, 2):
        first, middle, last = drive[j], drive[j + 1], drive[j + 2]
        k1 = w - loss(u)
        us.append(u)
        vs.append(k1)
        l1 = first - pull(u)
        a = u + half * k1
        k2, l2 = w + half * l1 - loss(a), middle - pull(a)
        b = u + half * k2
        k3, l3 = w + half * l2 - loss(b), middle - pull(b)
        c = u + h * k3
        k4, l4 = w + h * l3 - loss(c), last - pull(c)
        u = u + sixth * (k1 + 2.0 * (k2 + k3) + k4)
        w = w + sixth * (l1 + 2.0 * (l2 + l3) + l4)
    us.append(u)
    vs.append(w - loss(u))
    return [*us, w], vs


def turning_values(u: Array, v: Array) -> tuple[Array, Array]:
    """Extremes of the cubic Hermite path through samples u with slopes v (times the step)."""
    low, high = u.min(axis=0), u.max(axis=0)
    i, lane = np.nonzero((v[:-1] > 0) != (v[1:] > 0))
    if i.size == 0:
        return low, high
    a, b, p, q = u[i, lane], u[i + 1, lane], v[i, lane], v[i + 1, lane]
    s = p / np.where(p == q, 1e-300, p - q)  # of a nearly linear speed: the error enters the extremes squared
    turn = value(hermite(a, b - a, p, q), s)
    np.fmin.at(low, lane, turn)
    np.fmax.at(high, lane, turn)
    return low, high
