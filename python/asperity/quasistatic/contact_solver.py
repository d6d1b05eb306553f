"""A solid under a rigid flat: one position after the other, committed or rolled back."""

from __future__ import annotations

import logging
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from asperity.contact import Contact
from asperity.contact.contact_surface import Top
from asperity.fem.solid import Floats, Solid
from asperity.quasistatic.balance import Before, Checks, audit
from asperity.quasistatic.newton import NewtonSolver, SolverOptions, StepStats

TOUCHED = 1e-9  # gap below which a node counts as touched [L]


@dataclass(frozen=True)
class Snapshot:
    """State of the top after a step, this process's part.

    Attributes:
        step, branch, delta: as in the curve, delta in units of L
        pressure: at the local nodes [E]
        gap: at the local nodes [L]
        displacement: (nodes, 3) [L]
        stress: mean over each owned cell, xx yy zz xy xz yz (cells, 6) [E]
        plastic_strain: accumulated, at the quadrature points of the owned cells (cells, points); empty when elastic
    """

    step: int
    branch: str
    delta: float
    pressure: Floats
    gap: Floats
    displacement: Floats
    stress: Floats
    plastic_strain: Floats


@dataclass
class Counts:
    """Totals of a run, what was needed to converge in the order in which it is tried.

    Attributes:
        steps: accepted steps
        newton, krylov: iterations
        shortened: Newton steps that the line search made shorter
        direct: linear systems factorised because the iterative solver failed
        cutbacks: solves given up and repeated with half the step
    """

    steps: int = 0
    newton: int = 0
    krylov: int = 0
    shortened: int = 0
    direct: int = 0
    cutbacks: int = 0


def carried_on(before: Iterable[Floats], after: Iterable[Floats], lead: float) -> tuple[Floats, Floats]:
    """History carried on beyond a step by a part of its plastic flow.

    Where the plastic strain is large beside that of yield, the midpoint rule does not damp: an error of the direction
    of flow changes its sign with every step and stays, and the work it does adds up. So the flow is carried on by the
    cosine of the angle to the plastic strain it adds to only, which is one to second order where flow is steady.

    Args:
        before, after: plastic strain (..., 6) and accumulated plastic strain (...) at begin and end of the step
        lead: part of the flow
    """
    (strain, accumulated), (strain_after, accumulated_after) = before, after
    flow = strain_after - strain
    along = _inner(flow, strain)
    sizes = np.sqrt(_inner(flow, flow) * _inner(strain, strain))
    # what yields for the first time has no direction yet
    part = lead * np.clip(np.divide(along, sizes, out=np.ones_like(along), where=sizes > 0.0), 0.0, 1.0)
    return strain_after + part[..., None] * flow, accumulated_after + part * (accumulated_after - accumulated)


def _inner(a: Floats, b: Floats) -> Floats:
    """Inner products of symmetric tensors with components (..., 6)."""
    products: Floats = np.einsum("...i,...i->...", a[..., :3], b[..., :3])
    products += 2.0 * np.einsum("...i,...i->...", a[..., 3:], b[..., 3:])
    return products


