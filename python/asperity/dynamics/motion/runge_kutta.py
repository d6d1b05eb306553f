"""One period of the forcing, for many oscillators side by side.

Fixed-step Runge-Kutta 4 in Lienard's variable (see `asperity.dynamics.law.damping`), one lane per oscillator.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from asperity.dynamics.law.damping import primitive
from asperity.dynamics.law.law import Array, TaylorLaw
from asperity.dynamics.orbits.harmonic_balance import Balance

STEP = 0.14  # longest step in units of the shortest local time scale
FAR = 1e4  # displacement from which a lane has escaped
FEW = 16  # lanes that are faster in plain numbers


def steps_for(balance: Balance, omega: Array, u: Array) -> int:
    """Runge-Kutta steps per period that resolve the stiffest contact met."""
    stiff = balance.restoring.df(np.maximum(u, 0.0))
    rate = np.sqrt(np.maximum(1.0, np.where(np.isfinite(stiff), stiff, 1.0)))
    return int(np.clip(2 * np.ceil(np.max(np.pi / omega * rate / STEP)), 64, 4096))


def has_left(balance: Balance, u: Array, low: Array) -> Array:
    """Lanes whose motion has left the Taylor well for good."""
    bad = ~np.isfinite(u) | (np.abs(u) > FAR)
    law = balance.restoring.law
    if isinstance(law, TaylorLaw) and np.isfinite(law.rim()):
        bad |= ~(low > law.rim() - 2.0)
    return bad


def advance(
    balance: Balance, u: Array, w: Array, omega: Array, forcing: Array, steps: int
) -> tuple[Array, Array, Array, Array, Array]:
    """Advance one forcing period; returns the state, the extremes of u and the first harmonic."""
    few = u.size <= FEW and balance.restoring.law.scalar and balance.damping == "always"
    us, vs, w = (_path_of_each if few else _path)(balance, u, w, omega, forcing, steps)
    with np.errstate(over="ignore", invalid="ignore"):
        low, high = _turning_values(us, vs * (2.0 * np.pi / omega / steps))
        wave = np.exp(-2j * np.pi / steps * np.arange(steps))
        a1 = 2.0 / steps * np.abs(wave @ us[:-1])
    return us[-1], w, high, low, a1


def _path(balance: Balance, u: Array, w: Array, omega: Array, forcing: Array, steps: int) -> tuple[Array, Array, Array]:
    """Positions and speeds (steps + 1, lanes) of all lanes at once, and w at the end."""
    r, damping = balance.restoring, balance.damping
    rest, twice = 1.0 / r.n_loc, 2.0 * balance.zeta
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


def _path_of_each(
    balance: Balance, u: Array, w: Array, omega: Array, forcing: Array, steps: int
) -> tuple[Array, Array, Array]:
    """The same lane by lane in plain numbers, faster where lanes are few; for damping "always"."""
    r, twice = balance.restoring, 2.0 * balance.zeta
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
                if not -FAR < x < FAR:  # escaped: what is left stays nan
                    break
            else:
                xs.append(x)
                ss.append(y - twice * x)
                ends[lane] = y
        except OverflowError:  # on the way out, too
            pass
        us[: len(xs), lane], vs[: len(ss), lane] = xs, ss
    return us, vs, ends


def _angles(steps: int) -> tuple[Array, Array]:
    """Angles of the forcing at the ends and in the middle of the steps of a period."""
    ends = 2.0 * np.pi / steps * np.arange(steps + 1)
    return ends, ends[:-1] + np.pi / steps


def _turning_values(u: Array, v: Array) -> tuple[Array, Array]:
    """Extremes over the samples and the roots of u' of the cubic Hermite path (v: slope times step)."""
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
