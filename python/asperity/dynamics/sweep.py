# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

"""Time integration of many oscillators in parallel: frequency sweeps and attractors.

Each forcing, direction or initial state is a lane, integrated period by period
(`asperity.dynamics.time_integration`). The state is passed from one frequency to the next at forcing phase 0, as
soon as the Poincare map has converged.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from asperity.arrays import Array
from asperity.dynamics.equation import Equation, primitive
from asperity.dynamics.forcing import Setting
from asperity.dynamics.law.law import EXTRAPOLATE
from asperity.dynamics.time_integration import advance, has_escaped, steps_for
from asperity.errors import RangeError
from asperity.runtime.display import short_repr

SETTLED, NOT_SETTLED, ESCAPED = "settled", "not settled", "escaped"
_LONGEST = 4  # longest period distinguished from chaos, in forcing periods


@dataclass(frozen=True)
class Sweep:
    """Steady states of a sweep with carried state (arrays of shape (frequencies,), in the order of the sweep).

    Attributes:
        setting: law, damping and forcing.
        direction: "up" or "down".
        Omega: frequencies.
        u_max, u_min, a1: extreme displacements and amplitude at the forcing frequency; NaN after an escape.
        status: "settled", "period k", "not settled" or "escaped" for each point.
        periods: forcing periods integrated at each point.
        tolerance: largest estimated distance from the steady state among the settled points, relative to the orbit.
        valid: False where a Taylor law passes u = -1 or the motion has escaped.

    Examples:
        >>> oscillator = asp.ContactOscillator(asp.PowerLaw(1.5), zeta=0.1)
        >>> up, down = oscillator.sweep(0.05, (0.8, 1.2), points=3)
        >>> up.direction, up.status, up.u_max.round(3)
        ('up', ('settled', 'settled', 'settled'), array([0.126, 0.245, 0.099]))
    """

    setting: Setting
    direction: str
    Omega: Array
    u_max: Array
    u_min: Array
    a1: Array
    status: tuple[str, ...]
    periods: Array
    tolerance: float
    valid: Array

    __repr__ = short_repr

    def rows(self) -> Iterator[dict[str, Any]]:
        """Yield the rows of response.csv, without escaped points, which have no amplitude."""
        s = self.setting
        for i, status in enumerate(self.status):
            if status != ESCAPED:
                yield {
                    "model": s.model,
                    "F_hat": s.F_hat,
                    "zeta": s.zeta,
                    "Omega": float(self.Omega[i]),
                    "u_max": float(self.u_max[i]),
                    "u_min": float(self.u_min[i]),
                    "a1": float(self.a1[i]),
                    "stable": status != NOT_SETTLED,
                    "branch": f"sweep-{self.direction}",
                    "contact_loss": bool(self.u_min[i] < -1.0),
                    "phase": np.nan,
                }


@dataclass(frozen=True)
class Attractor:
    """Steady motion, with the share of the initial states that lead to it.

    Attributes:
        setting: law, damping and forcing.
        Omega: frequency of the forcing.
        period: in forcing periods; 0 if the motion did not repeat (long period, chaos or slow settling).
        u_max, u_min: extreme displacements.
        share: share of the initial states that lead to it.
        state: (u, v) at forcing phase 0.
        tolerance: allowed distance from the steady state, relative to the orbit.
        valid: False if a Taylor law passes u = -1.

    Examples:
        >>> oscillator = asp.ContactOscillator(asp.PowerLaw(1.5), zeta=0.1)
        >>> (motion,) = oscillator.attractors(0.9, 0.02, starts=2)
        >>> motion.period, motion.share, round(motion.u_max, 3)
        (1, 1.0, 0.076)
    """

    setting: Setting
    Omega: float
    period: int
    u_max: float
    u_min: float
    share: float
    state: tuple[float, float]
    tolerance: float
    valid: bool

    __repr__ = short_repr


@dataclass
class _Lanes:
    """States (u, w) of all lanes, and whether each has escaped."""

    u: Array
    w: Array
    escaped: Array


def sweep(
    equation: Equation,
    settings: list[Setting],
    omega: Array,
    *,
    directions: tuple[str, ...],
    tol: float,
    max_periods: int | None,
    steps: int | None,
) -> tuple[Sweep, ...]:
    """Sweep all forcings and directions in parallel.

    Args:
        equation: the oscillator.
        settings: one per forcing.
        omega: rising frequencies (frequencies,).
        directions: "up", "down" or both.
        tol: largest distance from the steady state, relative to the orbit.
        max_periods: largest number of forcing periods per frequency; default 4/zeta, between 100 and 20000.
        steps: Runge-Kutta steps per period; default from the largest stiffness reached.

    Returns:
        One `Sweep` per forcing and direction.

    Raises:
        RangeError: the motion leaves a table.
    """
    lanes = [(s, d) for s in settings for d in directions]
    forcing = np.array([s.F_hat for s, _ in lanes])
    path = np.array([omega if d == "up" else omega[::-1] for _, d in lanes])
    state = _Lanes(np.zeros(len(lanes)), np.zeros(len(lanes)), np.zeros(len(lanes), bool))
    limit = max_periods or int(np.clip(4.0 / equation.zeta, 100, 20000))
    columns = [_settle(equation, state, path[:, j], forcing, tol, limit, steps) for j in range(omega.size)]
    out = []
    for i, (setting, direction) in enumerate(lanes):
        u_max, u_min, a1, residual = (np.array([c[k][i] for c in columns]) for k in range(4))
        kinds = [int(c[4][i]) for c in columns]
        status = tuple(_name(k) for k in kinds)
        settled = np.array([k > 0 for k in kinds])
        valid = np.ones(omega.size, bool)
        if not equation.restoring.contact:
            valid = (u_min >= -1.0) & np.array([s != ESCAPED for s in status])
        out.append(
            Sweep(
                setting,
                direction,
                path[i],
                u_max,
                u_min,
                a1,
                status,
                np.array([int(c[5][i]) for c in columns]),
                float(residual[settled].max()) if settled.any() else np.inf,
                valid,
            )
        )
        low, high = equation.restoring.u_range
        seen = np.isfinite(u_max)
        if seen.any() and (u_max[seen].max() > high or u_min[seen].min() < low):
            worst = float(u_max[seen].max())
            raise RangeError(
                f"the sweep reaches u = {worst:.6g}, beyond the law (known up to {high:.6g}): lower the "
                f"forcing, compute the curve further, or {EXTRAPOLATE}"
            )
    return tuple(out)


def attractors(
    equation: Equation,
    omega: Array,
    setting: Setting,
    *,
    starts: int,
    spread: float,
    tol: float,
    max_periods: int | None,
) -> tuple[Attractor, ...]:
    """Find the steady motions reached from a grid of initial states at each frequency.

    Args:
        equation: the oscillator.
        omega: frequencies, shape (frequencies,).
        setting: law, damping and forcing.
        starts: initial states per side of a square grid in (u, v).
        spread: half-width of that grid.
        tol: as in `sweep`.
        max_periods: as in `sweep`.
    """
    axis = np.linspace(-spread, spread, starts)
    grid_u, grid_v = np.meshgrid(axis, axis)
    per = grid_u.size
    lanes_omega = np.repeat(omega, per)
    u, v = np.tile(grid_u.ravel(), omega.size), np.tile(grid_v.ravel(), omega.size)
    state = _Lanes(
        u, v + 2.0 * equation.zeta * primitive(equation.restoring, equation.damping, u), np.zeros(u.size, bool)
    )
    limit = max_periods or int(np.clip(4.0 / equation.zeta, 100, 20000))
    u_max, u_min, a1, _, kind, _ = _settle(
        equation, state, lanes_omega, np.full(u.size, setting.F_hat), tol, limit, None
    )
    found: list[Attractor] = []
    for block, om in enumerate(omega):
        rows = np.arange(block * per, (block + 1) * per)
        rows = rows[~state.escaped[rows]]
        order = sorted(rows.tolist(), key=lambda i: int(kind[i] == 0))  # unsettled motions last: they may join a group
        groups: list[list[int]] = []
        for i in order:
            for g in groups:
                j = g[0]
                size = max(u_max[j] - u_min[j], 1e-12)
                same = max(abs(u_max[i] - u_max[j]), abs(u_min[i] - u_min[j]), abs(a1[i] - a1[j])) < 0.01 * size
                if (same and kind[i] in (kind[j], 0)) or kind[i] == kind[j] == 0:
                    g.append(i)
                    break
            else:
                groups.append([i])
        for g in groups:
            j = g[0]
            loss = equation.loss(float(state.u[j]))
            found.append(
                Attractor(
                    setting,
                    float(om),
                    max(int(kind[j]), 0),
                    float(u_max[j]),
                    float(u_min[j]),
                    len(g) / per,
                    (float(state.u[j]), float(state.w[j] - loss)),
                    tol,
                    equation.restoring.contact or float(u_min[j]) >= -1.0,
                )
            )
    return tuple(found)


def _name(kind: int) -> str:
    if kind < 0:
        return ESCAPED
    return NOT_SETTLED if kind == 0 else SETTLED if kind == 1 else f"period {kind}"


def _settle(
    equation: Equation, state: _Lanes, omega: Array, forcing: Array, tol: float, limit: int, steps: int | None
) -> tuple[Array, ...]:
    """Integrate every lane to its steady state.

    The change of the Poincare map over a period, divided by ``1 - exp(-2 pi zeta / Omega)``, estimates the remaining
    distance from the steady state. Slow convergence is accelerated by extrapolating the map, which is nearly affine
    there (Aitken), if the extrapolated state is close to the motion.

    Returns:
        u_max, u_min, a1, residual, kind (period, 0 not settled, -1 escaped) and periods, shape (lanes,) each.
    """
    lanes = omega.size
    shrink = 1.0 - np.exp(-2.0 * np.pi * equation.zeta / omega)
    kind = np.where(state.escaped, -1, 0)
    residual = np.full(lanes, np.inf)
    periods = np.zeros(lanes, int)
    highest, lowest, a1 = np.full((_LONGEST, lanes), np.nan), np.full((_LONGEST, lanes), np.nan), np.zeros(lanes)
    # perturb by more than the tolerance: a start exactly on an unstable orbit must not look settled
    state.u = state.u + 10.0 * tol * np.hypot(state.u, state.w)
    history = [np.stack([state.u, state.w], axis=1)]
    count = steps or steps_for(equation, omega, state.u)
    hold = 0
    active = np.flatnonzero(kind == 0)
    for period in range(limit):
        if active.size == 0:
            break
        u, w = state.u[active], state.w[active]
        u, w, high, low, first = advance(equation, u, w, omega[active], forcing[active], count)
        gone = has_escaped(equation, u, low)
        state.escaped[active[gone]] = True
        kind[active[gone]] = -1
        state.u[active], state.w[active] = u, w
        periods[active] += 1
        highest[period % _LONGEST, active], lowest[period % _LONGEST, active] = high, low
        a1[active] = first
        history.append(np.stack([state.u, state.w], axis=1))
        history = history[-(2 * _LONGEST + 1) :]
        if steps is None:
            count = max(count, steps_for(equation, omega[active], np.where(gone, 0.0, high)))
        hold += 1
        if hold < 3:
            active = np.flatnonzero(kind == 0)
            continue
        size = 0.5 * (np.nanmax(highest[:, active], axis=0) - np.nanmin(lowest[:, active], axis=0)) + 1e-12
        repeats, gap = _periods(history, active, shrink[active], size, tol)
        settled = (repeats > 0) & ~gone
        kind[active[settled]] = repeats[settled]
        residual[active[settled]] = gap[settled]
        active = np.flatnonzero(kind == 0)
        if hold >= 8 and active.size:
            jump = _extrapolate(history, active)
            size = 0.5 * (np.nanmax(highest[:, active], axis=0) - np.nanmin(lowest[:, active], axis=0))
            near = np.abs(jump).max(axis=1) < 0.05 * size
            if near.any():
                state.u[active[near]] += jump[near, 0]
                state.w[active[near]] += jump[near, 1]
                history = [np.stack([state.u, state.w], axis=1)]
                hold = 0
    alive = kind >= 0
    u_max, u_min = (_extreme(record, best, kind, periods) for record, best in ((highest, np.fmax), (lowest, np.fmin)))
    return u_max, u_min, np.where(alive, a1, np.nan), residual, kind, periods


def _periods(history: list[Array], active: Array, shrink: Array, size: Array, tol: float) -> tuple[Array, Array]:
    """Return the period of each active lane (0 if it does not repeat), and its estimated distance from the orbit.

    Args:
        history: states of all lanes at the ends of the last periods (lanes, 2) each.
        active: numbers of the active lanes.
        shrink: 1 - exp(-2 pi zeta/Omega) of the active lanes.
        size: amplitude of the active lanes.
        tol: as in `sweep`.
    """
    found, distance = np.zeros(active.size, int), np.full(active.size, np.inf)
    gaps: dict[int, Array] = {}
    for m in range(1, _LONGEST + 1):
        if (len(history) < 2 * m + 1 and m > 1) or len(history) < m + 2:
            break
        gap = np.abs(history[-1][active] - history[-1 - m][active]).max(axis=1) / shrink / size / m
        before = np.abs(history[-2][active] - history[-2 - m][active]).max(axis=1) / shrink / size / m
        done = (np.maximum(gap, before) < tol) & (found == 0)
        gaps[m] = gap * m
        for divisor in (d for d in gaps if m % d == 0 and d < m):
            # a decaying spiral also comes close after a few periods, but not by so much
            done &= gaps[m] < 0.05 * shrink * gaps[divisor]
        found[done], distance[done] = m, gap[done]
    return found, distance


def _extreme(record: Array, best: np.ufunc, kind: Array, periods: Array) -> Array:
    """Return the extreme displacement of each lane over its period, NaN after an escape.

    Args:
        record: extremes of the last periods (_LONGEST, lanes).
        best: greatest or least of two values.
        kind, periods: as `_settle` returns them.
    """
    alive = kind >= 0
    out: Array = np.full(kind.size, np.nan)
    if alive.any():
        newest = record[(periods[alive] - 1) % _LONGEST, np.flatnonzero(alive)]
        whole = best.reduce(record[:, alive], axis=0)
        out[alive] = np.where(kind[alive] == 1, newest, whole)
    return out


def _extrapolate(history: list[Array], active: Array) -> Array:
    """Return the step from the state to the fixed point of the affine map through the last Poincare points."""
    y = np.stack([h[active] for h in history[-5:]], axis=0)
    d = np.diff(y, axis=0)
    # d[k+1] = M d[k]: fit the 2 x 2 matrix M to three pairs, then sum the geometric series
    a, b = np.moveaxis(d[:-1], 0, -1), np.moveaxis(d[1:], 0, -1)
    gram = a @ np.swapaxes(a, 1, 2)
    det = gram[:, 0, 0] * gram[:, 1, 1] - gram[:, 0, 1] * gram[:, 1, 0]
    usable = det > 1e-12 * (gram[:, 0, 0] + gram[:, 1, 1]) ** 2
    out = np.full((active.size, 2), np.inf)
    if usable.any():
        m = (b @ np.swapaxes(a, 1, 2))[usable] @ np.linalg.inv(gram[usable])
        radius = np.abs(np.linalg.eigvals(m)).max(axis=1)
        rest = np.eye(2) - m
        rest[radius >= 1.0] = np.eye(2)
        step = np.linalg.solve(rest, (m @ d[-1][usable][..., None]))[..., 0]
        step[radius >= 1.0] = np.inf
        out[usable] = step
    return out
