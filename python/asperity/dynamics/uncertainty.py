# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

"""What the uncertainty of the static law does to the vibration: error bar of the force, spread of the laws."""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from asperity.arrays import Array
from asperity.dynamics.forcing import forcings, window
from asperity.dynamics.law.law import Law
from asperity.dynamics.law.power import EXPONENT, PowerLaw
from asperity.dynamics.law.table import TableLaw
from asperity.dynamics.orbits.response import FrequencyResponse, frequency_response
from asperity.dynamics.oscillator import ContactOscillator
from asperity.errors import InputError
from asperity.runtime.display import short_repr

_MEMBERS = 12
BAND_COLUMNS = ("F_hat", "Omega", "upper_low", "upper_high", "lower_low", "lower_high")


@dataclass(frozen=True)
class Interval:
    """Value with the smallest and largest one by the laws that bound it."""

    value: float
    low: float
    high: float

    def to_list(self) -> list[float]:
        """Return [value, low, high]."""
        return [self.value, self.low, self.high]


@dataclass(frozen=True)
class Uncertainty:
    """Intervals of the oscillator at its preload, from the laws that bound its own.

    Attributes:
        n_loc, kappa: local exponent, backbone curvature.
        omega_s: natural frequency of small motion (rad/time), NaN without gravity.
        z_s: static deflection (length).
        softening: "softening", "hardening", or "undecided" if the interval of kappa contains 0.
        members: laws that bound it.
        origin: what they are made of, in words.

    Examples:
        >>> law = asp.PowerLaw(1.5, ci_n=(1.45, 1.55), ci_K=(0.97, 1.03))
        >>> result = asp.uncertainty(asp.ContactOscillator(law))
        >>> [round(x, 4) for x in result.n_loc.to_list()], result.softening
        ([1.5, 1.45, 1.55], 'softening')
    """

    n_loc: Interval
    kappa: Interval
    omega_s: Interval
    z_s: Interval
    softening: str
    members: tuple[Law, ...]
    origin: str = "laws given"

    __repr__ = short_repr

    def to_dict(self) -> dict[str, Any]:
        """Return the section "uncertainty" of thresholds.json."""
        out: dict[str, Any] = {name: getattr(self, name).to_list() for name in ("n_loc", "kappa", "omega_s", "z_s")}
        if np.isnan(self.omega_s.value):
            out["omega_s"] = None
        return {**out, "softening": self.softening, "origin": self.origin}


@dataclass(frozen=True)
class Band:
    """Envelope of the stable response over the laws that bound one, at fixed physical forcing and frequency.

    Attributes:
        F_hat: forcing of the central law.
        Omega: frequencies over omega_s of the central law, shape (frequencies,).
        upper: lowest and highest u_max of the largest stable orbit, shape (2, frequencies); NaN where there is none.
        lower: the same for the smallest stable orbit.

    Examples:
        >>> law = asp.PowerLaw(1.5, ci_n=(1.45, 1.55), ci_K=(0.97, 1.03))
        >>> oscillator = asp.ContactOscillator(law, zeta=0.1)
        >>> band = asp.response_band(oscillator, 0.01, (0.9, 1.1), members=[law], points=3, tol=1e-2)
        >>> band.Omega, band.upper.shape, next(band.rows())["F_hat"]
        (array([0.9, 1. , 1.1]), (2, 3), 0.01)
    """

    F_hat: float
    Omega: Array
    upper: Array
    lower: Array

    __repr__ = short_repr

    def rows(self) -> Iterator[dict[str, float]]:
        """Yield the rows of band.csv."""
        for values in zip(self.Omega, *self.upper, *self.lower, strict=True):
            yield dict(zip(BAND_COLUMNS, (self.F_hat, *(float(x) for x in values)), strict=True))


def ensemble(law: Law) -> tuple[Law, ...]:
    """Return 12 laws on the boundary of the misfit of a fit.

    Their extremes bound every smooth result over the intervals of n and K. For the points of one smooth curve these
    measure how badly a power law describes it, and not what is known of the force.

    Args:
        law: a `PowerLaw` with ci_n and ci_K, or a `TableLaw`, for which its scatter about the power-law fit counts.

    Raises:
        InputError: the law has no confidence interval.

    Examples:
        >>> from asperity.dynamics import ensemble
        >>> members = ensemble(asp.PowerLaw(1.5, ci_n=(1.45, 1.55), ci_K=(0.97, 1.03)))
        >>> len(members), round(min(law.n for law in members), 6)
        (12, 1.45)
    """
    centre = law.fit() if isinstance(law, TableLaw) else law
    if not isinstance(centre, PowerLaw) or centre.ci_n is None or centre.ci_K is None:
        raise InputError("the law has no confidence interval: give ci_n and ci_K, or a fitted law")
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


