"""Checks of every accepted step, valid for any case: balances that no correct result violates.

With exact contact and associative plasticity with linear hardening the energy of a step is bounded on both sides:

    F_n d_delta <= d(stored) + d(dissipated) <= F_n+1 d_delta,

because the flat moves each node that it touches at the end by at most d_delta, and each node that it touched at the
beginning by at least d_delta. Friction adds f_n du on the left and f_n+1 du on the right, f the tangential forces. The
dissipation (sigma - X) : d eps_p, X the back stress of kinematic hardening, lies
between those with the stress of either end (maximum dissipation). The dissipated energy sigma_y a + (1 - beta) H a^2/2
follows from the accumulated plastic strain a; the rest of the hardening, beta H eps_p:eps_p/3, is stored. What the
relaxation of volumetric strain within cells spends (solver/relaxation.hpp) is dissipated too, step by step.

A law in UFL of the strain does not say what it stores, nor one with time what it dissipates, and no step is balanced. A
solid that was at rest returns no more than was put in: the work of the flat from the beginning is not negative.
"""

from __future__ import annotations

from dataclasses import asdict, astuple, dataclass, field
from math import isfinite
from typing import Any

# Limits, unless the tolerance of the equations is larger
# greatest tension over greatest pressure, penetration over approach in exact contact, energy over the work so far
EXACT = 1e-6
COMPLIANT = 0.05  # mean penetration over approach, compliant contact; the force is too small by about twice that part
MIDPOINT_ENERGY = 0.05  # of the work done so far, where the path is integrated by the midpoint rule
ROUNDING = 1e-12  # of sums over the nodes, relative to the force; of strains

# of the figures with a unit; the others are ratios
ENERGIES = ("least_dissipation", "work", "stored", "dissipated", "relaxed", "peak", "work_at_peak")
UNITS = {"penetration": "length", "greatest_force": "force", **dict.fromkeys(ENERGIES, "force*length")}


@dataclass
class Checks:
    """Worst figures of a run so far; energies in units of E L^3."""

    force_balance: float = 0.0  # |force on the flat - reaction of the base| over the force
    unsolved: float = 0.0  # sum of the magnitudes of the residual forces over the greatest force so far
    tension: float = 0.0  # greatest suction over the greatest pressure of a step
    penetration: float = 0.0  # of a node into the flat [L]
    greatest_force: float = 0.0  # so far [E L^2]
    mean_penetration: float = 0.0  # weighted by the pressure, over the approach, at the greatest force
    strain_decrease: float = 0.0  # greatest decrease of the accumulated plastic strain, negative when there is none
    least_dissipation: float = 0.0  # least sum (sigma - X) : d eps_p of a step, X the back stress, at most 0
    work: float = 0.0  # done by the flat, trapezoidal rule; where energies are not known, the most it may be
    stored: float = 0.0  # energy of elastic strain and back stress
    dissipated: float = 0.0  # by plastic flow, the next one included
    relaxed: float = 0.0  # by the relaxation of volumetric strain within cells
    peak: float = 0.0  # greatest energy stored and dissipated
    work_at_peak: float = 0.0  # done until then; where energies are not known, the greatest work
    not_balanced: str = ""  # why energies of steps were not checked, empty where they were
    energy_excess: float = 0.0  # greatest violation of the energy bounds of a step, over the energy so far
    violated: dict[str, str] = field(default_factory=dict)  # sentences, the first of each kind

    def physical(self, L: float, E: float) -> dict[str, Any]:
        """Section "checks" of summary.json: the figures in the units of a case with this side and modulus."""
        scales = {"length": L, "force": E * L**2, "force*length": E * L**3}
        ratio = None if self.not_balanced else self.energy_ratio
        out = asdict(self) | {"energy_ratio": ratio, "units": dict(UNITS)}
        return out | {name: out[name] * scales[unit] for name, unit in UNITS.items()}

    @property
    def energy_ratio(self) -> float:
        """Work of the flat over stored and dissipated energy where that is greatest; 1 in the limit of small steps."""
        return self.work_at_peak / self.peak if self.peak > 0.0 else 1.0


@dataclass(frozen=True)
class StepBalance:
    """Numbers of an accepted step, summed or the greatest over all ranks; lengths in L, stresses in E."""

    delta: float
    delta_before: float
    force: float  # of the flat, at the end
    force_before: float
    reaction: float  # of the base
    residual: float  # sum of the magnitudes of the residual forces
    stored: float  # energy of elastic strain and back stress at the end
    dissipated: float  # by plastic strain so far
    dissipation: float  # of the step, sum (sigma - X) : d eps_p with the back stress X, relaxation included
    relaxed: float  # of the step, by relaxation
    penetration_work: float  # force times penetration of a compliant contact
    work_low: float  # of the internal force at the beginning of the step along it
    work_high: float  # of that at its end
    tangential_low: float  # the same of the tangential forces of the flat
    tangential_high: float
    penetration: float  # greatest, of a node into the flat
    suction: float  # greatest tension
    pressure: float  # greatest
    strain_decrease: float  # greatest, of the accumulated plastic strain; negative when there is none


