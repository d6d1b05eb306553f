# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

"""Where the one-degree model of a mass on a contact holds: against the full solid in time, docs/transient.md.

The surface of cases/demo.toml on a coarse mesh, elastic and plastic; the law comes from the same mesh, so all
that differs is the inertia of the block. Prints the tables docs/tables/transient_*.csv.
"""

from __future__ import annotations

import argparse
import warnings
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from time import process_time

import numpy as np

from asperity.arrays import Floats
from asperity.case import Case
from asperity.dynamics import ContactOscillator, TableLaw, unload_reload
from asperity.fem.inertia import consistent_mass
from asperity.fem.kernels import History
from asperity.model.load_path import Schedule
from asperity.model.material import Material
from asperity.model.settings import MeshSize
from asperity.quasistatic.contact_solver import ContactSolver, SolverState
from asperity.quasistatic.make import make_block, make_contact_solver
from asperity.quasistatic.stepping import Position, Record, follow
from asperity.transient import Scheme, TimeSeries, Transient

CASE = Path(__file__).parent.parent / "cases" / "demo.toml"
DEPTH = 0.03  # approach up to which the static law is computed [L]
STATIC_STEPS = 60
PRELOAD = 0.4  # over the force at DEPTH
RATIOS = (0.01, 0.05, 0.1, 0.2, 0.3, 0.5)  # omega_s over the block's first own frequency
AMPLITUDES = (0.05, 0.3)
FREE_ZETA = 0.02
FORCED_RATIOS = (0.01, 0.2)
FREQUENCIES = (0.85, 0.95, 1.1)
FORCING, FORCED_ZETA, FORCED_PERIODS = 0.03, 0.05, 7


@dataclass(frozen=True)
class Saved:
    """State of a contact solver from which runs start again."""

    state: SolverState
    history: History

    @staticmethod
    def of(solver: ContactSolver) -> Saved:
        return Saved(solver.state(), solver.solid.kernels.history().copy())

    def restore(self, solver: ContactSolver) -> None:
        solver.solid.kernels.restore(self.history)
        solver.restore(self.state)


@dataclass(frozen=True)
class Subject:
    """A block under a plate, and the quasi-static law of its contact.

    Attributes:
        name: of the material
        solver: the block
        saved: its state at the end of loading, or before it
        law: of the vibration, in units of L and E L^2
        loading: of the first loading
        load: W [E L^2]
        first: first own frequency of the block, top free, for unit density
    """

    name: str
    solver: ContactSolver
    saved: Saved
    law: TableLaw
    loading: TableLaw
    load: float
    first: float

    def oscillator(self, zeta: float = 0.0) -> ContactOscillator:
        return ContactOscillator(self.law, load=self.load, zeta=zeta)

    def transient(self, u: float, ratio: float, zeta: float = 0.0, velocity: float = 0.0) -> Transient:
        """The plate held at u and let go, in units of 1/omega_s."""
        solver, r = self.solver, self.oscillator().restoring
        self.saved.restore(solver)
        start = self.law.origin + r.z_s * (1.0 + u)
        for delta in np.linspace(solver.delta, start, 9)[1:]:
            if not solver.step(float(delta)).converged:
                raise SystemExit(f"{self.name}: the static solve failed at {delta:g} L")
        mass = r.scale / r.z_s
        t = Transient(
            solver, density=(ratio * self.first) ** 2, mass=mass, load=self.load, dashpot=2.0 * zeta * mass,
            scheme=Scheme(),
        )  # fmt: skip
        t.start(velocity * r.z_s)
        return t

    def release(self, t: Transient) -> None:
        """Take the inertia out of the solid again."""
        self.solver.solid.kernels = t.kernels.inner

    def u(self, series: TimeSeries) -> Floats:
        return (series.approach - self.law.origin) / self.oscillator().restoring.z_s - 1.0


