"""Static laws of a contact: force over approach, as a reversible spring; power law and Taylor series.

A law gives force and stiffness at an approach `z` (length), measured from first contact: a contact law is zero for
``z <= 0``.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.polynomial import Polynomial
from numpy.typing import ArrayLike
from scipy.optimize import brentq

from asperity.arrays import Array
from asperity.errors import RangeError
from asperity.model.limits import positive, within
from asperity.runtime.display import short_repr

#: Legal exponents of a power law: up to 1/2 the stiffness is not integrable where motion grazes, as u + 1 ~ t^2.
EXPONENT = (0.51, 100.0)
COEFFICIENT = (1e-100, 1e100)  # of a power law
_FARTHEST = 1e100  # approach beyond which no load is sought (length)
_STRAIGHT = 1e-10  # kappa below which a law is linear, far above round-off
NOT_RESOLVED = "curvature not resolved"
_CELL_X, _CELL_W = np.polynomial.legendre.leggauss(10)
_CELLS = np.geomspace(1e-9, 1.0, 91)  # ends of the cells of an integral over its upper limit, beside the knots
_STEP = 3e-3  # of differences over the approach


class Law(ABC):
    """Force over approach of a contact; subclasses are immutable.

    A subclass defines `force` and `slope`, and `sides` where it has an error.

    Attributes:
        contact: whether the force vanishes for ``z <= 0`` (False for a truncated series)
        known_to: largest approach of the points behind the law (length); beyond it motion is on a continuation
        knots: approaches at which the law is not smooth (length)

    Examples:
        A linear spring of 2 N/m that pushes only:

        >>> class Spring(Law):
        ...     def force(self, z):
        ...         return 2.0 * np.maximum(z, 0.0)
        ...     def slope(self, z):
        ...         return 2.0 * (np.asarray(z) > 0)
        >>> asp.ContactOscillator(Spring(), load=3.0).z_s
        1.5
    """

    contact = True
    known_to: float = np.inf
    knots: Array = np.empty(0)

    @abstractmethod
    def force(self, z: ArrayLike) -> Array:
        """Force at approaches `z` (length, any shape)."""

    @abstractmethod
    def slope(self, z: ArrayLike) -> Array:
        """Tangent stiffness (force/length) at approaches `z` (length, any shape)."""

    def sides(self) -> tuple[tuple[Law, Law], ...]:
        """Laws at both ends of each error that it has, a pair for an error; none where nothing bounds it."""
        return ()

    def potential(self, z: ArrayLike) -> Array:
        """Energy stored at `z`, the integral of the force from 0 (force * length)."""
        z = np.asarray(np.maximum(z, 0.0), float)
        top = float(z.max(initial=0.0))
        ends = np.unique(np.concatenate([[0.0], _CELLS * top, self.knots[(self.knots > 0.0) & (self.knots < top)]]))
        energy = np.append(0.0, np.cumsum(self._work(ends[:-1], ends[1:])))
        cell = np.searchsorted(ends, z, side="right") - 1
        return np.asarray(energy[cell] + self._work(ends[cell], z))

    def _work(self, start: Array, end: Array) -> Array:
        """Integral of the force from each approach to another, by Gauss' rule."""
        half = 0.5 * (end - start)
        return np.asarray(half * (self.force(start[..., None] + half[..., None] * (1.0 + _CELL_X)) @ _CELL_W))

    def derivatives(self, z: float) -> tuple[float, float, float]:
        """First three derivatives of the force at `z` (force/length, /length^2, /length^3)."""
        h = _STEP * z
        a, b, c, d, e = (float(k) for k in self.slope(z + h * np.arange(-2.0, 3.0)))
        return c, (a - 8.0 * b + 8.0 * d - e) / (12.0 * h), (-a + 16.0 * b - 30.0 * c + 16.0 * d - e) / (12.0 * h * h)

    def describe(self) -> str:
        """One line that names the law and its parameters."""
        return type(self).__name__

    def at(self, z: float) -> tuple[float, float]:
        """Force and stiffness at one approach."""
        return float(self.force(np.array([z]))[0]), float(self.slope(np.array([z]))[0])

    @property
    def default_load(self) -> float:
        """Preload where none is given (force): half of that of the last point, or the force at an approach of 1."""
        return 0.5 * self.at(self.known_to)[0] if np.isfinite(self.known_to) else self.at(1.0)[0]

    def deflection(self, load: float) -> float:
        """Static deflection (length): the approach at rest under `load` (force).

        Raises:
            RangeError: the law does not reach the load
        """
        load, high = positive("load", load), 1.0

        def short(z: float) -> float:
            with np.errstate(over="ignore"):  # far beyond a short table the power is large
                return self.at(z)[0] - load

        while short(high) < 0.0:
            high *= 2.0
            if high > _FARTHEST:
                raise RangeError(f"load = {load:g} lies outside the law, whose force is {load + short(high):g} at most")
        while short(0.5 * high) > 0.0:
            high *= 0.5
        return float(brentq(short, 0.5 * high, high, xtol=1e-15 * high, rtol=1e-14))

    def n_loc(self, z: float) -> float:
        """Local exponent ``z F'(z) / F(z)``; it equals n for a power law."""
        force, slope = self.at(z)
        return z * slope / force

    def kappa(self, z: float) -> float:
        """Backbone curvature: omega/omega_s = 1 + kappa a^2 (a: amplitude over z).

        ``kappa = (z^2/48) [3 P'''/P' - 5 (P''/P')^2]`` (multiple scales; Nayfeh & Mook 1979, section 2.3).
        """
        first, second, third = self.derivatives(z)
        return z**2 / 48.0 * (3.0 * third / first - 5.0 * (second / first) ** 2)

    def at_load(self, load: float) -> Array:
        """Approach (length), stiffness (force/length), local exponent and kappa under a load (force), (4,)."""
        z = self.deflection(load)
        return np.array([z, self.derivatives(z)[0], self.n_loc(z), self.kappa(z)])


