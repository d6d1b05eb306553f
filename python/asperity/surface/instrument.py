# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

"""Limit of a scanning probe: summits on scales below it are those of its tip."""

from __future__ import annotations

from asperity.arrays import Array

SHARPEST = 0.5  # curvature of a summit times the tip radius from which the tip shows (Sanner et al.)


def reliable_wavelength(z: Array, dx: float, dy: float, tip_radius: float) -> float:
    """Shortest wavelength of which the heights are not those of the tip, 0 where all are reliable; inf where none is.

    A tip rounds summits and sharpens valleys, for heights scanned by a sphere are at most as curved as the sphere. The
    second difference over a distance is compared with half of that curvature, as in Sanner, Nöhring, Thimons, Jacobs &
    Pastewka, Appl. Surf. Sci. Adv. 7 (2022) 100190; the wavelength is the length of its stencil.

    Args:
        z: heights (ny, nx) without gaps [length]
        dx, dy: distances between them [length]
        tip_radius: of the instrument [length]
    """
    found = 0.0
    for rows, step in ((z.T, dx), (z, dy)):
        for m in range(1, (len(rows) + 1) // 2):
            bend = rows[2 * m :] - 2.0 * rows[m:-m] + rows[: -2 * m]
            if float(bend.min()) >= -SHARPEST / tip_radius * (m * step) ** 2:
                break
        else:
            return float("inf")
        found = max(found, 2 * m * step if m > 1 else 0.0)
    return found
