"""Motions by SciPy, written from the equation of motion alone.

u'' + 2 zeta g(u) u' + [F_s(z_s (1 + u)) - W]/(z_s F_s'(z_s)) = F^ cos(Omega tau)
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

from asperity.vibration.equation import Equation
from asperity.vibration.law import PowerLaw
from asperity.vibration.oscillator import ContactOscillator
from asperity.vibration.response import FrequencyResponse

Vector = np.ndarray


@dataclass(frozen=True)
class Motion:
    """End (u, v) of a motion, its derivatives by the start and Omega (2, 3), extremes, a1 at the forcing frequency.

    `wave` are the integrals of u cos s and u sin s over the phase s.
    """

    end: Vector
    by: Vector
    u_max: float
    u_min: float
    a1: float
    wave: Vector


def motion(e: Equation, omega: float, forcing: float, y: Vector, rtol: float = 1e-11) -> Motion:
    """Integrate a state over a forcing period, from contact loss to landing, with its variations.

    The independent variable is the phase s = Omega tau. Where the acceleration jumps, by J, a neighbour whose distance
    is d arrives d/v later: its speed then differs by J d/v (saltation).
    """
    r, law = e, e.law
    edges = [-1.0] if r.contact else []

    def acceleration(s: float, u: float, v: float, region: int) -> Vector:
        """Acceleration, and its derivatives with respect to u and v."""
        push, slope = 0.0, 0.0
        if not (r.contact and region == 0):
            at = np.array([r.z_s * (1.0 + u)])
            push, slope = float(law.force(at)[0]), float(law.slope(at)[0])
        flying = r.contact and region == 0
        g, dg = (0.0 if flying and e.damping != "always" else 1.0), 0.0
        if e.damping == "hunt-crossley":
            g, dg = push / r.load, slope * r.z_s / r.load
        f, df = (push - r.load) / r.scale, slope * r.z_s / r.scale
        return np.array([forcing * np.cos(s) - f - 2 * e.zeta * g * v, -df - 2 * e.zeta * dg * v, -2 * e.zeta * g])

    def field(s: float, x: Vector, region: int) -> Vector:
        u, v = float(x[0]), float(x[1])
        a, a_u, a_v = acceleration(s, u, v, region)
        du, dv = x[2:5], x[5:8]
        change = np.array([v, a, *dv, *(a_u * du + a_v * dv)]) / omega
        change[[4, 7]] -= np.array([v, a]) / omega**2
        return np.append(change, [u * np.cos(s), u * np.sin(s)])

    def turn(s: float, x: Vector, region: int) -> float:
        return float(x[1])

    s, end = 0.0, 2.0 * np.pi
    x = np.array([*y, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0])
    region = sum(y[0] > edge or (y[0] == edge and y[1] > 0) for edge in edges)
    highest, lowest = float(y[0]), float(y[0])
    while s < end:
        events: list[Any] = [turn]
        for edge, direction in ((region - 1, -1.0), (region, 1.0)):
            if 0 <= edge < len(edges):
                events.append(_crossing(edges[edge], direction))
        run = solve_ivp(
            field, (s, end), x, method="DOP853", rtol=rtol, atol=1e-3 * rtol, events=events, args=(region,),
            max_step=0.2 * min(1.0, omega)
        )  # fmt: skip
        assert run.success
        turns = [float(state[0]) for state in run.y_events[0]]
        highest, lowest = max(highest, run.y[0].max(), *turns), min(lowest, run.y[0].min(), *turns)
        s, x = float(run.t[-1]), run.y[:, -1]
        if run.status == 1:
            after = region + (1 if x[1] > 0 else -1)
            jump = acceleration(s, x[0], x[1], after)[0] - acceleration(s, x[0], x[1], region)[0]
            x[5:8] += jump * x[2:5] / x[1]
            region = after
    return Motion(x[:2], x[2:8].reshape(2, 3), highest, lowest, float(np.hypot(*x[8:])) / np.pi, x[8:])


def _crossing(edge: float, direction: float) -> Any:
    def crossing(s: float, x: Vector, region: int) -> float:
        return float(x[0]) - edge

    crossing.terminal, crossing.direction = True, direction  # type: ignore[attr-defined]
    return crossing


@lru_cache
def computed(
    n: float = 1.5, zeta: float = 0.01, forcing: float = 0.05, window: tuple[float, float] = (0.5, 1.3)
) -> FrequencyResponse:
    """Response of a power law, computed once for all tests."""
    return ContactOscillator(PowerLaw(n), zeta=zeta).response(forcing, window)