def prepare(name: str, material: Material, h_contact: float) -> Subject:
    """Static law of a material on the coarse mesh."""
    from mpi4py import MPI

    surface = Case.load(CASE).build_surface()
    block = make_block(MPI.COMM_WORLD, surface, surface.L, DEPTH * surface.L, MeshSize(h_contact * surface.L))
    solver = make_contact_solver(MPI.COMM_WORLD, surface, block, material)
    before = Saved.of(solver)
    record = Record(1.0, 1.0, solver.solid.material.reduced_modulus)
    follow(solver, Schedule(delta_max=DEPTH, steps=STATIC_STEPS), record)
    load, saved = PRELOAD * solver.force, before
    law = loading = TableLaw.from_curve(record.curve())
    if material.plastic:
        # the law of the vibration: unloaded once, far enough to flow backwards where it will, and loaded again
        saved = Saved.of(solver)
        _unload(solver, record)
        law = unload_reload(record.curve(), load)
    return Subject(name, solver, saved, law, loading, load, first_frequency(solver))


def _unload(solver: ContactSolver, record: Record) -> None:
    """Add an unloading to zero force to a record."""
    schedule = Schedule(delta_max=DEPTH, steps=STATIC_STEPS, unload_steps=STATIC_STEPS)
    follow(solver, schedule, record, position=Position(leg=1))


def first_frequency(solver: ContactSolver) -> float:
    """Lowest own frequency of the elastic block with its top free, for unit density."""
    from scipy import sparse
    from scipy.sparse.linalg import eigsh

    solid = solver.solid
    elastic = np.empty_like(solid.values)
    solid.kernels.tangent(np.zeros((solid.nodes, 3)), elastic)
    K = sparse.csr_array((elastic, solid.sparsity.columns, solid.sparsity.rows))
    M = sparse.kron(consistent_mass(solid), sparse.eye_array(3)).tocsr()
    free = np.setdiff1d(np.arange(3 * solid.owned), solid.fixed)
    lowest = eigsh(K[free][:, free].tocsc(), 1, M[free][:, free].tocsc(), sigma=0.0, return_eigenvectors=False)
    return float(np.sqrt(lowest[0]))


def maxima(time: Floats, u: Floats) -> tuple[Floats, Floats]:
    """Times and values of the maxima, by parabolas."""
    at = np.flatnonzero((u[1:-1] > u[:-2]) & (u[1:-1] >= u[2:])) + 1
    below, above = u[at] - u[at - 1], u[at] - u[at + 1]
    shift = 0.5 * (below - above) / (below + above)
    return time[at] + shift * (time[at + 1] - time[at]), u[at] + 0.125 * (below - above) ** 2 / (below + above)


def table(title: str, heads: tuple[str, ...], rows: list[tuple[str, ...]]) -> None:
    print(f"\n{title}\n")
    for row in (heads, ("---",) * len(heads), *rows):
        print("| " + " | ".join(row) + " |", flush=True)


def free(subject: Subject, steps: int, ratios: tuple[float, ...]) -> None:
    """Free decay after a release: frequency over two periods and what amplitude is left after them."""
    oscillator = subject.oscillator(FREE_ZETA)
    r = oscillator.restoring
    rows: list[tuple[str, ...]] = []
    for u0 in AMPLITUDES:
        path = oscillator.simulate(1.0, 0.0, u=u0, periods=2.5, samples=400)
        times, tops = maxima(path.tau, path.u)
        one, left = 4.0 * np.pi / times[1], tops[1] / u0
        for ratio in ratios:
            begun = process_time()
            t = subject.transient(u0, ratio, FREE_ZETA)
            heavier = np.sqrt(1.0 + t.added_mass / t.mass)
            history = t.run(2.2 * 2.0 * np.pi / one * heavier, 2.0 * np.pi / steps)
            times, tops = maxima(history.time, subject.u(history))
            omega = 4.0 * np.pi / times[1]
            books = history.energy - history.supplied
            vibration = r.scale * r.z_s * float(r.potential(u0))
            rows.append((
                f"{u0:g}", f"{ratio:g}", f"{t.added_mass / t.mass:.4f}", f"{one:.4f}", f"{omega:.4f}",
                f"{100.0 * (omega / one - 1.0):+.2f} %", f"{100.0 * (omega * heavier / one - 1.0):+.2f} %",
                f"{left:.3f}", f"{tops[1] / u0:.3f}", f"{100.0 * (books[-1] - books[0]) / vibration:+.2f} %",
                f"{process_time() - begun:.0f}",
            ))  # fmt: skip
            subject.release(t)
    heads = (
        "u_0", "omega_s/omega_1", "added mass/m", "omega/omega_s, law", "full solid", "difference",
        "with the added mass", "amplitude left, law", "full solid", "balance of energy", "CPU s",
    )  # fmt: skip
    table(f"{subject.name}: free decay from u_0, zeta = {FREE_ZETA:g}, over two periods", heads, rows)


