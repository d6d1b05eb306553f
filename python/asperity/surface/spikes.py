"""Dust, spikes and streaks in a height map: heights that stand far above their surroundings."""

from __future__ import annotations

import numpy as np

from asperity.arrays import Array
from asperity.errors import InputError

WINDOW = 7  # nodes per side of the surroundings; it sees streaks of up to three rows
STANDS_OUT = 15.0  # over the usual distance from the median, from which a height is a spike
MOST = 0.05  # share of the heights beyond which they are features of the surface


def prominence_of_summit(z: Array) -> float:
    """Height of the highest node above the median of its surroundings, over the usual size of this difference.

    On self-affine surfaces that of a node is at most 12, of their summits 4.

    Args:
        z: heights (ny, nx) (length)
    """
    row, column = np.unravel_index(int(z.argmax()), z.shape)
    part = np.pad(z, WINDOW // 2, mode="symmetric")[row : row + WINDOW, column : column + WINDOW]
    return float((z[row, column] - np.median(part)) / _usual(z))


def without_spikes(z: Array) -> Array:
    """Heights with NaN in place of spikes and of the nodes next to them, whose heights a spike may have raised.

    Args:
        z: heights (ny, nx) (length)

    Raises:
        InputError: more than a twentieth of the heights stand out
    """
    from scipy.ndimage import binary_dilation

    spikes = binary_dilation(_above(z) > STANDS_OUT * _usual(z), structure=np.ones((3, 3)))
    if spikes.mean() > MOST:
        raise InputError(
            f"{spikes.mean():.0%} of the heights stand out of their surroundings, more than {MOST:.0%}: features of "
            "the surface, no spikes; leave out --despike, or cut a window"
        )
    return np.where(spikes, np.nan, z)


def _above(z: Array) -> Array:
    """Heights above the median of their surroundings (ny, nx) (length)."""
    from scipy.ndimage import median_filter

    return np.asarray(z - median_filter(z, size=WINDOW, mode="reflect"))


def _usual(z: Array) -> float:
    """Standard deviation of heights from the median of their surroundings by the median absolute one (length)."""
    above = _above(z[tuple(slice(max(n - 512, 0) // 2, (n + 512) // 2) for n in z.shape)])  # the middle is enough
    return 1.4826 * float(np.median(np.abs(above))) or float(np.sqrt(np.mean(above**2))) or 1.0
