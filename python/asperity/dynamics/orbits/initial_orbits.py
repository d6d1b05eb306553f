"""Where branches start: orbits from rest and from the backbone at the ends of a window of frequencies."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from scipy.optimize import brentq

from asperity.dynamics.law.law import Array
from asperity.dynamics.orbits.continuation import in_forcing, start, trace
from asperity.dynamics.orbits.free import orbit_coefficients, rough_orbit
from asperity.dynamics.orbits.harmonic_balance import Balance, resize
from asperity.errors import ConvergenceError

LEAST = 8  # harmonics per period of the forcing
_AT_REST = 1e-9  # impedance below which any forcing moves the mass far


def orbit_from_rest(balance: Balance, omega: float, forcing: float, tol: float) -> Array:
    """Coefficients of the orbit reached at fixed Omega by raising the forcing from zero."""
    impedance = complex(1.0 - omega * omega, 2.0 * balance.zeta * omega)
    if abs(impedance) < _AT_REST:
        raise ConvergenceError(f"no orbit found from rest at Omega = {omega:g}, the resonance without damping")
    transfer = 1.0 / impedance
    first = min(forcing, 0.02 / abs(transfer))
    x: Array = np.zeros(2 * LEAST + 1)
    x[1], x[LEAST + 1] = first * transfer.real, -first * transfer.imag
    x = balance.correct(x, omega, first)
    if first == forcing:
        return x
    if forcing * abs(transfer) < 0.3:  # nearly linear: Newton's method finds it at once
        direct = balance.correct(x * (forcing / first), omega, forcing)
        if np.linalg.norm(direct - x * (forcing / first)) < 0.2 * np.linalg.norm(direct):
            return direct
    equations = in_forcing(balance, omega)
    point = start(equations, x, first, 1.0, tol, LEAST)
    path = trace(equations, point, (0.0, forcing), tol=tol, least=LEAST, zeta=balance.zeta, max_step=0.5 * forcing)
    if path.end != "window" or path.points[-1].parameter < 0.5 * forcing:
        raise ConvergenceError(f"no orbit found from rest at Omega = {omega:g}, F^ = {forcing:g}")
    return path.points[-1].x


def backbone_chart(balance: Balance, forcing: float) -> tuple[Array, Array]:
    """Amplitudes and frequencies of a few free orbits, up to the first that the forcing cannot sustain.

    Empty where the backbone gives no starting values.
    """
    if not balance.restoring.contact or balance.zeta == 0:
        return np.empty(0), np.empty(0)
    grid = np.geomspace(3e-3, 300.0, 6)
    chart: list[tuple[float, float]] = []
    for u in grid[grid < balance.restoring.u_range[1]]:
        try:
            frequency, drive = rough_orbit(balance.restoring, float(u), balance.damping)
        except ConvergenceError:  # too stiff a law for the arithmetic, far beyond any resonance
            break
        chart.append((float(u), frequency))
        if 2.0 * balance.zeta * drive > forcing and balance.damping != "contact":
            break
    amplitudes, frequencies = np.array(chart).reshape(-1, 2).T
    return amplitudes, frequencies


def backbone_orbits(balance: Balance, omega: float, forcing: float, chart: tuple[Array, Array]) -> list[Array]:
    """Guesses of the orbits near the backbone at Omega, their phase set by the energy balance."""
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


def edge_orbits(
    balance: Balance, edge: float, forcing: float, tol: float, chart: tuple[Array, Array]
) -> Iterator[Array]:
    """Orbits at an end of the window from which branches enter it."""
    try:
        yield orbit_from_rest(balance, edge, forcing, tol)
    except ConvergenceError:
        pass
    for guess in backbone_orbits(balance, edge, forcing, chart):
        try:
            x = balance.correct(guess, edge, forcing)
        except (ConvergenceError, np.linalg.LinAlgError):
            continue
        if np.linalg.norm(x - resize(guess, x.size // 2)) < 0.5 * np.linalg.norm(guess):
            yield x
