# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

"""What the uncertainty of the static law does to the vibration: error bar, spread of the laws, points of a table."""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from asperity.arrays import Array
from asperity.dynamics.law.law import Law, bend
from asperity.dynamics.law.power import EXPONENT, PowerLaw
from asperity.dynamics.law.table import TableLaw
from asperity.dynamics.oscillator import ContactOscillator
from asperity.dynamics.response import FrequencyResponse, frequency_response
from asperity.dynamics.settings import forcings, window
from asperity.errors import InputError
from asperity.runtime.display import short_repr

_MEMBERS = 12
_SAME_SHAPE = 1e-3  # sum of differences in n and kappa up to which laws differ by their stiffness alone
_SAME_ORBIT = 1e-9  # relative difference in u_max up to which two orbits at a frequency are one
BAND_COLUMNS = ("F_hat", "Omega", "upper_low", "upper_high", "lower_low", "lower_high")


class Interval(NamedTuple):
    """Value with the smallest and largest one by the laws that bound it."""

    value: float
    low: float
    high: float

    @property
    def half(self) -> float:
        """Greatest distance of an end from the value."""
        return max(self.high - self.value, self.value - self.low)


def law_intervals(law: Law, load: float, members: Iterable[Law] = ()) -> dict[str, Interval]:
    """ "n_loc", "kappa", "z_s" (length) and "k_n" (force/length) of a law under a load (force).

    Each has the extremes over the laws that bound it, and is wider on both sides by the change without some of its
    points.

    Raises:
        RangeError: a law does not reach the load
    """

    def values(one: Law) -> dict[str, float]:
        z = one.deflection(load)
        k = one.derivatives(z)[0]
        return {"n_loc": z * k / load, "kappa": one.kappa(z), "z_s": z, "k_n": k}

    centre = values(law)
    others = [centre, *(values(one) for one in members)]
    thinned = [values(one) for one in (law.thinned if isinstance(law, TableLaw) else ())]
    found = {}
    for name, value in centre.items():
        wider = sum(abs(one[name] - value) for one in thinned)
        if name == "kappa":
            wider = law.kappa_bar(centre["z_s"])
        ends = [one[name] for one in others]
        found[name] = Interval(value, min(ends) - wider, max(ends) + wider)
    return found


@dataclass(frozen=True)
class Uncertainty:
    """Intervals of the oscillator at its preload, from the laws that bound its own.

    Attributes:
        n_loc, kappa, z_s, k_n: local exponent, backbone curvature, static deflection (length), stiffness
            (force/length)
        omega_s: natural frequency of small motion, sqrt(k_n/m) (rad/time), NaN without a mass
        members: laws that bound it
        origin: what they are made of, in words
    """

    n_loc: Interval
    kappa: Interval
    z_s: Interval
    k_n: Interval
    omega_s: Interval
    members: tuple[Law, ...]
    origin: str = "laws given"

    __repr__ = short_repr

    @property
    def softening(self) -> str:
        """ "softening", "hardening", or "undecided" if the interval of kappa contains 0."""
        return bend(self.kappa.low, self.kappa.high)

    def to_dict(self) -> dict[str, Any]:
        """Section "uncertainty" of thresholds.json."""
        names = ("n_loc", "kappa", "omega_s", "z_s", "k_n")
        out: dict[str, Any] = {name: list(getattr(self, name)) for name in names}
        if np.isnan(self.omega_s.value):
            out["omega_s"] = None
        return {**out, "softening": self.softening, "origin": self.origin}


@dataclass(frozen=True)
class Band:
    """Envelope of the stable response over the laws that bound one, at fixed physical forcing and frequency.

    Attributes:
        F_hat: forcing of the central law
        Omega: frequencies over omega_s of the central law, shape (frequencies,)
        upper: lowest and highest u_max on the upper stable branch, shape (2, frequencies); NaN where there is none
        lower: the same on the lower stable branch; that of `upper` where no law has two
    """

    F_hat: float
    Omega: Array
    upper: Array
    lower: Array

    __repr__ = short_repr

    def rows(self) -> Iterator[dict[str, float]]:
        """Rows of band.csv."""
        for values in zip(self.Omega, *self.upper, *self.lower, strict=True):
            yield dict(zip(BAND_COLUMNS, (self.F_hat, *(float(x) for x in values)), strict=True))