def forced(subject: Subject, steps: int, ratios: tuple[float, ...]) -> None:
    """Steady vibration, started on the orbit of the one-degree model."""
    oscillator = subject.oscillator(FORCED_ZETA)
    response = oscillator.response(FORCING, (0.6, 1.2))

    def drive(omega: float, time: float) -> float:
        return FORCING * oscillator.restoring.scale * float(np.cos(omega * time))

    rows: list[tuple[str, ...]] = []
    for omega in FREQUENCIES:
        orbit = next(s for s in response.at(omega) if s.stable)
        u0, v0 = orbit.start
        for ratio in ratios:
            begun = process_time()
            t = subject.transient(u0, ratio, FORCED_ZETA, v0)
            h = 2.0 * np.pi / omega / round(steps / omega)
            history = t.run(FORCED_PERIODS * 2.0 * np.pi / omega, h, partial(drive, omega))
            u = subject.u(history)
            _, tops = maxima(history.time, u)
            last = u[-round(2.0 * np.pi / omega / h) :]
            rows.append((
                f"{omega:g}", f"{ratio:g}", f"{orbit.u_max:.4f}", f"{tops[-1]:.4f}",
                f"{100.0 * (tops[-1] / orbit.u_max - 1.0):+.1f} %", f"{orbit.u_min:.4f}", f"{last.min():.4f}",
                f"{abs(tops[-1] / tops[-2] - 1.0):.1e}", f"{process_time() - begun:.0f}",
            ))  # fmt: skip
            subject.release(t)
    heads = (
        "Omega", "omega_s/omega_1", "u_max, law", "full solid", "difference", "u_min, law", "full solid",
        "last change", "CPU s",
    )  # fmt: skip
    title = f"{subject.name}: forced, F^ = {FORCING:g}, zeta = {FORCED_ZETA:g}, after {FORCED_PERIODS} periods"
    table(title, heads, rows)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--h-contact", type=float, default=0.2, help="element size at the contact over L")
    parser.add_argument("--steps", type=int, default=80, help="time steps per 2 pi/omega_s")
    parser.add_argument("--quick", action="store_true", help="one ratio each, for a look")
    parser.add_argument("--only", choices=("elastic", "plastic"))
    parser.add_argument("--part", choices=("free", "forced"))
    options = parser.parse_args()
    warnings.simplefilter("ignore")
    case = Case.load(CASE).material
    materials = {
        "elastic": Material(case.E, case.nu),
        "plastic": Material(case.E, case.nu, case.yield_strength, case.tangent_modulus or 0.0),
    }
    for name, material in materials.items():
        if options.only not in (None, name):
            continue
        subject = prepare(name, material, options.h_contact)
        r = subject.oscillator().restoring
        print(
            f"\n{name}: {subject.solver.solid.dofs} dofs, {subject.law.describe()}, n_loc = {r.n_loc:.4f}, kappa = "
            f"{r.kappa:.4f}, z_s = {r.z_s:.5f} L, W = {subject.load:.4e} E L^2, first own frequency "
            f"{subject.first:.4f}/sqrt(rho)"
        )
        if material.plastic:
            paper = ContactOscillator(subject.loading, load=subject.load).restoring
            softer = np.sqrt(paper.scale / paper.z_s / (r.scale / r.z_s))
            print(f"omega_s of the loading curve over that of the unload-reload branch: {softer:.4f}")
        if options.part != "forced":
            free(subject, options.steps, RATIOS[2:3] if options.quick else RATIOS)
        if options.part != "free":
            forced(subject, 3 * options.steps // 4, FORCED_RATIOS[:1] if options.quick else FORCED_RATIOS)


if __name__ == "__main__":
    main()
