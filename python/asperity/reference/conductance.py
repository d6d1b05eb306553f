"""Conductance of a joint of two rough Gaussian faces in vacuum: laws of fully plastic and of elastic summits.

Both give h sigma/(k_s m): h per nominal area, sigma the rms height, m the mean absolute slope of a profile, k_s the
harmonic mean of the conductivities.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from asperity.arrays import Array

TABOR = 2.8  # hardness over yield strength of a perfectly plastic solid (Tabor 1951)


def cooper_mikic_yovanovich(pressure: ArrayLike, hardness: float) -> Array:
    """h sigma/(k_s m) = 1.25 (p/H)^0.95 of summits that flow, H the hardness of the softer body.

    M. G. Cooper, B. B. Mikic, M. M. Yovanovich, Int. J. Heat Mass Transfer 12 (1969) 279, in the form of Yovanovich,
    AIAA Progr. Astronaut. Aeronaut. 83 (1982) 83.
    """
    return np.asarray(1.25 * (np.asarray(pressure, float) / hardness) ** 0.95)


def mikic_elastic(pressure: ArrayLike, modulus: float, slope: float) -> Array:
    """h sigma/(k_s m) = 1.55 (p sqrt(2)/(E' m))^0.95 of elastic summits, E' and m of both bodies together.

    One body on its mirror has E' m of one body on a rigid flat. B. B. Mikic, Int. J. Heat Mass Transfer 17 (1974) 205.
    """
    return np.asarray(1.55 * (math.sqrt(2.0) * np.asarray(pressure, float) / (modulus * slope)) ** 0.95)
