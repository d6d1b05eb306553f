"""Orbits on no branch from the ends of a window: a look from rest, and from other states, at a few frequencies.

Where the forcing is strong and the damping light, superharmonic resonances cut the branch from rest in pieces that
connect outside the window, or nowhere. Some motions run side by side for a few periods; Newton's method on the
period map then takes each to an orbit near by, stable or not.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from asperity.arrays import Array
from asperity.dynamics.forcing import LIGHTEST
from asperity.dynamics.law.damping import primitive
from asperity.dynamics.motion.runge_kutta import has_left, path_of, steps_for
from asperity.dynamics.orbits.branch import Branch
from asperity.dynamics.orbits.dense import on_cubic
from asperity.dynamics.orbits.harmonic_balance import Balance
from asperity.dynamics.orbits.stability import unstack

_DRIVE = 0.5  # F^^2/(2 zeta), which drives superharmonics, below which every orbit was met from the ends
_FREQUENCIES, _STARTS = 12, 24
_HIGH = 1.0  # Omega above which no superharmonic lies
_SETTLE, _NEWTON = 2, 10  # periods, iterations
_FARTHEST = 8.0  # largest start, in static deflections
_TYPICAL = 2.0  # deflection whose stiffness sets the time step: Newton's method on the balance follows
_CLOSE = 1e-4  # Newton step that ends the search, relative to the state
_KNOWN = 3e-3  # distance from the state of a known orbit, relative to the state
_HARMONICS = 24


def orbits_elsewhere(
    balance: Balance, forcing: float, window: tuple[float, float], branches: Sequence[Branch]
) -> Iterator[tuple[float, Array]]:
    """Yield Omega and rough coefficients of the orbits met that are on no branch.

    None where the drive is weak, or the damping so light that motion does not settle.

    Args:
        balance: the equations (order 1).
        forcing: F^.
        window: lowest and highest Omega.
        branches: what is known.
    """
    if balance.zeta < LIGHTEST or forcing**2 < 2.0 * balance.zeta * _DRIVE or window[0] > _HIGH:
        return
    omega, u, w = _starts(balance, forcing, window)
    steps = max(64, steps_for(balance, omega, np.array([_TYPICAL])) // 2)

    def mapped(omega: Array, u: Array, w: Array) -> tuple[Array, Array]:
        """Deflections (steps + 1, lanes) over one period, and w at its end."""
        path, _, end = path_of(balance, u, w, omega, np.full(u.size, forcing), steps)
        return path, end

    for _ in range(_SETTLE):
        path, w = mapped(omega, u, w)
        u = path[-1]
    found: list[tuple[float, float, float]] = []
    for _ in range(_NEWTON):
        kept = np.isfinite(u) & np.isfinite(w) & ~has_left(balance, u, u)
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
                loss = 2.0 * balance.zeta * float(primitive(balance.restoring, balance.damping, u[i : i + 1])[0])
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
    """Omega, u and w of the lanes: rest, and states on a spiral, at frequencies even in the length of the period."""
    omega = 1.0 / np.linspace(1.0 / window[0], 1.0 / min(window[1], _HIGH), _FREQUENCIES + 1)[:-1]
    i = np.arange(_STARTS)
    radius = min(forcing / (2.0 * balance.zeta), _FARTHEST) * i / (_STARTS - 1)
    angle = np.pi * (3.0 - np.sqrt(5.0)) * (i + _STARTS * np.arange(_FREQUENCIES)[:, None])
    u, w = radius * np.cos(angle), radius * np.sin(angle)
    return np.repeat(omega, _STARTS), u.ravel(), w.ravel()


def _newton_step(defect: Array, flow: Array) -> Array:
    """Steps (2, lanes) that remove the defects (2, lanes), with the derivatives (2, 2, lanes) of the period map."""
    (a, b), (c, d) = flow
    a, d = a - 1.0, d - 1.0
    with np.errstate(all="ignore"):
        return np.array([b * defect[1] - d * defect[0], c * defect[0] - a * defect[1]]) / (a * d - b * c)


def _near(a: tuple[float, ...], b: tuple[float, ...]) -> bool:
    return float(np.hypot(a[0] - b[0], a[1] - b[1])) < _KNOWN * (0.1 + abs(a[0]) + abs(a[1]))


def _states(branches: Sequence[Branch], omega: float) -> Iterator[tuple[float, float]]:
    """(u, v) at forcing phase 0 of the orbits of order 1 at a frequency, as the cubics give them."""
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
