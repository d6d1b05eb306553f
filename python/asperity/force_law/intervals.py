"""Intervals of a law at a preload: error bar, points of a table."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from asperity.arrays import Array
from asperity.errors import RangeError
from asperity.force_law.law import Law, bend
from asperity.force_law.table import TableLaw
from asperity.runtime.display import short_repr


class Interval(NamedTuple):
    """Value with the smallest and largest one by the laws that bound it, NaN where one does not reach the load."""

    value: float
    low: float
    high: float

    @property
    def half(self) -> float:
        """Greatest distance of an end from the value."""
        return float(np.max([self.high - self.value, self.value - self.low]))

    def within(self, other: Interval) -> Interval:
        """What two intervals that hold have in common, and the value; itself where that is nothing."""
        low, high = max(self.low, other.low), min(self.high, other.high)
        return Interval(self.value, min(low, self.value), max(high, self.value)) if low <= high else self


@dataclass(frozen=True)
class Uncertainty:
    """Intervals of a law at a preload, from the laws that bound it.

    Attributes:
        n_loc, kappa, z_s, k_n: local exponent, backbone curvature, static deflection (length), stiffness
            (force/length)
        omega_s: natural frequency of small motion (rad/time), NaN without a mass
        origin: what bounds it, in words; "" where nothing does
    """

    n_loc: Interval
    kappa: Interval
    z_s: Interval
    k_n: Interval
    omega_s: Interval
    origin: str

    __repr__ = short_repr

    @property
    def softening(self) -> str:
        """ "softening", "hardening", or "undecided" if the interval of kappa contains 0."""
        return bend(self.kappa.low, self.kappa.high)

    def within(self, other: Uncertainty) -> Uncertainty:
        """With a second bar of approach, stiffness and frequency, independent of its own."""
        both = {name: getattr(self, name).within(getattr(other, name)) for name in ("z_s", "k_n", "omega_s")}
        return replace(self, **both, origin=f"{self.origin}; z_s and k_n also by the {other.origin}")

    def to_dict(self) -> dict[str, Any]:
        """Section "uncertainty" of thresholds.json."""
        out: dict[str, Any] = {n: list(getattr(self, n)) for n in ("n_loc", "kappa", "omega_s", "z_s", "k_n")}
        unknown = {"omega_s": None} if math.isnan(self.omega_s.value) else {}
        return {**out, **unknown, "softening": self.softening, "origin": self.origin}


def intervals(
    law: Law, load: float, members: Iterable[Law] = (), origin: str = "", mass: float = math.nan
) -> Uncertainty:
    """Intervals of a law under a load (force), with the extremes over the laws that bound it.

    Those of a table are wider on both sides by the changes without every fourth of its points, and by that of its
    slopes where these are those of the points; where the points scatter, also by the greatest change with every second
    of them, with every fourth and so on, and NaN if they are too few; where they scatter less, at least their scatter.

    Raises:
        RangeError: the law does not reach the load
    """

    def values(one: Law) -> Array:
        try:
            z = one.deflection(load)
        except RangeError:
            if one is law:
                raise
            return np.full(4, np.nan)
        k = one.derivatives(z)[0]
        return np.array([z * k / load, one.kappa(z), z, k])

    members, centre, others = tuple(members), values(law), law.others if isinstance(law, TableLaw) else ()
    ends = np.stack([centre, *map(values, members)])
    wider = np.sum([np.zeros(4), *(np.abs(values(one) - centre) for one in others)], axis=0)
    if isinstance(law, TableLaw):
        for laws in law.coarser:
            wider += np.fmax.reduce([np.zeros(4), *(np.abs(values(one) - centre) for one in laws)])
        wider = np.maximum(wider, law.scatter(float(centre[2])) * np.abs(centre))
    wider[1] = law.kappa_bar(float(centre[2]))
    if isinstance(law, TableLaw) and law.noise and not law.thinned:
        wider[:] = np.nan  # too few points to leave one out: how far they are to be believed is unknown
    found = np.stack([centre, ends.min(axis=0) - wider, ends.max(axis=0) + wider], axis=1)
    frequency = np.sqrt(np.maximum(found[3], 0.0) / mass)
    n_loc, kappa, z_s, k_n, omega_s = (Interval(*row) for row in [*found.tolist(), frequency.tolist()])
    words = [origin] * bool(members) + ["points of the law"] * bool(others)
    return Uncertainty(n_loc, kappa, z_s, k_n, omega_s, " and ".join(words))
