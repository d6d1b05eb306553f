"""Bad surfaces."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from asperity.arrays import Floats

#: Heights in units of L at the nodes of a regular grid, from their coordinates (n, n) in the same units.
Map = Callable[[Floats, Floats], Floats]
SAMPLES = 33


def heights(of: Map, n: int = SAMPLES) -> Floats:
    """A height map in units of L (n, n)."""
    t = np.linspace(0.0, 1.0, n)
    return of(*np.meshgrid(t, t))


def two_peaks(x: Floats, y: Floats) -> Floats:
    """Two equal peaks on a diagonal."""
    one, other = (np.exp(-((x - c) ** 2 + (y - c) ** 2) / 0.02) for c in (0.25, 0.75))
    return 0.05 * (one + other)


def two_peaks_turned(x: Floats, y: Floats) -> Floats:
    """`two_peaks` with the peaks on the other diagonal."""
    return two_peaks(x, 1.0 - y)


def _wave(x: Floats, y: Floats) -> Floats:
    return 0.03 * np.cos(2 * np.pi * (x - 0.4)) * np.cos(2 * np.pi * (y - 0.55))


def noisy(x: Floats, y: Floats) -> Floats:
    """A wave with independent noise at each sample, 1 % of the height of the wave."""
    return _wave(x, y) + 5e-4 * np.random.default_rng(0).standard_normal(x.shape)


def spike(x: Floats, y: Floats) -> Floats:
    """A wave with one sample far above the others."""
    z = _wave(x, y)
    z[20, 9] += 0.1
    return z
