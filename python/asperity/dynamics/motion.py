"""A single motion in time with located separations and landings, by SciPy's DOP853 from one of them to the next.

The force is harmonic, a step, half a period of a sine, or a chirp.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from math import cos, pi, sin

import numpy as np
from scipy.integrate import solve_ivp

from asperity.arrays import Array
from asperity.dynamics.equation import Equation
from asperity.dynamics.period_map import ESCAPE
from asperity.dynamics.settings import Setting
from asperity.errors import ConvergenceError, RangeError
from asperity.runtime.display import short_repr

_SHORTEST = 1e-8  # contact or flight, which makes grazing end

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
    contact = equation.restoring.contact
    times, states = [0.0], [(u, v)]
    flights: list[tuple[float, float]] = []
    for begin, stop in pairwise([0.0, *(t for t in sorted(corners) if 0.0 < t < duration), duration]):
        t = begin
        while t < stop:
            x, speed = states[-1]
            flying = contact and (x < -1.0 - 1e-13 or (x <= -1.0 + 1e-13 and speed < 0.0))
            end, found = _phase(equation, force, states[-1], t, stop, flying, rtol, samples, max_step)
            if flying:
                flights.append((t, end))
            times += [time for time, _ in found]
            states += [s for _, s in found]
            t = end
    y, forces = np.array(states), np.array([force(t) for t in times])
    return Trajectory(np.array(times), y[:, 0], y[:, 1], forces, np.array(flights).reshape(-1, 2))


def _phase(
    equation: Equation, force: Force, state: tuple[float, float], start: float, stop: float, flying: bool, rtol: float,
    samples: float, max_step: float
) -> tuple[float, list[tuple[float, tuple[float, float]]]]:  # fmt: skip
    """Integrate until contact changes, or to `stop`: the end, and times with states (samples, turning points, end)."""
    r, side, acceleration = equation.restoring, -1.0 if flying else 1.0, equation.acceleration

    def field(t: float, s: Array) -> list[float]:
        x, v = float(s[0]), float(s[1])
        return [v, force(t) + acceleration(x, v)]

    def change(t: float, s: Array) -> float:
        if not r.contact:
            return ESCAPE - abs(float(s[0]))
        return side * (float(s[0]) + 1.0) if t > start + _SHORTEST else 1.0

    def turn(t: float, s: Array) -> float:
        return float(s[1])

    change.terminal, change.direction = True, -1.0  # type: ignore[attr-defined]
    end = stop
    while True:
        grid = np.linspace(start, end, max(2, int(samples * (end - start)) + 2)) if samples else np.array([start, end])
        run = solve_ivp(
            field, (start, end), state, method="DOP853", rtol=0.1 * rtol, atol=1e-3 * rtol, t_eval=grid,
            events=(change, turn), max_step=max_step
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
    found = [
        (float(t), (float(s[0]), float(s[1]))) for t, s in [*zip(run.t, run.y.T, strict=True), *turns] if t > start
    ]
    if changes.size:
        end = float(changes[0])
        if not r.contact:
            raise RangeError(f"the motion escapes from the Taylor well near tau = {end:g}: use the exact law")
        found = [one for one in found if one[0] < end]
        found.append((end, (-1.0, float(run.y_events[0][0][1]))))
    return end, sorted(found)
