"""Confidence of the static law, carried to the vibration."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from asperity.dynamics.forcing import forcings, window
from asperity.dynamics.law.law import EXPONENT, Array, Law, PowerLaw
from asperity.dynamics.law.table import TableLaw
from asperity.dynamics.orbits.response import FrequencyResponse, frequency_response
from asperity.dynamics.oscillator import ContactOscillator
from asperity.errors import InputError

_MEMBERS = 12
BAND_COLUMNS = ("F_hat", "Omega", "upper_low", "upper_high", "lower_low", "lower_high")


@dataclass(frozen=True)
class Interval:
    """A value with its 95 % confidence interval."""

    value: float
    low: float
    high: float

    def to_list(self) -> list[float]:
        """Value, low, high."""
        return [self.value, self.low, self.high]


@dataclass(frozen=True)
class Uncertainty:
    """What the confidence of the law means for the oscillator at its preload.

    Attributes:
        n_loc, kappa: local exponent, backbone curvature.
        omega_s: small-amplitude frequency (rad/time).
        z_s: static deflection (length).
        softening: "softening", "hardening", or "undecided" when the interval of kappa holds 0.
        members: laws on the edge of the confidence region.
    """

    n_loc: Interval
    kappa: Interval
    omega_s: Interval
    z_s: Interval
    softening: str
    members: tuple[Law, ...]

    def to_dict(self) -> dict[str, Any]:
        """Section "uncertainty" of thresholds.json."""
        out: dict[str, Any] = {name: getattr(self, name).to_list() for name in ("n_loc", "kappa", "omega_s", "z_s")}
        return {**out, "softening": self.softening, "confidence": 0.95}


@dataclass(frozen=True)
class Band:
    """Envelope of the stable response over the confidence region, at fixed physical forcing and frequency.

    Attributes:
        F_hat: forcing of the central law.
        Omega: frequency over the omega_s of the central law.
        upper: lowest and highest u_max (2, frequencies) of the greatest stable orbit; nan where there is none.
        lower: the same of the smallest stable orbit.
    """

    F_hat: float
    Omega: Array
    upper: Array
    lower: Array

    def rows(self) -> Iterator[dict[str, float]]:
        """Rows of band.csv."""
        for values in zip(self.Omega, *self.upper, *self.lower, strict=True):
            yield dict(zip(BAND_COLUMNS, (self.F_hat, *(float(x) for x in values)), strict=True))


def ensemble(law: Law) -> tuple[Law, ...]:
    """Laws on the edge of the confidence region, so that their extremes bound every smooth result at 95 %.

    Args:
        law: a `PowerLaw` with ci_n and ci_K, or a `TableLaw` (whose scatter about its power-law fit is used).

    Raises:
        InputError: the law carries no confidence interval.
    """
    centre = law.fit() if isinstance(law, TableLaw) else law
    if not isinstance(centre, PowerLaw) or centre.ci_n is None or centre.ci_K is None:
        raise InputError("the law carries no confidence interval: give ci_n and ci_K, or a fitted law")
    half_n = 0.5 * (centre.ci_n[1] - centre.ci_n[0])
    half_k = 0.5 * float(np.log(centre.ci_K[1] / centre.ci_K[0]))
    r = centre.correlation
    factors = []
    for angle in 2.0 * np.pi * np.arange(_MEMBERS) / _MEMBERS:
        a, b = np.cos(angle), np.sin(angle)
        factors.append((half_n * a, half_k * (r * a + np.sqrt(max(1.0 - r * r, 0.0)) * b)))
    if isinstance(law, TableLaw) and law.values == "interpolant":
        scale = law.z
        return tuple(replace(law, F=law.F * scale**dn * np.exp(dk), origin=0.0) for dn, dk in factors)
    return tuple(PowerLaw(float(np.clip(centre.n + dn, *EXPONENT)), centre.K * float(np.exp(dk))) for dn, dk in factors)


def uncertainty(oscillator: ContactOscillator, members: Iterable[Law] | None = None) -> Uncertainty:
    """Carry the confidence of the law, or an ensemble of laws (seeds), to omega_s, n_loc and kappa.

    Args:
        oscillator: the oscillator with the central law.
        members: laws to bound over; default `ensemble` of the law.
    """
    laws = tuple(members) if members is not None else ensemble(oscillator.law)
    others = [replace(oscillator, law=law, load=oscillator.restoring.load) for law in laws]

    def interval(name: str) -> Interval:
        def value(o: ContactOscillator) -> float:
            return o.omega_s if name == "omega_s" else float(getattr(o.restoring, name))

        values = [value(o) for o in others]
        centre = value(oscillator)
        return Interval(centre, min(*values, centre), max(*values, centre))

    kappa = interval("kappa")
    if isinstance(oscillator.law, TableLaw) and oscillator.law.values == "interpolant" and members is None:
        fit = oscillator.law.local_fit(oscillator.restoring.z_s)
        n_loc = Interval(oscillator.restoring.n_loc, *fit.interval("n_loc"))
        kappa = Interval(oscillator.restoring.kappa, *fit.interval("kappa"))
    else:
        n_loc = interval("n_loc")
    word = "softening" if kappa.high < 0 else "hardening" if kappa.low > 0 else "undecided"
    return Uncertainty(n_loc, kappa, interval("omega_s"), interval("z_s"), word, laws)


def response_band(
    oscillator: ContactOscillator,
    forcing: float,
    omega: Sequence[float] = (0.5, 1.3),
    *,
    members: Iterable[Law] | None = None,
    points: int = 161,
    tol: float = 1e-4,
) -> Band:
    """Envelope of the stable response over the confidence region of the law.

    Args:
        oscillator: the oscillator with the central law.
        forcing: F^ of the central oscillator; the members feel the same physical force and frequency.
        omega: window in units of the central omega_s.
        members: laws to bound over; default `ensemble` of the law.
        points: frequencies of the envelope.
        tol: see `ContactOscillator.response`.
    """
    laws = tuple(members) if members is not None else ensemble(oscillator.law)
    (f,), (low, high) = forcings(forcing), window(omega)
    grid = np.linspace(low, high, points)
    centre = oscillator.restoring
    upper, lower = [], []
    for law in (oscillator.law, *laws):
        other = replace(oscillator, law=law, load=centre.load)
        ratio = oscillator.omega_s / other.omega_s
        setting = other.setting(f * centre.scale / other.restoring.scale)
        found = frequency_response(other.balance(), setting, (low * ratio, high * ratio), tol=tol, subharmonics=False)
        greatest, smallest = stable_range(found, grid * ratio)
        size = other.restoring.z_s / centre.z_s
        shift = size - 1.0  # deflection is counted from the central static one
        upper.append(greatest * size + shift)
        lower.append(smallest * size + shift)
    with np.errstate(all="ignore"):
        pack = [np.array([np.fmin.reduce(v), np.fmax.reduce(v)]) for v in (np.array(upper), np.array(lower))]
    return Band(f, grid, pack[0], pack[1])


def stable_range(response: FrequencyResponse, omega: Array) -> tuple[Array, Array]:
    """Greatest and smallest stable u_max at each Omega, by linear interpolation; nan where there is none."""
    high, low = np.full(omega.size, np.nan), np.full(omega.size, np.nan)
    for b in response.branches:
        for i in range(len(b) - 1):
            if not (b.stable[i] and b.stable[i + 1]):
                continue
            left, right = sorted((b.Omega[i], b.Omega[i + 1]))
            inside = (omega >= left - 1e-12) & (omega <= right + 1e-12)
            if not inside.any() or right == left:
                continue
            s = (omega[inside] - b.Omega[i]) / (b.Omega[i + 1] - b.Omega[i])
            u = (1 - s) * b.u_max[i] + s * b.u_max[i + 1]
            high[inside], low[inside] = np.fmax(high[inside], u), np.fmin(low[inside], u)
    return high, low
