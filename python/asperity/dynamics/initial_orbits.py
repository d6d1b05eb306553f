# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

"""Initial orbits of branches: from rest, and of period 2 near the backbone; the frequencies that matter to a window."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import brentq

from asperity.arrays import Array
from asperity.dynamics.continuation import MIN_HARMONICS, Tracing, correct, in_forcing, in_omega, start, trace
from asperity.dynamics.equation import Equation
from asperity.dynamics.free import orbit_coefficients, rough_orbit
from asperity.dynamics.harmonic_balance import Balance
from asperity.dynamics.law.damping import only_in_contact
from asperity.errors import ConvergenceError

_POINTS = 16  # amplitudes on the backbone; a chart of 12 finds the same loops of period 2
_AMPLITUDES = (1e-3, 300.0)  # of free orbits: below they are linear, above the mass flies all the time
_SMALLEST = 0.05  # of them in the chart
_MOST_LOST = 2.0  # of `Chart.lost` with orbits of period 2: up to 1.1 in 250 random windows
_LINEAR, _FAINT = 0.3, 0.02  # amplitudes up to which, and at which, an orbit from rest starts as the linear response
_SINGULAR = 1e-9  # impedance below which there is no linear response to start from


def orbit_from_rest(balance: Balance, omega: float, forcing: float, tol: float) -> Array:
    """Coefficients (2 K + 1) of the orbit reached at fixed Omega by raising the forcing from zero.

    Raises:
        ConvergenceError: no orbit is found
    """
    impedance = complex(1.0 - omega * omega, 2.0 * balance.zeta * omega)
    if abs(impedance) < _SINGULAR:
        raise ConvergenceError(f"no orbit found from rest at Omega = {omega:g}, the resonance without damping")
    transfer, equations = 1.0 / impedance, in_forcing(balance, omega)
    first = forcing if forcing * abs(transfer) < _LINEAR else _FAINT / abs(transfer)
    x: Array = np.zeros(2 * MIN_HARMONICS + 1)
    x[1], x[MIN_HARMONICS + 1] = first * transfer.real, -first * transfer.imag
    how = Tracing((0.0, forcing), tol, balance.zeta, 0.5 * forcing)
    point = start(equations, x, first, 1.0, how)
    if first < forcing:
        path = trace(equations, point, how)
        point = path.points[-1]
        if path.end != "window" or point.parameter < 0.5 * forcing:
            raise ConvergenceError(f"no orbit found from rest at Omega = {omega:g}, F^ = {forcing:g}")
    return point.x


@dataclass(frozen=True)
class Chart:
    """Free orbits up to the amplitude that the forcing sustains; the arrays are empty where there is no backbone.

    Attributes:
        amplitude, frequency: release amplitude and frequency over omega_s (orbits,)
        lost: at twice the frequency, share of the work of the forcing on the second harmonic that the damping takes;
            1 is the least forcing of an orbit of period 2 near the free one (orbits,)
        lowest, highest: frequencies between which the resonance lies
    """

    amplitude: Array
    frequency: Array
    lost: Array
    lowest: float
    highest: float

    def may_double(self, window: tuple[float, float]) -> bool:
        """Whether orbits of period 2 may be near free ones in a window of Omega; True without a backbone."""
        if not self.lost.size:
            return True
        omega, lost = 2.0 * self.frequency, np.abs(self.lost)
        inside = (np.maximum(omega[1:], omega[:-1]) > window[0]) & (np.minimum(omega[1:], omega[:-1]) < window[1])
        return bool((np.minimum(lost[1:], lost[:-1])[inside] < _MOST_LOST).any())


def backbone_chart(equation: Equation, forcing: float) -> Chart:
    """Free orbits from small ones to the largest that the forcing sustains at phase resonance."""
    r, zeta, damping = equation.restoring, equation.zeta, equation.damping
    if not r.contact or zeta == 0:
        none: Array = np.empty(0)
        return Chart(none, none, none, 0.0, 1.0)

    def surplus(log: float) -> float:
        return 2.0 * zeta * rough_orbit(r, float(np.exp(log)), damping)[1] - forcing

    low, top = np.log([_AMPLITUDES[0], min(_AMPLITUDES[1], r.u_range[1])])
    high = low
    try:
        if only_in_contact(damping):
            high = top
        while high < top and surplus(high) < 0.0:
            low, high = high, min(high + 1.5, top)
        if surplus(low) < 0.0 < surplus(high) and not only_in_contact(damping):
            high = float(brentq(surplus, low, high, xtol=1e-3))
    except ConvergenceError:  # the law is too stiff at amplitudes far beyond any resonance
        high = low
    amplitude = np.geomspace(min(_SMALLEST, 0.1 * np.exp(high)), np.exp(high), _POINTS)
    frequency, drive, second = np.array([rough_orbit(r, float(u), damping) for u in amplitude]).T
    lost = np.divide(zeta * drive, forcing * second, out=np.full(_POINTS, np.inf), where=second != 0)
    return Chart(amplitude, frequency, lost, float(min(1.0, *frequency)), float(max(1.0, *frequency)))


def subharmonic_orbits(
    balance: Balance, window: tuple[float, float], forcing: float, chart: Chart
) -> Iterator[tuple[Array, float]]:
    """Orbits of period 2, with their Omega, near the backbone at Omega / 2.

    At the amplitudes where the loss takes the smallest share of the work, an orbit is guessed for both phases that
    balance the loss. It may lie on a loop that no period doubling leads to.
    """
    equations, k = in_omega(replace(balance, order=2), forcing), np.arange(1, 25)
    inside = np.flatnonzero((2.0 * chart.frequency > window[0]) & (2.0 * chart.frequency < window[1]))
    need = np.abs([np.inf, *chart.lost[inside], np.inf])
    for i in inside[(need[1:-1] < 1.0) & (need[1:-1] < need[:-2]) & (need[1:-1] <= need[2:])]:
        omega, x = 2.0 * float(chart.frequency[i]), orbit_coefficients(balance.restoring, float(chart.amplitude[i]), 24)
        for psi in (0.5 * np.arcsin(chart.lost[i]), 0.5 * (np.pi - np.arcsin(chart.lost[i]))):
            y = x.copy()
            y[1:25], y[25:] = x[1:25] * np.cos(k * psi), x[1:25] * np.sin(k * psi)
            y[2] += forcing / (1.0 - omega * omega)
            with suppress(ConvergenceError):  # a guess, no known orbit
                yield correct(equations, y, omega, np.zeros(49), 1.0, limit=0.5 * float(np.linalg.norm(y)))[0], omega
