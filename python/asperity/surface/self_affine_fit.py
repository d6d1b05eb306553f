# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

"""The self-affine equivalent of a spectrum: Hurst exponent and roll-off, and heights and slopes over a cut-off."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from asperity.arrays import Array
from asperity.errors import InputError
from asperity.surface.statistics import Spectrum

_PER_DECADE = 8  # bands of the wave number
_FIRST = 2  # waves per side from which the window does not disturb the spectrum
_MODEL = 0.02  # variance of ln C about the power law in any band
_CLIFF = 30.0  # a density that falls by this factor from band to band is beyond the cut-off of the surface
_PLATEAU = 3  # bands below the roll-off that show it
_GAIN = 0.5  # share of the squared misfit that a roll-off must leave at most


@dataclass(frozen=True)
class SelfAffineFit:
    """C(q) = C0 up to 2 pi/lambda_roll, C0 (q lambda_roll/2 pi)^(-2-2H) beyond.

    Attributes:
        H: Hurst exponent of the power law; a value outside 0 to 1 means that the surface is not self-affine.
        error_H: standard error of H from the scatter of the bands.
        lambda_roll: roll-off wavelength (length); None if the power law holds for all wavelengths of the patch.
        lambda_short: shortest wavelength used (length).
        lambda_long: longest wavelength used (length).
        C0: density at the roll-off, or at the longest wavelength used without one (length^4).

    >>> fit = SelfAffineFit(H=0.8, error_H=0.05, lambda_roll=0.3, lambda_short=0.01, lambda_long=0.5, C0=1e-6)
    >>> fit.H, fit.lambda_roll
    (0.8, 0.3)
    """

    H: float
    error_H: float
    lambda_roll: float | None
    lambda_short: float
    lambda_long: float
    C0: float

    def density(self, q: Array) -> Array:
        """Return C(q) (length^4) at wave numbers of any shape (1/length)."""
        over = q * (self.lambda_long if self.lambda_roll is None else self.lambda_roll) / (2 * math.pi)
        return np.asarray(self.C0 * (over if self.lambda_roll is None else np.maximum(over, 1.0)) ** (-2 - 2 * self.H))


def fit_self_affine(spectrum: Spectrum, shortest: float) -> SelfAffineFit:
    """Fit Hurst exponent and roll-off to a radial spectrum, in bands of equal ratio of wave numbers.

    >>> from asperity.surface import SelfAffine
    >>> from asperity.surface.self_affine_fit import fit_self_affine
    >>> surface = SelfAffine(L=1.0, H=0.8, rms_height=0.01, lambda_roll=0.2, lambda_short=0.01)
    >>> fit = fit_self_affine(surface.psd(512), shortest=0.01)
    >>> round(fit.H, 1), round(fit.lambda_roll, 1)
    (0.8, 0.2)

    Args:
        spectrum: radial, with one density for each multiple of 2 pi over the period.
        shortest: shortest wavelength to use (length).

    Raises:
        InputError: there are too few waves between the longest and the shortest, or the patch is flat.
    """
    q, C, variance_of_band = _bands(spectrum, shortest)
    if q.size < 4:
        raise InputError(
            f"the spectrum has {q.size} bands down to the wavelength {shortest:g}, a Hurst exponent needs 4"
        )
    x, y, weight = np.log(q), np.log(C), 1 / np.sqrt(variance_of_band)

    def line(x_roll: float) -> tuple[float, float, float, float]:
        """Return the misfit, the level at the roll-off, the exponent and its variance."""
        basis = np.stack([np.ones(x.size), -np.maximum(x - x_roll, 0.0)], axis=1)
        basis *= weight[:, None]
        (level, exponent), *_ = np.linalg.lstsq(basis, y * weight, rcond=None)
        misfit = float(np.sum((y * weight - basis @ (level, exponent)) ** 2))
        variance = np.linalg.inv(basis.T @ basis)[1, 1] * misfit / max(x.size - 3, 1)
        return misfit, float(level), float(exponent), float(variance)

    x_roll, found = x[0], line(x[0])
    candidates = np.linspace(x[_PLATEAU - 1], x[-3], 200) if x.size >= _PLATEAU + 3 else np.empty(0)
    best = min(candidates, key=lambda c: line(c)[0], default=x_roll)
    rolls = line(best)[0] <= _GAIN * found[0]
    if rolls:
        x_roll, found = best, line(best)
    _, level, exponent, variance = found
    roll, short, long = (2 * math.pi / math.exp(value) for value in (x_roll, x[-1], x[0]))
    return SelfAffineFit(
        H=exponent / 2 - 1,
        error_H=math.sqrt(variance) / 2,
        lambda_roll=roll if rolls else None,
        lambda_short=short,
        lambda_long=long,
        C0=math.exp(level),
    )


def rms_over_cutoff(spectrum: Spectrum, wavelengths: Array) -> tuple[Array, Array]:
    """Return rms height (length) and rms slope of the waves not shorter than each of some wavelengths (length).

    Args:
        spectrum: radial, with one density for each multiple of 2 pi over the period.
        wavelengths: cut-offs, any shape (length).

    >>> from asperity.surface import SelfAffine
    >>> surface = SelfAffine(L=1.0, H=0.8, slope=0.1, lambda_roll=0.5, lambda_short=0.05, seed=1)
    >>> rms_over_cutoff(surface.psd(128, window="none"), np.array([0.2, 0.05]))[1].round(2)
    array([0.06, 0.1 ])
    """
    q, C = spectrum.q, spectrum.density
    ring = C * q * q[0] / (2 * np.pi)  # mean square of the heights in a ring of width q[0]
    last = np.searchsorted(q, 2 * np.pi / np.asarray(wavelengths) * (1 + 1e-9), side="right")
    height, slope = (np.concatenate([[0.0], np.cumsum(part)])[last] for part in (ring, ring * q**2))
    return np.sqrt(height), np.sqrt(slope)


def _bands(spectrum: Spectrum, shortest: float) -> tuple[Array, Array, Array]:
    """Return wave numbers, mean densities and variances of their logarithms, of bands down to the shortest wavelength.

    A random density scatters by itself; the mean of m of them, which the window makes dependent, by 2/m.
    """
    q, C = spectrum.q, spectrum.density
    count = np.arange(1, q.size + 1)
    used = (count >= _FIRST) & (q <= 2 * np.pi / shortest * (1 + 1e-9)) & (C > 0)
    q, C, waves = q[used], C[used], np.pi * count[used]  # of different direction in a ring
    if not q.size:
        return q, C, waves
    band = np.floor(np.log10(q / q[0]) * _PER_DECADE + 1e-9).astype(int)
    there = np.unique(band)
    total = np.bincount(band, waves)[there]
    density = np.bincount(band, waves * C)[there] / total
    middle = np.exp(np.bincount(band, waves * np.log(q))[there] / total)
    cliffs = np.flatnonzero(density[1:] < density[:-1] / _CLIFF)
    end = int(cliffs[0]) if cliffs.size else density.size  # the band before it contains part of the cliff
    return middle[:end], density[:end], 2 / total[:end] + _MODEL