def ensemble(law: Law) -> tuple[Law, ...]:
    """12 laws on the boundary of the misfit of a fitted `PowerLaw`; `InputError` without ci_n and ci_K.

    Their extremes bound every smooth result over the intervals of n and K. For the points of one smooth curve these
    measure how badly a power law describes it, and not what is known of the force.
    """
    if not isinstance(law, PowerLaw) or law.ci_n is None or law.ci_K is None:
        raise InputError("the law has no confidence interval: give ci_n and ci_K, or a fitted law")
    half_n = 0.5 * (law.ci_n[1] - law.ci_n[0])
    half_k = 0.5 * float(np.log(law.ci_K[1] / law.ci_K[0]))
    r, angle = law.correlation, 2.0 * np.pi * np.arange(_MEMBERS) / _MEMBERS
    dn = half_n * np.cos(angle)
    dk = half_k * (r * np.cos(angle) + np.sqrt(max(1.0 - r * r, 0.0)) * np.sin(angle))
    n, K = np.clip(law.n + dn, *EXPONENT), law.K * np.exp(dk)
    return tuple(PowerLaw(float(a), float(b)) for a, b in zip(n, K, strict=True))


def uncertainty(
    oscillator: ContactOscillator, members: Iterable[Law] | None = None, origin: str = "laws given"
) -> Uncertainty:
    """Carry the intervals of the law, or an ensemble of laws (seeds), to k_n, omega_s, n_loc, kappa and z_s.

    Every interval of a table is wider on both sides by the change without every fourth of its points.

    Args:
        oscillator: oscillator with the central law
        members: laws whose extremes are the bounds; default none for a table, and `ensemble` for another law, the
            misfit of its fit
        origin: what the members are made of, in words

    Raises:
        InputError: the law has no confidence interval and `members` is not given

    Examples:
        Two laws, for example of two seeds:

        >>> oscillator = asp.ContactOscillator(asp.PowerLaw(1.5), load=1.0)
        >>> result = asp.uncertainty(oscillator, members=[asp.PowerLaw(1.4), asp.PowerLaw(1.6)])
        >>> print(f"omega_s = {result.omega_s.low:.3f} to {result.omega_s.high:.3f} rad/s")
        omega_s = 3.705 to 3.961 rad/s
    """
    law = oscillator.law
    if members is None:
        members, origin = ((), "") if isinstance(law, TableLaw) else (ensemble(law), "misfit of the fit")
    laws, points = tuple(members), isinstance(law, TableLaw) and bool(law.thinned)
    if not laws and not points:
        raise InputError("nothing bounds the law: it has too few points")
    known = law_intervals(law, oscillator.restoring.load, laws)
    omega = Interval(*(float(np.sqrt(max(k, 0.0) / oscillator.mass)) for k in known["k_n"]))
    text = " and ".join(text for text in (origin if laws else "", "points of the law" if points else "") if text)
    return Uncertainty(**known, omega_s=omega, members=laws, origin=text)