def audit(
    checks: Checks,
    step: StepBalance,
    *,
    bound: float,
    rtol: float,
    compliant: bool,
    exact: bool,
    energies: bool = True,
) -> None:
    """Judge an accepted step and update `checks`.

    Args:
        checks: of the run so far
        step: the step
        bound: of the sum of the residual forces, to which the equations are solved [E L^2]
        rtol: relative tolerance to which the equations are solved
        compliant: whether the contact has a stiffness (penalty, Nitsche) and takes a part of the work itself
        exact: whether the step began with the history of its displacement; with an extrapolated one the bounds of the
            energy hold to the accuracy of the integration only
        energies: whether those of the material are known
    """
    where = f"at delta/L = {step.delta:.6g}"

    def judge(kind: str, ok: bool, sentence: str) -> None:
        if not ok and kind not in checks.violated:
            checks.violated[kind] = f"{sentence} {where}"

    judge("finite", all(map(isfinite, astuple(step))), "a value is not finite")
    unbalanced = abs(step.reaction - step.force)
    if step.force > 0.0:
        checks.force_balance = max(checks.force_balance, unbalanced / step.force)
        checks.unsolved = max(checks.unsolved, step.residual / max(step.force, checks.greatest_force))
    judge(
        "force_balance",
        unbalanced <= bound + ROUNDING * step.force,
        f"the force on the flat {step.force:.6g} and the reaction of the base {step.reaction:.6g} E L^2 differ",
    )
    if step.pressure > 0.0:
        checks.tension = max(checks.tension, step.suction / step.pressure)
    judge("tension", step.suction <= max(EXACT, rtol) * step.pressure + 1e-15, "the flat pulls on the surface")
    checks.penetration = max(checks.penetration, step.penetration)
    if not compliant:
        slack = max(EXACT, rtol) * abs(step.delta) + ROUNDING
        ok = step.penetration <= slack
        judge("penetration", ok, f"the surface penetrates the flat by {step.penetration:.3g} L")
    if step.force > checks.greatest_force:  # until then the contact may have been smaller than a facet
        checks.violated.pop("touch", None)
        checks.violated.pop("compliance", None)
        checks.greatest_force = step.force
        checks.mean_penetration = abs(step.penetration_work) / step.force / step.delta
    judge("touch", checks.greatest_force > 0.0, "no node is touched, take a finer mesh or a filtered surface,")
    judge(
        "compliance",
        checks.mean_penetration <= COMPLIANT,
        f"the surface penetrates the flat by {checks.mean_penetration:.2g} of the approach in the mean, raise "
        "contact.penalty or contact.gamma, or make mesh.h_contact smaller,",
    )
    if energies:
        _judge_energy(checks, step, judge, rtol, compliant, exact)
        return
    checks.not_balanced = "the law does not say its energy: of the energies, only the work of the flat was checked"
    move = step.delta - step.delta_before
    checks.work += max(step.force_before * move, step.force * move)
    checks.work_at_peak = max(checks.work_at_peak, checks.work)
    judge("energy", checks.work >= -EXACT * checks.work_at_peak, "the solid returned more work than was put in")


def _judge_energy(checks: Checks, step: StepBalance, judge: Any, rtol: float, compliant: bool, exact: bool) -> None:
    """Plastic flow dissipates, and the energy of the step lies between its bounds."""
    checks.strain_decrease = max(checks.strain_decrease, step.strain_decrease)
    judge("plastic_strain", step.strain_decrease <= ROUNDING, "the accumulated plastic strain decreased")
    checks.least_dissipation = min(checks.least_dissipation, step.dissipation)
    checks.relaxed += step.relaxed
    dissipated = step.dissipated + checks.relaxed
    scale = checks.stored + checks.dissipated + step.stored + dissipated
    judge("dissipation", step.dissipation >= -max(EXACT, rtol) * scale, "plastic flow gained energy")
    move = step.delta - step.delta_before
    gained = step.stored + dissipated - checks.stored - checks.dissipated
    if compliant:
        low, high = step.work_low, step.work_high
    else:
        left = max(step.force, step.force_before) * step.penetration
        low, high = step.force_before * move - left, step.force * move + left
        low, high = low + step.tangential_low, high + step.tangential_high
    beyond = max(low - gained, gained - high)
    checks.work += 0.5 * (step.force_before + step.force) * move
    checks.stored, checks.dissipated = step.stored, dissipated
    checks.peak, checks.work_at_peak = max((checks.peak, checks.work_at_peak), (step.stored + dissipated, checks.work))
    if scale > 0.0:
        checks.energy_excess = max(checks.energy_excess, beyond / scale)
    slack = max(EXACT, rtol) if exact else MIDPOINT_ENERGY
    judge("energy", beyond <= slack * scale + 1e-18, "work and energy of the step do not balance")
