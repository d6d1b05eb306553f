"""The contact solver: a solid under a rigid flat, stepped from one position to the next, committed or rolled back."""

from __future__ import annotations

import logging
from copy import deepcopy
from dataclasses import dataclass, replace
from math import sqrt
from types import SimpleNamespace
from typing import Any

import numpy as np
from mpi4py import MPI

from asperity.arrays import Floats
from asperity.contact import Contact
from asperity.contact.contact_surface import ContactSurface
from asperity.fem.energies import dissipation, energies, equivalent_strain
from asperity.fem.history import History, extrapolate
from asperity.fem.solid import Solid
from asperity.linear.petsc import LinearFailure, destroy_unused, own_errors
from asperity.model.settings import SolverOptions
from asperity.quasistatic.balance import Checks, StepBalance, audit
from asperity.quasistatic.newton import COUNTED, NewtonSolver, StepStats
from asperity.runtime.parallel import summed

MOST_PASSES = 40  # of a step, in which friction settles; a usual step takes one to four
STRETCHED = 1.0  # logarithmic strain beyond which a bar in tension bears less, the more it is stretched


@dataclass
class Counts:
    """Totals of a run; the means of convergence in the order in which they are tried."""

    steps: int = 0  # accepted steps
    newton: int = 0  # iterations
    krylov: int = 0  # iterations
    shortened: int = 0  # Newton steps that the line search shortened
    direct: int = 0  # linear systems factorised because the iterative solver failed
    cutbacks: int = 0  # failed solves, repeated with half the step


@dataclass(frozen=True)
class SolverState:
    """State between two steps. Together with the histories of solid and contact it determines all later steps.

    The numbers are the same on all ranks; the displacements are those of the owned nodes of this rank.
    """

    delta: float  # of the last accepted step [L]
    force: float  # of the last accepted step [E L^2]
    before: float | None  # approach of the step before [L]; None when the next step is not predicted from two
    extrapolated: bool  # whether the committed history is extrapolated beyond the displacement
    counts: Counts
    checks: Checks
    displacement: Floats  # of the last step (owned, 3) [L]
    previous: Floats  # displacement of the step before (owned, 3) [L]; the same without `before`