def response_band(
    oscillator: ContactOscillator,
    forcing: float,
    omega: Sequence[float] = (0.5, 1.3),
    *,
    members: Iterable[Law] | None = None,
    points: int = 161,
    tol: float = 1e-4,
) -> Band:
    """Envelope of the stable response over the laws that bound its own.

    A law that is stiffer by a factor s^2 moves about another position of rest, and the response is the same with
    frequencies s times as high and displacements 1/s^2 as large. So the band at a frequency contains all points of the
    response in a range of frequencies: that of omega_s over the members. The responses of members of another shape are
    moved through the same range, which leaves no gaps between them.

    Args:
        oscillator: oscillator with the central law
        forcing: F^ of the central oscillator; the physical force and frequency are the same for all members
        omega: lowest and highest frequency over the central omega_s
        members: laws that bound it, see `uncertainty`
        points: number of frequencies
        tol: see `ContactOscillator.response`

    Examples:
        >>> oscillator = asp.ContactOscillator(asp.PowerLaw(1.5), zeta=0.1)
        >>> laws = [asp.PowerLaw(1.45), asp.PowerLaw(1.55)]
        >>> band = asp.response_band(oscillator, 0.01, (0.9, 1.1), members=laws, points=3, tol=1e-2)
        >>> band.upper[:, 1].round(3)
        array([0.048, 0.05 ])
    """
    (f,), (low, high) = forcings(forcing), window(omega)
    grid = np.linspace(low, high, points)
    centre = oscillator.restoring
    known = uncertainty(oscillator, members)
    stiff = tuple(float(np.sqrt(k / known.k_n.value)) for k in (known.k_n.low, known.k_n.high))
    thinned = oscillator.law.thinned if isinstance(oscillator.law, TableLaw) else ()
    rows, shapes = [], list[tuple[float, float]]()
    for shape in (oscillator, *(_with_law(oscillator, law) for law in (*known.members, *thinned))):
        r = shape.restoring
        if any(abs(r.n_loc / n - 1.0) + abs(r.kappa - kappa) < _SAME_SHAPE for n, kappa in shapes):
            continue
        shapes.append((r.n_loc, r.kappa))
        own = float(np.sqrt(r.n_loc / r.z_s / (centre.n_loc / centre.z_s)))  # its omega_s over the central one
        # to every stiffness in the range: its response is moved by s
        moved = (stiff[0] / own, stiff[1] / own)
        ends = (low / own / moved[1], high / own / moved[0])
        setting = shape.setting(f * centre.scale / r.scale)
        found = frequency_response(shape.balance(), setting, ends, tol=tol, subharmonics=False)
        rows.append([u * (r.z_s / centre.z_s) for u in _moved(found, grid / own, moved)])
    upper, lower = np.transpose([_branches(*np.concatenate(u, axis=1)) for u in zip(*rows, strict=True)], (1, 2, 0))
    return Band(f, grid, upper, lower)


def _branches(high: Array, low: Array) -> Array:
    """Ranges of the upper and of the lower stable branch from largest and smallest stable u_max of many responses.

    A response with one stable orbit is on the branch to which it is closer; where none has two, on both.
    """
    high, low = high[np.isfinite(high)], low[np.isfinite(low)]
    if high.size == 0:
        return np.full((2, 2), np.nan)
    two = high > low * (1.0 + _SAME_ORBIT)
    if two.any():
        middle = 0.5 * (high[two].min() + low[two].max())
        high, low = high[two | (high > middle)], low[two | (low <= middle)]
    return np.array([(high.min(), high.max()), (low.min(), low.max())])


def _moved(response: FrequencyResponse, omega: Array, moved: tuple[float, float]) -> list[Array]:
    """Largest and smallest stable u_max of the moved responses at each Omega, m arrays (2, responses).

    A point (Omega, u) of the response is moved to (s Omega, u/s^2), with s from `moved[0]` to `moved[1]`.
    """
    left, right = omega / moved[1], omega / moved[0]
    own = np.concatenate([line.Omega for line in response.lines()])
    at = np.unique(np.concatenate([left, right, own]))
    found = np.stack(stable_range(response, at)) * at**2
    first, last = np.searchsorted(at, left), np.searchsorted(at, right)
    return [found[:, a : b + 1] / w**2 for a, b, w in zip(first, last, omega, strict=True)]


def _with_law(oscillator: ContactOscillator, law: Law) -> ContactOscillator:
    """Oscillator with another law, without repeating its warnings."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return replace(oscillator, law=law, load=oscillator.restoring.load)


def stable_range(response: FrequencyResponse, omega: Array) -> tuple[Array, Array]:
    """Largest and smallest stable u_max at rising Omega (m,), linearly interpolated; NaN where none."""
    high, low = np.full(omega.size, np.nan), np.full(omega.size, np.nan)
    for b in response.lines():
        for i in np.flatnonzero(b.stable[:-1] & b.stable[1:]):
            ends = sorted(((b.Omega[i], b.u_max[i]), (b.Omega[i + 1], b.u_max[i + 1])))
            (left, u), (right, v) = ends
            inside = slice(*np.searchsorted(omega, (left - 1e-12, right + 1e-12)))
            if right == left or inside.start == inside.stop:
                continue
            value = u + (v - u) * np.clip((omega[inside] - left) / (right - left), 0.0, 1.0)
            high[inside], low[inside] = np.fmax(high[inside], value), np.fmin(low[inside], value)
    return high, low
