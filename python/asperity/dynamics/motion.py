"""Motion in time: a single one by SciPy's DOP853, and frequency sweeps, each a lane of the period map."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from math import cos, pi, sin
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from asperity.arrays import Array
from asperity.dynamics.equation import ESCAPE, TURN, Equation, motions
from asperity.vibration.settings import Setting
from asperity.errors import ConvergenceError, RangeError
from asperity.runtime.display import short_repr

SETTLED, NOT_SETTLED, ESCAPED = "settled", "not settled", "escaped"
_RTOL = 1e-8  # of the integrator of sweeps
_LONGEST = 4  # longest period distinguished from chaos, in forcing periods

Force = Callable[[float], float]


@dataclass(frozen=True)
class Trajectory:
    """Motion in time, in units of 1/omega_s.

    Attributes:
        tau: times, including every separation, landing and turning point, shape (times,)
        u, v: displacement and speed at these times, shape (times,)
        force: F^ at these times, shape (times,)
        flight: time intervals without contact, shape (flights, 2)
        setting: law, damping and forcing, if the motion is that of an oscillator
        tolerance: relative tolerance of the integrator
        valid: False if a Taylor law passes u = -1
    """

    tau: Array
    u: Array
    v: Array
    force: Array
    flight: Array
    setting: Setting | None = None
    tolerance: float = np.nan
    valid: bool = True

    __repr__ = short_repr


def course(shape: str, forcing: float, omega: tuple[float, float], duration: float) -> tuple[Force, list[float]]:
    """F^ over the time, and the times at which it is not smooth; see `ContactOscillator.simulate`."""
    low, high = omega
    if shape == "step":
        return lambda t: forcing, []
    if shape == "half-sine":
        end = pi / low
        return lambda t: forcing * sin(low * t) if t < end else 0.0, [end]
    rate = (high - low) / duration  # of the frequency
    return lambda t: forcing * cos((low + 0.5 * rate * t) * t), []


def integrate(
    equation: Equation,
    force: Force,
    u: float,
    v: float,
    duration: float,
    *,
    rtol: float = 1e-10,
    samples: float = 0.0,
    max_step: float = 0.25,
    corners: Sequence[float] = (),
) -> Trajectory:
    """Integrate from (u, v) over a duration (1/omega_s), with `samples` points per unit of time.

    Args:
        force: F^ over the time
        max_step: longest step, which the force needs (1/omega_s)
        corners: times at which the force is not smooth

    Raises:
        ConvergenceError: the integrator fails
        RangeError: the motion escapes from a Taylor well
    """
    contact, acceleration = equation.restoring.contact, equation.acceleration()

    def field(t: float, y: Array) -> list[float]:
        x, speed = float(y[0]), float(y[1])
        return [speed, force(t) + acceleration(x, speed)]

    def turn(t: float, y: Array) -> float:
        return float(y[1])

    def escape(t: float, y: Array) -> float:
        return 1.0 if contact else ESCAPE - abs(float(y[0]))

    escape.terminal = True  # type: ignore[attr-defined]
    times: list[Array] = [np.zeros(1)]
    states: list[Array] = [np.array([[u], [v]])]
    changes: list[float] = []
    for begin, stop in pairwise([0.0, *(t for t in sorted(corners) if 0.0 < t < duration), duration]):
        run = solve_ivp(
            field, (begin, stop), states[-1][:, -1], method="DOP853", rtol=0.02 * rtol, atol=1e-3 * rtol,
            dense_output=True, events=(turn, escape), max_step=max_step,
        )  # fmt: skip
        if not run.success:
            raise ConvergenceError(f"time integration failed at tau = {run.t[-1]:g}: {run.message}")
        if run.status == 1:
            raise RangeError(f"the motion escapes from the Taylor well near tau = {run.t[-1]:g}: use the exact law")
        t = np.union1d(np.linspace(begin, stop, int(samples * (stop - begin)) + 2), run.t_events[0])
        flying = (run.sol(t)[0] < -1.0) & contact  # every flight has a turning point
        lost = [_separation(run.sol, t[i], t[i + 1]) for i in np.flatnonzero(flying[1:] != flying[:-1])]
        t = np.union1d(t, lost)[1:]
        changes += lost
        times.append(t)
        states.append(run.sol(t))
    tau, y = np.concatenate(times), np.concatenate(states, axis=1)
    ends = [0.0] * (contact and u < -1.0) + changes
    flight = np.array(ends + [duration] * (len(ends) % 2)).reshape(-1, 2)
    return Trajectory(tau, y[0], y[1], np.array([force(t) for t in tau]), flight)


def _separation(motion: Callable[[float], Array], before: float, after: float) -> float:
    """Time of u = -1 between two times on its two sides."""
    return float(brentq(lambda t: float(motion(t)[0]) + 1.0, before, after, xtol=1e-15, rtol=1e-14))


@dataclass(frozen=True)
class Sweep:
    """Steady states of a sweep with carried state (arrays of shape (frequencies,), in the order of the sweep).

    Attributes:
        setting: law, damping and forcing
        direction: "up" or "down"
        Omega: frequencies
        u_max, u_min, a1: extreme displacements and amplitude at the forcing frequency; NaN after an escape
        status: "settled", "period k", "not settled" or "escaped" for each point
        periods: forcing periods integrated at each point
        tolerance: largest estimated distance from the steady state among the settled points, relative to the orbit
        valid: False where a Taylor law passes u = -1 or the motion has escaped
    """

    setting: Setting
    direction: str
    Omega: Array
    u_max: Array
    u_min: Array
    a1: Array
    status: tuple[str, ...]
    periods: Array
    tolerance: float
    valid: Array

    __repr__ = short_repr

    def to_dict(self) -> dict[str, Any]:
        """Section of thresholds.json."""
        counts = {name: self.status.count(name) for name in dict.fromkeys(self.status)}
        valid = bool(self.valid.all())
        return {"F_hat": self.setting.F_hat, "direction": self.direction, "valid": valid, "status": counts}

    def rows(self) -> Iterator[dict[str, Any]]:
        """Rows of response.csv, without escaped points, which have no amplitude."""
        for status, omega, u, low, a1 in zip(self.status, self.Omega, self.u_max, self.u_min, self.a1, strict=True):
            if status != ESCAPED:
                yield self.setting.row(f"sweep-{self.direction}", omega, u, low, a1, status != NOT_SETTLED)


def sweep(
    equation: Equation,
    settings: list[Setting],
    omega: Array,
    *,
    directions: tuple[str, ...],
    tol: float,
    max_periods: int | None,
) -> tuple[Sweep, ...]:
    """Sweep all forcings and directions in parallel; see `ContactOscillator.sweep`. The frequencies `omega` rise."""
    lanes = [(s, d) for s in settings for d in directions]
    path = np.array([omega if d == "up" else omega[::-1] for _, d in lanes])
    state: Array = np.zeros((len(lanes), 2))
    limit = max_periods or int(np.clip(4.0 / equation.zeta, 100, 20000))
    columns = []
    for j in range(omega.size):
        forcing = np.array([s.forcing(w) for (s, _), w in zip(lanes, path[:, j], strict=True)])
        state, found = _settle(equation, state, path[:, j], forcing, tol, limit)
        columns.append(found)
    u_max, u_min, a1, residual, kind, periods = np.moveaxis(np.array(columns), 0, -1)
    settled = kind > 0
    valid = np.ones_like(settled) if equation.restoring.contact else u_min >= -1.0
    names = {-1: ESCAPED, 0: NOT_SETTLED, 1: SETTLED}
    return tuple(
        Sweep(
            setting, direction, path[i], u_max[i], u_min[i], a1[i],
            tuple(names.get(int(k), f"period {k:.0f}") for k in kind[i]),
            periods[i].astype(int),
            float(residual[i][settled[i]].max(initial=0.0)) if settled[i].any() else np.inf,
            valid[i]
        )
        for i, (setting, direction) in enumerate(lanes)
    )  # fmt: skip


def _settle(
    equation: Equation, state: Array, omega: Array, forcing: Array, tol: float, limit: int
) -> tuple[Array, Array]:
    """Steady state (lanes, 2) of every lane from a state; u_max, u_min, a1, residual, kind, periods (6, lanes).

    Each lane goes on by as many periods as bring it closer by a factor of e, and is then judged by a few more: the
    change over a period of the orbit, divided by ``1 - exp(-2 pi zeta / Omega)``, estimates the remaining distance,
    `residual`. `kind` is the period, 0 not settled, -1 escaped.
    """
    shrink = 1.0 - np.exp(-2.0 * pi * equation.zeta / omega)
    closer = np.ceil(omega / (2.0 * pi * equation.zeta))
    # perturb by more than the tolerance: a start exactly on an unstable orbit must not look settled
    y = state + np.outer(np.hypot(*state.T), [10.0 * tol, 0.0])
    found = np.zeros((6, omega.size))
    left = np.arange(omega.size)
    while left.size:
        w, force = omega[left], forcing[left]
        periods = np.minimum(closer[left], limit - found[5, left] - _LONGEST)
        path = [motions(equation, y[left], w, force, length=TURN * periods, rtol=_RTOL, derivatives=False).end]
        values = []
        for _ in range(_LONGEST):
            m = motions(equation, path[-1], w, force, rtol=_RTOL, derivatives=False)
            path.append(m.end)
            values.append((m.high[:, 0], m.low[:, 0], np.hypot(*m.wave[:, :, 0].T) / pi))
        y[left], last = path[-1], np.array(values)
        size = 0.5 * (last[:, 0].max(axis=0) - last[:, 1].min(axis=0)) + 1e-12
        kind, residual = _periods(np.array(path), shrink[left], size, tol)
        last[:, :, kind == 1] = last[-1][:, kind == 1]  # of a longer period, of the last ones
        spent = found[5, left] + periods + _LONGEST
        found[:, left] = last[:, 0].max(axis=0), last[:, 1].min(axis=0), last[-1, 2], residual, kind, spent
        left = left[(kind == 0) & (spent + _LONGEST < limit)]
    return y, found


def _periods(y: Array, shrink: Array, size: Array, tol: float) -> tuple[Array, Array]:
    """Period of each lane, 0 if it does not repeat and -1 after an escape, and its estimated distance from the orbit.

    `y` are the states at the ends of the last periods (periods + 1, lanes, 2), `size` the amplitudes.
    """
    kind, distance = np.zeros(size.size), np.full(size.size, np.inf)
    once = np.zeros(size.size)
    for k in range(1, len(y)):
        gap = np.abs(y[k:] - y[:-k]).max(axis=(0, 2)) / shrink / size
        once = gap if k == 1 else once
        # a decaying spiral also comes close after a few periods, but not by so much
        done = (kind == 0) & (gap < tol * k) & ((k == 1) | (gap < 0.05 * shrink * once))
        kind[done], distance[done] = k, gap[done] / k
    return np.where(np.isfinite(y[-1, :, 0]), kind, -1.0), distance
