"""Closed forms of elastic contact: Hertz, sinusoids, patch test."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from asperity.arrays import Array
from asperity.errors import InputError
from asperity.model.material import Material


def reduced_modulus(E: float, nu: float) -> float:
    """E' = E/(1-nu^2) of contact with a rigid body [force/length^2]."""
    return Material(E, nu).reduced_modulus


def block_modulus(E: float, nu: float, sides: Literal["rollers", "free"] = "rollers") -> float:
    """Modulus M of uniform compression of the block [force/length^2].

    With sides "rollers" (u.n = 0, confined) E(1-nu)/((1+nu)(1-2 nu)); "free" E: the base must then be free to expand.

    Raises:
        InputError: unknown sides
    """
    if sides not in ("rollers", "free"):
        raise InputError(f'sides must be "rollers" or "free", not {sides!r}.')
    return Material(E, nu).block_modulus(sides)


def patch_test_slope(nu: float, aspect: float = 1.0, sides: Literal["rollers", "free"] = "rollers") -> float:
    """dP*/d(delta*) of a flat block of height `aspect` L in full contact, (L/h_b) M/E'."""
    return block_modulus(1.0, nu, sides) / reduced_modulus(1.0, nu) / aspect


@dataclass(frozen=True)
class Hertz:
    """Sphere of radius R on a half-space: Johnson, Contact Mechanics (1985), section 4.2; E_prime is E/(1-nu^2).

    Examples:
        >>> hertz = asp.reference.Hertz(R=1.0, E_prime=3.0)
        >>> hertz.force([0.01, 0.04]).round(6), hertz.radius([0.01, 0.04]).round(6)
        (array([0.004, 0.032]), array([0.1, 0.2]))
    """

    R: float
    E_prime: float

    def force(self, delta: ArrayLike) -> Array:
        """F = (4/3) E' sqrt(R) delta^(3/2) [force] (Johnson 4.23)."""
        return 4 / 3 * self.E_prime * math.sqrt(self.R) * np.asarray(delta, float) ** 1.5

    def approach(self, force: ArrayLike) -> Array:
        """Approach delta [length], the inverse of `force`."""
        return (0.75 * np.asarray(force, float) / (self.E_prime * math.sqrt(self.R))) ** (2 / 3)

    def radius(self, delta: ArrayLike) -> Array:
        """Contact radius a = sqrt(R delta) [length]."""
        return np.sqrt(self.R * np.asarray(delta, float))

    def peak_pressure(self, delta: ArrayLike) -> Array:
        """P0 = (2 E'/pi) sqrt(delta/R) [force/length^2]."""
        return 2 * self.E_prime / math.pi * np.sqrt(np.asarray(delta, float) / self.R)

    def pressure(self, r: ArrayLike, delta: float) -> Array:
        """P0 sqrt(1 - r^2/a^2) [force/length^2] at distance r from the axis; 0 outside."""
        inside = 1 - np.asarray(r, float) ** 2 / (self.R * delta)
        return self.peak_pressure(delta) * np.sqrt(np.maximum(inside, 0.0))


@dataclass(frozen=True)
class Westergaard:
    """Wave z = A cos(2 pi x/lam) in plane strain: Westergaard (1939), Johnson (1985) 13.2; E_prime is E/(1-nu^2).

    Examples:
        >>> wave = asp.reference.Westergaard(A=0.01, lam=1.0, E_prime=1.0)
        >>> print(f"{wave.full_pressure:.5f}, {wave.area_fraction(0.5 * wave.full_pressure):.3f}")
        0.03142, 0.500
    """

    A: float
    lam: float
    E_prime: float

    @property
    def full_pressure(self) -> float:
        """Mean pressure of full contact p* = pi E' A/lam [force/length^2]."""
        return math.pi * self.E_prime * self.A / self.lam

    def mean_pressure(self, area_fraction: ArrayLike) -> Array:
        """p = p* sin^2(pi a/lam) [force/length^2] at the area fraction 2a/lam."""
        return self.full_pressure * np.sin(np.pi / 2 * np.asarray(area_fraction, float)) ** 2

    def area_fraction(self, pressure: ArrayLike) -> Array:
        """Area fraction 2a/lam at the mean pressure; 1 at p* and above."""
        r = np.minimum(np.asarray(pressure, float) / self.full_pressure, 1.0)
        return 2 / np.pi * np.arcsin(np.sqrt(r))

    def approach(self, pressure: ArrayLike) -> Array:
        """Approach of the mean planes A r (1 - ln r), r = p/p* <= 1 [length].

        The compression p h_b/M of a block must be added. The formula follows from the pressure by integrating
        d(gap)/dp (Johnson 13.10).
        """
        r = np.minimum(np.asarray(pressure, float) / self.full_pressure, 1.0)
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.where(r > 0, self.A * r * (1 - np.log(r)), 0.0)

    def mean_gap(self, pressure: ArrayLike) -> Array:
        """Mean gap A (1 - r + r ln r), r = p/p* [length]: A at first touch, 0 in full contact."""
        return self.A - self.approach(pressure)

    def pressure(self, x: ArrayLike, mean: float) -> Array:
        """Pressure at x (crest at 0) under a mean pressure below p* (Johnson 13.8)."""
        angle = np.pi * np.asarray(x, float) / self.lam
        edge = mean / self.full_pressure  # sin^2(pi a/lam)
        inside = np.maximum(edge - np.sin(angle) ** 2, 0.0)
        return 2 * mean * np.abs(np.cos(angle)) * np.sqrt(inside) / edge
