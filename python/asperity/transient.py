"""A rigid mass vibrating on the block itself: the full solid in time, against which the one-degree model is held.

The flat carries a mass and moves as its one degree of freedom; the block has inertia. Both advance by the
generalised-alpha method in the form of Arnold & Bruels (Multibody Syst. Dyn. 18 (2007) 185), which is that of Chung &
Hulbert (J. Appl. Mech. 60 (1993) 371) with the average taken of accelerations instead of forces:

    M w + F_int(x) = F_contact                        in full at the end of each step,
    (1 - alpha_m) a' + alpha_m a = (1 - alpha_f) w' + alpha_f w,
    x' = x + h v + h^2 [(1/2 - beta) a + beta a'],    v' = v + h [(1 - gamma) a + gamma a'].

So contact holds, and history is committed, exactly where the displacement stands, and a step is a static solve of the
press with the stiffness of the inertia added. The method is of second order; plastic flow adds backward Euler's first
order while it lasts.

Units: lengths in L, stresses in E, any unit of time T; so forces are in E L^2, masses in E L T^2, the density in
E T^2/L^2.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from asperity import _solver
from asperity.errors import ConvergenceError, InputError
from asperity.fem.compiled_kernels import shape_gradients
from asperity.fem.solid import Bulk, Floats, Solid
from asperity.quasistatic.balance import energies
from asperity.quasistatic.contact_solver import Press
from asperity.runtime import compat

MASS_DEGREE = 6  # of the quadrature of the consistent mass: second-order shapes squared, on curved cells
PLATE_TOLERANCE = 1e-7  # unbalanced force on the plate over the load
PLATE_ITERATIONS = 20
LARGEST_CUT = 8  # parts into which a step is cut before a run gives up


@dataclass(frozen=True)
class Scheme:
    """Parameters of the generalised-alpha method for a spectral radius at infinite frequency.

    Linear motion far below 1/h is hardly damped for any of them (the damping ratio is of third order in omega h).
    What the step cannot resolve is damped by a factor `rho_inf` per step: with 1, the energy of a linear solid is
    kept, but the force of a node that meets the plate rings from step to step forever, for its velocity jumps and
    nothing takes the jump out again; with 0 the first modes of the block suffer. docs/transient.md is with 0.8.

    Attributes:
        rho_inf: in [0, 1]

    Raises:
        InputError: rho_inf is outside [0, 1]
    """

    rho_inf: float = 0.8

    def __post_init__(self) -> None:
        if not 0.0 <= self.rho_inf <= 1.0:
            raise InputError(f"rho_inf = {self.rho_inf!r} must lie in [0, 1]: 1 damps nothing, 0 all it cannot resolve")

    @property
    def alphas(self) -> tuple[float, float]:
        """alpha_m and alpha_f (Chung & Hulbert 1993, equation 25)."""
        rho = self.rho_inf
        return (2.0 * rho - 1.0) / (rho + 1.0), rho / (rho + 1.0)

    @property
    def newmark(self) -> tuple[float, float]:
        """beta and gamma (Chung & Hulbert 1993, equations 17 and 20)."""
        m, f = self.alphas
        return 0.25 * (1.0 - m + f) ** 2, 0.5 - m + f


@dataclass(frozen=True)
class Motion:
    """Position x, velocity v, acceleration w and the averaged acceleration a of a point, or of many (arrays)."""

    x: Any
    v: Any
    w: Any
    a: Any

    def anchor(self, scheme: Scheme, h: float) -> tuple[Any, float]:
        """(x*, c) with which the acceleration after a step h is c (x' - x*)."""
        (m, f), (beta, _) = scheme.alphas, scheme.newmark
        c = (1.0 - m) / ((1.0 - f) * beta * h * h)
        predicted = self.x + h * self.v + h * h * (0.5 - beta) * self.a
        return predicted - (m * self.a - f * self.w) / ((1.0 - f) * c), c

    def at(self, x: Any, scheme: Scheme, h: float) -> Motion:
        """The motion a step h later, when the position is `x`."""
        beta, gamma = scheme.newmark
        anchor, c = self.anchor(scheme, h)
        a = (x - self.x - h * self.v) / (beta * h * h) - (0.5 / beta - 1.0) * self.a
        return Motion(x, self.v + h * ((1.0 - gamma) * self.a + gamma * a), c * (x - anchor), a)


class InertialBulk:
    """A bulk whose internal force contains that of inertia, c M (u - u*), M the consistent mass.

    Args:
        bulk: the constitutive part
        solid: of the bulk
        density: mass density

    Attributes:
        shift: c; 0 leaves the bulk as it was
        anchor: u* at the local nodes (nodes, 3)
        linear: False, for the tangent changes with the shift
        mass: M of one component, this process's cells (nodes, nodes)
    """

    def __init__(self, bulk: Bulk, solid: Solid, density: float) -> None:
        self.inner = bulk
        self.linear = False
        self.shift = 0.0
        self.anchor = np.zeros((solid.nodes, 3))
        self.mass = density * consistent_mass(solid)
        # where the values of `mass` go in the local CSR of three dofs a node: the diagonals of its blocks
        width = np.diff(solid.graph.indptr).astype(np.int64)
        row = np.repeat(np.arange(solid.nodes), width)
        first = solid.graph.indptr[row].astype(np.int64)
        column = np.arange(len(row)) - first
        i = np.arange(3)
        self._diagonals = 9 * first[:, None] + 3 * width[row][:, None] * i + 3 * column[:, None] + i

    @property
    def volumes(self) -> Floats:
        """Of the quadrature points."""
        return self.inner.volumes

    @property
    def plastic_points(self) -> int:
        """Quadrature points flowing at the last residual."""
        return self.inner.plastic_points

    def add_internal_force(self, u: Floats, b: Floats) -> None:
        """See `solid.Bulk`; so for the methods below."""
        self.inner.add_internal_force(u, b)
        if self.shift:
            b += self.shift * (self.mass @ (u - self.anchor))

    def tangent(self, u: Floats, values: Floats) -> None:
        self.inner.tangent(u, values)
        if self.shift:
            values[self._diagonals] += self.shift * self.mass.data[:, None]

    def commit(self) -> None:
        self.inner.commit()

    def restore(self, plastic_strain: Floats, accumulated: Floats) -> None:
        self.inner.restore(plastic_strain, accumulated)

    def history(self) -> tuple[Floats, Floats]:
        return self.inner.history()

    def stress(self, u: Floats) -> Floats:
        return self.inner.stress(u)


def consistent_mass(solid: Solid) -> Any:
    """Integrals of products of shape functions over this process's cells: SciPy CSR on the graph (nodes, nodes)."""
    import basix
    from scipy import sparse

    points, weights = basix.make_quadrature(basix.CellType.tetrahedron, MASS_DEGREE)
    element = basix.create_element(
        basix.ElementFamily.P, basix.CellType.tetrahedron, 2, basix.LagrangeVariant.gll_warped
    )
    N = element.tabulate(0, points)[0, :, :, 0]
    nodes, x_nodes = solid.cell_nodes, compat.geometry_dofmap(solid.mesh)[: len(solid.cell_nodes)]
    cells = _solver.Cells(solid.mesh.geometry.x, x_nodes, nodes, shape_gradients(points), weights)
    volumes = np.empty((len(nodes), len(weights)))
    _solver.volumes(cells, volumes)
    local = np.einsum("cq,qa,qb->cab", volumes, N, N)
    graph = solid.graph
    keys = np.repeat(np.arange(solid.nodes), np.diff(graph.indptr)) * solid.nodes + graph.indices
    wanted = nodes[:, :, None].astype(np.int64) * solid.nodes + nodes[:, None, :]
    data = np.bincount(np.searchsorted(keys, wanted).ravel(), local.ravel(), minlength=len(keys))
    return sparse.csr_array((data, graph.indices, graph.indptr), shape=(solid.nodes, solid.nodes))


@dataclass(frozen=True)
class History:
    """What a run recorded, a row per step and one for the start; the same on all ranks.

    Attributes:
        time: [T]
        approach: of the plate from first touch [L]
        velocity: of the plate [L/T]
        force: of contact [E L^2]
        energy: kinetic of plate and block, stored and dissipated in the block [E L^3]
        supplied: work of load, forcing and dashpot on the plate since the start, in `energy` at the start [E L^3]
        newton: Newton iterations
    """

    time: Floats
    approach: Floats
    velocity: Floats
    force: Floats
    energy: Floats
    supplied: Floats
    newton: int


class Transient:
    """The plate of a press with a mass, a constant load and a dashpot to ground, on a block with inertia; collective.

        m q'' + c q' + P = W + F(t)

    It starts where the press stands and takes it over: its solid keeps the inertia. Each step solves the block for
    positions of the plate until the plate's own equation holds, by the secant method. That converges at once, for
    the part of P in that equation is (omega h)^2/4, with omega the frequency of the mass on the contact.

    Args:
        press: in equilibrium, at the position the plate is let go
        density: of the block [E T^2/L^2]
        mass: of the plate [E L T^2]
        load: W [E L^2]
        dashpot: c [E L T]
        scheme: of integration

    Attributes:
        added_mass: of the block, which adds to that of the plate as long as the block follows quasi-statically:
            omega falls by sqrt(1 + added_mass/mass) (Rayleigh) [E L T^2]

    Raises:
        InputError: density, mass or load is not positive, or dashpot is negative
    """

    def __init__(
        self,
        press: Press,
        *,
        density: float,
        mass: float,
        load: float,
        dashpot: float = 0.0,
        scheme: Scheme | None = None,
    ) -> None:
        for name, value in (("density", density), ("mass", mass), ("load", load)):
            if not (np.isfinite(value) and value > 0.0):
                raise InputError(f"{name} = {value!r} must be finite and positive")
        if not (np.isfinite(dashpot) and dashpot >= 0.0):
            raise InputError(f"dashpot = {dashpot!r} must be finite and at least 0")
        self.press, self.mass, self.load, self.dashpot = press, mass, load, dashpot
        self.scheme = scheme or Scheme()
        solid = press.solid
        self.bulk = InertialBulk(solid.bulk, solid, density)
        solid.bulk = self.bulk
        self.time = 0.0
        self._force = self._before = press.force
        self._slope = 0.0
        self.start()

    def start(self, velocity: float = 0.0, shape: Floats | None = None) -> None:
        """Let the plate go from where the press stands; collective.

        Velocity and first acceleration of the block are those of the plate times a shape. The acceleration follows
        from the balance of forces projected on that shape, which is exact for the shape of a mode.

        Args:
            velocity: of the plate [L/T]
            shape: displacement of the owned nodes per unit approach (owned, 3); default that of the last static step
        """
        press, solid = self.press, self.press.solid
        displacements = press.displacements()
        x = displacements["last"]
        if shape is None:
            before = press.numbers()["before"]
            step = 0.0 if before is None else press.delta - before
            shape = (x - displacements["previous"]) / step if step else np.zeros_like(x)
        solid.u.x.array[: 3 * solid.owned] = x.ravel()
        solid.u.x.scatter_forward()
        self.bulk.shift = 0.0
        resisting = solid.comm.allreduce(float(np.vdot(shape, solid.internal_force())))
        self.added_mass = 2.0 * self._kinetic(shape)
        w = (self.load - self.dashpot * velocity - resisting) / (self.mass + self.added_mass)
        self.block = Motion(x, shape * velocity, shape * w, shape * w)
        self.plate = Motion(press.delta, velocity, w, w)

    def run(self, duration: float, h: float, forcing: Callable[[float], float] | None = None) -> History:
        """Integrate on with steps `h`; may be called again to go on; collective.

        Args:
            duration: [T]; rounded up to whole steps
            h: time step [T]; a fiftieth of the period of the mass on its contact is good to about 0.1 %
            forcing: F(t) [E L^2], t from the first start

        Raises:
            InputError: duration or h is not positive
            ConvergenceError: a step does not converge
        """
        if not (h > 0.0 and duration > 0.0):
            raise InputError(f"duration = {duration!r} and h = {h!r} must be positive")
        push = forcing or (lambda t: 0.0)
        newton = self.press.counts.newton
        rows = [self._row(self._energy(), self._energy())]
        for _ in range(int(np.ceil(duration / h * (1.0 - 1e-12)))):
            old, was = self.plate, push(self.time)
            self._advance(h, push, self.time + h)
            moved = self.plate.x - old.x
            work = (self.load + 0.5 * (was + push(self.time))) * moved
            work -= 0.5 * h * self.dashpot * (old.v**2 + self.plate.v**2)
            rows.append(self._row(self._energy(), rows[-1][5] + work))
        time, approach, velocity, force, energy, supplied = np.array(rows).T
        return History(time, approach, velocity, force, energy, supplied, self.press.counts.newton - newton)

    def _advance(self, h: float, push: Callable[[float], float], end: float) -> None:
        """Go on to the time `end` by steps of `h`, halved where one does not converge."""
        smallest = h / LARGEST_CUT
        while self.time < end - 1e-9 * h:
            try:
                self.step(h, push(self.time + h))
            except ConvergenceError:
                self.press.counts.cutbacks += 1
                if h <= smallest:
                    raise
                h *= 0.5

    def step(self, h: float, push: float) -> None:
        """One step `h`, at whose end the forcing is `push` [E L^2]."""
        press, scheme = self.press, self.scheme
        anchor, self.bulk.shift = self.block.anchor(scheme, h)
        self.bulk.anchor = press.solid.with_ghosts(anchor.ravel())
        beta, gamma = scheme.newmark
        q_anchor, c = self.plate.anchor(scheme, h)
        drive = self.load + push

        def balance(q: float) -> float:
            """Force that plate and dashpot take at q, beside the contact."""
            return self.mass * c * (q - q_anchor) + self.dashpot * self.plate.at(q, scheme, h).v - drive

        stiffness = self.mass * c + self.dashpot * gamma / (beta * h)
        q = self.plate.x + h * self.plate.v
        q -= (balance(q) + 2.0 * self._force - self._before) / stiffness  # with the force extrapolated
        guess = self.block.x + h * self.block.v
        tried: tuple[float, float] | None = None
        for _ in range(PLATE_ITERATIONS):
            press.contact.begin(press.summit - q)
            stats = press.newton.solve(guess, max(abs(q - self.plate.x), 1e-6))
            press.counts.newton += stats.newton
            press.counts.krylov += stats.krylov
            if not stats.converged:
                break
            force, guess = press.trial_force(), press.newton.x.array_r.reshape(-1, 3).copy()
            unbalanced = balance(q) + force
            if abs(unbalanced) <= PLATE_TOLERANCE * self.load:
                self._accept(q, guess, force, h)
                return
            if tried is not None and abs(q - tried[0]) > 1e-6 * abs(q - self.plate.x):
                self._slope = max((force - tried[1]) / (q - tried[0]), 0.0)
            tried = q, force
            q -= unbalanced / (stiffness + self._slope)
        raise ConvergenceError(
            f"no convergence of the step of {h:.3g} at time {self.time:.6g} (approach {q:.6g} L, {stats.reason}): take "
            "a smaller time step"
        )

    def _accept(self, q: float, u: Floats, force: float, h: float) -> None:
        self.plate, self.block = self.plate.at(q, self.scheme, h), self.block.at(u, self.scheme, h)
        held = self.press.newton.rows  # they move with the plate from the moment they touch it
        for of_block, of_plate in (
            (self.block.v, self.plate.v),
            (self.block.w, self.plate.w),
            (self.block.a, self.plate.a),
        ):
            of_block.reshape(-1)[held] = -of_plate
        self.press.solid.bulk.commit()
        self.press.contact.commit()
        self._before, self._force = self._force, force
        self.time += h

    def _row(self, energy: float, supplied: float) -> list[float]:
        return [self.time, self.plate.x, self.plate.v, self._force, energy, supplied]

    def _kinetic(self, v: Floats) -> float:
        """Kinetic energy of the block at velocities of the owned nodes (owned, 3) [E L^3]."""
        full = self.press.solid.with_ghosts(v.ravel())
        return 0.5 * float(self.press.solid.comm.allreduce(np.vdot(full, self.bulk.mass @ full)))

    def _energy(self) -> float:
        """Kinetic, stored and dissipated energy of plate and block [E L^3]."""
        solid = self.press.solid
        shift, self.bulk.shift = self.bulk.shift, 0.0
        stored, dissipated = energies(solid, solid.internal_force())
        self.bulk.shift = shift
        sums = solid.comm.allreduce(np.array([stored, dissipated]))
        return 0.5 * self.mass * self.plate.v**2 + self._kinetic(self.block.v) + float(sums.sum())
