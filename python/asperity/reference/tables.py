"""Figures for rough elastic surfaces, computed by an independent half-space FFT solver."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..surface import WeierstrassMandelbrot


@dataclass(frozen=True)
class RoughPoint:
    """One load of the reference surface, interface part only.

    Attributes:
        P_star: P/(A_0 E').
        delta_star: deflection of the interface over L; the block adds P* (h_b/L) E'/M.
        area_fraction: true over nominal contact area.
    """

    P_star: float
    delta_star: float
    area_fraction: float


#: Sides u.n = 0, nu = 0.3, the surface of rough_elastic_surface(); rms slope 0.137, so that
#: half-space theory is good to a few per cent.
ROUGH_ELASTIC = (
    RoughPoint(0.001367, 0.010038, 0.0267),
    RoughPoint(0.004102, 0.015552, 0.0668),
    RoughPoint(0.013674, 0.020244, 0.2033),
    RoughPoint(0.041022, 0.023305, 0.5274),
)

#: (D, G in m) -> (mean, standard deviation) of the exponent n of the whole block over
#: rough_elastic_surface(D, G, seed), seeds 0 to 5; h_b = L, delta*_max = 0.02, elastic, nu = 0.3,
#: linear norm. The points of a fit move n by a few hundredths, other seeds by the deviation.
ROUGH_ELASTIC_FITS = {
    (2.4, 1e-13): (1.36, 0.04),
    (2.4, 1e-12): (1.79, 0.10),
    (2.4, 1.36e-11): (2.14, 0.17),
    (2.5, 1.36e-11): (1.77, 0.09),
    (2.6, 1.36e-11): (1.31, 0.03),
}


def rough_elastic_surface(D: float = 2.4, G: float = 1.36e-11, seed: int = 0) -> WeierstrassMandelbrot:
    """Return a surface of the tables, L = 1 um, with phases of their own layout."""
    phases = np.random.default_rng(seed).uniform(0, 2 * np.pi, size=(64, 11)).T[:, :6]
    return WeierstrassMandelbrot(L=1e-6, D=D, G=G, phases=phases)
