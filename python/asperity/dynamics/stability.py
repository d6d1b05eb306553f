"""Extrema and Floquet multipliers of many periodic orbits at once.

The perturbation of an orbit obeys, in Lienard's variable (see `asperity.dynamics.equation`),

    delta' = w - 2 zeta g(u) delta,    w' = -f'(u) delta,

whose coefficients have jumps but no delta functions at contact loss. The monodromy matrix is a product of
fourth-order Runge-Kutta steps. Its determinant must be ``exp(-2 zeta INT g dtau)`` (Liouville), for "always"
exp(-4 pi zeta p / Omega); the deviation measures the accuracy at each point.
"""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np

from asperity.arrays import Array
from asperity.dynamics.equation import rate
from asperity.dynamics.harmonic_balance import Balance, samples

_SAMPLES, _SAMPLES_LOSS = 512, 1024  # at first, without and with contact loss; doubled up to the largest number
_MAX_SAMPLES = 65536
_TOGETHER = 2**21  # samples of all orbits processed at once: 16 MiB per array
_DET_RTOL = 1e-6  # agreement of the determinant with Liouville's at which they are enough
NEGLIGIBLE = 1e-200  # determinant of a motion that has decayed completely
_HUGE = 300.0  # logarithm of a multiplier beyond which only its sign is kept


@dataclass(frozen=True)
class Floquet:
    """Floquet data of a batch of orbits (arrays of shape (orbits,))."""

    trace: Array  # of the monodromy matrix over one period of the orbit
    determinant: Array
    radius: Array  # largest modulus of a multiplier
    error: Array  # relative deviation of the computed determinant from Liouville's; 1 where the steps are too long

    def insert(self, at: list[int], other: Floquet) -> Floquet:
        """Batch with the orbits of another one inserted before the positions `at`."""
        return Floquet(*(np.insert(getattr(self, f.name), at, getattr(other, f.name)) for f in fields(self)))

    @property
    def stable(self) -> Array:
        """Whether all multipliers lie in the unit circle (up to round-off)."""
        return self.radius <= 1.0 + 1e-7

    @property
    def fold(self) -> Array:
        """Characteristic polynomial at +1; it vanishes at a fold."""
        return 1.0 - self.trace + self.determinant

    @property
    def flip(self) -> Array:
        """Characteristic polynomial at -1; it vanishes at a period doubling."""
        return 1.0 + self.trace + self.determinant


def state_at_phase_zero(c: Array, omega: float, order: int = 1) -> tuple[float, float]:
    """(u, v) at forcing phase 0 of an orbit with complex coefficients `c` (K + 1,)."""
    k = np.arange(c.size)
    return float(c.sum().real), float((1j * k * c).sum().real) * omega / order


def extrema(c: Array) -> tuple[Array, Array]:
    """Smallest and largest value of each orbit, from the roots of u' (shape (orbits,) each)."""
    u = _densely(c)
    return _turn(c, u, 1.0)[1], _turn(c, u, -1.0)[1]


def rise(c: Array, t: Array) -> Array:
    """Rate of the largest value of each orbit `c` along the change `t` (both as in `stack`)."""
    theta, _ = _turn(c, _densely(c), -1.0)
    return (t * np.exp(1j * theta[:, None] * np.arange(t.shape[1]))).sum(1).real


def _densely(c: Array) -> Array:
    return samples(c, max(128, 1 << int(np.ceil(np.log2(8 * max(c.shape[1] - 1, 1))))))


def _turn(c: Array, u: Array, sign: float) -> tuple[Array, Array]:
    """Angle and value of the lowest (sign 1) or highest (-1) point of each orbit, sampled as `u`."""
    points = u.shape[1]
    k = np.arange(c.shape[1])
    first, second = 1j * k * c, -(k * k) * c
    j = (sign * u).argmin(axis=1)
    best = u[np.arange(u.shape[0]), j]
    theta = 2.0 * np.pi / points * j
    for _ in range(5):
        wave = np.exp(1j * theta[:, None] * k)
        slope, bend = (first * wave).sum(1).real, (second * wave).sum(1).real
        step = slope / np.where(sign * bend > 1e-14, bend, np.inf)
        theta = theta - np.clip(step, -2.0 * np.pi / points, 2.0 * np.pi / points)
    value = (c * np.exp(1j * theta[:, None] * k)).sum(1).real
    return theta, sign * np.minimum(sign * value, sign * best)


