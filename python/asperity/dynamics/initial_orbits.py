# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

"""Initial orbits of branches: from rest, of period 2 near the backbone, and by Newton's method on the period map.

The period map finds what no branch from rest or from the backbone reaches: pieces that connect outside the window,
loops, orbits of period 2 that no period doubling leads to. The starts fill frequency and state evenly (a
low-discrepancy sequence, Roberts 2018); motions are integrated in parallel, and each start converges to an orbit near
it, stable or not.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import brentq

from asperity.arrays import Array
from asperity.dynamics.branch import Branch, on_cubic
from asperity.dynamics.continuation import MIN_HARMONICS, Tracing, correct, in_forcing, in_omega, start, trace
from asperity.dynamics.equation import Equation, primitive
from asperity.dynamics.free import orbit_coefficients, rough_orbit
from asperity.dynamics.harmonic_balance import Balance
from asperity.dynamics.law.damping import only_in_contact
from asperity.dynamics.stability import unstack
from asperity.dynamics.time_integration import has_escaped, path_of, steps_for
from asperity.errors import ConvergenceError

_POINTS = 16  # amplitudes on the backbone; a chart of 12 finds the same loops of period 2
_AMPLITUDES = (1e-3, 300.0)  # of free orbits: below they are linear, above the mass flies all the time
_SMALLEST = 0.05  # of them in the chart
_MOST_LOST = 2.0  # of `Chart.lost` with orbits of period 2: up to 1.1 in 250 random windows
_LINEAR, _FAINT = 0.3, 0.02  # amplitudes up to which, and at which, an orbit from rest starts as the linear response
_SINGULAR = 1e-9  # impedance below which there is no linear response to start from
_NEWTON = 9  # iterations on the period map
_TYPICAL = 2.0  # displacement whose stiffness sets the time step: rough, because the balance corrects the orbits
_MOST_STEPS = 400  # per period
_CLOSE = 1e-4  # Newton step that ends the search, relative to the state
_KNOWN = 1e-2  # distance within which an orbit is identical to a known one, relative to the state
_HARMONICS = 24  # of an orbit found, per forcing period
_ROWS = 8  # of a branch between two points


def orbit_from_rest(balance: Balance, omega: float, forcing: float, tol: float) -> Array:
    """Coefficients (2 K + 1) of the orbit reached at fixed Omega by raising the forcing from zero."""
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


def has_one_resonance(equation: Equation, forcing: float) -> bool:
    """Whether the second-order force, of twice the frequency, is well below the onset of hysteresis.

    At half of the resonance, where the response is 4/3 of the forcing, it is 0.9 |a2| F^^2. The orbits below the
    main resonance are then unique.
    """
    r = equation.restoring
    onset = np.sqrt(6.16 * equation.zeta**3 / max(abs(r.kappa), 1e-12))
    return bool(r.contact and 0.9 * abs(r.a2) * forcing**2 < 0.5 * onset)


def starts(equation: Equation, forcing: float, window: tuple[float, float], count: int) -> tuple[Array, Array, Array]:
    """Omega, u and w of the starts, at periods of even spacing: half of them in contact, half in flight."""
    i = np.arange(1, count + 1)[:, None]
    a, b, c = ((0.5 + i * 1.2207440846057596 ** -np.arange(1.0, 4.0)) % 1.0).T
    omega = 1.0 / (1.0 / window[1] + a * (1.0 / window[0] - 1.0 / window[1]))
    n = equation.restoring.n_loc
    drive = forcing / (2.0 * equation.zeta)
    radius = min(1.5 * drive + 2.0 * forcing, 2.5) * np.sqrt(b)
    u, v = radius * np.cos(2.0 * np.pi * c), radius * np.sin(2.0 * np.pi * c)
    flying = i[:, 0] % 2 == 1
    if drive > 1.0 and equation.restoring.contact:
        v_s = b * np.minimum(2.0 * np.pi / (n * omega), drive)  # the flight lasts up to two periods of the forcing
        s = 2.0 * n * v_s * c
        u, v = np.where(flying, -1.0 - v_s * s + s * s / (2.0 * n), u), np.where(flying, s / n - v_s, v)
    return omega, u, v + 2.0 * equation.zeta * primitive(equation.restoring, equation.damping, u)


def periodic_orbits(
    equation: Equation, forcing: float, lanes: tuple[Array, Array, Array], order: int, known: Sequence[Array]
) -> Iterator[tuple[float, Array]]:
    """Omega and rough coefficients of the orbits of `order` forcing periods near the starts (`lanes`).

    Orbits of shorter periods are left out, and the known ones (see `states`), which may grow in the meantime.
    """
    omega, u, w = lanes
    steps = min(max(64, steps_for(equation, omega, np.array([_TYPICAL])) // 2), _MOST_STEPS)

    def mapped(omega: Array, u: Array, w: Array) -> tuple[Array, Array, Array]:
        """Displacements and speeds (order * steps + 1, lanes) over the period, and w at its end."""
        us, vs = [u[None]], []
        for _ in range(order):
            path, speed, w = path_of(equation, us[-1][-1], w, omega, np.full(u.size, forcing), steps)
            us.append(path[1:])
            vs.append(speed[:-1])
        return np.concatenate(us), np.concatenate(vs), w

    path, _, w = mapped(omega, u, w)
    u = path[-1]
    for _ in range(_NEWTON):
        kept = np.isfinite(u) & np.isfinite(w) & ~has_escaped(equation, u, u)
        omega, u, w = omega[kept], u[kept], w[kept]
        if not u.size:
            return
        size = 0.1 + np.abs(u) + np.abs(w)
        h = 1e-4 * size
        path, speed, ends = mapped(np.tile(omega, 3), np.concatenate([u, u + h, u]), np.concatenate([w, w, w + h]))
        end = np.stack([path[-1].reshape(3, -1), ends.reshape(3, -1)])  # (u or w, lane of three, start)
        step = _newton_step(end, np.array([u, w]), h)
        length = np.hypot(*step)
        for i in np.flatnonzero(length < _CLOSE * size):
            if (
                order > 1
                and np.abs(path[steps, i] - path[0, i]) + np.abs(speed[steps, i] - speed[0, i]) < _KNOWN * size[i]
            ):
                continue
            if not any(_near(rows, float(omega[i]), float(u[i]), float(speed[0, i])) for rows in known):
                wave = np.fft.rfft(path[:-1, i])[: _HARMONICS * order + 1] / (steps * order)
                wave[1:] *= 2.0
                yield float(omega[i]), unstack(wave, _HARMONICS * order)
        moving = np.isfinite(length) & (length >= _CLOSE * size)
        omega, u, w, length, size, step = (x[..., moving] for x in (omega, u, w, length, size, step))
        u, w = [u, w] + step * np.minimum(1.0, 0.3 * size / length)


def states(branch: Branch) -> Array:
    """Omega, u and v at forcing phase 0 (3, periods, rows) along a branch, once for each forcing period."""
    places = np.linspace(0.0, len(branch) - 1.0, _ROWS * (len(branch) - 1) + 1)
    omega, c = on_cubic(branch, places)
    k = np.arange(c.shape[1])
    turn = np.exp(2j * np.pi / branch.order * np.outer(k, np.arange(branch.order)))
    u, v = (c @ turn).real, ((1j * k * c) @ turn).real * omega[:, None] / branch.order
    return np.stack(np.broadcast_arrays(omega, u.T, v.T))


def _near(rows: Array, omega: float, u: float, v: float) -> bool:
    """Whether a branch has an orbit with nearly the given state at a frequency."""
    above = rows[0, 0] > omega
    j = np.flatnonzero(above[1:] != above[:-1])
    a, b = rows[..., j], rows[..., j + 1]
    s = (omega - a[0]) / np.where(b[0] == a[0], 1.0, b[0] - a[0])
    gap = np.hypot(a[1] + s * (b[1] - a[1]) - u, a[2] + s * (b[2] - a[2]) - v)
    return bool((gap < _KNOWN * (0.1 + abs(u) + abs(v))).any())


def _newton_step(end: Array, start: Array, h: Array) -> Array:
    """Newton steps (2, lanes) of the period map.

    `end` are the states after the period (2, 3, lanes): from `start`, and from it with u and with w increased by `h`.
    """
    with np.errstate(all="ignore"):
        defect, flow = end[:, 0] - start, (end[:, 1:] - end[:, :1]) / h
        (a, b), (c, d) = flow
        a, d = a - 1.0, d - 1.0
        return np.array([b * defect[1] - d * defect[0], c * defect[0] - a * defect[1]]) / (a * d - b * c)