class ContactSolver:
    """Solid under a rigid flat, solved step by step; collective.

    The approach counts from first touch of the undeformed surface. A failed step leaves displacement and history as
    they were.

    Args:
        summit: greatest height of the composite surface [L]

    Attributes:
        delta, force: of the last accepted step [L], [E L^2]
        nodal_force: normal force of the flat on the owned nodes (owned,) [E L^2]
        pressure: at the local nodes, ghosts included (nodes,) [E]
        counts, checks: over all steps so far
        probes: measure what is wanted beside the usual columns, called with the solver before the history of a step
            is committed; collective, they return values by the name of a column, of their `columns`, in units of L, E
        probed: what they found in the last accepted step
        doubt: what is wrong with a law of the user, or with elements, in the last step without convergence, empty for
            nothing
    """

    def __init__(
        self, solid: Solid, contact_surface: ContactSurface, contact: Contact, summit: float, options: SolverOptions
    ) -> None:
        self.solid, self.contact_surface, self.contact, self.summit = solid, contact_surface, contact, summit
        self._options = options
        self._newton: NewtonSolver | None = None
        self.counts, self.checks = Counts(), Checks()
        self.delta, self.force = 0.0, 0.0
        self.nodal_force = np.zeros(solid.owned)
        self.pressure = np.zeros(solid.nodes)
        self._u, self._internal = np.zeros((solid.owned, 3)), np.zeros((solid.owned, 3))
        self._previous: tuple[float, Floats] | None = None
        self._extrapolated = False  # whether the committed history is ahead of the displacement
        self._own: History | None = None  # history of the displacement where the committed one is ahead
        self._first_touch = self._highest()
        self.probes: tuple[Any, ...] = ()
        self.probed: dict[str, float] = {}
        self.doubt = ""

    @property
    def columns(self) -> set[str]:
        """Names of the columns that the probes fill."""
        return {name for probe in self.probes for name in probe.columns}

    @property
    def newton(self) -> NewtonSolver:
        """Newton's method; collective after `drop_matrices`."""
        if self._newton is None:
            with own_errors():
                self._newton = NewtonSolver(self.solid, self.contact, self._options)
        return self._newton

    def drop_matrices(self) -> None:
        """Free the matrices and their solvers, most of the memory; what needs them makes them again. Collective.

        The state of the last accepted step stays, and steps may follow.
        """
        self._newton = None
        self.solid.tangent.drop()
        destroy_unused(self.solid.comm)

    def step(self, delta: float, extrapolation: float = 0.0) -> StepStats:
        """Move the flat to `delta`; on success the state is committed (see `commit`), else rolled back."""
        stats = self.solve(delta)
        if stats.converged:
            self.commit(delta, extrapolation)
        return stats

    def solve(self, delta: float, start: Floats | None = None) -> StepStats:
        """Solve with the flat at the approach `delta` [L] without committing; rolled back on failure.

        It begins with the displacement `start` (owned, 3) [L], by default one predicted from the last two steps.
        """
        predicted, ratio = self._u, 1.0
        if self._previous is not None:
            before, u = self._previous
            if (delta - self.delta) * (self.delta - before) > 0.0:
                ratio = (delta - self.delta) / (self.delta - before)
                predicted = self._u + (self._u - u) * (delta - self.delta) / (self.delta - before)
        self.contact.begin(self.summit - delta)
        self.contact.expect(self.summit - self.delta, self._u, predicted, ratio)
        return self._solve(f"delta/L = {delta:.6g}", predicted if start is None else start, abs(delta - self.delta))

    def _solve(self, where: str, start: Floats, scale: float) -> StepStats:
        try:
            stats = self._settle(start, scale)
        except LinearFailure as error:
            stats = StepStats(False, str(error), 0, 0)
            self.drop_matrices()  # with the solver that failed
        for name in COUNTED:
            setattr(self.counts, name, getattr(self.counts, name) + getattr(stats, name))
        log = logging.getLogger(__name__)
        if stats.shortened or stats.direct:
            counts = stats.newton, stats.shortened, stats.direct
            log.info("%s: of %d Newton steps %d shortened, %d solved by LU", where, *counts)
        if not stats.converged:
            found = self.solid.kernels.doubt(self.solid.u.x.array.reshape(-1, 3))
            self.doubt = next(filter(None, self.solid.comm.allgather(found)), "")
            log.info("%s: given up after %d Newton steps, %s", where, stats.newton, self.doubt or stats.reason)
            self.roll_back()
            self.doubt = self.doubt or self._stretched()
        return stats

    def _stretched(self) -> str:
        """What helps where finite strain is too much for the elements, empty where it is not; collective."""
        solid, material = self.solid, self.solid.material
        if not material.finite or material.law is not None:
            return ""
        most = float(np.max(equivalent_strain(solid, self.history), initial=0.0))
        most = solid.comm.allreduce(most, op=MPI.MAX)
        if most < STRETCHED:
            return ""
        soft = material.plastic_modulus < (material.yield_strength or 0.0)
        more = ", a material.tangent_modulus near material.yield_strength" if soft else ""
        return (
            f"the greatest strain is {most:.2g}, which turns elements inside out: take a larger mesh.h_contact, a "
            f"tool with a rounded tip{more}, or press less deep"
        )

    def _settle(self, start: Floats, scale: float) -> StepStats:
        """Solve until friction settles."""
        self.newton.linear.forget()  # a step of a resumed run is the same to the last bit
        stats = self.newton.solve(start, scale)
        for _ in range(MOST_PASSES):
            if not (stats.converged and self.contact.settle()):
                return stats
            stats = stats + self.newton.solve(self.newton.x.array_r.reshape(-1, 3).copy(), scale)
        return replace(stats, converged=False, reason="friction does not settle")

    def solved_force(self) -> float:
        """Force on the flat at the last solve [E L^2]; collective."""
        return float(self.solid.comm.allreduce(self.contact.nodal_force(self.newton.now.force).sum()))

    def roll_back(self) -> None:
        """Restore the displacement of the last accepted step."""
        self.newton.x.array = self._u.reshape(-1)
        self.solid.set_displacement(self.newton.x.array_r)

    def commit(self, delta: float, extrapolation: float = 0.0) -> None:
        """Commit the last solve, made with the flat at `delta`: measure it, accept it, audit it; collective.

        Args:
            delta: approach [L]
            extrapolation: part of the plastic flow of the step by which the history goes beyond `delta`, see
                `stepping`; with 1 the solve is the midpoint of what is committed, and the path is integrated to second
                order
        """
        solid, contact = self.solid, self.contact
        with solid.phases.phase("checks"):
            history = solid.kernels.history().copy()
        before = SimpleNamespace(delta=self.delta, force=self.force, u=self._u, internal=self._internal)
        self.delta, self.probed = delta, {}
        for probe in self.probes:  # while the tangent of the solve is valid
            self.probed |= probe(self)
        solid.kernels.commit()
        contact.commit()
        self._previous = (before.delta, self._u)
        self._u = solid.u.x.array.reshape(-1, 3)[: solid.owned].copy()
        self._internal, self._own = self.newton.now.force, None
        self._find_forces()
        balanced = "energy" not in self.checks.violated
        with solid.phases.phase("checks"):
            audit(
                self.checks,
                self._balance(before, history),
                bound=sqrt(solid.dofs) * self.newton.bound(self.force),
                rtol=self._options.rtol,
                compliant=contact.has_tangent,
                exact=extrapolation == 0.0 and not self._extrapolated,
                energies=solid.material.law is None or solid.material.law.hyperelastic,
            )
            if balanced and "energy" in self.checks.violated and (reason := self._stretched()):
                self.checks.violated["energy"] += f", and {reason}"
        self._extrapolated = extrapolation > 0.0
        if self._extrapolated:
            self._own = solid.kernels.history().copy()
            solid.kernels.restore(extrapolate(history, self._own, extrapolation))
            if contact.has_tangent or contact.held is not None:  # for the energy balance, as after a restart
                self._internal = solid.internal_force().copy()
        self.counts.steps += 1

    def _balance(self, before: SimpleNamespace, history: History) -> StepBalance:
        """Numbers of the step just accepted, from a state and the history committed there; collective."""
        solid, internal, contact = self.solid, self.newton.now.force, self.contact
        owned = self.contact_surface.owned_nodes
        pressure = self.pressure[owned]
        needed = solid.kernels.history().rows and solid.material.law is None
        stress = solid.kernels.conjugate_stress(solid.u.x.array.reshape(-1, 3)) if needed else None
        dissipation_of_step, relaxed, decrease = dissipation(solid, history, stress)
        move = self._u - before.u
        stored, dissipated = energies(solid, internal, stress)
        # both in the order of `StepBalance`
        sums = summed(
            solid.comm, internal[solid.base, 2].sum(), np.abs(self.newton.now.residual).sum(), stored, dissipated,
            dissipation_of_step, relaxed, contact.penetration_work(), np.vdot(before.internal, move),
            np.vdot(internal, move), contact.tangential_work(before.internal, move),
            contact.tangential_work(internal, move),
        )  # fmt: skip
        depth = np.max(-self.gap()[owned], initial=0.0)
        peaks = np.array([depth, np.max(-pressure, initial=0.0), np.max(pressure, initial=0.0), decrease])
        solid.comm.Allreduce(MPI.IN_PLACE, peaks, op=MPI.MAX)
        found = map(float, (*sums, *peaks))
        return StepBalance(self.delta, before.delta, self.force, before.force, *found)

    def _find_forces(self) -> None:
        """Force and pressure of the current state; collective."""
        solid = self.solid
        self.nodal_force = self.contact.nodal_force(self.newton.now.force)
        self.force = float(solid.comm.allreduce(self.nodal_force.sum()))
        owned = np.zeros(3 * solid.owned)
        owned[::3] = self.nodal_force
        self.pressure = self.contact_surface.pressure(solid.scatter_forward(owned)[:, 0])

    def gap(self) -> Floats:
        """Distance of each local node below the flat, meaningful on the contact surface only (nodes,) [L]."""
        return self.summit - self.delta - self.contact_surface.elevation(np.arange(self.solid.nodes))

    def release(self) -> StepStats:
        """Lift the flat off and commit; the new approach is that at which it would touch the deformed surface again."""
        self._previous = None
        self.contact.begin(np.inf)
        stats = self._solve("release", self._u, 0.0)
        if stats.converged:
            self.commit(self._first_touch - self._highest())
        return stats

    def _highest(self) -> float:
        """Greatest height of the deformed composite surface above the base, at a node [L]; collective."""
        nodes = self.contact_surface.owned_nodes
        z = self.contact_surface.elevation(nodes)
        return float(self.solid.comm.allreduce(np.max(z, initial=-np.inf), op=MPI.MAX))

    def retract(self) -> bool:
        """Take the history of the displacement in place of the extrapolated one; whether there was one.

        A step that is cut may end before the approach of an extrapolated history, from which it would unload.
        """
        if self._own is None:
            return False
        self.solid.kernels.restore(self._own)
        self._own, self._extrapolated, self._internal = None, False, self.solid.internal_force().copy()
        return True

    @property
    def history(self) -> History:
        """History of the displacement: where the committed one is extrapolated, the one before the extrapolation."""
        return self.solid.kernels.history() if self._own is None else self._own

    def state(self) -> SolverState:
        """Copy of the state without the histories."""
        before, previous = self._previous or (None, self._u)
        counts, checks = deepcopy(self.counts), deepcopy(self.checks)
        return SolverState(
            delta=self.delta, force=self.force, before=before, extrapolated=self._extrapolated, counts=counts,
            checks=checks, displacement=self._u, previous=previous,
        )  # fmt: skip

    def restore(self, state: SolverState) -> None:
        """Restore a state returned by `state`, after the histories of solid and contact; collective."""
        self.delta, self._u, self._extrapolated = state.delta, state.displacement, state.extrapolated
        self.counts, self.checks = deepcopy(state.counts), deepcopy(state.checks)
        self._previous = None if state.before is None else (state.before, state.previous)
        self.contact.begin(self.summit - self.delta)
        self.roll_back()
        self._internal = self.newton.evaluate(self.newton.x.array_r).force
        self._find_forces()
        self.force = state.force
