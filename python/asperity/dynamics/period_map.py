# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

"""Search for periodic orbits by Newton's method on the period map, from many states at many frequencies.

It finds what no branch from rest or from the backbone reaches: pieces that connect outside the window, loops, orbits of
period 2 that no period doubling leads to. The starts fill frequency and state evenly (a low-discrepancy sequence,
Roberts 2018); motions are integrated in parallel, and each start converges to an orbit near it, stable or not.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from asperity.arrays import Array
from asperity.dynamics.branch import Branch
from asperity.dynamics.dense import on_cubic
from asperity.dynamics.equation import Equation, primitive
from asperity.dynamics.stability import unstack
from asperity.dynamics.time_integration import has_escaped, path_of, steps_for

_NEWTON = 9  # iterations
_TYPICAL = 2.0  # displacement whose stiffness sets the time step: rough, because the balance corrects the orbits
_MOST_STEPS = 400  # per period
_CLOSE = 1e-4  # Newton step that ends the search, relative to the state
_KNOWN = 1e-2  # distance within which an orbit is identical to a known one, relative to the state
_HARMONICS = 24  # of an orbit found, per forcing period
_ROWS = 8  # of a branch between two points


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
    """Omega and rough coefficients of the periodic orbits near the starts, without the known ones.

    Args:
        lanes: Omega, u and w of the starts
        order: forcing periods per period of the orbit; shorter periods are left out
        known: see `states`; it may grow while the orbits are taken
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