def bar_of(law: Law, value: Callable[[Law], ArrayLike]) -> Array:
    """Bar of what is computed of a law: the same with its sides, the errors in quadrature; NaN where nothing bounds it.

    Raises:
        RangeError: a side of the law does not reach what is asked of it
    """
    pairs, centre = law.sides(), np.asarray(value(law), float)
    if not pairs:
        return np.full(centre.shape, np.nan)
    changes = [np.max([np.abs(np.asarray(value(side)) - centre) for side in pair], axis=0) for pair in pairs]
    return np.sqrt(np.sum(np.square(changes), axis=0))


def bend(low: float, high: float) -> str:
    """In words what the interval of kappa says of small motion."""
    if max(abs(low), abs(high)) < _STRAIGHT:
        return "linear"
    return "softening" if high < 0.0 else "hardening" if low > 0.0 else NOT_RESOLVED


@dataclass(frozen=True)
class PowerLaw(Law):
    """``F = K z^n`` for z > 0, zero otherwise.

    Attributes:
        n: exponent, 0.51 to 100
        K: coefficient (force/length^n), 1e-100 to 1e100
        known_to: largest approach of the fitted points (length); notes report results beyond it

    Raises:
        InputError: n or K is out of range

    Examples:
        >>> law = asp.PowerLaw(1.5, K=2.0)
        >>> law.force([0.0, 1.0, 4.0])
        array([ 0.,  2., 16.])
        >>> round(law.deflection(16.0), 6), law.n_loc(1.0), round(law.kappa(1.0), 6)
        (4.0, 1.5, -0.041667)
    """

    n: float
    K: float = 1.0
    known_to: float = np.inf

    __repr__ = short_repr

    def __post_init__(self) -> None:
        within("n", self.n, EXPONENT)
        within("K", self.K, COEFFICIENT)

    def force(self, z: ArrayLike) -> Array:
        return np.asarray(self.K * np.maximum(np.asarray(z, float), 0.0) ** self.n)

    def slope(self, z: ArrayLike) -> Array:
        s = np.maximum(np.asarray(z, float), 0.0)
        with np.errstate(divide="ignore", invalid="ignore"):  # n < 1: infinite stiffness at the point of separation
            return np.where(s > 0, self.n * self.K * s ** (self.n - 1.0), 0.0)

    def potential(self, z: ArrayLike) -> Array:
        return np.maximum(np.asarray(z, float), 0.0) * self.force(z) / (self.n + 1.0)

    def derivatives(self, z: float) -> tuple[float, float, float]:
        n, first = self.n, self.n * self.K * z ** (self.n - 1.0)
        return first, (n - 1) * first / z, (n - 1) * (n - 2) * first / z**2

    def deflection(self, load: float) -> float:
        with np.errstate(over="ignore"):
            return float(np.float64(positive("load", load) / self.K) ** (1.0 / self.n))

    def describe(self) -> str:
        return f"power law n = {self.n:g}, K = {self.K:g}"


@dataclass(frozen=True)
class TaylorLaw(Law):
    """Cubic Taylor series of a law about a static deflection, without contact loss.

    Attributes:
        z_s: static deflection (length)
        load: force at `z_s`
        p: first three derivatives of the force at `z_s` (force/length, /length^2, /length^3)

    Examples:
        >>> asp.TaylorLaw.about(asp.PowerLaw(1.5), load=1.0).p
        (1.5, 0.75, -0.375)
    """

    z_s: float
    load: float
    p: tuple[float, float, float]

    contact = False

    @classmethod
    def about(cls, law: Law, load: float) -> TaylorLaw:
        """Expand `law` about its static deflection under `load` (force)."""
        z_s = law.deflection(load)
        return cls(z_s, float(load), law.derivatives(z_s))

    @cached_property
    def _series(self) -> Polynomial:
        """Energy over z - z_s."""
        series = Polynomial([0.0, self.load, self.p[0] / 2, self.p[1] / 6, self.p[2] / 24])
        return series - series(-self.z_s)

    def _derivative(self, z: ArrayLike, order: int) -> Array:
        return np.asarray(self._series.deriv(order)(np.asarray(z, float) - self.z_s))

    def force(self, z: ArrayLike) -> Array:
        return self._derivative(z, 1)

    def slope(self, z: ArrayLike) -> Array:
        return self._derivative(z, 2)

    def potential(self, z: ArrayLike) -> Array:
        return self._derivative(z, 0)

    def derivatives(self, z: float) -> tuple[float, float, float]:
        first, second, third = (float(self._derivative(z, order)) for order in (2, 3, 4))
        return first, second, third

    def deflection(self, load: float) -> float:
        if not np.isclose(load, self.load, rtol=1e-12):
            raise RangeError(f"load = {load:g}: this series was expanded about load {self.load:g}")
        return self.z_s

    @property
    def default_load(self) -> float:
        return self.load

    def describe(self) -> str:
        return f"cubic Taylor series about z_s = {self.z_s:g}"

    def rims(self) -> tuple[float, float]:
        """Displacements u of the nearest saddles below and above the well, infinite where there is none.

        Motion beyond them escapes: a property of the truncated series, not of the contact.
        """
        p1, p2, p3 = self.p
        roots = np.roots([p3 / 6, p2 / 2, p1]) / self.z_s
        saddles = roots[np.abs(roots.imag) < 1e-12].real
        return float(saddles[saddles < 0].max(initial=-np.inf)), float(saddles[saddles > 0].min(initial=np.inf))
