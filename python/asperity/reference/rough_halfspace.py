"""Force and area of a rough half-space over the approach, from heights on a grid, with a greatest pressure.

It sees every spot of a surface in seconds, where a finite element mesh needs elements smaller than the spots.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from math import ceil

import numpy as np
from numpy.typing import ArrayLike

from asperity.arrays import Array, Floats
from asperity.errors import InputError
from asperity.reference.halfspace import compliance_of_waves, corrected_area, displacement
from asperity.runtime.display import short_repr
from asperity.surface import Surface

HARDNESS = 3.0  # of a full plastic indentation over the yield strength; Tabor, The Hardness of Metals (1951)
_ITERATIONS = 200  # at one approach; what is left then is far below the use of the result
SINGLE = 1e-4  # tolerance from which single precision is enough: it changes forces by 1e-7 to 3e-5 at 1e-3
_STRIDE = 256  # cosine transforms of multiples of it take up to twice as long: their columns share cache lines


def cells_per_side(least: float) -> int:
    """Number of cells per side of a `RoughHalfSpace` with a fast transform, no fewer than `least`."""
    from scipy.fft import next_fast_len

    n = next_fast_len(ceil(least), real=True)  # no factors above 5, which the cosine transform wants too
    return n if n % _STRIDE else cells_per_side(n + 1)


@dataclass(frozen=True)
class RoughHalfSpace:
    """Rigid flat on a layer, small slopes, elastic up to a greatest pressure.

    The pressure minimises the complementary energy under 0 <= p <= hardness (Almqvist, Sahlin, Larsson & Glavatskih,
    Tribol. Int. 40 (2007) 574), by projected conjugate gradients with a cosine or Fourier transform.

    Attributes:
        n: cells per side of the patch
        height: thickness of the layer [L]
        nu: Poisson's ratio
        sides: "rollers" (u.n = 0), "periodic" or "free"; free sides change the compression of the layer only
        hardness: greatest pressure over E', inf for an elastic layer

    Examples:
        >>> surface = asp.reference.rough_elastic_surface()
        >>> layer = asp.reference.RoughHalfSpace(n=64, height=1.0, nu=0.3)
        >>> curve = layer.curve(layer.heights(surface), surface.maximum()[2] / surface.L, [0.01, 0.02])
        >>> curve.P_star.round(4), bool(curve.area_fraction[0] < curve.area_fraction[1])
        (array([0.0011, 0.0047]), True)
    """

    n: int
    height: float
    nu: float
    sides: str = "rollers"
    hardness: float = np.inf

    def heights(self, surface: Surface) -> Floats:
        """Heights at the centres of the cells (n, n), index [iy, ix] [L]."""
        centres = (np.arange(self.n) + 0.5) * (surface.L / self.n)
        return surface.on_product(centres, centres) / surface.L

    def curve(
        self,
        heights: Floats,
        summit: float,
        delta_star: ArrayLike,
        tolerance: float = 1e-3,
        on_part: Callable[[float], None] | None = None,
        starts: Sequence[Array] = (),
    ) -> RoughCurve:
        """Press the layer to ascending approaches.

        Args:
            heights, summit, delta_star, tolerance, starts: see `pressures`
            on_part: called after each approach with the part of them that is done

        Raises:
            InputError: the approaches do not ascend from above zero
        """
        delta = np.asarray(delta_star, dtype=float)
        touched_at = np.full(heights.shape, np.inf)
        force, area = [], []
        for k, p in enumerate(self.pressures(heights, summit, delta, tolerance, starts)):
            touched_at[(p > 0.0) & np.isinf(touched_at)] = delta[k]
            force.append(float(p.mean()))
            area.append(self.area(p))
            if on_part is not None:
                on_part((k + 1) / len(delta))
        return RoughCurve(delta, np.array(force), np.array(area), touched_at)

    def area(self, pressure: Floats) -> float:
        """True over nominal area of contact under a pressure (n, n), corrected for the perimeter."""
        return max(corrected_area(pressure > 0.0, self.sides), 0.0)

    def pressures(
        self,
        heights: Floats,
        summit: float,
        delta_star: ArrayLike,
        tolerance: float = 1e-3,
        starts: Sequence[Array] = (),
    ) -> Iterator[Floats]:
        """Pressures over E' (n, n) at ascending approaches, one after the other.

        Args:
            heights: of the surface at the centres of the cells (n, n) [L]
            summit: height that the flat touches first [L]
            delta_star: ascending approaches from there (k,) [L]
            tolerance: largest gap in contact and penetration elsewhere, over the greatest approach
            starts: pressures over E' to begin with, as of a similar surface (k, n, n); default those of the approach
                before

        Raises:
            InputError: the approaches do not ascend from above zero
        """
        delta = np.asarray(delta_star, dtype=float)
        if not (len(delta) and delta[0] > 0.0 and np.all(np.diff(delta) > 0.0)):
            raise InputError(f"delta_star = {delta.tolist()} must ascend from above 0")
        precision = np.single if tolerance >= SINGLE else np.double
        compliance = compliance_of_waves(self.n, self.height, self.nu, self.sides).astype(precision)
        p = np.zeros(heights.shape, dtype=precision)
        for k, d in enumerate(delta):
            penetration = (heights - (summit - d)).astype(precision)
            p = starts[k].astype(precision) if len(starts) else p
            p = _press(p, penetration, compliance, self.sides, self.hardness, tolerance * delta[-1])
            yield p.astype(float)


@dataclass(frozen=True)
class RoughCurve:
    """Curve of a `RoughHalfSpace`: approach over L, mean pressure over E' and corrected area fraction, each (k,).

    Attributes:
        touched_at: first of the approaches at which each cell is in contact, inf for never (n, n) [L]
    """

    delta_star: Floats
    P_star: Floats
    area_fraction: Floats
    touched_at: Floats

    __repr__ = short_repr


def _press(start: Array, penetration: Array, compliance: Array, sides: str, hardness: float, tolerance: float) -> Array:
    """Pressure over E' (n, n) under a flat that the undeformed surface penetrates by `penetration` (n, n) [L].

    It begins with `start` (n, n); `compliance` is that of each wave (n, n) [L], `hardness` the greatest pressure over
    E', `tolerance` the largest gap in contact and penetration elsewhere [L].
    """
    p, within = start, np.zeros(penetration.shape, dtype=bool)
    outside = penetration > 0.0
    while outside.any():  # a thin layer bulges beside the spots: it may touch where the undeformed surface does not
        within |= outside | (p > 0.0)
        p, gap = _press_within(within, p, penetration, compliance, sides, hardness, tolerance)
        outside = (gap < -tolerance) & ~within
    return p


def _press_within(
    within: Array, start: Array, penetration: Array, compliance: Array, sides: str, hardness: float, tolerance: float
) -> tuple[Array, Array]:
    """Pressure and gap (n, n) where nothing but the cells `within` (n, n) may touch; see `_press`.

    Few cells touch a rough surface: what is done besides the transforms is done for them.
    """
    cells = np.flatnonzero(within)
    grid = np.zeros(penetration.shape, penetration.dtype)  # in rows, for ravel to be a view

    def displaced(values: Array) -> Array:
        grid.ravel()[cells] = values
        return displacement(grid, compliance, sides)

    depth = penetration.ravel()[cells]
    p = np.clip(start.ravel()[cells] if start.any() else np.maximum(depth, 0.0) / compliance.max(), 0.0, hardness)
    direction, previous, conjugate = np.zeros_like(p), 1.0, False
    for _ in range(_ITERATIONS):
        displaced_by_p = displaced(p)
        gap = displaced_by_p.ravel()[cells] - depth
        full = (p >= hardness) & (gap < 0.0)  # flows under the greatest pressure
        free = (p > 0.0) & ~full
        apart = -float(gap[~full].min(initial=0.0))
        if max(float(np.abs(gap[free]).max(initial=0.0)), apart) <= tolerance:
            break
        square = float(np.sum(gap[free] ** 2))
        direction = np.where(free, gap + (square / previous if conjugate else 0.0) * direction, 0.0)
        previous = square or 1.0
        image = displaced(direction).ravel()[cells]
        curvature = float(np.sum(image[free] * direction[free]))
        step = float(np.sum(gap[free] * direction[free])) / curvature if curvature > 0.0 else 0.0
        new = np.clip(p - step * direction, 0.0, hardness)
        overlap = (new == 0.0) & (gap < 0.0)
        new[overlap] -= (step or 1.0 / compliance.max()) * gap[overlap]
        conjugate = not overlap.any() and bool(np.all((new >= hardness) == (p >= hardness)))
        p = np.minimum(new, hardness)
    grid.ravel()[cells] = p
    return grid, displaced_by_p - penetration
