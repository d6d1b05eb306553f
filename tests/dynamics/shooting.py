"""Periodic orbits by Newton's method on the motion with located separations and landings; shared responses."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy.interpolate import CubicHermiteSpline

from asperity.dynamics import ContactOscillator, FrequencyResponse, PowerLaw
from asperity.dynamics.equation import Equation
from asperity.dynamics.motion import integrate
from asperity.errors import ConvergenceError


@dataclass(frozen=True)
class Shot:
    """Extremes, amplitude at the forcing frequency and Floquet multipliers of an orbit."""

    u_max: float
    u_min: float
    a1: float
    multipliers: tuple[complex, complex]


def shoot(equation: Equation, omega: float, forcing: float, u: float, v: float, rtol: float = 1e-12) -> Shot:
    """Correct the orbit of period 1 near the state (u, v) at forcing phase 0."""
    period = 2.0 * np.pi / omega
    y = np.array([u, v])

    def end(y: np.ndarray) -> np.ndarray:
        path = integrate(equation, omega, forcing, float(y[0]), float(y[1]), period, rtol=rtol)
        return np.array([path.u[-1], path.v[-1]])

    def flow(y: np.ndarray, h: float = 1e-4) -> np.ndarray:
        """Derivative of the state after a period, by differences of fourth order."""
        ends = ([end(y + k * h * e) for k in (-2, -1, 1, 2)] for e in np.eye(2))
        return np.column_stack([(a - 8.0 * b + 8.0 * c - d) / (12.0 * h) for a, b, c, d in ends])

    slope = flow(y)
    for _ in range(12):
        step = np.linalg.solve(slope - np.eye(2), end(y) - y)
        y = y - step
        if np.abs(step).max() < 1e-10 * (1.0 + np.abs(y).max()):
            break
    else:
        raise ConvergenceError("no periodic orbit")
    path = integrate(equation, omega, forcing, float(y[0]), float(y[1]), period, rtol=rtol, samples=4096 / period)
    tau, kept = np.unique(path.tau, return_index=True)
    even = CubicHermiteSpline(tau, path.u[kept], path.v[kept])(np.arange(4096) * period / 4096)
    a1 = 2.0 * abs(np.fft.rfft(even)[1]) / 4096
    first, second = np.linalg.eigvals(flow(y))  # of the orbit, not of the start
    return Shot(float(path.u.max()), float(path.u.min()), float(a1), (complex(first), complex(second)))


@lru_cache
def computed(
    n: float = 1.5, zeta: float = 0.01, forcing: float = 0.05, window: tuple[float, float] = (0.5, 1.3)
) -> FrequencyResponse:
    """Response of a power law, computed once for all tests."""
    return ContactOscillator(PowerLaw(n), zeta=zeta).response(forcing, window)
