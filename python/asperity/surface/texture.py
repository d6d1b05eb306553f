"""What a levelled height map is besides random roughness: a form, or waves that repeat."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from asperity.arrays import Array

FIRST, STEP = 3, 3  # waves per side of the longest wave sought; to its neighbours, beyond the lobe of the window
STANDS_OUT = 100.0  # density over those of its neighbours; on random surfaces it is below 40
SHARE = 0.05  # least part of the mean square height in it


@dataclass(frozen=True)
class Wave:
    """A wave that repeats over the map, as the grooves of a turned surface.

    Attributes:
        length: wavelength (length)
        share: part of the mean square height of the map, its harmonics not counted
    """

    length: float
    share: float


def repeating_wave(z: Array, L: float) -> Wave | None:
    """Strongest wave of a map if the spectrum has a line there, else None.

    The density there is compared with that of waves of the same direction a little longer and a little shorter: a
    ground surface has all lengths in one direction, a turned one the feed and its harmonics.

    Args:
        z: heights (n, n) (length)
        L: distance of the first and the last height of a row (length)
    """
    n = len(z)
    taper = np.sin(np.pi * (np.arange(n) + 0.5) / n) ** 2
    power = np.abs(np.fft.fft2((z - z.mean()) * taper * taper[:, None])) ** 2
    power = np.fft.fftshift(power)
    middle = n // 2
    k = np.arange(n) - middle
    radius = np.hypot(k[:, None], k)
    inside = (radius >= FIRST) & (radius < middle - STEP - 1) & (k[:, None] >= 0)
    if not inside.any() or not power.any():
        return None
    iy, ix = np.unravel_index(int(np.where(inside, power, 0.0).argmax()), power.shape)
    ky, kx = k[iy], k[ix]
    towards = np.array([ky, kx]) / math.hypot(ky, kx)

    def mean(steps: float) -> float:
        y, x = np.rint(np.array([iy, ix]) + steps * towards).astype(int)
        return float(power[y - 1 : y + 2, x - 1 : x + 2].mean())

    line = power[iy - 2 : iy + 3, ix - 2 : ix + 3]
    share = 2 * float(line.sum()) / float(power.sum())
    if share < SHARE or power[iy, ix] < STANDS_OUT * max(mean(-STEP), mean(STEP)):
        return None
    off = np.arange(-2, 3)  # the centre of a line is between the wave numbers of the transform
    ky, kx = ky + np.average(off, weights=line.sum(1)), kx + np.average(off, weights=line.sum(0))
    return Wave(L * n / (n - 1) / float(np.hypot(ky, kx)), min(share, 1.0))
