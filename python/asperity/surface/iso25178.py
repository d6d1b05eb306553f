"""Parameters of ISO 25178-2 of heights on a regular grid."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass

import numpy as np

from asperity.arrays import Array
from asperity.errors import InputError
from asperity.runtime.display import short_repr
from asperity.surface.base import Surface
from asperity.surface.height_map import HeightMap
from asperity.surface.spline import light_depth

RATIOS = 10_001  # material ratios of the Abbott curve
CORE = 0.4  # width of the secant of least slope (annex B)
DECAYED, DIRECTIONS = 0.2, 360  # of the autocorrelation, for Sal and Str; of lags in half a turn
LAGS = 2048  # heights per side for the autocorrelation, the most that its transform takes without gigabytes
GRID = 513  # nodes per side of a surface that is no map


@dataclass(frozen=True)
class ISO25178:
    """Areal parameters; heights are taken about their mean.

    Attributes:
        Sq, Sa, Sz, Sp, Sv: rms, mean absolute, total height, highest peak, deepest pit [length]
        Ssk, Sku: skewness and kurtosis
        Sdq: rms gradient
        Sdr: developed over projected area, minus 1
        Sal: lag of the fastest decay of the autocorrelation to 0.2 [length]; NaN where it does not decay on the patch
        Str: Sal over the lag of the slowest decay; NaN where that is beyond the patch
        Sk, Spk, Svk: core height, reduced peak height and reduced pit depth [length]
        Smr1, Smr2: material ratios between peaks, core and pits
    """

    Sq: float
    Sa: float
    Sz: float
    Sp: float
    Sv: float
    Ssk: float
    Sku: float
    Sdq: float
    Sdr: float
    Sal: float
    Str: float
    Sk: float
    Spk: float
    Svk: float
    Smr1: float
    Smr2: float

    __repr__ = short_repr

    def to_dict(self) -> dict[str, float | None]:
        """Values by name, None where unknown."""
        return {name: value if value == value else None for name, value in asdict(self).items()}


def abbott_curve(z: Array) -> tuple[Array, Array]:
    """Material ratios 0 to 1 (n,), and the height about the mean (n,) [length] which that share of the area exceeds."""
    ratio = np.linspace(0.0, 1.0, RATIOS)
    return ratio, np.quantile(z - z.mean(), 1.0 - ratio)


def core_and_ends(z: Array) -> tuple[float, float, float, float, float]:
    """Sk, Spk, Svk, Smr1 and Smr2 of heights of any shape [length], by the line through the core of the Abbott curve.

    Spk and Svk are heights of triangles with the area of the curve above and below the line.
    """
    ratio, height = abbott_curve(z)
    width = round(CORE * (RATIOS - 1))
    first = int(np.argmax(height[width:] - height[:-width]))  # the least slope, the first of equal ones
    slope, upper = np.polyfit(ratio[first : first + width + 1], height[first : first + width + 1], 1)
    peaks, pits = (float(np.interp(-end, -height, ratio)) for end in (upper, upper + slope))
    above = np.trapezoid(np.maximum(height - upper, 0.0), ratio)
    below = np.trapezoid(np.maximum(upper + slope - height, 0.0), ratio)
    Spk, Svk = (
        float(2.0 * area / share) if share > 0.0 else 0.0 for area, share in ((above, peaks), (below, 1.0 - pits))
    )
    return -float(slope), Spk, Svk, peaks, pits


def iso25178(z: Array, dx: float, dy: float) -> ISO25178:
    """Parameters of heights.

    Args:
        z: complete heights (ny, nx), levelled before [length]
        dx, dy: distances along x and y [length]

    Raises:
        InputError: the heights are all equal
    """
    z = z - z.mean()
    Sq = float(np.sqrt(np.mean(z**2)))
    if not Sq > 0.0:
        raise InputError("the heights are all equal: there is no roughness")
    Sk, Spk, Svk, Smr1, Smr2 = core_and_ends(z)
    zx, zy = np.diff(z, axis=1) / dx, np.diff(z, axis=0) / dy
    shortest, longest = _decay_lengths(z, dx, dy)
    # developed area: the mean of both ways to split each cell into triangles
    excess = [
        float(np.mean(np.sqrt(1.0 + x**2 + y**2) - 1.0)) for x in (zx[:-1], zx[1:]) for y in (zy[:, :-1], zy[:, 1:])
    ]
    return ISO25178(
        Sq=Sq, Sa=float(np.mean(np.abs(z))), Sz=float(np.ptp(z)), Sp=float(z.max()), Sv=-float(z.min()),
        Ssk=float(np.mean((z / Sq) ** 3)), Sku=float(np.mean((z / Sq) ** 4)),
        Sdq=math.sqrt(float(np.mean(zx**2) + np.mean(zy**2))), Sdr=sum(excess) / 4.0,
        Sal=shortest, Str=shortest / longest, Sk=Sk, Spk=Spk, Svk=Svk, Smr1=Smr1, Smr2=Smr2,
    )  # fmt: skip


def heights_of(surface: Surface) -> tuple[Array, float, float]:
    """Heights (ny, nx) and their distances along x and y: those of a map, or of a grid on another surface [length]."""
    z = surface.heights if isinstance(surface, HeightMap) else surface.grid(GRID)
    ny, nx = z.shape
    return z, surface.L / (nx - 1), surface.L / (ny - 1)


def light_approach(surface: Surface) -> float:
    """Approach from the summit (length), at most a tenth of the side, with a small share of the heights above it.

    The share does not depend on the spectrum. A spike takes all of the approach.
    """
    return min(light_depth(heights_of(surface)[0], surface.maximum()[2]), 0.1 * surface.L)


def _decay_lengths(z: Array, dx: float, dy: float) -> tuple[float, float]:
    """Lags of the fastest and of the slowest decay of the autocorrelation [length]; NaN where it does not decay."""
    from scipy.fft import irfft2, next_fast_len, rfft2
    from scipy.ndimage import map_coordinates

    stride = -(-max(z.shape) // LAGS)
    z, dx, dy = z[::stride, ::stride], stride * dx, stride * dy
    ny, nx = z.shape
    shape = [next_fast_len(2 * n, real=True) for n in (ny, nx)]
    power = np.abs(rfft2(z, s=shape)) ** 2
    raw = np.fft.fftshift(irfft2(power, s=shape))
    cy, cx = (n // 2 for n in shape)
    at = raw[cy : cy + ny, cx - nx + 1 : cx + nx]  # lags of half a turn, y from 0
    pairs = np.outer(ny - np.arange(ny), nx - np.abs(np.arange(-nx + 1, nx)))
    at = at / pairs
    at /= at[0, nx - 1]
    angles = np.arange(DIRECTIONS) * math.pi / DIRECTIONS
    step = 0.25 * min(dx, dy)
    lag = step * np.arange(int(math.hypot(nx * dx, ny * dy) / step))
    lengths = []
    for angle in angles:
        x, y = lag * math.cos(angle) / dx, lag * math.sin(angle) / dy
        inside = (np.abs(x) <= nx - 1) & (y <= ny - 1)
        along = map_coordinates(at, [y[inside], x[inside] + nx - 1], order=1)
        below = np.flatnonzero(along < DECAYED)
        if not below.size:
            lengths.append(math.nan)
            continue
        i = int(below[0])
        part = (along[i - 1] - DECAYED) / (along[i - 1] - along[i])
        lengths.append(step * (i - 1 + part))
    known = np.array(lengths)
    if np.isnan(known).all():
        return math.nan, math.nan
    return float(np.nanmin(known)), float(known.max())
