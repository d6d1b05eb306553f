"""Measurements after a step: row of the curve, fields for figures."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from mpi4py import MPI

from asperity.arrays import Floats
from asperity.contact.contact_surface import spots_of
from asperity.curve import DIMENSIONS, Curve
from asperity.fem.energies import equivalent_strain
from asperity.quasistatic.contact_solver import ContactSolver
from asperity.quasistatic.newton import StepStats

STRAINED = 0.05  # equivalent strain above which the volume is counted


@dataclass(frozen=True)
class Snapshot:
    """Fields of a solid after a step, part of this rank.

    Attributes:
        step, branch: as in the curve
        delta: approach [L]
        pressure, gap: at the local nodes of the solid (nodes,) [E], [L]
        touched: 1 at the local nodes whose thirds of facets are in contact, else 0, see `Contact.touched_edges`
        displacement: at the local nodes (nodes, 3) [L]
        stress: mean over each owned cell, xx yy zz xy xz yz (cells, 6) [E]
        plastic_strain: accumulated, at the quadrature points of the owned cells (cells, points); or empty
    """

    step: int
    branch: str
    delta: float
    pressure: Floats
    gap: Floats
    touched: Floats
    displacement: Floats
    stress: Floats
    plastic_strain: Floats


def row(solver: ContactSolver) -> dict[str, Any]:
    """Columns of the curve that describe the state, dimensionless (E = L = 1), unknown ones left out; collective."""
    solid, comm = solver.solid, solver.solid.comm
    strain = solver.history.accumulated
    volumes = solid.kernels.volumes
    yielded = float(volumes[strain > 0.0].sum()) if strain.size else 0.0
    total = equivalent_strain(solid, solver.history)
    sums = comm.allreduce(np.array([yielded, volumes.sum(), volumes[total > STRAINED].sum()]))
    peaks = np.array([np.max(values, initial=0.0) for values in (solver.pressure, strain, total)])
    comm.Allreduce(MPI.IN_PLACE, peaks, op=MPI.MAX)
    gap, edges = solver.gap(), solver.contact.touched_edges()
    surface, (touched, weights) = solver.contact_surface, solver.contact.touched()
    area = surface.area_of(touched, weights)
    count, largest = spots_of(surface, edges, np.sum(weights * touched, axis=1))
    mean_pressure = {"mean_pressure": solver.force / area.value} if area.value > 0.0 else {}
    return {
        "area_fraction": area.value,
        "error_area_fraction": area.error,
        "edge_fraction": area.edge,
        "max_pressure": float(peaks[0]),
        "plastic_fraction": float(sums[0] / sums[1]),
        "max_plastic_strain": float(peaks[1]),
        "mean_gap": surface.mean(gap),
        **mean_pressure,
        "spots": count,
        "largest_spot": largest,
        **solver.probed,
        "max_strain": float(peaks[2]),
        "strained_fraction": float(sums[2] / sums[1]),
    }


@dataclass
class Record:
    """Rows of the curve in physical units, and requested snapshots."""

    side: float  # L [length]
    E: float  # unit of stress [force/length^2]
    reduced_modulus: float  # E' [force/length^2]
    rows: list[dict[str, Any]] = field(default_factory=list)
    snapshots: list[Snapshot] = field(default_factory=list)

    def add(
        self, solver: ContactSolver, branch: str, stats: StepStats, seconds: float, time: float | None = None
    ) -> None:
        """Append the state of `solver` as a row, at a time of the path where it takes any [s]; collective."""
        state = row(solver)
        force = solver.force * self.E * self.side**2
        units = {
            "": 1.0, "length": self.side, "length^2": self.side**2, "length^3": self.side**3,
            "force/length": self.E * self.side, "force/length^2": self.E,
        }  # fmt: skip
        columns = {
            "step": len(self.rows) + 1,
            "branch": branch,
            "delta": solver.delta * self.side,
            "delta_star": solver.delta,
            "force": force,
            "P_star": force / (self.side**2 * self.reduced_modulus),
            **{name: value * units[DIMENSIONS[name]] for name, value in state.items()},
            "newton": stats.newton,
            "krylov": stats.krylov,
            "seconds": seconds,
            **({} if time is None else {"time": time}),
        }
        self.rows.append(columns)

    def curve(self) -> Curve:
        """The rows so far."""
        return Curve.from_rows(self.rows)


def snapshot(solver: ContactSolver, step: int, branch: str) -> Snapshot:
    """Copy of the fields for figures and files; part of this rank."""
    u = solver.solid.u.x.array.reshape(-1, 3).copy()
    stress, plastic_strain = mean_stress(solver, u)
    return Snapshot(
        step, branch, solver.delta, pressure=solver.pressure, gap=solver.gap(),
        touched=solver.contact.touched_edges().astype(float), displacement=u, stress=stress,
        plastic_strain=plastic_strain,
    )  # fmt: skip


def mean_stress(solver: ContactSolver, u: Floats) -> tuple[Floats, Floats]:
    """Mean stress of the owned cells (cells, 6) and accumulated plastic strain (cells, points) at u."""
    kernels = solver.solid.kernels
    stress = kernels.stress(u, solver.history)
    mean = np.einsum("cq,cqi->ci", kernels.volumes, stress) / kernels.volumes.sum(axis=1, keepdims=True)
    return mean, solver.history.accumulated.copy()
