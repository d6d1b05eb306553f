"""Checks that every accepted step of a run must pass, whatever the case: balances that no correct result violates.

With exact contact and associative plasticity with isotropic hardening the energy of a step is bounded on both sides:

    F_n d_delta <= d(stored) + d(dissipated) <= F_n+1 d_delta,

for the flat pushes each node it touches at the end by no more than d_delta, and each it touched at the beginning by
no less; the plastic work sigma : d eps_p lies between those with the stress of either end (maximum dissipation).
With isotropic hardening the dissipated energy sigma_0 a + H a^2/2 follows from the accumulated plastic strain a.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from math import sqrt
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from asperity.fem.solid import Floats, Solid
    from asperity.quasistatic.contact_solver import Press

# Limits, unless the tolerance of the equations is larger
SUCTION = 1e-6  # greatest tension over greatest pressure
EXACT = 1e-6  # penetration over deflection that exact contact may leave
COMPLIANT = 0.05  # mean penetration over deflection that a compliant one may; the force lacks about twice that part
ENERGY = 1e-6  # of the work done so far
MIDPOINT_ENERGY = 0.05  # the same where the path is integrated by the midpoint rule
ROUNDING = 1e-12


@dataclass
class Checks:
    """Worst figures of a run so far; energies in units of E L^3.

    Attributes:
        force_balance: |force on the flat - reaction of the base| over the force
        tension: greatest suction over the greatest pressure of a step
        penetration: of a node into the flat [L]
        greatest_force: so far [E L^2]
        mean_penetration: weighted by the pressure, over the deflection, at the greatest force
        strain_decrease: greatest decrease of the accumulated plastic strain, negative when there is none
        least_dissipation: least plastic work sum sigma : d eps_p of a step
        work: done by the flat, trapezoidal rule
        stored: elastic energy
        dissipated: plastic work
        peak: greatest energy stored and dissipated, and the work done until then
        energy_excess: by which a step left the bounds of its energy, over the work so far
        violated: sentences, the first of each kind
    """

    force_balance: float = 0.0
    tension: float = 0.0
    penetration: float = 0.0
    greatest_force: float = 0.0
    mean_penetration: float = 0.0
    strain_decrease: float = 0.0
    least_dissipation: float = 0.0
    work: float = 0.0
    stored: float = 0.0
    dissipated: float = 0.0
    peak: tuple[float, float] = (0.0, 0.0)
    energy_excess: float = 0.0
    violated: dict[str, str] = field(default_factory=dict)

    @staticmethod
    def from_dict(values: Mapping[str, Any]) -> Checks:
        """Read what `dataclasses.asdict` gave, also after a detour through JSON."""
        energy, work = values["peak"]
        return Checks(**{**values, "peak": (energy, work)})

    @property
    def energy_ratio(self) -> float:
        """Work of the flat over stored and dissipated energy where that is greatest; 1 in the limit of small steps."""
        energy, work = self.peak
        return work / energy if energy > 0.0 else 1.0


@dataclass(frozen=True)
class Before:
    """What the audit of a step needs of the state before it: deflection, force on the flat, displacement and internal
    force of the owned nodes (owned, 3), history of the bulk."""

    delta: float
    force: float
    displacement: Floats
    internal: Floats
    plastic_strain: Floats
    accumulated: Floats


def audit(press: Press, before: Before, base: float, exact: bool = True) -> None:
    """Check a step just accepted and update `press.checks`; collective.

    Args:
        press: after the step
        before: from before it
        base: reaction of the base [E L^2]
        exact: whether the history the step began with belongs to its displacement; where it was carried on beyond,
            the bounds of the energy hold to the accuracy of the integration only
    """
    checks = press.checks
    sums, peaks = _measure(press, before)
    force, delta = press.force, press.delta
    stored, dissipated, plastic_work, sunk, *of_forces = sums
    penetration, suction, pressure, decrease = peaks
    where = f"at delta/L = {delta:.6g}"

    def judge(kind: str, ok: bool, sentence: str) -> None:
        if not ok and kind not in checks.violated:
            checks.violated[kind] = f"{sentence} {where}"

    finite = bool(np.all(np.isfinite([*sums, *peaks, force, base, delta])))
    judge("finite", finite, "a value is not finite")

    unbalanced = abs(base - force)
    if force > 0.0:
        checks.force_balance = max(checks.force_balance, unbalanced / force)
    rtol = press.newton.options.rtol
    solved = sqrt(press.solid.dofs) * (rtol * force + 1e-15) + ROUNDING * force
    judge(
        "force_balance",
        unbalanced <= solved,
        f"the force on the flat {force:.6g} and the reaction of the base {base:.6g} E L^2 differ",
    )

    if pressure > 0.0:
        checks.tension = max(checks.tension, suction / pressure)
    judge("tension", suction <= max(SUCTION, rtol) * pressure + 1e-15, "the flat pulls on the surface")

    checks.penetration = max(checks.penetration, penetration)
    if not press.contact.stiff:
        slack = max(EXACT, rtol) * abs(delta) + ROUNDING
        judge("penetration", penetration <= slack, f"the surface penetrates the flat by {penetration:.3g} L")
    if force > checks.greatest_force:  # until then the contact may have been smaller than a facet
        checks.violated.pop("touch", None)
        checks.violated.pop("compliance", None)
        checks.greatest_force, checks.mean_penetration = force, abs(sunk) / force / delta
    judge("touch", checks.greatest_force > 0.0, "no node is touched, make mesh.h_contact smaller,")
    judge(
        "compliance",
        checks.mean_penetration <= COMPLIANT,
        f"the surface penetrates the flat by {checks.mean_penetration:.2g} of the deflection in the mean, raise "
        "contact.penalty or contact.gamma, or make mesh.h_contact smaller,",
    )

    checks.strain_decrease = max(checks.strain_decrease, decrease)
    judge("plastic_strain", decrease <= ROUNDING, "the accumulated plastic strain decreased")
    checks.least_dissipation = min(checks.least_dissipation, plastic_work)
    scale = checks.stored + checks.dissipated + stored + dissipated
    judge("dissipation", plastic_work >= -max(ENERGY, rtol) * scale, "plastic flow gained energy")

    move = delta - before.delta
    gained = stored + dissipated - checks.stored - checks.dissipated
    if press.contact.stiff:  # it takes a part of the work of the flat itself
        low, high = of_forces
    else:
        left = max(force, before.force) * penetration
        low, high = before.force * move - left, force * move + left
    beyond = max(low - gained, gained - high)
    checks.work += 0.5 * (before.force + force) * move
    checks.stored, checks.dissipated = stored, dissipated
    checks.peak = max(checks.peak, (stored + dissipated, checks.work))
    if scale > 0.0:
        checks.energy_excess = max(checks.energy_excess, beyond / scale)
    slack = max(ENERGY, rtol) if exact else MIDPOINT_ENERGY
    judge("energy", beyond <= slack * scale + 1e-18, "work and energy of the step do not balance")


def _measure(press: Press, before: Before) -> tuple[Floats, Floats]:
    """Sums and greatest values over all ranks; collective.

    The sums: energy stored, dissipated so far, plastic work of the step, force times penetration of a compliant
    contact, work of the internal force at the beginning and at the end of the step along it.
    The greatest values: penetration, suction, pressure, decrease of plastic strain.
    """
    from mpi4py import MPI

    solid = press.solid
    held, dissipated = energies(solid, press.newton.force)
    plastic_work = decrease = 0.0
    strain, accumulated = solid.bulk.history()
    if accumulated.size:
        yielded = np.flatnonzero(accumulated.any(axis=1))
        stress = solid.bulk.stress(solid.u.x.array.reshape(-1, 3))[yielded] * _PAIRS
        flow = strain[yielded] - before.plastic_strain[yielded]
        plastic_work = float(np.einsum("cq,cqi,cqi", solid.bulk.volumes[yielded], stress, flow))
        decrease = float(np.max(before.accumulated - accumulated))
    owned = press.top.owned_nodes
    pressure = press.pressure[owned]
    peaks = np.array(
        [
            np.max(-press.gap()[owned], initial=0.0),
            np.max(-pressure, initial=0.0),
            np.max(pressure, initial=0.0),
            decrease,
        ]
    )
    u, internal = solid.u.x.array.reshape(-1, 3)[: solid.owned], press.newton.force
    works = [float(np.vdot(f, u - before.displacement)) for f in (before.internal, internal)]
    sums = np.array([held, dissipated, plastic_work, press.contact.sinking(), *works])
    solid.comm.Allreduce(MPI.IN_PLACE, sums)
    solid.comm.Allreduce(MPI.IN_PLACE, peaks, op=MPI.MAX)
    return sums, peaks


def energies(solid: Solid, force: Floats) -> tuple[float, float]:
    """Stored elastic and dissipated plastic energy of this process's part, over the committed history [E L^3].

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


_PAIRS = np.array([1.0, 1.0, 1.0, 2.0, 2.0, 2.0])  # sum over both off-diagonal components
