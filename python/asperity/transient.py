"""Rigid mass vibrating on the full block: the dynamic solution with which the one-degree model is compared.

The flat carries a mass and has one degree of freedom; the block has inertia. Both advance by the
generalised-alpha method in the form of Arnold & Bruels (Multibody Syst. Dyn. 18 (2007) 185), which is that of Chung &
Hulbert (J. Appl. Mech. 60 (1993) 371) with the average taken of accelerations instead of forces:

    M w + F_int(x) = F_contact                        in full at the end of each step,
    (1 - alpha_m) a' + alpha_m a = (1 - alpha_f) w' + alpha_f w,
    x' = x + h v + h^2 [(1/2 - beta) a + beta a'],    v' = v + h [(1 - gamma) a + gamma a'].

So the contact conditions hold, and history is committed, exactly at the displacement, and a step is a static solve of
the contact solver with the stiffness of the inertia added. The method is of second order; during plastic flow the
first order of backward Euler prevails.

Units: lengths in L, stresses in E, any unit of time T; so forces are in E L^2, masses in E L T^2, the density in
E T^2/L^2.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from asperity.arrays import Floats
from asperity.errors import ConvergenceError, InputError
from asperity.fem.energies import energies
from asperity.fem.tangent import Inertia
from asperity.quasistatic.contact_solver import ContactSolver
from asperity.quasistatic.newton import ROUNDING

PLATE_TOLERANCE = 1e-7  # unbalanced force on the plate over the greatest force on it
PLATE_ITERATIONS = 20  # of the secant method


@dataclass(frozen=True)
class GeneralisedAlpha:
    """Time integration by the generalised-alpha method, by its spectral radius at infinite frequency.

    Attributes:
        rho_inf: in [0, 1], the factor a step by which motion is damped that it cannot resolve. With 1 the energy of a
            linear solid is conserved, but the force of a node that meets the plate oscillates without end, because its
            velocity jumps; with 0 the first modes of the block are damped too. The default is 0.8.

    Raises:
        InputError: rho_inf is outside [0, 1]

    Examples:
        >>> GeneralisedAlpha(1.0).constants
        (0.5, 0.5, 0.25, 0.5)
    """

    rho_inf: float = 0.8

    def __post_init__(self) -> None:
        if not 0.0 <= self.rho_inf <= 1.0:
            raise InputError(f"rho_inf = {self.rho_inf!r} must lie in [0, 1]: 1 damps nothing, 0 all it cannot resolve")

    @property
    def constants(self) -> tuple[float, float, float, float]:
        """alpha_m, alpha_f, beta and gamma (Chung & Hulbert 1993, equations 25, 17 and 20)."""
        rho = self.rho_inf
        m, f = (2.0 * rho - 1.0) / (rho + 1.0), rho / (rho + 1.0)
        return m, f, 0.25 * (1.0 - m + f) ** 2, 0.5 - m + f


@dataclass(frozen=True)
class Motion:
    """Position x, velocity v, acceleration w and averaged acceleration a of a point, or of many (arrays)."""

    x: Any
    v: Any
    w: Any
    a: Any

    def anchor(self, scheme: GeneralisedAlpha, h: float) -> tuple[Any, float]:
        """(x*, c) with which the acceleration after a step h is c (x' - x*)."""
        m, f, beta, _ = scheme.constants
        c = (1.0 - m) / ((1.0 - f) * beta * h * h)
        predicted = self.x + h * self.v + h * h * (0.5 - beta) * self.a
        return predicted - (m * self.a - f * self.w) / ((1.0 - f) * c), c

    def at(self, x: Any, scheme: GeneralisedAlpha, h: float) -> Motion:
        """Motion after a step h to the position `x`."""
        _, _, beta, gamma = scheme.constants
        anchor, c = self.anchor(scheme, h)
        a = (x - self.x - h * self.v) / (beta * h * h) - (0.5 / beta - 1.0) * self.a
        return Motion(x, self.v + h * ((1.0 - gamma) * self.a + gamma * a), c * (x - anchor), a)


@dataclass(frozen=True)
class TimeSeries:
    """Record of a run, a row per step and one for the start (n,); the same on all ranks.

    Attributes:
        time: [T]
        approach: of the plate from first touch [L]
        velocity: of the plate [L/T]
        force: of contact [E L^2]
        energy: kinetic of plate and block, stored and dissipated in the block [E L^3]
        supplied: work of load, forcing and dashpot on the plate since the start, in `energy` at the start [E L^3]
        newton: number of Newton iterations
    """

    time: Floats
    approach: Floats
    velocity: Floats
    force: Floats
    energy: Floats
    supplied: Floats
    newton: int


class Transient:
    """Plate with a mass, a constant load and a dashpot to ground, on a block with inertia; collective.

        m q'' + c q' + P = W + F(t)

    The motion starts in the state of the contact solver, whose solid has inertia from then on. Each step solves the
    block for positions of the plate until the equation of the plate holds, by the secant method, in few iterations: the
    part of P in the equation is (omega h)^2/4, with omega the frequency of the mass on the contact.

    Args:
        solver: in equilibrium, at the position where the plate is released
        density: of the block [E T^2/L^2]
        mass: of the plate [E L T^2]
        load: W [E L^2]; 0 for a free impact
        dashpot: c [E L T]
        scheme: of integration

    Attributes:
        added_mass: of the block, adds to the mass of the plate as long as the block follows quasi-statically:
            omega falls by sqrt(1 + added_mass/mass) (Rayleigh) [E L T^2]

    Raises:
        InputError: density or mass is not positive, load or dashpot is negative, or the contact sticks

    Examples:
        >>> from asperity.surface import Flat
        >>> size, elastic = asp.MeshSize(h_contact=1.0, h_max=1.0), asp.Material(E=1.0, nu=0.3)
        >>> solver = asp.solve_contact(Flat(L=1.0), elastic, delta_max=0.01, steps=1, size=size).solver
        >>> transient = asp.Transient(solver, density=0.3, mass=1.0, load=2.0 * solver.force)
        >>> round(transient.added_mass, 6)  # a third of the block
        0.1
        >>> bool(transient.run(duration=1.0, h=0.25).approach[-1] > 0.01)
        True
    """

    def __init__(
        self,
        solver: ContactSolver,
        *,
        density: float,
        mass: float,
        load: float,
        dashpot: float = 0.0,
        scheme: GeneralisedAlpha | None = None,
    ) -> None:
        for name, value in (("density", density), ("mass", mass), ("load", load), ("dashpot", dashpot)):
            if not (np.isfinite(value) and value >= 0.0) or (value == 0.0 and name in ("density", "mass")):
                raise InputError(f"{name} = {value!r} must be finite and positive; load and dashpot may be 0")
        if solver.contact.held is not None:
            raise InputError("friction has no motion in time yet: give Transient a solver without it")
        self.solver, self.mass, self.load, self.dashpot = solver, mass, load, dashpot
        self.scheme = scheme or GeneralisedAlpha()
        self.inertia = solver.solid.tangent.inertia = Inertia(solver.solid.V, solver.solid.sparsity, density)
        self.time = 0.0
        self._force = self._before = solver.force
        self._slope = 0.0
        self.start()

    def start(self, velocity: float = 0.0, shape: Floats | None = None) -> None:
        """Release the plate at the position of the contact solver; collective.

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
        resisting = solid.comm.allreduce(float(np.vdot(shape, solid.internal_force())))
        self.added_mass = 2.0 * self._kinetic(shape)
        w = (self.load - self.dashpot * velocity - resisting) / (self.mass + self.added_mass)
        self.block = Motion(x, shape * velocity, shape * w, shape * w)
        self.plate = Motion(solver.delta, velocity, w, w)

    def run(self, duration: float, h: float, forcing: Callable[[float], float] | None = None) -> TimeSeries:
        """Integrate with steps `h`; another call continues; collective.

        Args:
            duration: [T]; rounded up to whole steps
            h: time step [T]; a fiftieth of the period of the mass on its contact gives errors of about 0.1 %
            forcing: F(t) [E L^2], t from the first start

        Returns:
            record from the current time to the end of the duration

        Raises:
            InputError: duration or h is not positive
            ConvergenceError: a step does not converge; its `result` is the record up to there
        """
        if not (h > 0.0 and duration > 0.0):
            raise InputError(f"duration = {duration!r} and h = {h!r} must be positive")
        push = forcing or (lambda t: 0.0)
        newton = self.solver.counts.newton
        supplied = self._energy()
        rows = [self._row(supplied)]
        for _ in range(int(np.ceil(duration / h * (1.0 - 1e-12)))):
            old, was = self.plate, push(self.time)
            try:
                self.step(h, push(self.time + h))
            except ConvergenceError as failure:
                failure.result = self._record(rows, newton)
                raise
            supplied += (self.load + 0.5 * (was + push(self.time))) * (self.plate.x - old.x)
            supplied -= 0.5 * h * self.dashpot * (old.v**2 + self.plate.v**2)
            rows.append(self._row(supplied))
        return self._record(rows, newton)

    def _record(self, rows: list[list[float]], newton: int) -> TimeSeries:
        """Record of rows of `_row`, after `newton` iterations before the first."""
        time, approach, velocity, force, energy, work = np.array(rows).T
        return TimeSeries(time, approach, velocity, force, energy, work, self.solver.counts.newton - newton)

    def step(self, h: float, push: float) -> None:
        """Make one step `h`; the forcing at its end is `push` [E L^2]."""
        solver, scheme = self.solver, self.scheme
        anchor, self.inertia.shift = self.block.anchor(scheme, h)
        self.inertia.anchor = solver.solid.scatter_forward(anchor.ravel())
        _, _, beta, gamma = scheme.constants
        q_anchor, c = self.plate.anchor(scheme, h)
        drive = self.load + push

        def balance(q: float) -> float:
            """Residual of the plate at q without the contact force [E L^2]."""
            return self.mass * c * (q - q_anchor) + self.dashpot * self.plate.at(q, scheme, h).v - drive

        stiffness = self.mass * c + self.dashpot * gamma / (beta * h)
        q = self.plate.x + h * self.plate.v
        q -= (balance(q) + 2.0 * self._force - self._before) / stiffness  # with the force extrapolated
        guess = self.block.x + h * self.block.v
        tried: tuple[float, float] | None = None
        for _ in range(PLATE_ITERATIONS):
            solver.contact.begin(solver.summit - q)
            stats = solver.newton.solve(guess, max(abs(q - self.plate.x), 1e-6), 1.0 + c * self.inertia.heaviest)
            solver.counts.newton += stats.newton
            solver.counts.krylov += stats.krylov
            if not stats.converged:
                break
            force, guess = solver.solved_force(), solver.newton.x.array_r.reshape(-1, 3).copy()
            unbalanced = balance(q) + force
            # a free impact has no load, and no force at all in its flight
            greatest = max(self.load, abs(drive), abs(force), abs(self._force), self.mass * abs(self.plate.w))
            rounding = ROUNDING * stiffness * max(abs(q), abs(self.plate.x))
            if abs(unbalanced) <= PLATE_TOLERANCE * greatest + rounding:
                self.plate, self.block = self.plate.at(q, scheme, h), self.block.at(guess, scheme, h)
                held = solver.newton.rows  # nodes in contact move with the plate
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
        raise ConvergenceError(
            f"no convergence of the step of {h:.3g} at time {self.time:.6g} (approach {q:.6g} L, {stats.reason}): take "
            "a smaller time step"
        )

    def _row(self, supplied: float) -> list[float]:
        return [self.time, self.plate.x, self.plate.v, self._force, self._energy(), supplied]

    def _kinetic(self, v: Floats) -> float:
        """Kinetic energy of the block at velocities of the owned nodes (owned, 3) [E L^3]."""
        full = self.solver.solid.scatter_forward(v.ravel())
        return 0.5 * float(self.solver.solid.comm.allreduce(np.vdot(full, self.inertia.mass @ full)))

    def _energy(self) -> float:
        """Kinetic, stored and dissipated energy of plate and block [E L^3]."""
        solid = self.solver.solid
        shift, self.inertia.shift = self.inertia.shift, 0.0
        stored_and_dissipated = energies(solid, solid.internal_force())
        self.inertia.shift = shift
        of_solid = float(solid.comm.allreduce(np.array(stored_and_dissipated)).sum())
        return 0.5 * self.mass * self.plate.v**2 + self._kinetic(self.block.v) + of_solid
