"""Stored and dissipated energy of a solid, the dissipation of a step, and the equivalent strain."""

from __future__ import annotations

import numpy as np

from asperity.arrays import Floats
from asperity.fem.forms import FormKernels
from asperity.fem.history import History
from asperity.fem.solid import Solid
from asperity.model.material import PAIRS


def energies(solid: Solid, force: Floats, stress: Floats | None = None) -> tuple[float, float]:
    """Stored and dissipated energy over the committed history, of an internal force (owned, 3) [E L^3]; this rank's.

    The conjugate stress is computed where it is wanted and not given.

    Elastic strain and back stress store energy. That of a law in UFL is known where it is hyperelastic, else zero.
    """
    u = solid.u.x.array.reshape(-1, 3)
    kernels, material = solid.kernels, solid.material
    if material.law is not None:
        if isinstance(kernels, FormKernels) and material.law.hyperelastic:
            return float(np.vdot(kernels.volumes, kernels.energy(u))), 0.0
        return 0.0, 0.0
    if kernels.linear:
        return 0.5 * float(np.vdot(u[: solid.owned], force)), 0.0
    stress = kernels.conjugate_stress(u) if stress is None else stress
    stored = float(np.vdot(kernels.volumes, material.elastic_energy(stress)))
    history = kernels.history()
    yielded = history.changed()
    volumes = kernels.volumes[yielded]
    stored += float(np.vdot(volumes, material.hardening_energy(history.plastic_strain[yielded])))
    return stored, float(np.vdot(volumes, material.dissipated_energy(history.accumulated[yielded])))


def dissipation(solid: Solid, before: History, stress: Floats | None) -> tuple[float, float, float]:
    """Plastic work of a step less what the back stress X stores, sum (sigma - X) : d eps_p [E L^3], that of the
    relaxation of volumetric strain included; of the latter what the step spends (solver/relaxation.hpp) [E L^3]; and
    the greatest decrease of the accumulated plastic strain.

    Part of this rank; zero for an elastic solid, and the work without a conjugate stress, for a law in UFL.
    """
    kernels = solid.kernels
    after = kernels.history()
    if not after.rows:
        return 0.0, 0.0, 0.0
    decrease = float(np.max(before.accumulated - after.accumulated))
    if stress is None:
        return 0.0, 0.0, decrease
    yielded = after.changed()
    driving = stress[yielded]
    pressure, volumes = driving[..., :3].mean(axis=-1), kernels.volumes[yielded]
    driving -= solid.material.back_stress(after.plastic_strain[yielded])
    flow = after.plastic_strain[yielded] - before.plastic_strain[yielded]
    work = float(np.einsum("cq,cqi,cqi,i", volumes, driving, flow, PAIRS))
    relaxed = after.dilatation[yielded] - before.dilatation[yielded]
    strain = np.sum(volumes * (after.accumulated[yielded] - before.accumulated[yielded]), axis=1)
    squares = np.sum(volumes, axis=1) * np.sum(volumes * relaxed**2, axis=1)
    flowing = (strain > 0.0) & (squares > 0.0)  # elsewhere it is rounding
    work += float(np.vdot(volumes[flowing], (pressure * relaxed)[flowing]))
    strain, squares = strain[flowing], squares[flowing]
    by_flow, threshold = kernels.relaxation
    spent = float(np.sum(0.5 * by_flow * squares / strain + threshold * np.sqrt(squares)))
    return work, spent, decrease


def equivalent_strain(solid: Solid, history: History) -> Floats:
    """Equivalent strain sqrt(2/3 e:e) at the quadrature points (cells, points), e the deviator of the strain.

    Compiled kernels have it from the stress, and the plastic strain that the history holds.
    """
    kernels, u = solid.kernels, solid.u.x.array.reshape(-1, 3)
    if isinstance(kernels, FormKernels):
        e = kernels.strain(u)
        e -= np.trace(e, axis1=2, axis2=3)[..., None, None] / 3.0 * np.eye(3)
        return np.asarray(np.sqrt(2.0 / 3.0 * np.einsum("cqij,cqij->cq", e, e)))
    stress = kernels.conjugate_stress(u, history)
    stress[..., :3] -= stress[..., :3].mean(axis=-1, keepdims=True)
    deviator = stress / (2.0 * solid.material.lame[1])
    if history.rows:
        deviator += history.plastic_strain
    return np.asarray(np.sqrt(2.0 / 3.0 * np.einsum("cqi,cqi,i->cq", deviator, deviator, PAIRS)))
