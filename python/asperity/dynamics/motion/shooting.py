# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

"""Shooting: periodic orbits by Newton's method on the event-accurate flow."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from asperity.arrays import Array
from asperity.dynamics.equation import Equation
from asperity.dynamics.motion.trajectory import augmented_state, integrate_arc
from asperity.errors import ConvergenceError


@dataclass(frozen=True)
class Shot:
    """Periodic orbit found by shooting.

    Attributes:
        omega: Omega of the orbit.
        u, v: state at forcing phase 0.
        u_max, u_min, a1: extreme displacements, amplitude at the forcing frequency.
        multipliers: Floquet multipliers.
        residual: largest defect of periodicity.
    """

    omega: float
    u: float
    v: float
    u_max: float
    u_min: float
    a1: float
    multipliers: tuple[complex, complex]
    residual: float


def shoot(
    equation: Equation,
    omega: float,
    forcing: float,
    u: float,
    v: float,
    *,
    order: int = 1,
    tol: float = 1e-10,
    rtol: float = 1e-12,
    hold: bool = True,
) -> Shot:
    """Correct a periodic orbit by Newton's method on the event-accurate flow.

    Args:
        equation: the oscillator.
        omega, forcing: Omega and F^.
        u, v: guess of the state at forcing phase 0.
        order: forcing periods per period of the orbit.
        tol: allowed defect of periodicity, relative to the orbit.
        rtol: tolerance of the integrator.
        hold: keep Omega fixed; otherwise find the nearest orbit in (u, u', Omega), which also works at a fold.

    Raises:
        ConvergenceError: no convergence in 12 iterations.
    """
    y = augmented_state(equation, u, v)
    singular = equation.restoring.singular
    for _ in range(12):
        period = 2.0 * np.pi * order / omega
        arc = integrate_arc(equation, omega, forcing, y, 0.0, period, rtol, 0)
        defect = arc.state[:2] - y[:2]
        flow: Array = arc.state[2:6].reshape(2, 2)
        if singular:
            flow = _differences(equation, omega, forcing, y, period, rtol)
        size = max(arc.high - arc.low, 1e-12)
        residual = float(np.abs(defect).max())
        matrix: Array = flow - np.eye(2)
        if not hold:
            h = 1e-5 * omega
            ends = [
                integrate_arc(equation, w, forcing, y, 0.0, 2.0 * np.pi * order / w, rtol, 0).state[:2]
                for w in (omega + h, omega - h)
            ]
            matrix = np.column_stack([matrix, (ends[0] - ends[1]) / (2.0 * h)])
        step = np.linalg.lstsq(matrix, defect, rcond=None)[0]
        if residual < 0.1 * tol * size or max(residual, float(np.abs(step).max())) < tol * size:
            found = np.linalg.eigvals(flow)
            return Shot(
                omega,
                float(y[0]),
                float(y[1] - equation.loss(y[0])),
                arc.high,
                arc.low,
                float(2.0 / period * np.hypot(arc.state[6], arc.state[7])),
                (complex(found[0]), complex(found[1])),
                residual,
            )
        y = y.copy()
        y[:2] -= step[:2]
        if not hold:
            omega -= float(step[2])
    raise ConvergenceError(f"shooting did not converge at Omega = {omega:g} (defect {residual:.1e})")


def _differences(equation: Equation, omega: float, forcing: float, y: Array, period: float, rtol: float) -> Array:
    """Return the derivative (2, 2) of the flow over a period with respect to (u, w), by central differences."""
    flow = np.empty((2, 2))
    h = 1e-5
    for j in range(2):
        ends = []
        for sign in (1.0, -1.0):
            shifted = y.copy()
            shifted[j] += sign * h
            ends.append(integrate_arc(equation, omega, forcing, shifted, 0.0, period, rtol, 0).state[:2])
        flow[:, j] = (ends[0] - ends[1]) / (2.0 * h)
    return flow
