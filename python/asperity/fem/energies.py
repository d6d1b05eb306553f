"""Stored and dissipated energy of a solid, and the plastic work of a step."""

from __future__ import annotations

import numpy as np

from asperity.arrays import Floats
from asperity.fem.kernels import History
from asperity.fem.solid import Solid
from asperity.model.material import PAIRS


def energies(solid: Solid, force: Floats) -> tuple[float, float]:
    """Stored elastic and dissipated plastic energy over the committed history [E L^3]; part of this rank.

    Args:
        solid: in the state to measure
        force: its internal force on the owned nodes (owned, 3) [E L^2]
    """
    u = solid.u.x.array.reshape(-1, 3)
    kernels, material = solid.kernels, solid.material
    if kernels.linear:
        return 0.5 * float(np.vdot(u[: solid.owned], force)), 0.0
    stored = float(np.vdot(kernels.volumes, material.elastic_energy(kernels.stress(u))))
    history = kernels.history()
    yielded = history.changed()
    dissipated = material.dissipated_energy(history.accumulated[yielded])
    return stored, float(np.vdot(kernels.volumes[yielded], dissipated))


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
    stress = solid.kernels.stress(solid.u.x.array.reshape(-1, 3))[yielded] * PAIRS
    flow = after.plastic_strain[yielded] - before.plastic_strain[yielded]
    work = float(np.einsum("cq,cqi,cqi", solid.kernels.volumes[yielded], stress, flow))
    return work, float(np.max(before.accumulated - after.accumulated))
