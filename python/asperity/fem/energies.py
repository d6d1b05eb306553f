"""Stored and dissipated energy of a solid, and the plastic work of a step."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from asperity.arrays import Floats
from asperity.fem.solid import Solid

_PAIRS = np.array([1.0, 1.0, 1.0, 2.0, 2.0, 2.0])  # sum over both off-diagonal components


def energies(solid: Solid, force: Floats) -> tuple[float, float]:
    """Stored elastic and dissipated plastic energy over the committed history [E L^3]; of this rank's part.

    With isotropic hardening the dissipated energy sigma_0 a + H a^2/2 follows from the accumulated plastic strain a.

    Args:
        solid: in the state meant
        force: its internal force on the owned nodes (owned, 3) [E L^2]
    """
    u = solid.u.x.array.reshape(-1, 3)
    stored, dissipated = 0.5 * float(np.vdot(u[: solid.owned], force)), 0.0
    strain, accumulated = solid.bulk.history()
    if accumulated.size:
        _, _, strength, hardening = solid.material.parameters
        yielded = np.flatnonzero(accumulated.any(axis=1))
        weights, a = solid.bulk.volumes[yielded], accumulated[yielded]
        stress = solid.bulk.stress(u)[yielded] * _PAIRS
        stored -= 0.5 * float(np.einsum("cq,cqi,cqi", weights, stress, strain[yielded]))
        dissipated = float(np.sum(weights * a * (strength + 0.5 * hardening * a)))
    return stored, dissipated


def plastic_work(solid: Solid, before: Iterable[Floats]) -> tuple[float, float]:
    """Plastic work of a step, sum sigma : d eps_p [E L^3], and the greatest decrease of the accumulated plastic strain.

    Of this rank's part; zero for an elastic solid.

    Args:
        solid: after the step, its history committed
        before: plastic strain (cells, points, 6) and accumulated plastic strain (cells, points) before the step
    """
    strain, accumulated = solid.bulk.history()
    if not accumulated.size:
        return 0.0, 0.0
    strain_before, accumulated_before = before
    yielded = np.flatnonzero(accumulated.any(axis=1))
    stress = solid.bulk.stress(solid.u.x.array.reshape(-1, 3))[yielded] * _PAIRS
    flow = strain[yielded] - strain_before[yielded]
    work = float(np.einsum("cq,cqi,cqi", solid.bulk.volumes[yielded], stress, flow))
    return work, float(np.max(accumulated_before - accumulated))
