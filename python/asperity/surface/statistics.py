"""Roughness parameters and power spectra of a sampled surface."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from asperity.arrays import Array
from asperity.errors import InputError
from asperity.runtime.display import short_repr

#: rms slope up to which small-strain, small-slope contact theory is accurate.
SMALL_SLOPE = 0.1


@dataclass(frozen=True)
class SurfaceStatistics:
    """Roughness parameters of the patch from a regular grid; heights are taken about their mean.

    Those of ISO 25178 are in `iso25178`.

    Attributes:
        Sq: rms height (length)
        Sz: height of the highest above the lowest node (length)
        rms_slope: sqrt(<|grad z|^2>) (dimensionless)
        rms_curvature: sqrt(<(laplacian z)^2>)/2 (1/length)
    """

    Sq: float
    Sz: float
    rms_slope: float
    rms_curvature: float

    __repr__ = short_repr


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
