# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

"""Search for orbits that are on no branch, from rest and other initial states at a few frequencies.

Where the forcing is strong and the damping light, superharmonic resonances cut the branch from rest into pieces
that connect outside the window, or nowhere. Many motions are integrated in parallel for a few periods; Newton's
method on the period map then finds a periodic orbit near each, stable or unstable.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from asperity.arrays import Array
from asperity.dynamics.forcing import MIN_ZETA
from asperity.dynamics.motion.runge_kutta import has_escaped, path_of, steps_for
from asperity.dynamics.orbits.branch import Branch
from asperity.dynamics.orbits.dense import on_cubic
from asperity.dynamics.orbits.harmonic_balance import Balance
from asperity.dynamics.orbits.stability import unstack

_DRIVE = 0.5  # F^^2/(2 zeta), the strength of superharmonics; below this the ends of the window reach all orbits
_FREQUENCIES, _STARTS = 12, 24
_HIGH = 1.0  # Omega above which there are no superharmonics
_SETTLE, _NEWTON = 2, 10  # periods, iterations
_FARTHEST = 8.0  # largest initial amplitude, over the static deflection
_TYPICAL = 2.0  # displacement whose stiffness sets the time step: rough, because the balance corrects the orbits
_CLOSE = 1e-4  # Newton step that ends the search, relative to the state
_KNOWN = 3e-3  # distance within which an orbit is identical to a known one, relative to the state
_HARMONICS = 24


def orbits_on_no_branch(
    balance: Balance, forcing: float, window: tuple[float, float], branches: Sequence[Branch]
) -> Iterator[tuple[float, Array]]:
    """Yield Omega and rough coefficients of the orbits found that are on no branch.

    There are none where the drive is weak, or the damping so light that motion does not settle.

    Args:
        balance: equations of order 1.
        forcing: F^.
        window: lowest and highest Omega.
        branches: known branches.
    """
    if balance.zeta < MIN_ZETA or forcing**2 < 2.0 * balance.zeta * _DRIVE or window[0] > _HIGH:
        return
    omega, u, w = _starts(balance, forcing, window)
    steps = max(64, steps_for(balance, omega, np.array([_TYPICAL])) // 2)

    def mapped(omega: Array, u: Array, w: Array) -> tuple[Array, Array]:
        """Return displacements (steps + 1, lanes) over one period, and w at its end."""
        path, _, end = path_of(balance, u, w, omega, np.full(u.size, forcing), steps)
        return path, end

    for _ in range(_SETTLE):
        path, w = mapped(omega, u, w)
        u = path[-1]
    found: list[tuple[float, float, float]] = []
    for _ in range(_NEWTON):
        kept = np.isfinite(u) & np.isfinite(w) & ~has_escaped(balance, u, u)
        omega, u, w = omega[kept], u[kept], w[kept]
        if not u.size:
            return
        size = 0.1 + np.abs(u) + np.abs(w)
        h = 1e-4 * size
        path, ends = mapped(np.tile(omega, 3), np.concatenate([u, u + h, u]), np.concatenate([w, w, w + h]))
        end = np.stack([path[-1].reshape(3, -1), ends.reshape(3, -1)])  # (u or w, lane of three, start)
        step = _newton_step(end[:, 0] - [u, w], (end[:, 1:] - end[:, :1]) / h)
        length = np.hypot(*step)
        for i in np.flatnonzero(length < _CLOSE * size):
            at = (float(omega[i]), float(u[i]), float(w[i]))
            if not any(a[0] == at[0] and _near(a[1:], at[1:]) for a in found):
                found.append(at)
                loss = balance.loss(float(u[i]))
                if not any(_near(state, (at[1], at[2] - loss)) for state in _states(branches, at[0])):
                    wave = np.fft.rfft(path[:-1, i])[: _HARMONICS + 1] / steps
                    wave[1:] *= 2.0
                    yield at[0], unstack(wave, _HARMONICS)
        moving = np.isfinite(length) & (length >= _CLOSE * size)
        omega, u, w, length, size, step = (
            omega[moving],
            u[moving],
            w[moving],
            length[moving],
            size[moving],
            step[:, moving],
        )
        u, w = [u, w] + step * np.minimum(1.0, 0.3 * size / length)


def _starts(balance: Balance, forcing: float, window: tuple[float, float]) -> tuple[Array, Array, Array]:
    """Return Omega, u and w of the lanes: rest and states on a spiral, at periods of equal spacing."""
    omega = 1.0 / np.linspace(1.0 / window[0], 1.0 / min(window[1], _HIGH), _FREQUENCIES + 1)[:-1]
    i = np.arange(_STARTS)
    radius = min(forcing / (2.0 * balance.zeta), _FARTHEST) * i / (_STARTS - 1)
    angle = np.pi * (3.0 - np.sqrt(5.0)) * (i + _STARTS * np.arange(_FREQUENCIES)[:, None])
    u, w = radius * np.cos(angle), radius * np.sin(angle)
    return np.repeat(omega, _STARTS), u.ravel(), w.ravel()


def _newton_step(defect: Array, flow: Array) -> Array:
    """Return the Newton steps (2, lanes) for defects (2, lanes) and derivatives (2, 2, lanes) of the period map."""
    (a, b), (c, d) = flow
    a, d = a - 1.0, d - 1.0
    with np.errstate(all="ignore"):
        return np.array([b * defect[1] - d * defect[0], c * defect[0] - a * defect[1]]) / (a * d - b * c)


def _near(a: tuple[float, ...], b: tuple[float, ...]) -> bool:
    return float(np.hypot(a[0] - b[0], a[1] - b[1])) < _KNOWN * (0.1 + abs(a[0]) + abs(a[1]))


def _states(branches: Sequence[Branch], omega: float) -> Iterator[tuple[float, float]]:
    """Yield (u, v) at forcing phase 0 of the orbits of order 1 at a frequency, from the cubics."""
    for b in branches:
        above = b.Omega > omega
        left = np.flatnonzero(above[:-1] != above[1:]).astype(float)
        if b.order > 1 or not left.size:
            continue
        right = left + 1.0
        for _ in range(30):
            middle = 0.5 * (left + right)
            same = (on_cubic(b, middle)[0] > omega) == above[left.astype(int)]
            left, right = np.where(same, middle, left), np.where(same, right, middle)
        for c in on_cubic(b, left)[1]:
            yield float(c.sum().real), float((1j * np.arange(c.size) * c).sum().real) * omega