def uncertainty(
    oscillator: ContactOscillator, members: Iterable[Law] | None = None, origin: str = "laws given"
) -> Uncertainty:
    """Carry the intervals of the law, or an ensemble of laws (seeds), to omega_s, n_loc, kappa and z_s.

    Args:
        oscillator: oscillator with the central law.
        members: laws whose extremes are the bounds; default `ensemble` of the law, the misfit of its fit.
        origin: what the members are made of, in words.

    Raises:
        InputError: the law has no confidence interval and `members` is not given.

    Examples:
        Two laws, for example of two seeds:

        >>> oscillator = asp.ContactOscillator(asp.PowerLaw(1.5), load=1.0)
        >>> result = asp.uncertainty(oscillator, members=[asp.PowerLaw(1.4), asp.PowerLaw(1.6)])
        >>> print(f"omega_s = {result.omega_s.low:.3f} to {result.omega_s.high:.3f} rad/s")
        omega_s = 3.705 to 3.961 rad/s
    """
    fitted = members is None
    if members is None:
        members, origin = ensemble(oscillator.law), "misfit of the fit"
    laws = tuple(members)
    others = [_with_law(oscillator, law) for law in laws]

    def interval(name: str) -> Interval:
        def value(o: ContactOscillator) -> float:
            return o.omega_s if name == "omega_s" else float(getattr(o.restoring, name))

        values = [value(o) for o in others]
        centre = value(oscillator)
        return Interval(centre, min(*values, centre), max(*values, centre))

    kappa = interval("kappa")
    if isinstance(oscillator.law, TableLaw) and oscillator.law.values == "interpolant" and fitted:
        fit = oscillator.law.local_fit(oscillator.restoring.z_s)
        n_loc = Interval(oscillator.restoring.n_loc, *fit.interval("n_loc"))
        kappa = Interval(oscillator.restoring.kappa, *fit.interval("kappa"))
    else:
        n_loc = interval("n_loc")
    word = "softening" if kappa.high < 0 else "hardening" if kappa.low > 0 else "undecided"
    return Uncertainty(n_loc, kappa, interval("omega_s"), interval("z_s"), word, laws, origin)


def response_band(
    oscillator: ContactOscillator,
    forcing: float,
    omega: Sequence[float] = (0.5, 1.3),
    *,
    members: Iterable[Law] | None = None,
    points: int = 161,
    tol: float = 1e-4,
) -> Band:
    """Compute the envelope of the stable response over the laws that bound its own.

    Args:
        oscillator: oscillator with the central law.
        forcing: F^ of the central oscillator; the physical force and frequency are the same for all members.
        omega: lowest and highest frequency over the central omega_s.
        members: laws of the envelope; default `ensemble` of the law, the misfit of its fit.
        points: number of frequencies.
        tol: see `ContactOscillator.response`.

    Raises:
        InputError: an argument is not legal, or the law has no confidence interval.

    Examples:
        >>> oscillator = asp.ContactOscillator(asp.PowerLaw(1.5), zeta=0.1)
        >>> laws = [asp.PowerLaw(1.45), asp.PowerLaw(1.55)]
        >>> band = asp.response_band(oscillator, 0.01, (0.9, 1.1), members=laws, points=3, tol=1e-2)
        >>> band.upper[:, 1].round(3)
        array([0.048, 0.05 ])
    """
    laws = tuple(members) if members is not None else ensemble(oscillator.law)
    (f,), (low, high) = forcings(forcing), window(omega)
    grid = np.linspace(low, high, points)
    centre = oscillator.restoring
    upper, lower = [], []
    for law in (oscillator.law, *laws):
        other = _with_law(oscillator, law)
        # ratio of the omega_s, at the same gravity
        ratio = float(np.sqrt(centre.n_loc / centre.z_s * other.restoring.z_s / other.restoring.n_loc))
        setting = other.setting(f * centre.scale / other.restoring.scale)
        found = frequency_response(other.balance(), setting, (low * ratio, high * ratio), tol=tol, subharmonics=False)
        greatest, smallest = stable_range(found, grid * ratio)
        size = other.restoring.z_s / centre.z_s  # each moves about its own position of rest
        upper.append(greatest * size)
        lower.append(smallest * size)
    with np.errstate(all="ignore"):
        pack = [np.array([np.fmin.reduce(v), np.fmax.reduce(v)]) for v in (np.array(upper), np.array(lower))]
    return Band(f, grid, pack[0], pack[1])


def _with_law(oscillator: ContactOscillator, law: Law) -> ContactOscillator:
    """Return the oscillator with another law, without repeating its warnings."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return replace(oscillator, law=law, load=oscillator.restoring.load)


def stable_range(response: FrequencyResponse, omega: Array) -> tuple[Array, Array]:
    """Return the largest and smallest stable u_max at each Omega, linearly interpolated; NaN where there is none."""
    high, low = np.full(omega.size, np.nan), np.full(omega.size, np.nan)
    for b in response.lines():
        for i in range(b.Omega.size - 1):
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
