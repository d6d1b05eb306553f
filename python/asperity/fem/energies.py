"""Stored and dissipated energy of a solid, and the plastic work of a step."""

from __future__ import annotations

import numpy as np

from asperity.arrays import Floats
from asperity.fem.kernels import History
from asperity.fem.solid import Solid

_PAIRS = np.array([1.0, 1.0, 1.0, 2.0, 2.0, 2.0])  # sum over both off-diagonal components


def energies(solid: Solid, force: Floats) -> tuple[float, float]:
    """Stored elastic and dissipated plastic energy over the committed history [E L^3]; part of this rank.

    With isotropic hardening the dissipated energy sigma_0 a + H a^2/2 follows from the accumulated plastic strain a.

    Args:
        solid: in the state to measure
        force: its internal force on the owned nodes (owned, 3) [E L^2]
    """
    u = solid.u.x.array.reshape(-1, 3)
    stored, dissipated = 0.5 * float(np.vdot(u[: solid.owned], force)), 0.0
    history = solid.kernels.history()
    if history.rows:
        _, _, strength, hardening = solid.material.parameters
        yielded = history.changed()
        weights, a = solid.kernels.volumes[yielded], history.accumulated[yielded]
        stress = solid.kernels.stress(u)[yielded] * _PAIRS
        stored -= 0.5 * float(np.einsum("cq,cqi,cqi", weights, stress, history.plastic_strain[yielded]))
        dissipated = float(np.sum(weights * a * (strength + 0.5 * hardening * a)))
    return stored, dissipated


def plastic_work(solid: Solid, before: History) -> tuple[float, float]:
    """Plastic work of a step, sum sigma : d eps_p [E L^3], and the greatest decrease of the accumulated plastic strain.

    Part of this rank; zero for an elastic solid.

    Args:
        solid: after the step, its history committed
        before: history before the step
    """
    after = solid.kernels.history()
    if not after.rows:
        return 0.0, 0.0
    yielded = after.changed()
    stress = solid.kernels.stress(solid.u.x.array.reshape(-1, 3))[yielded] * _PAIRS
    flow = after.plastic_strain[yielded] - before.plastic_strain[yielded]
    work = float(np.einsum("cq,cqi,cqi", solid.kernels.volumes[yielded], stress, flow))
    return work, float(np.max(before.accumulated - after.accumulated))
