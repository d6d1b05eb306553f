# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

"""One forcing period of many oscillators in parallel.

Runge-Kutta method of order 4 with fixed steps in Lienard's variable (see `asperity.dynamics.equation`), one lane
of the arrays per oscillator.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from asperity.arrays import Array
from asperity.dynamics.equation import Equation, primitive
from asperity.dynamics.law.taylor import TaylorLaw

STEP = 0.14  # longest step over the shortest local time scale
ESCAPE = 1e4  # displacement beyond which a lane has escaped
FEW = 16  # largest number of lanes for which plain floats are faster


def steps_for(equation: Equation, omega: Array, u: Array) -> int:
    """Return the number of steps per period that resolve the stiffest contact at displacements `u`."""
    stiff = equation.restoring.df(np.maximum(u, 0.0))
    rate = np.sqrt(np.maximum(1.0, np.where(np.isfinite(stiff), stiff, 1.0)))
    return int(np.clip(2 * np.ceil(np.max(np.pi / omega * rate / STEP)), 64, 4096))


def has_escaped(equation: Equation, u: Array, low: Array) -> Array:
    """Return which lanes have left the Taylor well and cannot return."""
    bad = ~np.isfinite(u) | (np.abs(u) > ESCAPE)
    law = equation.restoring.law
    if isinstance(law, TaylorLaw) and np.isfinite(law.rim()):
        bad |= ~(low > law.rim() - 2.0)
    return bad


def advance(
    equation: Equation, u: Array, w: Array, omega: Array, forcing: Array, steps: int
) -> tuple[Array, Array, Array, Array, Array]:
    """Advance all lanes by one forcing period.

    Args:
        equation: the oscillator.
        u, w, omega, forcing: state, Omega and F^ of each lane, shape (lanes,).
        steps: Runge-Kutta steps.

    Returns:
        u, w, largest u, smallest u and amplitude at the forcing frequency, shape (lanes,) each.
    """
    us, vs, w = path_of(equation, u, w, omega, forcing, steps)
    with np.errstate(over="ignore", invalid="ignore"):
        low, high = _turning_values(us, vs * (2.0 * np.pi / omega / steps))
        wave = np.exp(-2j * np.pi / steps * np.arange(steps))
        a1 = 2.0 / steps * np.abs(wave @ us[:-1])
    return us[-1], w, high, low, a1


def path_of(
    equation: Equation, u: Array, w: Array, omega: Array, forcing: Array, steps: int
) -> tuple[Array, Array, Array]:
    """Return displacements and speeds (steps + 1, lanes) over one forcing period, and w at its end."""
    few = u.size <= FEW and equation.restoring.law.scalar and equation.damping == "always"
    return (_path_scalar if few else _path)(equation, u, w, omega, forcing, steps)


def _path(
    equation: Equation, u: Array, w: Array, omega: Array, forcing: Array, steps: int
) -> tuple[Array, Array, Array]:
    """Integrate all lanes at once in arrays; see `path_of`."""
    r, damping = equation.restoring, equation.damping
    rest, twice = 1.0 / r.n_loc, 2.0 * equation.zeta
    always = damping == "always"
    h = 2.0 * np.pi / omega / steps
    half, sixth = 0.5 * h, h / 6.0
    drive, middle = (np.cos(angle)[:, None] * forcing + rest for angle in _angles(steps))
    us, vs = np.empty((steps + 1, u.size)), np.empty((steps + 1, u.size))

    def speed(u: Array, w: Array) -> Array:
        return w - twice * (u if always else primitive(r, damping, u))

    with np.errstate(over="ignore", invalid="ignore"):
        for j in range(steps):
            k1 = speed(u, w)
            us[j], vs[j] = u, k1
            l1 = drive[j] - r.pull_only(u)
            ua, wa = u + half * k1, w + half * l1
            k2, l2 = speed(ua, wa), middle[j] - r.pull_only(ua)
            ub, wb = u + half * k2, w + half * l2
            k3, l3 = speed(ub, wb), middle[j] - r.pull_only(ub)
            uc, wc = u + h * k3, w + h * l3
            k4, l4 = speed(uc, wc), drive[j + 1] - r.pull_only(uc)
            u = u + sixth * (k1 + 2.0 * (k2 + k3) + k4)
            w = w + sixth * (l1 + 2.0 * (l2 + l3) + l4)
        us[steps], vs[steps] = u, speed(u, w)
    return us, vs, w


def _path_scalar(
    equation: Equation, u: Array, w: Array, omega: Array, forcing: Array, steps: int
) -> tuple[Array, Array, Array]:
    """Integrate lane by lane in plain floats, faster for few lanes; for damping "always" only."""
    r, twice = equation.restoring, 2.0 * equation.zeta
    at, scale, z_s, rest = r.law.at, 1.0 / r.scale, r.z_s, 1.0 / r.n_loc
    us, vs, ends = np.full((steps + 1, u.size), np.nan), np.full((steps + 1, u.size), np.nan), np.full(u.size, np.nan)
    for lane in range(u.size):
        x, y, force = float(u[lane]), float(w[lane]), float(forcing[lane])
        h = 2.0 * np.pi / float(omega[lane]) / steps
        half, sixth = 0.5 * h, h / 6.0
        waves: list[Any] = [(np.cos(angle) * force + rest).tolist() for angle in _angles(steps)]
        drive, middle = waves
        xs, ss = [], []
        try:
            for j in range(steps):
                k1 = y - twice * x
                xs.append(x)
                ss.append(k1)
                l1 = drive[j] - scale * at(z_s * (1.0 + x))[0]
                xa = x + half * k1
                k2 = y + half * l1 - twice * xa
                l2 = middle[j] - scale * at(z_s * (1.0 + xa))[0]
                xb = x + half * k2
                k3 = y + half * l2 - twice * xb
                l3 = middle[j] - scale * at(z_s * (1.0 + xb))[0]
                xc = x + h * k3
                k4 = y + h * l3 - twice * xc
                l4 = drive[j + 1] - scale * at(z_s * (1.0 + xc))[0]
                x += sixth * (k1 + 2.0 * (k2 + k3) + k4)
                y += sixth * (l1 + 2.0 * (l2 + l3) + l4)
                if not -ESCAPE < x < ESCAPE:  # escaped: the remaining samples stay NaN
                    break
            else:
                xs.append(x)
                ss.append(y - twice * x)
                ends[lane] = y
        except OverflowError:  # escaped as well
            pass
        us[: len(xs), lane], vs[: len(ss), lane] = xs, ss
    return us, vs, ends


def _angles(steps: int) -> tuple[Array, Array]:
    """Return the angles of the forcing at the ends and in the middle of the steps of a period."""
    ends = 2.0 * np.pi / steps * np.arange(steps + 1)
    return ends, ends[:-1] + np.pi / steps


def _turning_values(u: Array, v: Array) -> tuple[Array, Array]:
    """Return the extremes of the cubic Hermite path through samples u with slopes v (times the step)."""
    low, high = u.min(axis=0), u.max(axis=0)
    i, lane = np.nonzero((v[:-1] > 0) != (v[1:] > 0))
    if i.size == 0:
        return low, high
    a, b, p, q = u[i, lane], u[i + 1, lane], v[i, lane], v[i + 1, lane]
    c3, c2 = p + q - 2 * (b - a), 3 * (b - a) - 2 * p - q  # a + p s + c2 s^2 + c3 s^3
    s = p / np.where(p == q, 1e-300, p - q)
    for _ in range(3):
        bend = 2 * c2 + 6 * c3 * s
        s = s - (p + 2 * c2 * s + 3 * c3 * s * s) / np.where(bend == 0, np.inf, bend)
    s = np.clip(s, 0.0, 1.0)
    turn = a + s * (p + s * (c2 + s * c3))
    np.fmin.at(low, lane, turn)
    np.fmax.at(high, lane, turn)
    return low, high
