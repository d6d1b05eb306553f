"""A mass on the full solid in time, block with inertia, against the static law of the contact.

    ./run python3 benchmarks/inertia.py

A cosine bump of the block is pressed by a flat that carries a mass. The rows compare its motion with that of the mass
on the static law: on a light block, on a heavy one (Rayleigh's added mass), and in an impact.

Flat and block advance by the generalised-alpha method in the form of Arnold & Bruels (Multibody Syst. Dyn. 18 (2007)
185), which is that of Chung & Hulbert (J. Appl. Mech. 60 (1993) 371) with the average taken of accelerations:

    M w + F_int(x) = F_contact                        in full at the end of each step,
    (1 - alpha_m) a' + alpha_m a = (1 - alpha_f) w' + alpha_f w,
    x' = x + h v + h^2 [(1/2 - beta) a + beta a'],    v' = v + h [(1 - gamma) a + gamma a'].

So the contact conditions hold, and history is committed, exactly at the displacement, and a step is a static solve with
the stiffness of the inertia added. Units: lengths in L, stresses in E, any unit of time T.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from mpi4py import MPI
from scipy.sparse import csr_array

from asperity.arrays import Floats, Singles
from asperity.errors import ConvergenceError
from asperity.fem.weak_form import Matrix, measure
from asperity.mesh.generate import build_block
from asperity.model.load_path import Schedule
from asperity.model.material import Material
from asperity.model.problem import Problem
from asperity.quasistatic.contact_solver import ContactSolver
from asperity.quasistatic.make import make_contact_solver
from asperity.quasistatic.measures import Record
from asperity.quasistatic.newton import ROUNDING
from asperity.quasistatic.stepping import follow
from asperity.runtime.compiled import solver as _solver
from asperity.surface import Sinusoid
from asperity.vibration import ContactOscillator, CurveLaw

MASS_DEGREE = 6  # of the quadrature of the consistent mass: second-order shapes squared, on curved cells
PLATE_TOLERANCE = 1e-7  # unbalanced force on the plate over the greatest force on it
PLATE_ITERATIONS = 20  # of the secant method
# Spectral radius at infinite frequency. With 1 the force of a node that meets the plate oscillates without end, because
# its velocity jumps; with 0 the first modes of the block are damped too.
RHO = 0.8
ALPHA_M, ALPHA_F = (2.0 * RHO - 1.0) / (RHO + 1.0), RHO / (RHO + 1.0)  # Chung & Hulbert 1993, equations 25, 17 and 20
BETA, GAMMA = 0.25 * (1.0 - ALPHA_M + ALPHA_F) ** 2, 0.5 - ALPHA_M + ALPHA_F


@dataclass(frozen=True)
class Motion:
    """Position x, velocity v, acceleration w and averaged acceleration a of a point, or of many (arrays)."""

    x: Any
    v: Any
    w: Any
    a: Any

    def anchor(self, h: float) -> tuple[Any, float]:
        """(x*, c) with which the acceleration after a step h is c (x' - x*)."""
        c = (1.0 - ALPHA_M) / ((1.0 - ALPHA_F) * BETA * h * h)
        predicted = self.x + h * self.v + h * h * (0.5 - BETA) * self.a
        return predicted - (ALPHA_M * self.a - ALPHA_F * self.w) / ((1.0 - ALPHA_F) * c), c

    def at(self, x: Any, h: float) -> Motion:
        """Motion after a step h to the position `x`."""
        anchor, c = self.anchor(h)
        a = (x - self.x - h * self.v) / (BETA * h * h) - (0.5 / BETA - 1.0) * self.a
        return Motion(x, self.v + h * ((1.0 - GAMMA) * self.a + GAMMA * a), c * (x - anchor), a)


class TimeSeries(NamedTuple):
    """Record of a run, a row per step and one for the start (n,)."""

    time: Floats  # [T]
    approach: Floats  # of the plate from first touch [L]
    velocity: Floats  # of the plate [L/T]
    force: Floats  # of contact [E L^2]


class Inertia:
    """Kernels of a solid with the force of inertia c M (u - u*), M the consistent mass; they replace its own.

    Attributes:
        kernels: those of the solid
        shift: c [1/T^2]
        anchor: u* at the local nodes (nodes, 3) [L]
        mass: M of one component, of the cells of this rank (nodes, nodes) [E L T^2]
    """

    linear = False  # the tangent changes with the time step

    def __init__(self, solid: Any, density: float) -> None:
        import ufl

        self.kernels, self._sparsity, self.shift = solid.kernels, solid.sparsity, 0.0
        self.anchor: Floats = np.zeros((solid.nodes, 3))
        form = ufl.inner(ufl.TrialFunction(solid.V), ufl.TestFunction(solid.V)) * measure(solid.mesh, MASS_DEGREE)
        data, pattern = Matrix(form, solid.sparsity).blocks()[:, 0, 0].copy(), solid.sparsity
        self.mass = density * csr_array((data, pattern.indices, pattern.indptr), shape=(solid.nodes, solid.nodes))
        self._diagonals = solid.sparsity.diagonals(np.arange(self.mass.nnz))
        solid.kernels = solid.tangent._kernels = self

    def __getattr__(self, name: str) -> Any:
        return getattr(self.kernels, name)

    def add_internal_force(self, u: Floats, b: Floats) -> None:
        """Add internal force and inertia at the displacement u (nodes, 3) to b (nodes, 3) [E L^2]."""
        self.kernels.add_internal_force(u, b)
        b += self.shift * (self.mass @ (u - self.anchor))

    def tangent(self, u: Floats, values: Floats | Singles, **given: Any) -> None:
        """Write the derivative, whole or its upper half in single precision."""
        whole = values if values.dtype == np.float64 else np.zeros(self._sparsity.size)
        self.kernels.tangent(u, whole, **given)
        whole[self._diagonals] += self.shift * self.mass.data[:, None]
        if whole is not values:
            _solver.upper_half(self._sparsity.indptr, self._sparsity.indices, whole, values)


class Transient:
    """Plate with a mass, a constant load and a dashpot to ground, on a block with inertia.

        m q'' + c q' + P = W

    The motion starts in the state of the contact solver, whose solid has inertia from then on. Each step solves the
    block for positions of the plate until the equation of the plate holds, by the secant method, in few iterations: the
    part of P in the equation is (omega h)^2/4, with omega the frequency of the mass on the contact.

    Args:
        solver: in equilibrium, at the position where the plate is released
        density: of the block [E T^2/L^2]
        mass: of the plate [E L T^2]
        load: W [E L^2]; 0 for a free impact
        dashpot: c [E L T]

    Attributes:
        added_mass: of the block, adds to the mass of the plate as long as the block follows quasi-statically:
            omega falls by sqrt(1 + added_mass/mass) (Rayleigh) [E L T^2]
    """

    def __init__(
        self, solver: ContactSolver, *, density: float, mass: float, load: float, dashpot: float = 0.0
    ) -> None:
        self.solver, self.mass, self.load, self.dashpot = solver, mass, load, dashpot
        self.inertia = Inertia(solver.solid, density)
        self.time = 0.0
        self._force = self._before = solver.force
        self._slope = 0.0
        self.start()

    def start(self, velocity: float = 0.0, shape: Floats | None = None) -> None:
        """Release the plate at the position of the contact solver.

        Velocity and first acceleration of the block are those of the plate times a shape. The acceleration follows
        from the balance of forces projected on that shape, which is exact for the shape of a mode.

        Args:
            velocity: of the plate [L/T]
            shape: displacement of the owned nodes per unit approach (owned, 3); default that of the last static step
        """
        solver, solid = self.solver, self.solver.solid
        last = solver.state()
        x = last.displacement
        if shape is None:
            step = 0.0 if last.before is None else solver.delta - last.before
            shape = np.asarray((x - last.previous) / (step or np.inf))
        solid.u.x.array[: 3 * solid.owned] = x.ravel()
        solid.u.x.scatter_forward()
        self.inertia.shift = 0.0
        full = solid.scatter_forward(shape.ravel())
        self.added_mass = float(np.vdot(full, self.inertia.mass @ full))
        resisting = float(np.vdot(shape, solid.internal_force()))
        w = (self.load - self.dashpot * velocity - resisting) / (self.mass + self.added_mass)
        self.block = Motion(x, shape * velocity, shape * w, shape * w)
        self.plate = Motion(solver.delta, velocity, w, w)

    def run(self, duration: float, h: float) -> TimeSeries:
        """Integrate for a duration, rounded up to whole steps h; a fiftieth of a period gives errors of about 0.1 %."""
        rows = [(self.time, self.plate.x, self.plate.v, self._force)]
        for _ in range(int(np.ceil(duration / h * (1.0 - 1e-12)))):
            self.step(h)
            rows.append((self.time, self.plate.x, self.plate.v, self._force))
        return TimeSeries(*np.array(rows).T)

    def step(self, h: float) -> None:
        """Make one step `h`."""
        solver = self.solver
        anchor, self.inertia.shift = self.block.anchor(h)
        self.inertia.anchor = solver.solid.scatter_forward(anchor.ravel())
        q_anchor, c = self.plate.anchor(h)

        def balance(q: float) -> float:
            """Residual of the plate at q without the contact force [E L^2]."""
            return self.mass * c * (q - q_anchor) + self.dashpot * self.plate.at(q, h).v - self.load

        stiffness = self.mass * c + self.dashpot * GAMMA / (BETA * h)
        q = self.plate.x + h * self.plate.v
        q -= (balance(q) + 2.0 * self._force - self._before) / stiffness  # with the force extrapolated
        guess = self.block.x + h * self.block.v
        tried: tuple[float, float] | None = None
        for _ in range(PLATE_ITERATIONS):
            solver.contact.begin(solver.summit - q)
            stats = solver.newton.solve(guess, max(abs(q - self.plate.x), 1e-6))
            if not stats.converged:
                break
            force, guess = solver.solved_force(), solver.newton.x.array_r.reshape(-1, 3).copy()
            unbalanced = balance(q) + force
            # a free impact has no load, and no force at all in its flight
            greatest = max(self.load, abs(force), abs(self._force), self.mass * abs(self.plate.w))
            rounding = ROUNDING * stiffness * max(abs(q), abs(self.plate.x))
            if abs(unbalanced) <= PLATE_TOLERANCE * greatest + rounding:
                self.plate, self.block = self.plate.at(q, h), self.block.at(guess, h)
                held = solver.newton.now.rows  # nodes in contact move with the plate
                for name in "vwa":
                    getattr(self.block, name).reshape(-1)[held] = -getattr(self.plate, name)
                solver.solid.kernels.commit()
                solver.contact.commit()
                self._before, self._force = self._force, force
                self.time += h
                return
            if tried is not None and abs(q - tried[0]) > 1e-6 * abs(q - self.plate.x):
                self._slope = max((force - tried[1]) / (q - tried[0]), 0.0)
            tried = q, force
            q -= unbalanced / (stiffness + self._slope)
        raise ConvergenceError(f"no convergence of the step of {h:.3g} at time {self.time:.6g} ({stats.reason})")


BUMP, DEEP, ZETA, NU = Sinusoid(L=1.0, amplitude=0.05, wavelength=1.0), 0.035, 0.02, 0.3


def pressed() -> ContactSolver:
    """The bump in contact with the flat, without a load."""
    block = build_block(BUMP, 1.0, lambda x, y, depth: 0.35)
    return make_contact_solver(MPI.COMM_SELF, Problem.of(BUMP, Material(1.0, NU), delta_max=0.06), block)


def static_law() -> CurveLaw:
    """Law of the contact on this mesh [E L^2 over L]."""
    solver = pressed()
    record = Record(1.0, 1.0, solver.solid.material.reduced_modulus)
    follow(solver, Schedule(delta_max=0.06, steps=60), record)
    curve = record.curve()
    return CurveLaw(curve.delta, curve.force)


def released(law: CurveLaw, u: float, density: float) -> tuple[Transient, ContactOscillator]:
    """Flat on the bump, let go at u; time in units of 1/omega_s."""
    oscillator = ContactOscillator(law, load=float(law.force(DEEP)), zeta=ZETA)
    r, solver = oscillator, pressed()
    for delta in np.linspace(0.0, r.z_s * (1.0 + u), 9)[1:]:
        assert solver.step(float(delta)).converged
    mass = r.scale / r.z_s
    return Transient(solver, density=density, mass=mass, load=r.load, dashpot=2.0 * ZETA * mass), oscillator


def light(law: CurveLaw) -> Iterator[tuple[str, float]]:
    """Greatest difference of motion and force from those on the static law, over their greatest, %."""
    transient, oscillator = released(law, 0.4, 1e-6)
    history, z = transient.run(9.0, 2.0 * np.pi / 100), oscillator.z_s
    path = oscillator.simulate(1.0, 0.0, u=0.4, periods=1.5, samples=400)
    u = history.approach / z - 1.0
    yield "light block, motion over z_s", 100.0 * float(np.abs(u - np.interp(history.time, path.tau, path.u)).max())
    force = law.force(np.maximum(history.approach, 0.0))
    yield "light block, force", 100.0 * float(np.abs(history.force[1:] - force[1:]).max() / force.max())


def heavy(law: CurveLaw) -> Iterator[tuple[str, float]]:
    """Difference of the shift of the frequency by a heavy block from Rayleigh's, over the shift, %."""
    times = []
    for density in (1e-6, 0.1):
        transient, _ = released(law, 0.1, density)
        history = transient.run(8.0, 2.0 * np.pi / 100)
        turn = np.flatnonzero((history.velocity[:-1] > 0) & (history.velocity[1:] <= 0))[0]
        v = history.velocity[turn : turn + 2]
        times.append(history.time[turn] + (history.time[1] - history.time[0]) * v[0] / (v[0] - v[1]))
    shift = float(np.sqrt(1.0 + transient.added_mass / transient.mass)) - 1.0
    yield "heavy block, added mass", 100.0 * abs(times[1] / times[0] - 1.0 - shift) / shift


def impact(law: CurveLaw) -> Iterator[tuple[str, float]]:
    """Difference of the greatest approach and of the rebound of a free impact from those on the static law, %."""
    deepest, mass, solver = 0.03, 1.0, pressed()
    speed = float(np.sqrt(2.0 * law.potential(deepest) / mass))
    assert solver.step(-0.002).converged
    transient = Transient(solver, density=1e-4, mass=mass, load=0.0)
    transient.start(velocity=speed, shape=np.zeros((solver.solid.owned, 3)))
    lasts = 3.0 * deepest / speed
    history = transient.run(1.6 * lasts, lasts / 100)
    yield "impact, greatest approach", 100.0 * abs(history.approach.max() / deepest - 1.0)
    yield "impact, speed of the rebound", 100.0 * abs(history.velocity[-1] / speed + 1.0)


def main() -> None:
    law = static_law()
    print("| case | difference, % |\n|---|---|")
    for rows in (light, heavy, impact):
        for name, value in rows(law):
            print(f"| {name} | {value:.2g} |", flush=True)


if __name__ == "__main__":
    main()
