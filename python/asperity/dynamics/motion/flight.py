# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

"""Free flight of the mass under gravity, forcing and, for some damping models, linear damping, in closed form."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq

from asperity.arrays import Array

_WINDOW = 64  # samples looked at together in the search for the landing


@dataclass(frozen=True)
class Flight:
    """Solution of u'' + c u' = 1/n + F^ cos(Omega tau) with u = u0 and u' = v0 at tau = start.

    Attributes:
        n: local exponent n_loc of the law.
        c: twice the damping ratio in flight.
        omega, forcing: Omega and F^.
        start: time of separation.
        u0, v0: displacement and speed there.
    """

    n: float
    c: float
    omega: float
    forcing: float
    start: float
    u0: float
    v0: float

    def position(self, s: Array) -> Array:
        """Return the displacement at the times `s` after separation, in their shape."""
        one, two = self.decay_integrals(s)
        return np.asarray(self.u0 + self._free_speed * one + two / self.n + (self._wave(s) - self._wave_at_start).real)

    def velocity(self, s: Array) -> Array:
        """Return the speed at the times `s` after separation, in their shape."""
        return np.asarray(
            self._free_speed * np.exp(-self.c * s)
            + self.decay_integrals(s)[0] / self.n
            + (1j * self.omega * self._wave(s)).real
        )

    def decay_integrals(self, s: Array) -> tuple[Array, Array]:
        """Return the first and second integral of exp(-c s)."""
        x = self.c * s
        small = np.abs(x) < 1e-3
        safe = np.where(small, 1.0, x)
        one = np.where(small, 1 - x / 2 + x * x / 6 - x**3 / 24, -np.expm1(-safe) / safe)
        two = np.where(small, 0.5 - x / 6 + x * x / 24 - x**3 / 120, (1.0 - one) / safe)
        return s * one, s * s * two

    def landing(self, length: float) -> float:
        """Return the time after separation at which u = -1 is reached from below, `length` if not before it.

        A contact shorter than the sampling is found as a maximum of u above -1.
        """
        s0 = 0.0
        first = min(length, max(1e-9, 0.02 * abs(self.v0) * self.n))
        spacing = min(self._period / 64.0, 0.1)
        previous: float | None = None
        while s0 < length:
            ends = max(s0, first), min(length, s0 + _WINDOW * spacing)
            grid = np.unique(np.concatenate([[first] if s0 == 0.0 else [s0], np.linspace(*ends, _WINDOW + 1)]))
            if previous is not None:
                grid = np.concatenate([[previous], grid])
            bracket = self._bracket(grid)
            if bracket is not None:
                if self._height(bracket[0]) >= 0:
                    return float(bracket[1])
                return float(brentq(self._height, *bracket, xtol=1e-15, rtol=1e-14))
            s0 = previous = float(grid[-1])
        return length

    def turns(self, end: float) -> list[float]:
        """Return the times after separation, up to `end`, at which the speed vanishes."""
        grid = np.linspace(0.0, end, max(3, int(64 * end / self._period) + 3))
        rates = self.velocity(grid)
        return [self._turn(grid[j], grid[j + 1]) for j in np.flatnonzero((rates[:-1] > 0) != (rates[1:] > 0))]

    def fourier_integrals(self, end: float) -> tuple[float, float]:
        """Return the integrals of u cos(Omega tau) and u sin(Omega tau) from separation to `end` after it."""
        pieces = max(1, int(np.ceil(4 * end / self._period)))
        x, w = np.polynomial.legendre.leggauss(20)
        edges = np.linspace(0.0, end, pieces + 1)
        nodes = (0.5 * (edges[1:] + edges[:-1])[:, None] + 0.5 * np.diff(edges)[:, None] * x).ravel()
        weights = (0.5 * np.diff(edges)[:, None] * w).ravel()
        path = self.position(nodes) * weights
        phase = self.omega * (self.start + nodes)
        return float(path @ np.cos(phase)), float(path @ np.sin(phase))

    @property
    def _period(self) -> float:
        return 2.0 * np.pi / self.omega

    @property
    def _response(self) -> complex:
        """Amplitude of the particular solution."""
        return self.forcing / complex(-self.omega * self.omega, self.c * self.omega)

    @property
    def _wave_at_start(self) -> complex:
        wave: complex = self._response * np.exp(1j * self.omega * self.start)
        return wave

    @property
    def _free_speed(self) -> float:
        """Speed of the free part at separation."""
        return self.v0 - (1j * self.omega * self._wave_at_start).real

    def _wave(self, s: Array) -> Array:
        """Return the particular solution as a complex number."""
        return np.asarray(self._response * np.exp(1j * self.omega * (self.start + s)))

    def _height(self, s: float) -> float:
        return float(self.position(np.array(s))) + 1.0

    def _turn(self, a: float, b: float) -> float:
        return float(brentq(lambda s: float(self.velocity(np.array(s))), a, b, xtol=1e-15))

    def _bracket(self, grid: Array) -> tuple[float, float] | None:
        """Return times between which the mass lands first, None if it does not land on the grid."""
        rates, up = self.velocity(grid), self.position(grid) + 1.0 > 0
        crossing = int(np.argmax(up)) if up.any() else grid.size
        humps = np.flatnonzero((rates[:-1] > 0) & (rates[1:] < 0) & ~up[:-1] & ~up[1:])
        for j in humps[humps < crossing]:
            top = self._turn(grid[j], grid[j + 1])
            if self._height(top) > 0:
                return grid[j], top
        if crossing < grid.size:
            return grid[crossing - 1] if crossing else 0.0, grid[crossing]
        return None
