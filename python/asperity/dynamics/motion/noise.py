# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

"""Motion under band-limited noise: power spectral density, and the share of time out of contact.

The force is a sum of cosines of one amplitude with random phases (Shinozuka & Deodatis, Appl. Mech. Rev. 44 (1991)
191), periodic over the record. The record begins after the start from rest has decayed, so the motion is periodic too
unless it is chaotic, and its spectrum needs no window: in the linear limit each line is exactly |H|^2 times that of
the force. Time integration is a Runge-Kutta method of order 4 with steps that end at each separation and landing.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from math import sqrt
from typing import Any

import numpy as np
from scipy.fft import next_fast_len

from asperity.arrays import Array
from asperity.dynamics.forcing import Setting
from asperity.dynamics.law.damping import in_flight, rate
from asperity.dynamics.law.law import EXTRAPOLATE
from asperity.dynamics.law.loop_damping import LoopDamping
from asperity.dynamics.motion.runge_kutta import ESCAPE, STEP
from asperity.dynamics.orbits.harmonic_balance import Balance
from asperity.errors import InputError, RangeError
from asperity.runtime.display import short_repr

_LINES = 4  # of the spectrum within zeta
_FEWEST = 20  # lines of a band: with fewer the force is no noise
_MOST_STEPS = 2e7  # of all records, one to two minutes
_TOGETHER = 2  # neighbouring lines averaged
_DECAY = 10.0  # times 1/zeta from rest to the record
_PER_WAVE = 24  # steps per period of the fastest part of the force
_STIFFER = 1.2  # growth of the natural frequency at the greatest displacement above which a record is repeated
_IN_CONTACT = -1.0 + 1e-12  # stages of the step to a separation may lie just beyond it
_CLOSE = 1e-12  # distance from contact loss at which an event is located


@dataclass(frozen=True)
class RandomResponse:
    """Stationary motion under band-limited noise.

    Attributes:
        setting: law, damping and forcing; F_hat is the rms of F^.
        band: lowest and highest Omega of the force.
        Omega: frequencies over omega_s, shape (lines,).
        psd: one-sided power spectral density of u; its integral over Omega is the mean square about the mean (lines,).
        psd_force: the same of F^ (lines,).
        psd_linear: the same of u with the tangent stiffness, |H|^2 psd_force (lines,).
        mean: of u.
        rms: of u about its mean.
        scatter: standard error of `rms` by the scatter between the records.
        u_max, u_min: extreme displacements.
        lost: share of time out of contact.
        separations: number of separations per period of small vibration.
        records: number of records.
        periods: length of a record in periods of small vibration.

    Examples:
        A linear contact in contact: the rms of a wide band is sqrt(pi S/(4 zeta)) with the density S of the force.

        >>> oscillator = asp.ContactOscillator(asp.PowerLaw(1.0), zeta=0.1)
        >>> motion = oscillator.random(0.05, (0.05, 8.0), records=2)
        >>> wide = np.sqrt(np.pi * 0.05**2 / 7.95 / 0.4)
        >>> motion.lost, bool(abs(motion.rms / wide - 1) < 0.05)
        (0.0, True)
    """

    setting: Setting
    band: tuple[float, float]
    Omega: Array
    psd: Array
    psd_force: Array
    psd_linear: Array
    mean: float
    rms: float
    scatter: float
    u_max: float
    u_min: float
    lost: float
    separations: float
    records: int
    periods: float

    __repr__ = short_repr

    def rows(self) -> Iterator[dict[str, Any]]:
        """Yield the rows of random.csv, without units."""
        columns = {"Omega": self.Omega, "psd_u": self.psd, "psd_u_linear": self.psd_linear, "psd_F_hat": self.psd_force}
        for values in zip(*columns.values(), strict=True):
            row = dict(zip(columns, (float(x) for x in values), strict=True))
            yield {"model": self.setting.model, "F_hat_rms": self.setting.F_hat, **row}

    def summary(self) -> dict[str, Any]:
        """Return the numbers of thresholds.json."""
        names = ("mean", "rms", "scatter", "u_max", "u_min", "lost", "separations", "records", "periods")
        return {"F_hat_rms": self.setting.F_hat, "band": list(self.band)} | {n: getattr(self, n) for n in names}


@dataclass(frozen=True, eq=False)
class Noise:
    """Periodic force with a flat spectrum in a band.

    Attributes:
        spacing: distance of its lines in Omega; its period is 2 pi over this.
        lines: numbers of the lines, shape (m,).
        phases: of the lines, shape (m,).
        amplitude: of each line.
    """

    spacing: float
    lines: Array
    phases: Array
    amplitude: float

    @classmethod
    def of(cls, rms: float, band: tuple[float, float], spacing: float, generator: np.random.Generator) -> Noise:
        """Draw the phases of a force of a given rms."""
        lines = np.arange(max(1, round(band[0] / spacing)), max(1, round(band[1] / spacing)) + 1)
        return cls(spacing, lines, generator.uniform(0.0, 2.0 * np.pi, lines.size), rms * sqrt(2.0 / lines.size))

    def sampled(self, count: int) -> Array:
        """Return the force at `count` equidistant times of its period."""
        spectrum = np.zeros(count // 2 + 1, complex)
        spectrum[self.lines] = 0.5 * count * self.amplitude * np.exp(1j * self.phases)
        return np.fft.irfft(spectrum, count)

    def at(self, time: float) -> float:
        """Return the force at any time (1/omega_s)."""
        return self.amplitude * float(np.cos(self.spacing * time * self.lines + self.phases).sum())


@dataclass(frozen=True, eq=False)
class Record:
    """Motion over one period of the noise: u at equidistant times, time in flight, number of separations."""

    u: Array
    lost: float
    separations: int
    steps: int


def random_response(
    balance: Balance, setting: Setting, band: tuple[float, float], *, records: int, seed: int
) -> RandomResponse:
    """Integrate records of the motion under noise.

    Args:
        balance: the oscillator.
        setting: law, damping and forcing; F_hat is the rms.
        band: lowest and highest Omega of the force.
        records: number of records.
        seed: of the phases.

    Raises:
        InputError: the band has too few lines, or the records too many steps.
        RangeError: the motion leaves the law.
    """
    zeta, generator = balance.zeta, np.random.default_rng(seed)
    _check_band(band, zeta, records)
    spacing = zeta / _LINES
    found: list[Record] = []
    stiffest = 1.0  # natural frequency at the greatest displacement
    for _ in range(records):
        noise = Noise.of(setting.F_hat, band, spacing, generator)
        while True:
            record = integrate_noise(balance, noise, _step(band, stiffest))
            rate = sqrt(max(1.0, float(balance.restoring.df(np.array([record.u.max()]))[0])))
            if rate <= _STIFFER * stiffest:
                break
            stiffest = rate
        balance.restoring.check_range(float(record.u.min()), float(record.u.max()))
        found.append(record)
    count = max(_TOGETHER, int(max(2.0 * band[1], 3.0) / spacing) // _TOGETHER * _TOGETHER)
    u_psd = np.mean([_density(r.u, spacing, count) for r in found], axis=0)
    line = np.arange(1, count + 1)
    omega = spacing * line
    force = np.where(np.isin(line, noise.lines), 0.5 * noise.amplitude**2 / spacing, 0.0)
    linear = force / ((1.0 - omega**2) ** 2 + (2.0 * zeta * omega) ** 2)
    omega, u_psd, force, linear = (x.reshape(-1, _TOGETHER).mean(1) for x in (omega, u_psd, force, linear))
    rms = np.array([float(r.u.std()) for r in found])
    period = 2.0 * np.pi / spacing
    return RandomResponse(
        setting, band, omega, u_psd, force, linear,
        mean=float(np.mean([r.u.mean() for r in found])),
        rms=float(np.sqrt(np.mean(rms**2))),
        scatter=float(rms.std(ddof=1) / sqrt(records)) if records > 1 else np.nan,
        u_max=max(float(r.u.max()) for r in found),
        u_min=min(float(r.u.min()) for r in found),
        lost=float(np.mean([r.lost for r in found])) / period,
        separations=float(np.mean([r.separations for r in found])) * 2.0 * np.pi / period,
        records=records,
        periods=period / (2.0 * np.pi),
    )  # fmt: skip


def _step(band: tuple[float, float], stiffest: float = 1.0) -> float:
    """Return the longest time step for a force in a band and a greatest natural frequency."""
    return min(STEP / stiffest, 2.0 * np.pi / band[1] / _PER_WAVE)


def _check_band(band: tuple[float, float], zeta: float, records: int) -> None:
    """Raise `InputError` unless a band has enough lines and its records, without those repeated, few enough steps."""
    spacing = zeta / _LINES
    narrowest = _FEWEST * spacing
    if band[1] - band[0] < narrowest * (1.0 - 1e-9):
        raise InputError(
            f"band = {list(band)} is too narrow for zeta = {zeta:g}: the force needs {_FEWEST} lines, {spacing:g} "
            f"apart, so the band must be at least {narrowest:g} wide; give a wider band or a smaller zeta"
        )
    steps = records * 2.0 * np.pi / spacing / _step(band)
    if steps > _MOST_STEPS:
        raise InputError(
            f"band = {list(band)} with zeta = {zeta:g} takes too long: {records} records have {steps:.2g} time steps, "
            f"and at most {_MOST_STEPS:g} are legal; give fewer records, a band that ends lower, or a larger zeta"
        )


def _density(u: Array, spacing: float, count: int) -> Array:
    """Return the one-sided power spectral density of a record at its first `count` lines, zero beyond its last one."""
    lines = np.abs(np.fft.rfft(u)[1 : count + 1]) * (2.0 / u.size)
    return np.pad(0.5 * lines**2 / spacing, (0, count - lines.size))


def integrate_noise(balance: Balance, noise: Noise, step: float) -> Record:
    """Integrate the motion over one period of the noise, from rest long before it.

    Args:
        balance: the oscillator.
        noise: the force.
        step: longest time step (1/omega_s).

    Raises:
        RangeError: the motion leaves any law.
    """
    period = 2.0 * np.pi / noise.spacing
    steps = next_fast_len(max(int(np.ceil(period / step)), 4 * int(noise.lines[-1])), real=True)
    h = period / steps
    force: list[float] = [float(x) for x in noise.sampled(2 * steps)]
    motion = _Motion(balance, noise)
    start = -min(steps, int(np.ceil(_DECAY / balance.zeta / h)))
    u, v, path = 0.0, 0.0, []
    for j in range(start, steps):
        if j == 0:
            motion.lost, motion.separations = 0.0, 0
        if j >= 0:
            path.append(u)
        i = 2 * (j % steps)
        u, v = motion.advance(u, v, j * h, h, (force[i], force[i + 1], force[(i + 2) % (2 * steps)]))
        if not -ESCAPE < u < ESCAPE:
            raise RangeError(f"the motion under noise leaves the law near u = {ESCAPE:g}: {EXTRAPOLATE}, or less force")
    return Record(np.array(path), motion.lost, motion.separations, steps)


class _Motion:
    """Steps in time that end at each separation and landing; sums up flight.

    Attributes:
        lost: time out of contact so far.
        separations: separations so far.
    """

    def __init__(self, balance: Balance, noise: Noise) -> None:
        r = balance.restoring
        self.noise = noise
        self._at, self._z_s, self._scale = r.law.at, r.z_s, 1.0 / r.scale
        self._rest, self._loss = 1.0 / r.n_loc, 2.0 * balance.zeta
        self._share = r.n_loc if balance.damping == "hunt-crossley" else 0.0
        self._loops = balance.damping if isinstance(balance.damping, LoopDamping) else None
        self._restoring = r
        self._flight_loss = self._loss if in_flight(balance.damping) else 0.0
        self.lost, self.separations = 0.0, 0

    def advance(
        self, u: float, v: float, time: float, h: float, force: tuple[float, float, float]
    ) -> tuple[float, float]:
        """Return u and v after a step `h`; `force` is that at its begin, middle and end."""
        for _ in range(64):
            touching = u > -1.0 or (u == -1.0 and v > 0.0)
            new_u, new_v = self._step(u, v, h, force, touching)
            share = _crossing(u + 1.0, new_u + 1.0, v * h, new_v * h, touching)
            if share is None:
                if not touching:
                    self.lost += h
                return new_u, new_v
            part, v = self._to_event(u, v, time, share * h, touching)
            part = min(part, h)
            if touching:
                self.separations += 1
            else:
                self.lost += part
            u, time, h = -1.0, time + part, h - part
            if h <= 0.0:
                return u, v
            force = (self.noise.at(time), self.noise.at(time + 0.5 * h), force[2])
        return u, v

    def _to_event(self, u: float, v: float, time: float, part: float, touching: bool) -> tuple[float, float]:
        """Return time and speed from (u, v) to u = -1, near the time `part`, by Newton's method."""
        speed = v
        for _ in range(6):
            force = (self.noise.at(time), self.noise.at(time + 0.5 * part), self.noise.at(time + part))
            end, speed = self._step(u, v, part, force, touching)
            if abs(end + 1.0) < _CLOSE or speed == 0.0:
                break
            part = max(part - max(-0.5 * part, min((end + 1.0) / speed, 0.5 * part)), 1e-9)
        return part, speed

    def _step(
        self, u: float, v: float, h: float, force: tuple[float, float, float], touching: bool
    ) -> tuple[float, float]:
        """Return u and v after one Runge-Kutta step within contact or within flight."""
        pull = self._in_contact if touching else self._in_flight
        half = 0.5 * h
        first, middle, last = force
        a1 = first + pull(u, v)
        v2 = v + half * a1
        a2 = middle + pull(u + half * v, v2)
        v3 = v + half * a2
        a3 = middle + pull(u + half * v2, v3)
        v4 = v + h * a3
        a4 = last + pull(u + h * v3, v4)
        sixth = h / 6.0
        return u + sixth * (v + 2.0 * (v2 + v3) + v4), v + sixth * (a1 + 2.0 * (a2 + a3) + a4)

    def _in_contact(self, u: float, v: float) -> float:
        p = self._scale * self._at(self._z_s * (1.0 + u))[0]
        factor = self._share * p if self._share else 1.0
        if self._loops is not None:
            factor = float(rate(self._restoring, self._loops, np.array([max(u, _IN_CONTACT)]))[0])
        return self._rest - p - self._loss * factor * v

    def _in_flight(self, u: float, v: float) -> float:
        return self._rest - self._flight_loss * v


def _crossing(a: float, b: float, p: float, q: float, touching: bool) -> float | None:
    """Return the share of a step at which the cubic through heights a and b with slopes p and q changes its sign.

    None if it keeps that of the phase: positive in contact. A start at zero height is no crossing.
    """
    if not touching:
        a, b, p, q = -a, -b, -p, -q
    if b > 0.0 and not (p < 0.0 < q):
        return None
    c3, c2 = p + q - 2.0 * (b - a), 3.0 * (b - a) - 2.0 * p - q
    roots = np.roots([c3, c2, p] if a == 0.0 else [c3, c2, p, a])
    real = roots[np.abs(roots.imag) < 1e-9].real
    inside = real[(real > 1e-9) & (real <= 1.0)]
    if inside.size:
        return float(inside.min())
    return 1.0 if b < 0.0 else None
