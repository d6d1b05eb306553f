# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

"""Correction of harmonic-balance orbits by shooting, and the reverse."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from asperity.arrays import Array
from asperity.dynamics.motion.shooting import shoot
from asperity.dynamics.motion.trajectory import integrate
from asperity.dynamics.orbits.branch import Branch
from asperity.dynamics.orbits.harmonic_balance import Balance, tail
from asperity.dynamics.orbits.response import FrequencyResponse
from asperity.dynamics.orbits.stability import state_at_phase_zero
from asperity.errors import AsperityError, ConvergenceError


def polish(response: FrequencyResponse) -> FrequencyResponse:
    """Correct extremes, a1 and stability of every point by shooting; coefficients stay.

    At a fold the frequency is corrected together with the orbit. A point at which shooting fails keeps its values
    and its error estimate.
    """
    branches = tuple(_polish_branch(response, b) for b in response.branches)
    return replace(response, branches=branches, tolerance=max(float(b.error.max()) for b in branches))


def coefficients(balance: Balance, omega: float, forcing: float, state: tuple[float, float]) -> Array | None:
    """Return the harmonic-balance solution (2 K + 1) near the periodic orbit through `state`, or None."""
    duration = 2.0 * np.pi * balance.order / omega
    count = 24 * balance.order
    try:
        path, _ = integrate(
            balance, omega, forcing, *state, duration, rtol=1e-8, samples=int(np.ceil(16 * count / duration))
        )
        t = np.linspace(0.0, duration, 8 * count, endpoint=False)
        tau, index = np.unique(path.tau, return_index=True)
        c = np.fft.rfft(np.interp(t, tau, path.u[index]))[: count + 1] / t.size
        x = np.concatenate([[c[0].real], 2.0 * c[1:].real, -2.0 * c[1:].imag])
        y = balance.correct(x, omega, forcing)
    except (AsperityError, np.linalg.LinAlgError):
        return None
    return y if np.linalg.norm(y - x) < 0.1 * np.linalg.norm(x) + 10 * tail(y) else None


def _polish_branch(response: FrequencyResponse, branch: Branch) -> Branch:
    balance = replace(response.balance, order=branch.order)
    values = {
        name: getattr(branch, name).copy() for name in ("Omega", "u_max", "u_min", "a1", "stable", "radius", "error")
    }
    for i, omega in enumerate(branch.Omega):
        u, v = state_at_phase_zero(branch.coefficients[i], float(omega), branch.order)
        size = branch.u_max[i] - branch.u_min[i]
        for hold in (True, False):
            try:
                shot = shoot(
                    balance,
                    float(omega),
                    response.setting.F_hat,
                    u,
                    v,
                    order=branch.order,
                    tol=1e-10,
                    rtol=1e-11,
                    hold=hold,
                )
                break
            except ConvergenceError:
                continue
        else:
            continue
        if abs(shot.u_max - branch.u_max[i]) > 0.01 * size:  # another orbit
            continue
        values["Omega"][i] = shot.omega
        radius = max(abs(m) for m in shot.multipliers)
        values["u_max"][i], values["u_min"][i], values["a1"][i] = shot.u_max, shot.u_min, shot.a1
        values["radius"][i], values["stable"][i] = radius, radius <= 1.0 + 1e-7
        values["error"][i] = max(shot.residual / size, 1e-11, 1e-12 / size)
    return replace(branch, **values)