class Press:
    """A solid under a flat, driven step by step; collective.

    Deflection counts from first touch of the undeformed surface. The state after each accepted step is the
    displacement of `solid` and its committed history; a failed attempt leaves both as they were.

    Args:
        solid, top, contact: what is pressed and how
        summit: height of the highest point of the surface [L]
        options: of the Newton solver

    Attributes:
        delta, force: of the last accepted step [L], [E L^2]
        nodal_force: of the flat on the owned nodes (owned,) [E L^2]
        pressure: at the local nodes, ghosts included (nodes,) [E]
        counts, checks: over all steps so far
    """

    def __init__(self, solid: Solid, top: Top, contact: Contact, summit: float, options: SolverOptions) -> None:
        self.solid, self.top, self.contact, self.summit = solid, top, contact, summit
        self.newton = NewtonSolver(solid, contact, options)
        self.counts, self.checks = Counts(), Checks()
        self.delta, self.force = 0.0, 0.0
        self.nodal_force = np.zeros(solid.owned)
        self.pressure = np.zeros(solid.nodes)
        self._u, self._internal = np.zeros((solid.owned, 3)), np.zeros((solid.owned, 3))
        self._previous: tuple[float, Floats] | None = None
        self._led = False  # whether the committed history is ahead of the displacement
        self._own: tuple[Floats, Floats] | None = None  # the history of the displacement where it is
        self._first_touch = self._touch()
        self._touched_at: Floats = np.full(len(top.owned_nodes), np.inf)

    def attempt(self, delta: float, lead: float = 0.0) -> StepStats:
        """Move the flat to `delta`; on success the state is committed (see `accept`), else restored."""
        stats = self.trial(delta)
        if stats.converged:
            self.accept(delta, lead)
        return stats

    def trial(self, delta: float) -> StepStats:
        """Solve with the flat at `delta` and commit nothing; the last accepted displacement is back on failure."""
        start = self._u
        if self._previous is not None:
            before, u = self._previous
            if (delta - self.delta) * (self.delta - before) > 0.0:
                start = self._u + (self._u - u) * (delta - self.delta) / (self.delta - before)
        self.contact.begin(self.summit - delta)
        return self._solve(f"delta/L = {delta:.6g}", start, abs(delta - self.delta))

    def _solve(self, where: str, start: Floats, scale: float) -> StepStats:
        self.newton.linear.forget()  # a step of a resumed run is the same to the last bit
        stats = self.newton.solve(start, scale)
        self.counts.newton += stats.newton
        self.counts.krylov += stats.krylov
        self.counts.shortened += stats.shortened
        self.counts.direct += stats.direct
        log = logging.getLogger(__name__)
        if stats.shortened or stats.direct:
            log.info(
                "%s: of %d Newton steps %d shortened, %d solved by LU",
                where,
                stats.newton,
                stats.shortened,
                stats.direct,
            )
        if not stats.converged:
            log.info("%s: given up after %d Newton steps, %s", where, stats.newton, stats.reason)
            self.restore()
        return stats

    def trial_force(self) -> float:
        """Force on the flat at the last solve [E L^2]; collective."""
        return float(self.solid.comm.allreduce(self.contact.nodal_force(self.newton.force).sum()))

    def restore(self) -> None:
        """Put the displacement of the last accepted step back."""
        self.newton.x.array = self._u.reshape(-1)
        self.solid.set_displacement(self.newton.x)

    def accept(self, delta: float, lead: float = 0.0) -> None:
        """Commit the last solve, made with the flat at `delta`; collective.

        Args:
            delta: deflection [L]
            lead: part of the step's plastic flow by which the history is carried on beyond `delta`, see `carried_on`;
                with 1 the solve is the midpoint of what is committed, and the path is integrated to second order
        """
        solid = self.solid
        with solid.phases.phase("checks"):
            history = (values.copy() for values in solid.bulk.history())
            before = Before(self.delta, self.force, self._u, self._internal, *history)
        of_contact = [values.copy() for values in self.contact.state().values()]
        solid.bulk.commit()
        self.contact.commit()
        self._previous = (self.delta, self._u)
        self._u = solid.u.x.array.reshape(-1, 3)[: solid.owned].copy()
        self.delta = delta
        base = self._find_forces()
        touched = (self.gap()[self.top.owned_nodes] <= TOUCHED) & np.isinf(self._touched_at)
        self._touched_at[touched] = delta  # and not less when the flat is lifted again
        with solid.phases.phase("checks"):
            audit(self, before, base, exact=lead == 0.0 and not self._led)
        self._internal = self.newton.force
        self._led, self._own = lead > 0.0, None
        if self._led:
            strain, accumulated = (values.copy() for values in solid.bulk.history())
            self._own = strain, accumulated
            solid.bulk.restore(*carried_on((before.plastic_strain, before.accumulated), self._own, lead))
            after = self.contact.state()
            if after:
                self.contact.restore_state(dict(zip(after, carried_on(of_contact, after.values(), lead), strict=True)))
            if self.contact.stiff:  # whose energy is judged by it; as after a restart
                self._internal = solid.internal_force().copy()
        self.counts.steps += 1

    def _find_forces(self) -> float:
        """Force and pressure of the current state; returns the reaction of the base [E L^2]; collective."""
        solid, internal = self.solid, self.newton.force
        self.nodal_force = self.contact.nodal_force(internal)
        sums = np.array([self.nodal_force.sum(), internal[solid.base, 2].sum()])
        self.force, base = (float(x) for x in solid.comm.allreduce(sums))
        owned = np.zeros(3 * solid.owned)
        owned[::3] = self.nodal_force
        self.pressure = self.top.pressure(solid.with_ghosts(owned)[:, 0])
        return base

    def gap(self) -> Floats:
        """Distance of each local node below the flat; only meaningful on the top (nodes,) [L]."""
        solid = self.solid
        return self.summit - self.delta - solid.points[:, 2] - solid.u.x.array.reshape(-1, 3)[:, 2]

    def release(self) -> StepStats:
        """Lift the flat off; the deflection becomes how much lower it would touch the deformed surface again."""
        self._previous = None
        self.contact.begin(np.inf)
        stats = self._solve("release", self._u, 0.0)
        if stats.converged:
            self.accept(self._first_touch - self._touch())
        return stats

    def _touch(self) -> float:
        """Height of the highest node of the top above the base, displacement included [L]; collective."""
        from mpi4py import MPI

        nodes = self.top.owned_nodes
        z = self.solid.points[nodes, 2] + self.solid.u.x.array.reshape(-1, 3)[nodes, 2]
        return float(self.solid.comm.allreduce(np.max(z, initial=-np.inf), op=MPI.MAX))

    def row(self) -> dict[str, Any]:
        """Columns of the curve that describe the state, dimensionless (E = L = 1); collective."""
        from mpi4py import MPI

        solid, comm = self.solid, self.solid.comm
        strain = (self._own or solid.bulk.history())[1]
        volumes = solid.bulk.volumes
        yielded = float(volumes[strain > 0.0].sum()) if strain.size else 0.0
        sums = comm.allreduce(np.array([yielded, volumes.sum()]))
        peaks = np.array([np.max(self.pressure, initial=0.0), np.max(strain, initial=0.0)])
        comm.Allreduce(MPI.IN_PLACE, peaks, op=MPI.MAX)
        area = self.contact.area()
        return {
            "area_fraction": area.value,
            "error_area_fraction": area.error,
            "max_pressure": float(peaks[0]),
            "plastic_fraction": float(sums[0] / sums[1]),
            "max_plastic_strain": float(peaks[1]),
        }

    def reach(self) -> tuple[Floats, Floats]:
        """Where the nodes of the top are (N, 2) and the deflection that first touched them (N,), inf for never.

        On rank 0, of all ranks; elsewhere empty; collective.
        """
        comm, nodes = self.solid.comm, self.top.owned_nodes
        parts = comm.gather((self.solid.points[nodes, :2], self._touched_at), root=0) or []
        empty = (np.empty((0, 2)), np.empty(0))
        xy, touched = zip(*[empty, *parts], strict=True)
        return np.concatenate(xy), np.concatenate(touched)

    def top_state(self) -> tuple[Floats, Floats]:
        """Pressure and gap at the local nodes (nodes,), ghosts included."""
        return self.pressure, self.gap()

    def snapshot(self, step: int, branch: str) -> Snapshot:
        """Copy of the state for fields and figures."""
        u = self.solid.u.x.array.reshape(-1, 3).copy()
        stress, strain = self._mean_stress(u)
        return Snapshot(step, branch, self.delta, *self.top_state(), u, stress, strain)

    def _mean_stress(self, u: Floats) -> tuple[Floats, Floats]:
        """Mean stress of the owned cells (cells, 6) and accumulated plastic strain (cells, points) at u."""
        bulk = self.solid.bulk
        committed = tuple(values.copy() for values in bulk.history())
        bulk.restore(*(self._own or committed))
        stress = bulk.stress(u)
        bulk.restore(*committed)
        mean = np.einsum("cq,cqi->ci", bulk.volumes, stress) / bulk.volumes.sum(axis=1, keepdims=True)
        return mean, (self._own or committed)[1]

    # -- what a checkpoint keeps -------------------------------------------------------------------------------

    def numbers(self) -> dict[str, Any]:
        """State beside the fields, the same on all ranks, plain values for JSON."""
        return {
            "delta": self.delta,
            "force": self.force,
            "before": None if self._previous is None else self._previous[0],
            "led": self._led,
            "counts": asdict(self.counts),
            "checks": asdict(self.checks),
        }

    def displacements(self) -> dict[str, Floats]:
        """Displacements of the last step and of the one before, if there is one (owned, 3)."""
        if self._previous is None:
            return {"last": self._u}
        return {"last": self._u, "previous": self._previous[1]}

    def touched_at(self) -> Floats:
        """Deflection that first touched each owned node of the top, inf for never."""
        return self._touched_at

    def resume(self, numbers: Mapping[str, Any], displacements: Mapping[str, Floats], touched_at: Floats) -> None:
        """Take up a saved state; the history of bulk and contact has been restored before; collective."""
        self.delta = numbers["delta"]
        self.counts, self.checks = Counts(**numbers["counts"]), Checks.from_dict(numbers["checks"])
        self._u = displacements["last"]
        self._led = numbers["led"]
        before = numbers["before"]
        self._previous = None if before is None else (before, displacements["previous"])
        self._touched_at = touched_at
        self.contact.begin(self.summit - self.delta)
        self.restore()
        self._internal = self.newton.force = self.solid.internal_force().copy()
        self.contact.residual(self.newton.force)
        self._find_forces()
        self.force = numbers["force"]
