"""Static laws of a contact: force over approach, as a reversible spring.

A law gives force, stiffness and potential at an approach `z` (length), measured from first contact: a contact
law is zero for ``z <= 0``. The equations of vibration use a law only in its normal form about a preload,
`Restoring`:

    f(u) = [F_s(z_s (1 + u)) - W] / (z_s F_s'(z_s)),    F_s(z_s) = W,    free flight f = -1/n_loc,

with ``n_loc = z_s F_s'(z_s) / W``; contact is lost at ``u = -1``.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import brentq

from asperity.arrays import Array
from asperity.errors import InputError, RangeError

_GAUSS_X, _GAUSS_W = np.polynomial.legendre.leggauss(16)
EXPONENT = (0.25, 100.0)  # outside, no practical number of harmonics describes the orbits
COEFFICIENT = (1e-100, 1e100)
EXTRAPOLATE = "extrapolate the law (extrapolate=True, asperity dynamics --extrapolate)"  # advice of messages
_SMALL = 0.05  # below this |u| the potential is integrated or summed: differences of potentials cancel


def positive(name: str, value: float, *, zero: bool = False) -> float:
    """Return `value` as a float; raise `InputError` unless it is finite and positive (or zero)."""
    try:
        number = float(value)
    except (TypeError, ValueError):
        raise InputError(f"{name} = {value!r} is not legal: it must be a number") from None
    if not np.isfinite(number) or number < 0 or (number == 0 and not zero):
        legal = "at least 0" if zero else "greater than 0"
        raise InputError(f"{name} = {value} is not legal: it must be finite and {legal}")
    return number


def within(name: str, value: float, legal: tuple[float, float]) -> float:
    """Return `value` as a float; raise `InputError` unless it is in the legal range."""
    number, (low, high) = positive(name, value), legal
    if not low <= number <= high:
        raise InputError(f"{name} = {number:g} is not legal: it must lie between {low:g} and {high:g}")
    return number


def positives(name: str, values: Any) -> tuple[float, ...]:
    """Return one number or several as a tuple; raise `InputError` if there is none or one is not positive."""
    several = isinstance(values, Iterable) and not isinstance(values, str)
    if isinstance(values, np.ndarray):
        several = values.ndim > 0
    numbers = tuple(positive(name, value) for value in (values if several else (values,)))
    if not numbers:
        raise InputError(f"{name} is empty: give at least one value greater than 0")
    return numbers


class Law(ABC):
    """Force over approach of a contact; subclasses are immutable.

    A subclass defines `both`, `potential`, `derivatives` and `describe`, and a finite `z_range` unless it also
    defines `deflection`.

    Examples:
        A linear spring of 2 N/m that pushes only:

        >>> class Spring(Law):
        ...     z_range = (0.0, 1e3)
        ...
        ...     def both(self, z):
        ...         return 2.0 * np.maximum(z, 0.0), np.where(np.asarray(z) > 0, 2.0, 0.0)
        ...
        ...     def potential(self, z):
        ...         return np.maximum(z, 0.0) ** 2
        ...
        ...     def derivatives(self, z):
        ...         return 2.0, 0.0, 0.0
        ...
        ...     def describe(self):
        ...         return "spring"
        >>> spring = Spring()
        >>> spring.force([-1.0, 0.5])
        array([0., 1.])
        >>> asp.ContactOscillator(spring, load=3.0).restoring.z_s
        1.5
    """

    contact = True
    """Whether the force vanishes for ``z <= 0`` (False for a truncated series)."""

    extrapolate = True
    """Whether approaches outside `z_range` are allowed."""

    scalar = False
    """Whether `at` works on plain floats, many times faster than `both` on an array of one element."""

    @abstractmethod
    def both(self, z: Array) -> tuple[Array, Array]:
        """Return force and stiffness (force/length) at approaches `z` (length, any shape)."""

    def push(self, z: Array) -> Array:
        """Return the force alone at `z`, without range check."""
        return self.both(z)[0]

    def at(self, z: float) -> tuple[float, float]:
        """Return force and stiffness at one approach, without range check, for the inner loop of integration."""
        force, slope = self.both(np.array([z]))
        return float(force[0]), float(slope[0])

    @abstractmethod
    def potential(self, z: ArrayLike) -> Array:
        """Return the energy stored at `z`, the integral of the force from 0 (force * length)."""

    @abstractmethod
    def derivatives(self, z: float) -> tuple[float, float, float]:
        """Return the first three derivatives of the force at `z` (force/length, /length^2, /length^3)."""

    @abstractmethod
    def describe(self) -> str:
        """Return one line that names the law and its parameters."""

    @property
    def z_range(self) -> tuple[float, float]:
        """Smallest and largest approach at which the law is known (length)."""
        return (0.0, np.inf)

    def force(self, z: ArrayLike) -> Array:
        """Return the force at `z` (length, any shape).

        Raises:
            RangeError: an approach lies outside `z_range` of a law that does not extrapolate.
        """
        return self.both(self._checked(z))[0]

    def stiffness(self, z: ArrayLike) -> Array:
        """Return the tangent stiffness (force/length) at `z` (length, any shape).

        Raises:
            RangeError: as for `force`.
        """
        return self.both(self._checked(z))[1]

    def deflection(self, load: float) -> float:
        """Return the static deflection (length): the approach at rest under `load` (force).

        Raises:
            RangeError: the law does not reach the load.
        """
        load = positive("load", load)
        low, high = self.z_range
        top = float(self.both(np.array([high]))[0][0])
        if load > top:
            raise RangeError(
                f"load = {load:g} lies outside the law, which ends at force {top:g}; lower the load, "
                "or compute the curve further"
            )
        return float(
            brentq(lambda z: float(self.both(np.array([z]))[0][0]) - load, low, high, xtol=1e-15 * high, rtol=1e-14)
        )

    def doubts(self, load: float) -> tuple[str, ...]:
        """Return reasons to doubt the law near a load (force), one sentence each."""
        return ()

    def n_loc(self, z: float) -> float:
        """Return the local exponent ``z F'(z) / F(z)``; it equals n for a power law."""
        return z * self.derivatives(z)[0] / float(self.both(np.array([z]))[0][0])

    def kappa(self, z: float) -> float:
        """Return the backbone curvature: omega/omega_s = 1 + kappa a^2 (a: amplitude over z).

        ``kappa = (z^2/48) [3 P'''/P' - 5 (P''/P')^2]`` (multiple scales; Nayfeh & Mook 1979, section 2.3).
        """
        p1, p2, p3 = self.derivatives(z)
        return z**2 / 48.0 * (3.0 * p3 / p1 - 5.0 * (p2 / p1) ** 2)

    def well(self, u: Array, z_s: float, load: float, scale: float) -> Array:
        """Return the normalised potential ``V(u)``, the integral of f from 0 to u."""
        u = np.asarray(u, float)
        inside = np.maximum(u, -1.0) if self.contact else u
        value = (self.potential(z_s * (1 + inside)) - self.potential(z_s) - load * z_s * inside) / (scale * z_s)
        small = np.abs(u) < _SMALL
        if small.any():
            v = u[small]
            s = 0.5 * v[..., None] * (1.0 + _GAUSS_X)
            f = (self.both(z_s * (1 + s))[0] - load) / scale
            value = np.array(value)
            value[small] = 0.5 * v * (f @ _GAUSS_W)
        return value + (inside - u) * load / scale

    def _checked(self, z: ArrayLike) -> Array:
        z = np.asarray(z, float)
        if not self.extrapolate:
            low, high = self.z_range
            if z.size and (z.max() > high * (1 + 1e-12) or (not self.contact and z.min() < low)):
                worst = z.max() if z.max() > high else z.min()
                raise RangeError(
                    f"approach {worst:g} lies outside the law, known from {low:g} to {high:g}; "
                    f"compute the curve further, or {EXTRAPOLATE}"
                )
        return z