def floquet(balance: Balance, c: Array, omega: Array) -> Floquet:
    """Compute the Floquet multipliers of the orbits with coefficients `c` (see `stack`) at frequencies `omega`.

    The samples per period are doubled until the determinant agrees with Liouville's.
    """
    count = c.shape[1] - 1
    least = 1 << int(np.ceil(np.log2(8 * max(count, 1))))
    # the determinant is insensitive to the kink of the stiffness: contact loss needs more samples anyway
    kinked = np.full(omega.size, balance.restoring.contact) & (np.abs(c).sum(axis=1) > 1.0)
    result = Floquet(*(np.empty(omega.size) for _ in range(4)))
    for group, samples_wanted in ((~kinked, _SAMPLES), (kinked, _SAMPLES_LOSS)):
        rows, n = np.flatnonzero(group), max(samples_wanted, least)
        while rows.size and n <= _MAX_SAMPLES:
            for some in np.array_split(rows, -(-rows.size * n // _TOGETHER)):
                part = _floquet(balance, c[some], omega[some], n)
                for f in fields(part):
                    getattr(result, f.name)[some] = getattr(part, f.name)
            rows = rows[~(result.error[rows] < _DET_RTOL)]
            n *= 2
    return result


def _floquet(balance: Balance, c: Array, omega: Array, points: int) -> Floquet:
    u = samples(c, points)
    h = 4.0 * np.pi * balance.order / omega / points  # a step spans two sample intervals
    k = _ends_and_middle(balance.restoring.df(u) * h[:, None] ** 2)  # time is scaled by the step
    d = 2.0 * balance.zeta * h[:, None]
    if balance.damping != "always":
        d = d * rate(balance.restoring, balance.damping, u)
    if balance.restoring.contact:
        k = _averaged(balance, u, h, *k)
    resolved = np.max([np.abs(x).max(axis=1) for x in k], axis=0) < 1.0
    m, log = _multiplied(_runge_kutta(*k, *_ends_and_middle(d)))
    decay = -0.5 * points * d.mean(axis=1)
    # cancellation in the determinant of a strongly unstable orbit is not an error of the steps
    expected, found = np.exp(decay - 2.0 * log), m[0] * m[3] - m[1] * m[2]
    noise = 1e-14 * points * (np.abs(m[0] * m[3]) + np.abs(m[1] * m[2]))
    error = np.maximum(np.abs(found - expected) - noise, 0.0) / np.maximum(expected, NEGLIGIBLE)
    error = np.where(resolved, np.minimum(error, 1.0), 1.0)
    trace, determinant = (m[0] + m[3]) * np.exp(np.clip(log, -_HUGE, _HUGE)), np.exp(decay)
    root = np.sqrt((0.25 * trace * trace - determinant).astype(complex))
    radius = np.maximum(np.abs(0.5 * trace + root), np.abs(0.5 * trace - root))
    return Floquet(trace, determinant, radius, error)


def _multiplied(m: tuple[Array, ...]) -> tuple[tuple[Array, ...], Array]:
    """Products of the matrices of all steps, scaled to a largest entry of 1, and the logarithms of scale."""
    log = np.zeros(m[0].shape)
    while m[0].shape[1] > 1:  # product tree, later factors on the left
        a, b = tuple(x[:, 1::2] for x in m), tuple(x[:, ::2] for x in m)
        m = (a[0] * b[0] + a[1] * b[2], a[0] * b[1] + a[1] * b[3], a[2] * b[0] + a[3] * b[2], a[2] * b[1] + a[3] * b[3])
        size = np.max(np.abs(m), axis=0)
        m = tuple(x / size for x in m)
        log = log[:, 1::2] + log[:, ::2] + np.log(size)
    return tuple(x[:, 0] for x in m), log[:, 0]


def _ends_and_middle(x: Array) -> tuple[Array, ...]:
    """Samples at start, middle and end of each step; a constant stays one number per orbit."""
    if x.shape[1] == 1:
        return x, x, x
    start = np.ascontiguousarray(x[:, ::2])
    return start, np.ascontiguousarray(x[:, 1::2]), np.roll(start, -1, axis=1)


def _averaged(balance: Balance, u: Array, h: Array, *k: Array) -> tuple[Array, ...]:
    """Replace the stiffness by its mean over each step that crosses contact loss or the onset of yield.

    The mean is the divided difference of the force: exact at the jump of a linear contact, and finite for a law
    with n < 1, whose stiffness is infinite at contact loss.
    """
    a, _, b = _ends_and_middle(u)
    gap = b - a
    low, high, kink = np.minimum(a, b), np.maximum(a, b), balance.restoring.kink
    crossing = (((1.0 + low < high - low) & (high > -1.0)) | ((low < kink) & (high > kink))) & (gap != 0)
    rows = np.nonzero(crossing)
    pull = balance.restoring.pull
    mean = (pull(b[rows])[0] - pull(a[rows])[0]) / gap[rows] * h[rows[0]] ** 2
    for values in (out := [values.copy() for values in k]):
        values[rows] = mean
    return tuple(out)


def _runge_kutta(k0: Array, km: Array, k1: Array, d0: Array, dm: Array, d1: Array) -> tuple[Array, ...]:
    """Transition matrices (m11, m12, m21, m22) of one step for delta' = w - d delta, w' = -k delta."""

    def slope(k: Array, d: Array, y: tuple[Array, ...]) -> tuple[Array, ...]:
        return (y[2] - d * y[0], y[3] - d * y[1], k * y[0], k * y[1])

    def moved(y: tuple[Array, ...], factor: float) -> tuple[Array, ...]:
        return (1 + factor * y[0], factor * y[1], factor * y[2], 1 + factor * y[3])

    k0, km, k1 = -k0, -km, -k1
    one, zero = np.ones(()), np.zeros(())
    s1 = slope(k0, d0, (one, zero, zero, one))
    s2 = slope(km, dm, moved(s1, 0.5))
    s3 = slope(km, dm, moved(s2, 0.5))
    s4 = slope(k1, d1, moved(s3, 1.0))
    total = tuple((a + 2 * (b + c) + d) / 6 for a, b, c, d in zip(s1, s2, s3, s4, strict=True))
    return moved(total, 1.0)
