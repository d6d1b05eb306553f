"""Elastic-plastic references: a sphere flattened by a rigid flat.

The material is J2 with linear isotropic hardening: Young's modulus E, yield strength Y, tangent modulus E_t.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from asperity.arrays import Array
from asperity.errors import InputError
from asperity.reference.elastic import Hertz, reduced_modulus

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
FLATTENED_DEPTHS = (6.0, 10.0, 50.0, 100.0)  # of the columns: approach over that at first yield


def hardening_modulus(E: float, E_t: float) -> float:
    """Plastic modulus H = E E_t/(E - E_t), the slope of stress over plastic strain.

    Raises:
        InputError: E_t is out of range
    """
    if not 0 <= E_t < E:
        raise InputError(f"tangent modulus {E_t:g} must lie between 0 and E = {E:g}.")
    return E * E_t / (E - E_t)


def kogut_etsion(delta: ArrayLike, R: float, E: float, nu: float, Y: float) -> tuple[Array, Array]:
    """(force, contact area) of an elastic-perfectly plastic sphere pressed by a rigid flat.

    Kogut and Etsion, J. Appl. Mech. 69 (2002) 657, hardness 2.8 Y; fits for delta up to
    110 delta_c, NaN beyond.
    """
    delta = np.asarray(delta, float)
    E_prime = reduced_modulus(E, nu)
    delta_c = (math.pi * (0.454 + 0.41 * nu) * 2.8 * Y / (2 * E_prime)) ** 2 * R
    w = delta / delta_c
    ranges = [w <= 1, w <= 6, w <= 110]
    force = np.select(ranges, [w**1.5, 1.03 * w**1.425, 1.40 * w**1.263], math.nan)
    area = np.select(ranges, [w, 0.93 * w**1.136, 0.94 * w**1.146], math.nan)
    return force * Hertz(R, E_prime).force(delta_c), area * math.pi * R * delta_c