@dataclass(frozen=True)
class PowerLaw(Law):
    """``F = K z^n`` for z > 0, zero otherwise.

    Attributes:
        n: exponent, 0.25 to 100.
        K: coefficient (force/length^n), 1e-100 to 1e100.
        ci_n: 95 % confidence interval of n, or None.
        ci_K: 95 % confidence interval of K, or None.
        correlation: correlation of the estimates of ln K and n.
        fitted_to: largest approach of the fitted points (length); notes report results beyond it.

    Raises:
        InputError: n or K is out of range, or an interval does not contain its value.

    Examples:
        >>> law = asp.PowerLaw(1.5, K=2.0)
        >>> law.force([0.0, 1.0, 4.0])
        array([ 0.,  2., 16.])
        >>> round(law.deflection(16.0), 6), law.n_loc(1.0), round(law.kappa(1.0), 6)
        (4.0, 1.5, -0.041667)
    """

    n: float
    K: float = 1.0
    ci_n: tuple[float, float] | None = None
    ci_K: tuple[float, float] | None = None
    correlation: float = 0.0
    fitted_to: float = np.inf

    scalar = True

    def __post_init__(self) -> None:
        within("n", self.n, EXPONENT)
        within("K", self.K, COEFFICIENT)
        for name, value, ci in (("n", self.n, self.ci_n), ("K", self.K, self.ci_K)):
            if ci is not None and not (0 < ci[0] <= value <= ci[1]):
                raise InputError(f"ci_{name} = {ci} must be positive and hold {name} = {value:g}")

    @classmethod
    def from_fit(cls, fit: Any, length: float = 1.0, force: float = 1.0) -> PowerLaw:
        """Return the law ``F = force * k (z/length)^n`` of a `PowerLawFit`, with its confidence intervals.

        Args:
            fit: fit in dimensionless variables, with k, n, ci_k, ci_n, correlation and range.
            length: unit of the approach (L for delta*).
            force: unit of the force (A_0 E' for P*).
        """
        shift = np.log(length)
        half_n = 0.5 * (fit.ci_n[1] - fit.ci_n[0])
        half_k = 0.5 * np.log(fit.ci_k[1] / fit.ci_k[0])
        covariance = fit.correlation * half_n * half_k
        half_K = np.sqrt(max(half_k**2 - 2 * shift * covariance + shift**2 * half_n**2, 0.0))
        mixed = covariance - shift * half_n**2
        with np.errstate(over="ignore"):
            K = force * fit.k * np.float64(length) ** -fit.n
        return cls(
            float(fit.n),
            float(K),
            (max(float(fit.n - half_n), 1e-12), float(fit.n + half_n)),
            (float(K * np.exp(-half_K)), float(K * np.exp(half_K))),
            float(np.clip(mixed / (half_n * half_K), -1, 1)) if half_n * half_K > 0 else 0.0,
            float(fit.range[1] * length),
        )

    def both(self, z: Array) -> tuple[Array, Array]:
        s = np.maximum(z, 0.0)
        if self.n < 1:  # the stiffness is infinite at the point of separation
            with np.errstate(divide="ignore"):
                slope = np.where(s > 0, s ** (self.n - 1.0), 0.0)
        else:
            slope = s ** (self.n - 1.0)
            if self.n == 1:
                slope = np.where(np.asarray(z) > 0, 1.0, 0.0)
        slope = self.K * slope
        return slope * s, self.n * slope

    def push(self, z: Array) -> Array:
        return self.K * np.maximum(z, 0.0) ** self.n

    def at(self, z: float) -> tuple[float, float]:
        if z <= 0.0:
            return 0.0, 0.0
        slope = self.K * z ** (self.n - 1.0)
        return slope * z, self.n * slope

    def potential(self, z: ArrayLike) -> Array:
        return self.K * np.maximum(np.asarray(z, float), 0.0) ** (self.n + 1.0) / (self.n + 1.0)

    def derivatives(self, z: float) -> tuple[float, float, float]:
        n, p1 = self.n, self.n * self.K * z ** (self.n - 1.0)
        return p1, (n - 1) * p1 / z, (n - 1) * (n - 2) * p1 / z**2

    def deflection(self, load: float) -> float:
        with np.errstate(over="ignore"):
            return float(np.float64(positive("load", load) / self.K) ** (1.0 / self.n))

    def describe(self) -> str:
        return f"power law n = {self.n:g}, K = {self.K:g}"

    def well(self, u: Array, z_s: float, load: float, scale: float) -> Array:
        n, u = self.n, np.asarray(u, float)
        s = np.maximum(1.0 + u, 0.0)
        value = (s ** (n + 1.0) / (n + 1.0) - (1.0 + u)) / n + 1.0 / (n + 1.0)
        small = np.abs(u) < _SMALL
        if small.any():  # binomial series: the closed form cancels
            v = u[small]
            term, total = v * v, v * v / 2.0
            for j in range(2, 16):
                term = term * v * (n - j + 1) / j
                total = total + term / (j + 1)
            value = np.array(value)
            value[small] = total
        return value


