"""Whether one patch stands for a joint: the stiffness that other patches of the same roughness add to it.

A joint is many patches under one plane. A layer in small-slope theory presses the patch of the run and others of the
same statistics, each at the same distance of the flat from its mean plane; the mean of their pressures is that of the
joint.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from asperity.arrays import Array, Floats
from asperity.errors import InputError
from asperity.model.problem import Problem
from asperity.reference.halfspace import HARDNESS, RoughHalfSpace, cells_per_side
from asperity.surface import HeightMap, Surface, WeierstrassMandelbrot
from asperity.surface.spectrum import fit_self_affine, psd

USUAL_HURST = 0.8  # of machined and fractured surfaces
OTHERS = 4  # patches with other seeds; a map is compared with its quarters
CELLS = 64, 128  # fewest and most per side
PER_WAVE = 3.0  # cells per shortest wave
PLANES, DEEPER = 16, 4.0  # heights of the flat, and the lowest over the approach of the patch under the preload
PRECISION = 3e-3  # of the gap, over the greatest approach


@dataclass(frozen=True)
class Spread:
    """What other patches change of the stiffness of a joint.

    Attributes:
        change: stiffness of the mean of all patches over that of the one in the run, minus 1
        error: standard error of that mean, over the stiffness
        patches: number of patches, the own one included
    """

    change: float
    error: float
    patches: int

    @property
    def bar(self) -> float:
        """Relative bar of a joint's stiffness by its patch."""
        return abs(self.change) + self.error

    def __str__(self) -> str:
        """The change and its standard error in words."""
        word = "softer" if self.change < 0.0 else "stiffer"
        return f"{100 * abs(self.change):.0f} % ± {100 * self.error:.0f} percentage points {word}"

    def to_dict(self) -> dict[str, Any]:
        """Section "patches" of summary.json."""
        return {"change": self.change, "error": self.error, "bar": self.bar, "patches": self.patches}


def spread_of_patches(problem: Problem, pressure: float) -> Spread | None:
    """Compare the patch of a problem with others of its roughness, in one process.

    Args:
        problem: with the surface of the patch
        pressure: nominal, of the preload [force/length^2]

    Returns:
        None where there are no others: the surface is neither random nor a map, or they do not carry the preload
    """
    solid, surface = problem.material, problem.surface
    target = pressure / solid.reduced_modulus
    hardness = math.inf if solid.yield_strength is None else HARDNESS * solid.yield_strength / solid.reduced_modulus
    if not 0.0 < target < hardness:
        return None
    n = cells_per_side(float(np.clip(PER_WAVE * surface.L / surface.feature_size, *CELLS)))
    layer = RoughHalfSpace(n, problem.height / surface.L, solid.nu, problem.sides, hardness)
    own = layer.heights(surface)
    patches = [own, *_others(surface, layer, own)]
    top, depth = float(own.max()), float(np.ptp(own)) * np.geomspace(1e-3, 1.0, 13)
    alone = _carried(layer, own, top - depth)
    if len(patches) == 1 or not alone[0] < target < alone[-1]:
        return None
    approach = float(np.exp(np.interp(math.log(target), np.log(np.maximum(alone, 1e-300)), np.log(depth))))
    highest = max(float(heights.max()) for heights in patches)
    planes = highest - np.geomspace(0.1 * approach, highest - top + DEEPER * approach, PLANES)
    carried = np.array([_carried(layer, heights, planes) for heights in patches])
    without = [np.delete(carried, i, axis=0).mean(axis=0) for i in range(len(patches))]
    found = [_stiffness(planes, mean, target) for mean in (carried[0], carried.mean(axis=0), *without)]
    known = [k for k in found if k is not None]
    if len(known) < len(found):
        return None
    mine, whole, *parts = known
    error = math.sqrt(len(patches) - 1) * float(np.std(parts))  # jackknife
    return Spread(whole / mine - 1.0, error / mine, len(patches))


def hurst_without_end(surface: Surface) -> tuple[float, bool] | None:
    """Hurst exponent of a surface whose roughness goes on in waves longer than its patch, and whether it is measured.

    That of a fractal, or of a map without a roll-off; a map whose exponent is unknown gets USUAL_HURST. None where the
    model of the surface, or the spectrum of the map, ends on the patch.
    """
    if isinstance(surface, WeierstrassMandelbrot):
        return 3.0 - surface.D, True
    if not isinstance(surface, HeightMap):
        return None
    side = min(surface.heights.shape)
    z = surface.heights[:side, :side]
    try:
        found = fit_self_affine(psd(z, surface.L), 4.0 * surface.L / side)
    except InputError:
        return USUAL_HURST, False
    return None if found.lambda_roll is not None else (min(max(found.H, 0.0), 1.0), True)


def _others(surface: Surface, layer: RoughHalfSpace, own: Floats) -> Iterator[Floats]:
    """Heights of other patches about their mean plane (n, n) [L]: other seeds, or the quarters of a map."""
    seed, phases = getattr(surface, "seed", None), getattr(surface, "phases", None)
    again: Any = replace
    drawn = {} if phases is None else {"phases": None}
    explicit = phases is not None and not np.array_equal(again(surface, **drawn).phases, phases)
    if seed is not None and not explicit:
        for k in range(1, OTHERS + 1):
            other = again(surface, seed=seed + 1000 + k, **drawn)
            yield layer.heights(other) - float(other.mean() - surface.mean()) / surface.L
    elif isinstance(surface, HeightMap):
        half = len(own) // 2
        for part in (own[:half, :half], own[:half, half:], own[half:, :half], own[half:, half:]):
            wide = np.pad(part, [(0, len(own) - half)] * 2, mode="symmetric")  # mirrored
            yield wide - float(wide.mean() - own.mean())


def _carried(layer: RoughHalfSpace, heights: Floats, planes: Array) -> Floats:
    """Mean pressure over E' under the flat at descending heights [L], zero above the summit."""
    top = float(heights.max())
    touching = planes < top
    found = np.zeros(len(planes))
    if touching.any():
        found[touching] = layer.curve(heights, top, top - planes[touching], PRECISION).P_star
    return found


def _stiffness(planes: Array, carried: Floats, target: float) -> float | None:
    """Slope of the pressure over the approach where it is the target [1/L], None where that is not reached."""
    before = np.maximum.accumulate(np.concatenate([[0.0], carried[:-1]]))
    some = np.flatnonzero(carried > before * (1.0 + 1e-9))  # the iteration may end a little lower
    if len(some) < 3 or not carried[some[0]] < target < carried[some[-1]]:
        return None
    from scipy.interpolate import PchipInterpolator

    law = PchipInterpolator(np.log(carried[some]), -planes[some])
    slope = float(law(math.log(target), 1))  # of the approach over the logarithm of the pressure
    return target / slope if slope > 0.0 else None
