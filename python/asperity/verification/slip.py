"""Micro-slip of a spot far smaller than the block under a constant load, by the solid: Cattaneo and Mindlin."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from asperity.quasistatic.contact_solver import ContactSolver
from asperity.quasistatic.slip_paths import Sliding
from asperity.verification.stiffness import MATERIAL, RADIUS, WALLS, press_spot
from asperity.verification.table import LOCAL, Row, counting_error, on_meshes, rows_along

MU = 0.4
AMPLITUDES = (0.4, 0.8)  # of the tangential force over mu P
FAR = 3.0  # displacement over that at which all of the contact slips
SOURCE = "Mindlin"
ROUNDING = 1e-5  # of the residual of a step over the normal force, 1e-6


def slip() -> Iterator[Row]:
    """Stiffness at rest, slip and energy of a loop, limit; Johnson, Contact Mechanics (1985), 7.43, 7.44 and 7.57.

    The displacement of slip is that beyond the stiffness at rest, which has the compliance of base and sides. The edge
    between stick and slip is as uncertain as that of the contact, and the ring that slips is a part of its area.
    """
    names = [f"{name} at {t:g} mu P" for name in ("slip", "energy of a loop") for t in AMPLITUDES]
    results = on_meshes(press_spot)
    values = np.array([_ratios(result.solver) for result in results])
    yield from rows_along(
        "slip", ["k_t at rest over 8 G a/(2 - nu)"], SOURCE, list(values[:, 0]), [1.0], WALLS, order=LOCAL
    )
    ring = 1.0 - (1.0 - np.array(AMPLITUDES)) ** (2.0 / 3.0)
    counted = np.tile(counting_error(results[-1]) / ring, 2)
    yield from rows_along(
        "slip", names, SOURCE, list(values[:, 1:-1]), np.ones(len(names)), order=LOCAL, counted=counted
    )
    yield Row("slip", "greatest force over mu P", SOURCE, 1.0, float(values[-1, -1]), ROUNDING)


def _ratios(solver: ContactSolver) -> list[float]:
    """Values over Mindlin's: stiffness at rest, slip and energy of each amplitude, limit."""
    sliding = Sliding(solver, MU)
    nu, force, rest = MATERIAL.nu, 4.0 * solver.force, 4.0 * sliding.k_rest
    G, limit = MATERIAL.lame[1], MU * force
    a = (0.75 * force * RADIUS / MATERIAL.reduced_modulus) ** (1.0 / 3.0)
    c = 3.0 * limit * (2.0 - nu) / (16.0 * G * a)
    slips, energies = [], []
    for amplitude in AMPLITUDES:
        sliding.reset()
        path = sliding.path(amplitude, 1)
        t = 4.0 * path.force / limit
        slips.append((path.displacement - 4.0 * path.force / rest) / (c * (1.0 - (1.0 - t) ** (2 / 3) - 2.0 * t / 3.0)))
        shape = 1.0 - (1.0 - t) ** (5 / 3) - 5.0 * t / 6.0 * (1.0 + (1.0 - t) ** (2 / 3))
        energies.append(4.0 * path.energy / (4.8 * limit * c * shape))
    sliding.reset()
    for part in (0.1, 0.3, 1.0):  # each begins with the nodes that slip in the one before
        sliding.solve(part * FAR * (c + limit / rest))
    return [rest * (2.0 - nu) / (8.0 * G * a), *slips, *energies, 4.0 * sliding.solved_force() / limit]
