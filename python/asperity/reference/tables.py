"""Computed reference values: rough elastic surfaces (half-space FFT), flattened sphere (finite elements)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from asperity.surface import WeierstrassMandelbrot


@dataclass(frozen=True)
class RoughPoint:
    """One load of the reference surface, interface part only: the approach of the block adds P* (h_b/L) E'/M."""

    P_star: float
    delta_star: float
    area_fraction: float


#: Sides u.n = 0, nu = 0.3, the surface of rough_elastic_surface(). The rms slope is 0.137, so
#: half-space theory has errors of a few per cent.
ROUGH_ELASTIC = (
    RoughPoint(0.001367, 0.010038, 0.0267),
    RoughPoint(0.004102, 0.015552, 0.0668),
    RoughPoint(0.013674, 0.020244, 0.2033),
    RoughPoint(0.041022, 0.023305, 0.5274),
)

#: (D, G in m) -> (mean, standard deviation) of the exponent n of the whole block over
#: rough_elastic_surface(D, G, seed), seeds 0 to 5; h_b = L, delta*_max = 0.02, elastic, nu = 0.3,
#: linear norm. The choice of the points changes n by a few hundredths, other seeds by the deviation.
ROUGH_ELASTIC_FITS = {
    (2.4, 1e-13): (1.36, 0.04),
    (2.4, 1e-12): (1.79, 0.10),
    (2.4, 1.36e-11): (2.14, 0.17),
    (2.5, 1.36e-11): (1.77, 0.09),
    (2.6, 1.36e-11): (1.31, 0.03),
}


def rough_elastic_surface(D: float = 2.4, G: float = 1.36e-11, seed: int = 0) -> WeierstrassMandelbrot:
    """Surface of the tables, L = 1 um; the layout of its random phases is fixed."""
    phases = np.random.default_rng(seed).uniform(0, 2 * np.pi, size=(64, 11)).T[:, :6]
    return WeierstrassMandelbrot(L=1e-6, D=D, G=G, phases=phases)


#: E_t/E -> force over that at the onset of yield, of a hemisphere on a sliding base pressed by a rigid flat to
#: FLATTENED_DEPTHS times that approach (Jackson and Green's); E = 200 GPa, nu = 0.3, Y = 1 GPa, small strains.
#: Second-order triangles in the plane of r and z (a solver of its own); another mesh changes the forces by at most
#: 0.4 %, for E_t = 0 by 2 %.
FLATTENED_SPHERE = {
    0.0: (12.99, 25.78, 195.82, 444.63),
    0.1: (13.27, 26.79, 227.19, 555.46),
    0.3: (13.77, 28.41, 272.07, 713.35),
    0.5: (14.16, 29.75, 306.22, 835.05),
}
FLATTENED_DEPTHS = (6.0, 10.0, 50.0, 100.0)
