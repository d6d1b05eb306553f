"""Motion in time by SciPy's DOP853, with every separation and landing located."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from math import cos, pi, sin

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from asperity.arrays import Array
from asperity.errors import ConvergenceError, RangeError
from asperity.runtime.display import short_repr
from asperity.vibration.equation import Equation

ESCAPE = 1e3  # displacement beyond which motion has left a Taylor well

Force = Callable[[float], float]


@dataclass(frozen=True)
class Trajectory:
    """Motion in time, in units of 1/omega_s.

    Attributes:
        tau: times, including every separation, landing and turning point, shape (times,)
        u, v: displacement and speed at these times, shape (times,)
        force: F^ at these times, shape (times,)
        flight: time intervals without contact, shape (flights, 2)
        valid: False if a Taylor law passes u = -1
    """

    tau: Array
    u: Array
    v: Array
    force: Array
    flight: Array
    valid: bool = True

    __repr__ = short_repr


def course(shape: str, forcing: float, omega: Sequence[float], duration: float) -> tuple[Force, list[float]]:
    """F^ over the time, and the times at which it is not smooth; see `ContactOscillator.simulate`."""
    low, rate = omega[0], (omega[-1] - omega[0]) / duration  # of the frequency
    if shape == "step":
        return lambda t: forcing, []
    if shape == "half-sine":
        end = pi / low
        return lambda t: forcing * sin(low * t) if t < end else 0.0, [end]
    return lambda t: forcing * cos((low + 0.5 * rate * t) * t), []


def integrate(
    equation: Equation, force: Force, start: tuple[float, float], duration: float, *, rtol: float, samples: float,
    max_step: float, corners: Sequence[float] = (),
) -> Trajectory:  # fmt: skip
    """Integrate from a state (u, v) over a duration (1/omega_s), with `samples` points per unit of time.

    Args:
        force: F^ over the time
        max_step: longest step, which the force needs (1/omega_s)
        corners: times at which the force is not smooth

    Raises:
        ConvergenceError: the integrator fails
        RangeError: the motion escapes from a Taylor well
    """
    contact = equation.contact

    def field(t: float, y: Array) -> list[float]:
        f = equation.f(y[:1])
        return [y[1], force(t) - f[0] - 2.0 * equation.zeta * equation.rate(y[:1], f)[0] * y[1]]

    def turn(t: float, y: Array) -> float:
        return float(y[1])

    def escape(t: float, y: Array) -> float:
        return 1.0 if contact else ESCAPE - abs(float(y[0]))

    escape.terminal = True  # type: ignore[attr-defined]
    times: list[Array] = [np.zeros(1)]
    states: list[Array] = [np.array(start)[:, None]]
    changes = [0.0] * (contact and start[0] < -1.0)
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
        flying = run.sol(t)[0] < -1.0  # every flight has a turning point
        sides = np.flatnonzero((flying[1:] != flying[:-1]) & contact)
        lost = [brentq(lambda s: run.sol(s)[0] + 1.0, t[i], t[i + 1], xtol=1e-15, rtol=1e-14) for i in sides]  # noqa: B023
        t = np.union1d(t, lost)[1:]
        changes += lost
        times.append(t)
        states.append(run.sol(t))
    tau, (u, v) = np.concatenate(times), np.concatenate(states, axis=1)
    flight = np.array(changes + [duration] * (len(changes) % 2)).reshape(-1, 2)
    return Trajectory(tau, u, v, np.array([force(t) for t in tau]), flight, contact or bool(u.min() >= -1.0))
