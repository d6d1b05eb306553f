"""Element sizes that share the error of the force among the spots of a contact at the least cost.

A spot of half-width a and force F_i adds F_i (h/a)^2 to the error of the force and A_i/h^2 elements to the mesh, A_i
being its area. Of all sizes h with one error, h ~ (A_i a^2/F_i)^(1/4) has the fewest elements: a spot that carries
little may be resolved less than one that carries much.
"""

from __future__ import annotations

import numpy as np
from scipy import ndimage

from asperity.arrays import Floats

LARGEST = 4.0  # size over the half-width of a spot: elements miss it in any case, and the half-space corrects it


def sizes_of_spots(pressure: Floats) -> Floats:
    """Sizes with which the sum of F_i/F (h_i/a_i)^2 over the spots is 1, at the cells of a grid (n, n) [side].

    Args:
        pressure: at the cells, not negative (n, n)

    Returns:
        Sizes, inf where there is no contact

    Examples:
        >>> pressure = np.zeros((64, 64))
        >>> pressure[8:24, 8:24] = 1.0
        >>> pressure[40:44, 40:44] = 1.0
        >>> sizes = sizes_of_spots(pressure)
        >>> bool(sizes[10, 10] < 8 / 64), bool(sizes[42, 42] > 2 / 64), float(sizes[0, 0])
        (True, True, inf)
    """
    n, touched = len(pressure), pressure > 0.0
    spot, count = ndimage.label(touched, np.ones((3, 3)))
    if count == 0:
        return np.full(pressure.shape, np.inf)
    inside = np.full(touched.shape, 0.5 * n) if touched.all() else ndimage.distance_transform_edt(touched)
    of = spot[touched] - 1
    half_width, area = np.zeros(count), np.bincount(of) / n**2
    np.maximum.at(half_width, of, inside[touched])  # ndimage.maximum sorts the whole grid
    half_width = np.clip(half_width - 0.5, 0.5, 0.5 * n) / n
    share = np.bincount(of, pressure[touched]) / pressure.sum()
    sizes = (area * half_width**2 / share) ** 0.25
    sizes /= np.sqrt(np.sum(share * (sizes / half_width) ** 2))
    return np.asarray(np.append(np.inf, np.minimum(sizes, LARGEST * half_width))[spot])
