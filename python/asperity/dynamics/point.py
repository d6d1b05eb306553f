"""Points and paths of branches of periodic orbits, and the cubics between points."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.optimize import brentq

from asperity.arrays import Array
from asperity.dynamics.equation import TURN

PIECES = 4  # of a forcing period
TOO_MUCH = "too much work"  # a reason why a path ends
SMALLEST = 1e-200  # determinant of a motion that has decayed completely


@dataclass(frozen=True)
class Point:
    """One periodic orbit on a branch, with the tangent of the branch; arrays are float.

    Attributes:
        y: states u, v at equally spaced phases, from 0, and Omega
        tangent: of the branch in these; its last entry changes sign at a fold
        extremes: u_max, u_min, and the cosine and sine coefficients at the forcing frequency (4,)
        slopes: their derivatives along the tangent (4,)
        trace, determinant: of the monodromy matrix over the period of the orbit
        det_error: deviation of the computed determinant from Liouville's, which is `determinant`
        error: estimated error of the orbit, relative to its amplitude
    """

    y: Array
    tangent: Array
    extremes: Array
    slopes: Array
    trace: float
    determinant: float
    det_error: float
    error: float

    @property
    def Omega(self) -> float:
        """Forcing frequency over omega_s."""
        return float(self.y[-1])

    @property
    def order(self) -> int:
        """Forcing periods per period of the orbit."""
        return self.y.size // (2 * PIECES)

    @property
    def states(self) -> Array:
        """States u, v at forcing phase 0, one for each forcing period (order, 2)."""
        return self.y[:-1].reshape(-1, 2)[::PIECES]

    @property
    def rate(self) -> float:
        """Change of Omega along the tangent."""
        return float(self.tangent[-1])

    @property
    def start(self) -> Array:
        """State u, v at forcing phase 0, for `ContactOscillator.simulate`."""
        return self.y[:2]

    @property
    def u_max(self) -> float:
        """Largest displacement."""
        return float(self.extremes[0])

    @property
    def u_min(self) -> float:
        """Smallest displacement; contact is lost where it is below -1."""
        return float(self.extremes[1])

    @property
    def amplitude(self) -> float:
        """Half of the range of u."""
        return 0.5 * (self.u_max - self.u_min) + 1e-300

    @property
    def a1(self) -> float:
        """Amplitude at the forcing frequency."""
        return float(np.hypot(*self.extremes[2:]))

    @property
    def phase(self) -> float:
        """Of u over the force at the forcing frequency, -270 to 90 degrees, so that -180 is no edge."""
        c, s = self.extremes[2:]
        return float(np.degrees((np.arctan2(-s, c) + 1.5 * np.pi) % TURN - 1.5 * np.pi))

    @property
    def fold(self) -> float:
        """Characteristic polynomial of the multipliers at 1."""
        return 1.0 - self.trace + self.determinant

    @property
    def flip(self) -> float:
        """Characteristic polynomial of the multipliers at -1."""
        return 1.0 + self.trace + self.determinant

    @property
    def radius(self) -> float:
        """Largest modulus of a multiplier."""
        half, root = 0.5 * abs(self.trace), 0.25 * self.trace**2 - self.determinant
        return half + float(np.sqrt(root)) if root > 0 else float(np.sqrt(self.determinant))

    @property
    def stable(self) -> bool:
        """Whether all multipliers lie in the unit circle (up to round-off)."""
        return self.radius <= 1.0 + 1e-7

    def phase_square(self, sign: float) -> float:
        """Psi^2 of multipliers sign * rho exp(+-i psi); negative where they are real and of that sign."""
        h = 0.5 * sign * self.trace / np.sqrt(max(self.determinant, SMALLEST))
        return float(np.arccos(np.clip(h, -1.0, 1.0)) ** 2 if h <= 1.0 else -(np.arccosh(h) ** 2))

    def turned(self) -> Point:
        """Same point with the opposite direction."""
        return replace(self, tangent=-self.tangent, slopes=-self.slopes)


@dataclass(frozen=True)
class Path:
    """Points in order along a branch, and the reasons why it begins and ends there."""

    points: tuple[Point, ...]
    end: str
    begin: str = "window"

    @property
    def order(self) -> int:
        """Forcing periods per period of its orbits."""
        return self.points[0].order


def hermite(start: Any, chord: Any, out: Any, into: Any) -> Array:
    """Coefficients (4, ...), lowest first, of the cubic over [0, 1] with the given slopes at its ends."""
    return np.array([start, out, 3.0 * chord - 2.0 * out - into, out + into - 2.0 * chord])


def value(cubic: Array, s: Any) -> Array:
    """Value of a cubic at the fraction s."""
    return np.asarray(cubic[0] + s * (cubic[1] + s * (cubic[2] + s * cubic[3])))


def root(at: Callable[[float], float], fa: float, fb: float, xtol: float = 1e-15) -> float:
    """Zero of a function over [0, 1] with the values fa and fb, of opposite signs, at the ends."""
    return float(brentq(lambda s: fa if s <= 0.0 else fb if s >= 1.0 else at(s), 0.0, 1.0, xtol=xtol, rtol=1e-14))
