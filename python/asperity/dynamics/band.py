"""What the uncertainty of the static law does to the vibration: bounds of an oscillator, and a band of responses."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from asperity.arrays import Array
from asperity.dynamics.branch import dense
from asperity.dynamics.equation import Restoring
from asperity.dynamics.oscillator import ContactOscillator
from asperity.dynamics.response import FrequencyResponse, frequency_response
from asperity.dynamics.settings import forcings, window
from asperity.errors import ConvergenceError, InputError
from asperity.force_law.intervals import Uncertainty, intervals
from asperity.force_law.law import Law
from asperity.force_law.table import TableLaw
from asperity.runtime.display import short_repr

_RTOL = 1.5e-3  # relative error of the straight lines between orbits
_SAME_SHAPE = 1e-3  # sum of differences in n and kappa up to which laws differ by their stiffness alone
_SAME_ORBIT = 1e-9  # relative difference in u_max up to which two orbits at a frequency are one


def uncertainty(oscillator: ContactOscillator, members: Iterable[Law] = (), origin: str = "laws given") -> Uncertainty:
    """Intervals of the law of an oscillator, with the extremes over an ensemble of laws (seeds), and by its points.

    Args:
        oscillator: with the central law
        members: laws whose extremes are the bounds
        origin: what the members are made of, in words

    Raises:
        InputError: nothing bounds the law

    Examples:
        >>> oscillator = asp.ContactOscillator(asp.PowerLaw(1.5), load=1.0)
        >>> result = asp.uncertainty(oscillator, members=[asp.PowerLaw(1.4), asp.PowerLaw(1.6)])
        >>> print(f"omega_s = {result.omega_s.low:.3f} to {result.omega_s.high:.3f} rad/s")
        omega_s = 3.705 to 3.961 rad/s
    """
    known = intervals(oscillator.law, oscillator.restoring.load, members, origin, oscillator.mass)
    if not known.origin:
        raise InputError("nothing bounds the law: give members, or a table with more points")
    return known


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
        names = ("Omega", "upper_low", "upper_high", "lower_low", "lower_high")
        for values in zip(self.Omega, *self.upper, *self.lower, strict=True):
            yield {"F_hat": self.F_hat} | dict(zip(names, map(float, values), strict=True))


def response_band(
    oscillator: ContactOscillator,
    forcing: float,
    known: Uncertainty,
    omega: Sequence[float] = (0.5, 1.3),
    *,
    points: int = 161,
    tol: float = 1e-4,
) -> Band:
    """Envelope of the stable response over the laws that bound its own.

    A law that is stiffer by a factor s^2 has the same response with frequencies s times as high and displacements 1/s^2
    as large. So the band at a frequency contains the response in the range of omega_s over the members. The responses
    of members of another shape are moved through the same range.

    Args:
        oscillator: with the central law
        forcing: F^ of the central oscillator; the physical force and frequency are the same for all members
        known: bounds of its law, see `uncertainty`
        omega: lowest and highest frequency over the central omega_s
        points: number of frequencies
        tol: see `ContactOscillator.response`

    Raises:
        InputError: the bounds of the stiffness reach zero
        ConvergenceError: no orbit is stable

    Examples:
        >>> oscillator = asp.ContactOscillator(asp.PowerLaw(1.5), zeta=0.1)
        >>> known = asp.uncertainty(oscillator, [asp.PowerLaw(1.45), asp.PowerLaw(1.55)])
        >>> band = asp.response_band(oscillator, 0.01, known, (0.9, 1.1), points=3, tol=1e-2)
        >>> band.upper[:, 1].round(3)
        array([0.048, 0.05 ])
    """
    (f,), (low, high) = forcings(forcing), window(omega)
    if known.k_n.low <= 0.0:
        raise InputError("the error bar of the stiffness reaches zero")
    grid = np.linspace(low, high, points)
    centre = oscillator.restoring
    stiff = tuple(float(np.sqrt(k / known.k_n.value)) for k in (known.k_n.low, known.k_n.high))
    thinned = oscillator.law.thinned if isinstance(oscillator.law, TableLaw) else ()
    rows, shapes = [], list[tuple[float, float]]()
    for law in (oscillator.law, *known.members, *thinned):
        r = Restoring(law, centre.load)
        if any(abs(r.n_loc / n - 1.0) + abs(r.kappa - kappa) < _SAME_SHAPE for n, kappa in shapes):
            continue
        shapes.append((r.n_loc, r.kappa))
        own = float(np.sqrt(r.n_loc / r.z_s / (centre.n_loc / centre.z_s)))  # its omega_s over the central one
        moved = (stiff[0] / own, stiff[1] / own)
        ends = (low / own / moved[1], high / own / moved[0])
        equation, setting = replace(oscillator.equation, restoring=r), oscillator.setting(f * centre.scale / r.scale)
        found = frequency_response(equation, setting, ends, tol=tol, subharmonics=False)
        rows.append([u * (r.z_s / centre.z_s) for u in _moved(found, grid / own, moved)])
    upper, lower = np.transpose([_branches(*np.concatenate(u, axis=1)) for u in zip(*rows, strict=True)], (1, 2, 0))
    if not np.isfinite(upper).any():
        raise ConvergenceError("no orbit of period 1 is stable")
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
    lines = [replace(b, points=dense(response.orbits(b), b.points, _RTOL)) for b in response.branches]
    left, right = omega / moved[1], omega / moved[0]
    at = np.unique(np.concatenate([left, right, *(line.Omega for line in lines)]))
    # largest and smallest stable u_max of the response, linear between rows
    found = np.full((2, at.size), np.nan)
    for line in lines:
        for i in np.flatnonzero(line.stable[:-1] & line.stable[1:]):
            (a, u), (b, v) = sorted(zip(line.Omega[i : i + 2], line.u_max[i : i + 2], strict=True))
            inside = slice(*np.searchsorted(at, (a - 1e-12, b + 1e-12)))
            if b > a:
                value = u + (v - u) * np.clip((at[inside] - a) / (b - a), 0.0, 1.0)
                found[:, inside] = np.fmax(found[0, inside], value), np.fmin(found[1, inside], value)
    found *= at**2
    first, last = np.searchsorted(at, left), np.searchsorted(at, right)
    return [found[:, a : b + 1] / w**2 for a, b, w in zip(first, last, omega, strict=True)]
