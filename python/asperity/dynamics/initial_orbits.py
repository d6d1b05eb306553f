"""Initial orbits of branches: from rest, and by Newton's method on the period map.

The period map finds loops, and orbits of period 2 that no period doubling leads to. Some starts fill frequency and
state evenly (a low-discrepancy sequence, Roberts 2018), the others lie on free orbits; motions are integrated in
parallel, and each start converges to an orbit near it, stable or not.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass

import numpy as np

from asperity.arrays import Array
from asperity.dynamics.branch import Branch, on_cubic
from asperity.dynamics.continuation import MIN_HARMONICS, Tracing, in_forcing, start, trace
from asperity.dynamics.equation import Equation, primitive
from asperity.dynamics.free import free_orbit, rough_states
from asperity.dynamics.harmonic_balance import Balance, unstack
from asperity.dynamics.motion import has_escaped, path_of, steps_for
from asperity.dynamics.thresholds import resonance_peak
from asperity.errors import ConvergenceError
from asperity.force_law.damping import only_in_contact

_POINTS = 16  # amplitudes on the backbone; a chart of 12 finds the same loops of period 2
_LARGEST = 300.0  # amplitude of free orbits, above which the mass flies all the time
_SMALLEST = 0.05  # of them in the chart
_MOST_LOST = 2.0  # of `Chart.lost` with orbits of period 2: up to 1.1 in 250 random windows
_LINEAR, _FAINT = 0.3, 0.02  # amplitudes up to which, and at which, an orbit from rest starts as the linear response
_SINGULAR = 1e-9  # impedance below which there is no linear response to start from
_NEWTON = 9  # iterations on the period map
_TYPICAL = 2.0  # displacement whose stiffness sets the time step: rough, because the balance corrects the orbits
_MOST_STEPS = 400  # per period
_CLOSE = 1e-4  # Newton step that ends the search, relative to the state
_KNOWN = 1e-2  # distance within which an orbit is identical to a known one, relative to the state
_HARMONICS = 24  # of an orbit found, per forcing period
_ROWS = 8  # of a branch between two points
_CYCLES = 5  # of free orbits in a forcing period
_GOLDEN = {2: 1.3247179572447460, 3: 1.2207440846057596}  # roots of x^(d + 1) = x + 1


def orbit_from_rest(balance: Balance, omega: float, forcing: float, tol: float) -> Array:
    """Coefficients (2 K + 1) of the orbit reached at fixed Omega by raising the forcing from zero."""
    impedance = complex(1.0 - omega * omega, 2.0 * balance.zeta * omega)
    if abs(impedance) < _SINGULAR:
        raise ConvergenceError(f"no orbit found from rest at Omega = {omega:g}, the resonance without damping")
    transfer, equations = 1.0 / impedance, in_forcing(balance, omega)
    first = forcing if forcing * abs(transfer) < _LINEAR else _FAINT / abs(transfer)
    x: Array = np.zeros(2 * MIN_HARMONICS + 1)
    x[1], x[MIN_HARMONICS + 1] = first * transfer.real, -first * transfer.imag
    how = Tracing((0.0, forcing), tol, balance.zeta, 0.5 * forcing)
    point = start(equations, x, first, 1.0, how)
    if first < forcing:
        path = trace(equations, point, how)
        point = path.points[-1]
        if path.end != "window" or point.parameter < 0.5 * forcing:
            raise ConvergenceError(f"no orbit found from rest at Omega = {omega:g}, F^ = {forcing:g}")
    return point.x


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
        peak = None if only_in_contact(damping) else resonance_peak(r, forcing / (2.0 * zeta), damping, rough=True)
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
    """Omega, u and w (3, starts) at periods of even spacing: half of them in contact, half in flight."""
    a, b, c = _even(count, 3)
    omega = 1.0 / (1.0 / window[1] + a * (1.0 / window[0] - 1.0 / window[1]))
    n = equation.restoring.n_loc
    drive = forcing / (2.0 * equation.zeta)
    radius = min(1.5 * drive + 2.0 * forcing, 2.5) * np.sqrt(b)
    u, v = radius * np.cos(2.0 * np.pi * c), radius * np.sin(2.0 * np.pi * c)
    if drive > 1.0 and equation.restoring.contact:
        flying = np.arange(count) % 2 == 0
        v_s = b * np.minimum(2.0 * np.pi / (n * omega), drive)  # the flight lasts up to two periods of the forcing
        s = 2.0 * n * v_s * c
        u, v = np.where(flying, -1.0 - v_s * s + s * s / (2.0 * n), u), np.where(flying, s / n - v_s, v)
    return _lienard(equation, omega, u, v)


def free_starts(equation: Equation, chart: Chart, window: tuple[float, float], order: int, count: int) -> Array:
    """Omega, u and w (3, starts) on free orbits of 1 to 5 cycles in a forcing period, or of odd numbers in two.

    Superharmonic and subharmonic resonances follow these orbits, at a phase that balances the loss.
    """
    found = []
    if chart.amplitude.size:
        (place, phase), size = _even(count, 2), np.log(chart.amplitude)
        amplitude = np.exp(np.interp(place * (size.size - 1), np.arange(size.size), size))
        share = order / (1.0 + order * (np.arange(count) % _CYCLES))  # of the frequency of the free orbit
        rough = share * np.interp(np.log(amplitude), size, chart.frequency)
        for i in np.flatnonzero((rough > window[0]) & (rough < window[1])):
            state = rough_states(equation.restoring, float(amplitude[i]), 2.0 * np.pi * phase[i])
            found.append((share[i] * state[0], *state[1:]))
    lanes = _lienard(equation, *np.array(found).reshape(-1, 3).T)
    return lanes[:, (lanes[0] > window[0]) & (lanes[0] < window[1])]


def _even(count: int, dimensions: int) -> Array:
    """Numbers from 0 to 1 that fill the cube evenly (dimensions, count)."""
    ratio: Array = np.power(_GOLDEN[dimensions], -np.arange(1.0, dimensions + 1.0))
    return (0.5 + np.multiply.outer(ratio, np.arange(1.0, count + 1.0))) % 1.0


def _lienard(equation: Equation, omega: Array, u: Array, v: Array) -> Array:
    return np.array([omega, u, v + 2.0 * equation.zeta * primitive(equation.restoring, equation.damping, u)])


def periodic_orbits(
    equation: Equation, forcing: float, lanes: Array, order: int, known: Sequence[Array]
) -> Iterator[tuple[float, Array]]:
    """Omega and rough coefficients of the orbits of `order` forcing periods near the starts (`lanes`: Omega, u, w).

    Orbits of shorter periods are left out, and the known ones (see `states`), which may grow in the meantime.
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
        with np.errstate(all="ignore"):
            defect, ((a, b), (c, d)) = end[:, 0] - [u, w], (end[:, 1:] - end[:, :1]) / h
            step = np.array([b * defect[1] - (d - 1.0) * defect[0], c * defect[0] - (a - 1.0) * defect[1]])
            step /= (a - 1.0) * (d - 1.0) - b * c
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