@dataclass(frozen=True)
class TaylorLaw(Law):
    """Cubic Taylor series of a law about a static deflection, without contact loss.

    Attributes:
        z_s: static deflection (length).
        load: force at `z_s`.
        p: first three derivatives of the force at `z_s` (force/length, /length^2, /length^3).

    Examples:
        The force of the series stays positive where the contact has opened:

        >>> series = asp.TaylorLaw.about(asp.PowerLaw(1.5), load=1.0)
        >>> series.p
        (1.5, 0.75, -0.375)
        >>> series.force([1.0, 1.1, 0.0]).round(6)
        array([ 1.      ,  1.153688, -0.0625  ])
    """

    z_s: float
    load: float
    p: tuple[float, float, float]

    contact = False
    scalar = True

    @classmethod
    def about(cls, law: Law, load: float) -> TaylorLaw:
        """Expand `law` about its static deflection under `load` (force)."""
        z_s = law.deflection(load)
        return cls(z_s, float(load), law.derivatives(z_s))

    @property
    def z_range(self) -> tuple[float, float]:
        return (-np.inf, np.inf)

    def both(self, z: Array) -> tuple[Array, Array]:
        x = np.asarray(z, float) - self.z_s
        p1, p2, p3 = self.p
        return (self.load + x * (p1 + x * (p2 / 2 + x * p3 / 6)), p1 + x * (p2 + x * p3 / 2))

    def at(self, z: float) -> tuple[float, float]:
        x = z - self.z_s
        p1, p2, p3 = self.p
        return self.load + x * (p1 + x * (p2 / 2 + x * p3 / 6)), p1 + x * (p2 + x * p3 / 2)

    def potential(self, z: ArrayLike) -> Array:
        p1, p2, p3 = self.p

        def primitive(x: Array | float) -> Array | float:
            return x * (self.load + x * (p1 / 2 + x * (p2 / 6 + x * p3 / 24)))

        return np.asarray(primitive(np.asarray(z, float) - self.z_s) - primitive(-self.z_s))

    def well(self, u: Array, z_s: float, load: float, scale: float) -> Array:
        p1, p2, p3 = self.p
        u = np.asarray(u, float)
        x = z_s * u
        return u * u * z_s * (p1 / 2 + x * (p2 / 6 + x * p3 / 24)) / scale

    def derivatives(self, z: float) -> tuple[float, float, float]:
        x = z - self.z_s
        p1, p2, p3 = self.p
        return p1 + x * (p2 + x * p3 / 2), p2 + x * p3, p3

    def deflection(self, load: float) -> float:
        if not np.isclose(load, self.load, rtol=1e-12):
            raise RangeError(f"load = {load:g}: this series was expanded about load {self.load:g}")
        return self.z_s

    def describe(self) -> str:
        return f"cubic Taylor series about z_s = {self.z_s:g}"

    def rim(self) -> float:
        """Return the displacement u of the nearest saddle below the well, -inf if there is none.

        Motion beyond it escapes: a property of the truncated series, not of the contact.
        """
        p1, p2, p3 = self.p
        z = self.z_s
        roots = np.roots([p3 * z * z / (6 * p1), p2 * z / (2 * p1), 1.0])
        real = roots[np.abs(roots.imag) < 1e-12].real
        below = real[real < 0]
        return float(below.max()) if below.size else -np.inf

    def rim_above(self) -> float:
        """Return the displacement u of the nearest saddle above the well, +inf if there is none."""
        p1, p2, p3 = self.p
        z = self.z_s
        roots = np.roots([p3 * z * z / (6 * p1), p2 * z / (2 * p1), 1.0])
        above = roots[(np.abs(roots.imag) < 1e-12) & (roots.real > 0)].real
        return float(above.min()) if above.size else np.inf
