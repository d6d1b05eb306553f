"""The shortest cut-off that makes a surface acceptable and leaves it nearly as high as before.

A cut-off is tried before it is recommended, so the filtered surface needs no second one.
"""

from __future__ import annotations

from collections.abc import Callable
from math import ceil, floor, log2, log10

import numpy as np

from asperity.surface.base import Surface
from asperity.surface.iso25178 import heights_of
from asperity.surface.spline import LIGHT, light_depth

KEPT = 0.75  # least rms height of the filtered surface over that of the surface
RUNGS = 4  # cut-offs tried per octave


def approach_of_share(surface: Surface, share: float = LIGHT) -> float:
    """Approach from the summit (length), at most a tenth of the side, with a share of the heights above it.

    The share does not depend on the spectrum. A spike takes all of the approach.
    """
    return min(light_depth(heights_of(surface)[0], share, surface.maximum()[2]), 0.1 * surface.L)


def share_of_approach(surface: Surface, delta: float) -> float:
    """Share of the heights above a flat at an approach from the summit (length)."""
    return float(np.mean(heights_of(surface)[0] > surface.maximum()[2] - delta))


def shortest_cutoff(surface: Surface, delta: float, accepts: Callable[[Surface, float], bool]) -> float | None:
    """Shortest cut-off, of two digits, that makes a surface acceptable (length).

    Args:
        surface: any; there is no cut-off of one without short waves
        delta: approach (length)
        accepts: whether a surface is acceptable at an approach, that with the same share of the heights above the flat

    Returns:
        None if none makes it acceptable that leaves three quarters of the rms height
    """
    if not surface.cutoff_key:
        return None
    share, height = share_of_approach(surface, delta), np.std(heights_of(surface)[0])

    def acceptable(cutoff: float) -> bool:
        filtered = surface.cut_off(cutoff)
        return accepts(filtered, approach_of_share(filtered, share))

    rungs = _rungs(surface.feature_size, surface.L / 2)
    rungs = rungs[: _first(rungs, lambda cutoff: bool(np.std(heights_of(surface.cut_off(cutoff))[0]) < KEPT * height))]
    if not rungs or not acceptable(rungs[-1]):
        return None
    return rungs[_first(rungs, acceptable)]


def _rungs(shortest: float, longest: float) -> list[float]:
    """Cut-offs in equal ratios, rounded up to two digits (length)."""
    rungs = [shortest * 2.0 ** (k / RUNGS) for k in range(1, max(int(RUNGS * log2(longest / shortest)), 0) + 1)]
    digits = [10.0 ** (floor(log10(rung)) - 1) for rung in rungs]
    return [float(f"{ceil(rung / digit) * digit:.1e}") for rung, digit in zip(rungs, digits, strict=True)]


def _first(rungs: list[float], holds: Callable[[float], bool]) -> int:
    """Index of the first cut-off from which on something holds, len(rungs) for none."""
    low, high = 0, len(rungs)
    while low < high:
        middle = (low + high) // 2
        low, high = (low, middle) if holds(rungs[middle]) else (middle + 1, high)
    return low
