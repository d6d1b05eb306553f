"""Radial power spectrum of heights, and its self-affine equivalent: Hurst exponent and roll-off.

The scatter of the bands says little of the exponent, for which roll-off a spectrum has is known no better: a later one
makes a steeper law. The error bar therefore holds every exponent that with any roll-off, or with none, fits nearly as
well as the best.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from asperity.arrays import Array
from asperity.errors import InputError
from asperity.runtime.display import short_repr

_PER_DECADE = 8  # bands of the wave number
_FIRST = 2  # waves per side from which levelling does not disturb the spectrum
_LONGEST = 2.5  # waves per side of the longest roll-off that bands from _FIRST on can show
_ROLLS = 80  # roll-offs tried
_MODEL = 0.02  # variance of ln C about the power law in any band
_CLIFF, _STEEP = 10.0, 6  # a density that falls so much in two waves per side, of more than so many, is cut off
_SIGNIFICANT = 7.0  # drop of the squared misfit that shows a roll-off, or a bend; on surfaces without one it is below 6
_AS_GOOD = 4.0  # rise of it that is chance: two standard deviations
_UNKNOWN = 0.5  # error bar that holds as much as all exponents of self-affine surfaces


@dataclass(frozen=True)
class Spectrum:
    """A radial power spectral density.

    Attributes:
        q: angular wave number 2 pi/wavelength (1/length), rising, without 0, (m,)
        density: at q, (m,) (length^4)
    """

    q: Array
    density: Array

    __repr__ = short_repr


def psd(z: Array, L: float, window: str = "hann") -> Spectrum:
    """Radial power spectral density, in the conventions of Jacobs, Junge and Pastewka (2017).

    Surf. Topogr.: Metrol. Prop. 5 013001. The discrete transform includes the factor dx dy, so that <z^2> = sum of
    C(q)/L^2 over all wave vectors. The windowed heights are rescaled to the power of the unwindowed ones.

    Args:
        z: heights (n, n) at i L/n (length); the period of the transform is L; the mean is subtracted
        L: side of the patch (length)
        window: "hann" (suppresses the jump at the edges of a patch that is not periodic) or "none"

    Returns:
        Mean of the density over rings of width 2 pi/L

    Raises:
        InputError: unknown window
    """
    if window not in ("hann", "none"):
        raise InputError(f'psd window must be "hann" or "none", not {window!r}.')
    n, z = len(z), z - z.mean()
    taper = np.sin(np.pi * (np.arange(n) + 0.5) / n) ** 2 if window == "hann" else np.ones(n)
    taper = taper / np.sqrt(np.mean(taper**2))
    power = np.abs(np.fft.fft2(z * taper * taper[:, None])) ** 2 * (L / n) ** 4 / L**2
    k = np.fft.fftfreq(n, 1 / n)
    ring = np.rint(np.hypot(k[:, None], k)).astype(int).ravel()
    density = np.bincount(ring, power.ravel()) / np.bincount(ring)
    index = np.arange(1, n // 2)
    return Spectrum(2 * np.pi * index / L, density[index])


@dataclass(frozen=True)
class SelfAffineFit:
    """C(q) = C0 up to 2 pi/lambda_roll, C0 (q lambda_roll/2 pi)^(-2-2H) beyond.

    Attributes:
        H: Hurst exponent of the power law; a value outside 0 to 1 means that the surface is not self-affine
        error_H: error bar of H, which holds those of the roll-offs that fit as well
        lambda_roll: roll-off wavelength (length); None if the power law holds for all wavelengths of the patch
        lambda_short: shortest wavelength used (length)
        lambda_long: longest wavelength used (length)
        C0: density at the roll-off, or at the longest wavelength used without one (length^4)
    """

    H: float
    error_H: float
    lambda_roll: float | None
    lambda_short: float
    lambda_long: float
    C0: float

    def density(self, q: Array) -> Array:
        """C(q) (length^4) at wave numbers of any shape (1/length)."""
        over = q * (self.lambda_long if self.lambda_roll is None else self.lambda_roll) / (2 * math.pi)
        return np.asarray(self.C0 * (over if self.lambda_roll is None else np.maximum(over, 1.0)) ** (-2 - 2 * self.H))


def fit_self_affine(spectrum: Spectrum, shortest: float) -> SelfAffineFit:
    """Fit Hurst exponent and roll-off to a radial spectrum, in bands of equal ratio of wave numbers.

    Args:
        spectrum: radial, with one density for each multiple of 2 pi over the period
        shortest: shortest wavelength to use (length)

    Raises:
        InputError: there are too few waves between the longest and the shortest, or the spectrum is far from a power
            law: it bends, or the exponent is not known to 0.5; or the patch is flat
    """
    x, y, weight = _bands(spectrum, shortest)
    if x.size < 4:
        raise InputError(
            f"the spectrum has {x.size} bands down to the wavelength {shortest:g}, a Hurst exponent needs 4"
        )
    without, first, last = _line(x, y, weight, None), math.log(_LONGEST), x[-3]  # three bands beyond at least
    rolls = np.linspace(first, last, _ROLLS) if first < last else np.empty(0)
    lines = [without, *(_line(x, y, weight, float(roll)) for roll in rolls)]
    best = min(lines, key=lambda line: line.misfit)
    scatter = max(1.0, best.misfit / max(x.size - 3, 1))
    found = best if without.misfit - best.misfit > _SIGNIFICANT * scatter else without
    off = [abs(line.exponent - found.exponent) + line.reach(best.misfit + _AS_GOOD * scatter) for line in lines]
    H, error = found.exponent / 2 - 1, max(off) / 2
    if error >= _UNKNOWN:
        raise InputError(
            f"the spectrum has too few waves, or is far from a power law: it would be {H:.2f} ± {error:.2g}"
        )
    bent = min(_line(x, y, weight, line.x_roll, bends=True).misfit for line in lines)
    if best.misfit - bent > _SIGNIFICANT:
        raise InputError(
            f"the spectrum bends, as where heights are smoothed, noisy or in few steps, the roll-off is gradual or the "
            f"surface has a lay: no power law holds down to the wavelength {shortest:g}"
        )
    L = 2 * math.pi / float(spectrum.q[0])
    return SelfAffineFit(
        H=H,
        error_H=error,
        lambda_roll=None if found.x_roll is None else L / math.exp(found.x_roll),
        lambda_short=L / math.exp(x[-1]),
        lambda_long=L / math.exp(x[0]),
        C0=math.exp(found.level - (found.exponent * x[0] if found.x_roll is None else 0.0)),
    )


@dataclass(frozen=True)
class _Line:
    """Least squares: ln C = level - exponent (x - x_roll) beyond the roll-off, x_roll = 0 without one."""

    x_roll: float | None
    level: float
    exponent: float
    variance: float
    misfit: float

    def reach(self, misfit: float) -> float:
        """How far the exponent may be from its best value for so large a squared misfit; -inf for a smaller one."""
        return math.sqrt((misfit - self.misfit) * self.variance) if misfit >= self.misfit else -math.inf


def _bands(spectrum: Spectrum, shortest: float) -> tuple[Array, Array, Array]:
    """Logs of mean waves per side and of density of bands down to the shortest wavelength, and weights of the latter.

    A random density scatters by itself; the mean of m of them, which the window makes dependent, by 2/m.
    """
    q, C = spectrum.q, spectrum.density
    count: Array = np.arange(1.0, q.size + 1)
    used = (count >= _FIRST) & (q <= 2 * np.pi / shortest * (1 + 1e-9)) & (C > 0)
    count, C = count[used], C[used]
    if not count.size:
        return (count,) * 3
    cliffs = np.flatnonzero((C[2:] < C[:-2] / _CLIFF) & (count[:-2] >= _STEEP))
    count, C = (column[: cliffs[0] + 1] if cliffs.size else column for column in (count, C))
    waves = np.pi * count  # of different direction in a ring
    band = np.unique(np.floor(np.log10(count / count[0]) * _PER_DECADE + 1e-9), return_inverse=True)[1]
    total = np.bincount(band, waves)
    density = np.bincount(band, waves * C) / total
    middle = np.bincount(band, waves * np.log(count)) / total
    return middle, np.log(density), 1 / np.sqrt(2 / total + _MODEL)


def _line(x: Array, y: Array, weight: Array, x_roll: float | None, bends: bool = False) -> _Line:
    """Fit the law with a given roll-off, or without; with an exponent that changes along it if it bends."""
    law = x if x_roll is None else np.maximum(x - x_roll, 0.0)
    powers = [np.ones(law.size), -law, law**2][: 3 if bends else 2]
    basis, right = np.stack(powers, axis=1) * weight[:, None], y * weight
    found, *_ = np.linalg.lstsq(basis, right, rcond=None)
    misfit = float(np.sum((right - basis @ found) ** 2))
    variance = np.linalg.pinv(basis.T @ basis)[1, 1]
    return _Line(x_roll, float(found[0]), float(found[1]), float(variance), misfit)
