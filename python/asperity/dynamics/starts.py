"""Initial orbits of branches: from rest, and by Newton's method on the period map.

The period map finds loops, and orbits of period 2 that no period doubling leads to. Some starts fill frequency and
state evenly (a low-discrepancy sequence, Roberts 2018), the others lie on free orbits; each converges to an orbit near
it, stable or not.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass

import numpy as np

from asperity.arrays import Array
from asperity.dynamics.equation import Equation, Forcing
from asperity.dynamics.free import free_orbit
from asperity.dynamics.orbits import Orbits
from asperity.dynamics.period_map import TURN, motions
from asperity.dynamics.point import PIECES, Point, Tracing
from asperity.dynamics.thresholds import resonance_peak
from asperity.errors import ConvergenceError
from asperity.force_law.damping import only_in_contact

_POINTS = 12  # amplitudes on the backbone
_LARGEST = 300.0  # amplitude of free orbits, above which the mass flies all the time
_SMALLEST = 0.05  # of them in the chart
_MOST_LOST = 2.0  # of `Chart.lost` with orbits of period 2: up to 1.1 in 250 random windows
_LINEAR, _FAINT = 0.3, (0.02, 1e-3, 1e-5)  # amplitudes up to which, and at which, orbits from rest start as linear
_RAISING = 500.0  # work while the forcing is raised
_SINGULAR = 1e-9  # impedance below which there is no linear response to start from
_NEWTON = 9  # iterations on the period map
_MOST_STEPS = 8e5  # of the integrator in these iterations
_TOGETHER = 8  # starts whose motions are followed at once
_ROUGH = 1e-6  # tolerance of the motions of the search; the orbits are corrected later
_CLOSE = 1e-4  # Newton step that ends the search, relative to the state
_KNOWN = 1e-2  # distance within which an orbit is identical to a known one, relative to the state
_ROWS = 8  # of a branch between two points
_CYCLES = 5  # of free orbits in a forcing period
_GOLDEN = {2: 1.3247179572447460, 3: 1.2207440846057596}  # roots of x^(d + 1) = x + 1


def orbit_from_rest(equation: Equation, omega: float, forcing: float, rtol: float) -> Point:
    """Orbit reached at fixed Omega by raising F^ from zero."""
    impedance = complex(1.0 - omega * omega, 2.0 * equation.zeta * omega)
    if abs(impedance) < _SINGULAR:
        raise ConvergenceError(f"no orbit found from rest at Omega = {omega:g}, the resonance without damping")
    response = np.exp(1j * TURN / PIECES * np.arange(PIECES)) / impedance
    unit = np.column_stack([response.real, -omega * response.imag]).ravel()
    orbits, size = Orbits(equation, Forcing(forcing), rtol=rtol, raised_at=omega), 1.0 / abs(impedance)
    for first in [forcing] * (forcing * size < _LINEAR) + [share / size for share in _FAINT]:
        if first > forcing:
            continue
        with suppress(ConvergenceError):
            point = orbits.at(np.append(first * unit, first), first * size)
            break
    else:
        raise ConvergenceError(f"no orbit found from rest at Omega = {omega:g}")
    if first < forcing:
        path = orbits.trace(point, Tracing((0.0, forcing), 0.5 * forcing, _RAISING))
        point = path.points[-1]
        if path.end != "window" or point.parameter < 0.5 * forcing:
            raise ConvergenceError(f"no orbit found from rest at Omega = {omega:g}, F^ = {forcing:g}")
    return point


@dataclass(frozen=True)
class Chart:
    """Free orbits up to the amplitude that the forcing sustains; the arrays are empty where there is no backbone."""

    amplitude: Array  # of release (orbits,)
    frequency: Array  # over omega_s (orbits,)
    lost: Array  # at twice the frequency, share of the work on the second harmonic that the damping takes (orbits,)
    lowest: float  # frequencies between which the resonance lies
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
    top = _SMALLEST
    with suppress(ConvergenceError):  # the law is too stiff at amplitudes far beyond any resonance
        peak = None if only_in_contact(damping) else resonance_peak(r, Forcing(forcing), zeta, damping, rough=True)
        top = _LARGEST if peak is None else min(peak.u0, _LARGEST)
    amplitude = np.geomspace(min(_SMALLEST, 0.1 * top), top, _POINTS)
    orbits = [free_orbit(r, float(u), damping, rough=True) for u in amplitude]
    frequency, drive, second = np.array([(o.omega, o.drive, o.a2 / o.a1) for o in orbits]).T
    lost = np.divide(zeta * drive, forcing * second, out=np.full(_POINTS, np.inf), where=second != 0)
    return Chart(amplitude, frequency, lost, float(min(1.0, *frequency)), float(max(1.0, *frequency)))


def has_one_resonance(equation: Equation, forcing: float) -> bool:
    """Whether the second-order force, of twice the frequency, is well below the onset of hysteresis.

    At half of the resonance, where the response is 4/3 of the forcing, it is 0.9 |a2| F^^2. The orbits below the
    main resonance are then unique.
    """
    r = equation.restoring
    onset = np.sqrt(6.16 * equation.zeta**3 / max(abs(r.kappa), 1e-12))
    return bool(r.contact and 0.9 * abs(r.a2) * forcing**2 < 0.5 * onset)


def random_starts(equation: Equation, forcing: float, window: tuple[float, float], count: int) -> Array:
    """Omega, u and v (3, starts) at periods of even spacing: half of them in contact, half in flight."""
    a, b, c = _even(count, 3)
    omega = 1.0 / (1.0 / window[1] + a * (1.0 / window[0] - 1.0 / window[1]))
    n = equation.restoring.n_loc
    drive = forcing / (2.0 * equation.zeta)
    radius = min(1.5 * drive + 2.0 * forcing, 2.5) * np.sqrt(b)
    u, v = radius * np.cos(TURN * c), radius * np.sin(TURN * c)
    if drive > 1.0 and equation.restoring.contact:
        flying = np.arange(count) % 2 == 0
        v_s = b * np.minimum(TURN / (n * omega), drive)  # the flight lasts up to two periods of the forcing
        s = 2.0 * n * v_s * c
        u, v = np.where(flying, -1.0 - v_s * s + s * s / (2.0 * n), u), np.where(flying, s / n - v_s, v)
    return np.array([omega, u, v])


def free_starts(equation: Equation, chart: Chart, window: tuple[float, float], order: int, count: int) -> Array:
    """Omega, u and v (3, starts) on free orbits of 1 to 5 cycles in a forcing period, or of odd numbers in two.

    Superharmonic and subharmonic resonances follow these orbits, at a phase that balances the loss.
    """
    if not chart.amplitude.size:
        return np.empty((3, 0))
    (place, phase), size = _even(count, 2), np.log(chart.amplitude)
    log_u = np.interp(place * (size.size - 1), np.arange(size.size), size)
    share = order / (1.0 + order * (np.arange(count) % _CYCLES))  # of the frequency of the free orbit
    omega = share * np.interp(log_u, size, chart.frequency)
    kept = (omega > window[0]) & (omega < window[1])
    omega, rest = omega[kept], np.column_stack([np.exp(log_u), np.zeros(count)])[kept]
    lengths, free = TURN * phase[kept], Equation(equation.restoring, 0.0)
    y = motions(free, rest, omega / share[kept], 0.0, length=lengths, rtol=_ROUGH, derivatives=False).end
    return np.vstack([omega, y.T])


def _even(count: int, dimensions: int) -> Array:
    """Numbers from 0 to 1 that fill the cube evenly (dimensions, count)."""
    ratio: Array = np.power(_GOLDEN[dimensions], -np.arange(1.0, dimensions + 1.0))
    return (0.5 + np.multiply.outer(ratio, np.arange(1.0, count + 1.0))) % 1.0


def periodic_orbits(
    equation: Equation, forcing: Forcing, lanes: Array, order: int, known: Sequence[Array], notes: list[str]
) -> Iterator[tuple[float, Array, float]]:
    """Omega, rough states (order, 2) and amplitude of the orbits of `order` forcing periods near the starts.

    Orbits of shorter periods are left out, and the known ones (see `states`), which may grow in the meantime. A search
    that is too long ends with a note.
    """
    steps, given = 0.0, lanes.shape[1]
    ends: list[Array] = [np.empty((0, 3))]
    parts = max(given // _TOGETHER, 1)
    for i in range(parts):  # each spread over all starts
        if steps < _MOST_STEPS / _NEWTON:
            omega, y = lanes[0, i::parts], lanes[1:, i::parts].T
            m = motions(equation, y, omega, forcing.at(omega), length=TURN * order, rtol=_ROUGH, derivatives=False)
            steps += m.steps
            ends.append(np.column_stack([omega, m.end]))
    tried = np.concatenate(ends)
    omega, y, skipped = tried[:, 0], tried[:, 1:], given - len(tried)
    most = 0.5 * _MOST_STEPS if skipped else _MOST_STEPS  # not for long where there is little hope
    for _ in range(_NEWTON):
        kept = np.isfinite(y).all(axis=1)
        omega, y = omega[kept], y[kept]
        if steps > most or not y.size:
            skipped += len(y)
            break
        size = 0.1 + np.abs(y).sum(axis=1)
        m = motions(equation, y, omega, forcing.at(omega), length=TURN * order, rtol=_ROUGH)
        steps += m.steps
        with np.errstate(all="ignore"):
            (a, b), (c, d) = m.by_end[:, :, :2].transpose(1, 2, 0)
            p, q = (m.end - y).T
            step = np.array([b * q - (d - 1.0) * p, c * p - (a - 1.0) * q]) / ((a - 1.0) * (d - 1.0) - b * c)
        length = np.hypot(*step)
        for i in np.flatnonzero(length < _CLOSE * size):
            start, w = y[i] + step[:, i], float(omega[i])
            both = [start]
            if order > 1:
                both.append(motions(equation, start, w, forcing.at(w), rtol=_ROUGH, derivatives=False).end[0])
                if np.abs(both[1] - start).sum() < _KNOWN * size[i]:
                    continue
            if not any(_near(rows, w, *start) for rows in known):
                yield w, np.array(both), float(0.5 * (m.high[i, 0] - m.low[i, 0]))
        moving = np.isfinite(length) & (length >= _CLOSE * size)
        omega, y, length, size, step = omega[moving], y[moving], length[moving], size[moving], step[:, moving]
        y = y + (step * np.minimum(1.0, 0.3 * size / length)).T
    if skipped:
        notes.append(
            f"the search from {skipped} of {given} starts of period {order} ended after too much work, and orbits may "
            "be missing: give a narrower window"
        )


def states(points: Sequence[Point]) -> Array:
    """Omega, u and v at forcing phase 0 (3, order, rows) along a branch, once for each forcing period."""
    u, v = np.moveaxis(np.array([p.states for p in points]), (0, 1), (2, 1))
    return np.stack([np.broadcast_to([p.parameter for p in points], u.shape), u, v])


def _near(rows: Array, omega: float, u: float, v: float) -> bool:
    """Whether a branch has an orbit with nearly the given state at a frequency."""
    above = rows[0, 0] > omega
    j = np.flatnonzero(above[1:] != above[:-1])
    a, b = rows[..., j], rows[..., j + 1]
    s = (omega - a[0]) / np.where(b[0] == a[0], 1.0, b[0] - a[0])
    gap = np.hypot(a[1] + s * (b[1] - a[1]) - u, a[2] + s * (b[2] - a[2]) - v)
    return bool((gap < _KNOWN * (0.1 + abs(u) + abs(v))).any())
