"""Elastic-plastic references: a sphere flattened by a rigid flat.

The material is J2 with linear isotropic hardening: Young's modulus E, yield strength Y, tangent modulus E_t.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

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


@dataclass(frozen=True)
class _Yield:
    """Onset of yield of a flattened sphere after Jackson and Green (2005), eqs. 6-12."""

    E_prime: float
    nu: float
    Y: float
    R: float

    @property
    def C(self) -> float:
        return 1.295 * math.exp(0.736 * self.nu)

    @property
    def delta(self) -> float:
        return (math.pi * self.C * self.Y / (2 * self.E_prime)) ** 2 * self.R

    @property
    def force(self) -> float:
        return 4 / 3 * (self.R / self.E_prime) ** 2 * (self.C / 2 * math.pi * self.Y) ** 3

    def plastic_radius(self, w: Array) -> Array:
        """Contact radius over R at w = delta/delta_c > 1.9."""
        B = 0.14 * math.exp(23 * self.Y / self.E_prime)
        return math.pi * self.C * self.Y / (2 * self.E_prime) * np.sqrt(w * (w / 1.9) ** B)

    def plastic_force(self, w: Array, hardness: Array) -> Array:
        """F/F_c for hardness H_G/Y."""
        return np.exp(-0.25 * w ** (5 / 12)) * w**1.5 + 4 * hardness / self.C * w * (1 - np.exp(-(w ** (5 / 9)) / 25))


def jackson_green(delta: ArrayLike, R: float, E: float, nu: float, Y: float) -> tuple[Array, Array]:
    """(force, contact area) of an elastic-perfectly plastic sphere of radius R pressed by a rigid flat.

    Jackson and Green, J. Tribol. 127 (2005) 343; a fit to finite elements with errors of a few per
    cent. Hertz below 1.9 delta_c.
    """
    delta = np.asarray(delta, float)
    onset = _Yield(reduced_modulus(E, nu), nu, Y, R)
    w = np.maximum(delta / onset.delta, 1.9)
    ratio = onset.plastic_radius(w)
    hardness = 2.84 * (1 - np.exp(-0.82 * ratio**-0.7))
    elastic = delta <= 1.9 * onset.delta
    hertz = Hertz(R, onset.E_prime)
    force = np.where(elastic, hertz.force(delta), onset.force * onset.plastic_force(w, hardness))
    area = np.where(elastic, math.pi * R * delta, math.pi * (R * ratio) ** 2)
    return force, area


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


def ghaednia(delta: ArrayLike, R: float, E: float, nu: float, Y: float, E_t: float) -> tuple[Array, Array]:
    """(force, contact area) of a bilinearly hardening sphere pressed by a rigid flat.

    Ghaednia, Brake, Berryhill and Jackson, J. Tribol. 141 (2019) 031402, eqs. 21-30, eq. 26 as
    corrected in the authors' own implementation; a fit to finite elements with errors of 5 to 8 %.

    Raises:
        InputError: E_t is out of range
    """
    hardening_modulus(E, E_t)
    delta = np.asarray(delta, float)
    onset = _Yield(reduced_modulus(E, nu), nu, Y, R)
    hertz = Hertz(R, onset.E_prime)
    w = np.maximum(delta / onset.delta, 1.9)
    stiff, ratio = math.sqrt(E / Y), E_t / E
    # interpolation of the radius between perfectly plastic (E_t = 0) and elastic
    upsilon = (-2 * stiff / (4 - 3 * math.exp(-2 * stiff * ratio)) / (1 - ratio)) * ratio ** (
        1 - (delta - onset.delta) / R
    )
    plastic_radius = R * onset.plastic_radius(w)
    a = hertz.radius(delta) + (plastic_radius - hertz.radius(delta)) * np.exp(upsilon)
    hardness = 2.84 - 0.92 * (1 - np.cos(math.pi * a / R))
    plastic = onset.force * onset.plastic_force(w, hardness)
    elastic = hertz.force(delta)
    force = plastic + (elastic - plastic) * (1 - math.exp(-3.3 * ratio))
    small = delta <= 1.9 * onset.delta
    return (
        np.where(small, elastic, force),
        np.where(small, math.pi * R * delta, math.pi * a**2),
    )
