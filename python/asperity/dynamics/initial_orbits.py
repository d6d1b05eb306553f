# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

"""Initial orbits of branches: from rest and from the backbone, at the ends of a window of frequencies."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from scipy.optimize import brentq

from asperity.arrays import Array
from asperity.dynamics.continuation import MIN_HARMONICS, Tracing, in_forcing, start, trace
from asperity.dynamics.free import orbit_coefficients, rough_orbit
from asperity.dynamics.harmonic_balance import Balance, resize
from asperity.dynamics.law.damping import only_in_contact
from asperity.errors import ConvergenceError

_BACKBONE = 16  # number of amplitudes at which subharmonic orbits are searched
_SMALLEST = 0.1  # smallest of them: below, the share of the loss hardly changes
_SINGULAR = 1e-9  # impedance below which there is no linear response to start from


def orbit_from_rest(balance: Balance, omega: float, forcing: float, tol: float) -> Array:
    """Return the coefficients (2 K + 1) of the orbit reached at fixed Omega by raising the forcing from zero.

    Raises:
        ConvergenceError: no orbit is found.
    """
    impedance = complex(1.0 - omega * omega, 2.0 * balance.zeta * omega)
    if abs(impedance) < _SINGULAR:
        raise ConvergenceError(f"no orbit found from rest at Omega = {omega:g}, the resonance without damping")
    transfer = 1.0 / impedance
    first = min(forcing, 0.02 / abs(transfer))
    x: Array = np.zeros(2 * MIN_HARMONICS + 1)
    x[1], x[MIN_HARMONICS + 1] = first * transfer.real, -first * transfer.imag
    x = balance.correct(x, omega, first)
    if first == forcing:
        return x
    if forcing * abs(transfer) < 0.3:  # nearly linear: Newton's method needs no continuation
        direct = balance.correct(x * (forcing / first), omega, forcing)
        if np.linalg.norm(direct - x * (forcing / first)) < 0.2 * np.linalg.norm(direct):
            return direct
    equations = in_forcing(balance, omega)
    how = Tracing((0.0, forcing), tol, balance.zeta, 0.5 * forcing)
    path = trace(equations, start(equations, x, first, 1.0, how), how)
    if path.end != "window" or path.points[-1].parameter < 0.5 * forcing:
        raise ConvergenceError(f"no orbit found from rest at Omega = {omega:g}, F^ = {forcing:g}")
    return path.points[-1].x


def backbone_chart(balance: Balance, forcing: float) -> tuple[Array, Array]:
    """Return amplitudes and frequencies of a few free orbits, up to the first that the forcing cannot sustain.

    Both are empty where the backbone provides no starting values.
    """
    if not balance.restoring.contact or balance.zeta == 0:
        return np.empty(0), np.empty(0)
    grid = np.geomspace(3e-3, 300.0, 6)
    chart: list[tuple[float, float]] = []
    for u in grid[grid < balance.restoring.u_range[1]]:
        try:
            frequency, drive = rough_orbit(balance.restoring, float(u), balance.damping)
        except ConvergenceError:  # the law is too stiff at amplitudes far beyond any resonance
            break
        chart.append((float(u), frequency))
        if 2.0 * balance.zeta * drive > forcing and not only_in_contact(balance.damping):
            break
    amplitudes, frequencies = np.array(chart).reshape(-1, 2).T
    return amplitudes, frequencies


def backbone_orbits(balance: Balance, omega: float, forcing: float, chart: tuple[Array, Array]) -> list[Array]:
    """Return guesses of the orbits near the backbone at Omega, with the phase of the energy balance."""
    restoring = balance.restoring
    grid, frequency = chart
    guesses = []
    for i in range(len(grid) - 1):
        if (frequency[i] > omega) == (frequency[i + 1] > omega):
            continue
        u0 = float(
            brentq(lambda u: rough_orbit(restoring, u, balance.damping)[0] - omega, grid[i], grid[i + 1], rtol=1e-3)
        )
        need = 2.0 * balance.zeta * rough_orbit(restoring, u0, balance.damping)[1] / forcing
        if need > 1.0:
            continue
        x = orbit_coefficients(restoring, u0, 24)
        k = np.arange(1, 25)
        for psi in (np.arcsin(need), np.pi - np.arcsin(need)):
            y = x.copy()
            y[1:25], y[25:] = x[1:25] * np.cos(k * psi), x[1:25] * np.sin(k * psi)
            guesses.append(y)
    return guesses


def subharmonic_orbits(
    balance: Balance, window: tuple[float, float], forcing: float, chart: tuple[Array, Array]
) -> Iterator[tuple[Array, float]]:
    """Yield orbits of period 2, with their Omega, near the backbone at Omega / 2.

    The forcing does work on the second harmonic of the free orbit. At the amplitudes where the loss takes the
    smallest share of that work, an orbit is guessed for both phases that balance the loss. It may lie on a loop that
    no period doubling leads to.
    """
    restoring, double = balance.restoring, replace(balance, order=2)
    inside = (2.0 * chart[1] > window[0]) & (2.0 * chart[1] < window[1])
    near = inside | np.append(inside[1:], False) | np.append(False, inside[:-1])
    if near.sum() < 2:
        return
    found: list[tuple[float, float, Array]] = []  # share of the work lost, Omega, free orbit
    top = chart[0][near][-1]
    for u0 in np.geomspace(max(min(_SMALLEST, 0.1 * top), chart[0][near][0]), top, _BACKBONE):
        frequency, drive = rough_orbit(restoring, float(u0), balance.damping)
        if window[0] < 2.0 * frequency < window[1]:
            x = orbit_coefficients(restoring, float(u0), 24)
            found.append((balance.zeta * drive * x[1] / (forcing * x[2]) if x[2] else np.inf, 2.0 * frequency, x))
    need = np.abs([np.inf, *(share for share, _, _ in found), np.inf])
    for i in np.flatnonzero((need[1:-1] < 1.0) & (need[1:-1] < need[:-2]) & (need[1:-1] <= need[2:])):
        share, omega, x = found[i]
        k = np.arange(1, 25)
        for psi in (0.5 * np.arcsin(share), 0.5 * (np.pi - np.arcsin(share))):
            y = x.copy()
            y[1:25], y[25:] = x[1:25] * np.cos(k * psi), x[1:25] * np.sin(k * psi)
            y[2] += forcing / (1.0 - omega * omega)
            corrected = _corrected(double, y, omega, forcing)
            if corrected is not None:
                yield corrected, omega


def edge_orbits(
    balance: Balance, edge: float, forcing: float, tol: float, chart: tuple[Array, Array]
) -> Iterator[Array]:
    """Yield orbits at an end of the window, from which branches enter it."""
    try:
        yield orbit_from_rest(balance, edge, forcing, tol)
    except ConvergenceError:
        pass
    for guess in backbone_orbits(balance, edge, forcing, chart):
        x = _corrected(balance, guess, edge, forcing)
        if x is not None:
            yield x


def _corrected(balance: Balance, guess: Array, omega: float, forcing: float) -> Array | None:
    """Return the corrected orbit near a guess, None if there is none or it is far away."""
    try:
        x = balance.correct(guess, omega, forcing)
    except (ConvergenceError, np.linalg.LinAlgError):
        return None
    return x if np.linalg.norm(x - resize(guess, x.size // 2)) < 0.5 * np.linalg.norm(guess) else None
