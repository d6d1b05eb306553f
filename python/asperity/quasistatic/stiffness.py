"""Stiffness of the contact at a converged state, with the touched points held: normal and tangential, in units of E L.

A rigid flat that moves by one relative to the block is the same as a base that moves by one relative to the flat, for
every formulation of the contact, because a rigid motion strains nothing. With e the unit translation, zero where the
contact prescribes dofs, the displacement relative to the flat is w = e + y, K w = 0 on the free dofs, and the stiffness
is the energy w.K w. It is stationary: an error of the linear solver counts by its square.
"""

from __future__ import annotations

from math import nan, sqrt
from typing import TYPE_CHECKING, Any

import numpy as np

from asperity.arrays import Flags, Floats, Integers, Singles
from asperity.curve import ELASTIC_STIFFNESSES
from asperity.fem.solid import Solid
from asperity.linear.matrix_free import TangentOperator, tangent_product
from asperity.linear.multigrid import ITERATIONS, EnergyTest, PMultigrid
from asperity.mesh.distribute import SIDE_X, SIDE_Y
from asperity.runtime.parallel import summed

if TYPE_CHECKING:
    from asperity.quasistatic.contact_solver import ContactSolver

PREFIX = "asperity_stiffness_"
# Estimate of the relative error of the energy at which the iteration ends; the estimate is subtracted. With the penalty
# method it is too small after few iterations: 1e-3 left 2.5e-3 in k_n_elastic of a scene of the tests, this 1e-5.
LEFT = 1e-4
NEAR = 0.8  # least energy over that of its start, the solution of the step before, roughly
PASSES = 5  # of the solver at most
RTOL = 1e-8  # relative tolerance where an absolute one counts
STALE = 0.15  # contraction of an elastic system above which its coarse matrix is renewed, where also
CHANGED = 0.1  # of the nodes in contact have changed
FULL = 1e-3  # part of the compliance below which that of the interface is lost in rounding and discretisation


class Stiffness:
    """Stiffness of the contact: a probe of accepted steps; collective.

    The elastic systems start from their solutions at the step before, and their coarse matrices last until they are
    stale. Both belong to the state of a run, see `memory`.
    """

    def __init__(self, solid: Solid) -> None:
        self._solid = solid
        self._elastic: TangentOperator | None = None  # with the elastic stiffness, beside the tangent of the solver
        self._height = 0.0  # of the undeformed block
        self._along_x, self._along_y = (_Motion(solid, mirrored(solid, k), (0, 1)) for k in (0, 1))
        self._along_z = _Motion(solid, solid.fixed, (2,))

    def __call__(self, solver: ContactSolver) -> dict[str, float]:
        """Elastic stiffness at the last solve, before its history is committed.

        Returns:
            by name, in units of E L; what the linear solver does not find is left out
                k_n_elastic: of unloading and small vibration, with the elastic stiffness
                k_t: tangential, nodes in contact stick to a plate that moves along x and along y and are free along z,
                    as on a like body; mean of the two, elastic
                k_t_x: that along x
                k_n_interface: k_n_elastic without the compliance h_b/(A M) of the block; absent where that is all
                    there is
                k_t_interface: k_t without the compliance h_b/(A G), likewise
        """
        solid, contact = solver.solid, solver.contact
        nodes = contact.nodes()
        if not solid.comm.allreduce(len(nodes)):
            for motion in (self._along_x, self._along_y, self._along_z):
                motion.take(None)
            return dict.fromkeys(ELASTIC_STIFFNESSES, 0.0)
        held, symmetric = solver.newton.rows, contact.symmetric and solid.material.symmetric
        normal = _Translation(solver, 2, np.concatenate([solid.fixed, held]), held, symmetric, contact.has_tangent)
        self._elastic = self._elastic or TangentOperator(solid, symmetric=True, single=True, keeps=True)
        found = {}
        if contact.has_tangent:
            solid.tangent.assemble_elastic(contact.add_elastic_tangent)
            found["k_n_elastic"], w = normal.force(normal.start(self._along_z.before))
            self._along_z.take(w)
        if solid.material.finite or not self._elastic.version:  # in small strain it never changes
            solid.tangent.assemble_elastic()
            self._elastic.update()
        if not contact.has_tangent:
            found["k_n_elastic"], w = self._along_z.force(self._elastic, normal, nodes, normal.start(), None)
        k_x, k_y = self._tangential(solver, nodes, w)
        found["k_t"], found["k_t_x"] = 0.5 * (k_x + k_y), k_x
        self._height = height = self._height or solver.contact_surface.mean(solid.points[:, 2])
        modulus, shear_modulus = solid.material.block_modulus(solid.sides), solid.material.lame[1]
        found["k_n_interface"] = without_block(found["k_n_elastic"], modulus / height)  # elastic like k_t and the block
        found["k_t_interface"] = without_block(found["k_t"], shear_modulus / height)
        return {name: value for name, value in found.items() if value == value}

    def _tangential(self, solver: ContactSolver, nodes: Integers, w: Floats) -> tuple[float, float]:
        """Stiffness against motions along x and along y [E L], from the displacement along z (owned, 3); collective.

        All three, and their changes since the step before, decay alike from the contact.
        """
        elastic, along_x, along_y, along_z = self._elastic, self._along_x, self._along_y, self._along_z
        assert elastic is not None
        plate = _dofs(nodes, (0, 1))
        x, y = (
            _Translation(solver, k, np.union1d(motion.fixed, plate), plate, True, False)
            for k, motion in enumerate((along_x, along_y))
        )
        change = None if along_z.change is None else along_z.change[:, 2:] * x.unit
        k_x, w = along_x.force(elastic, x, nodes, w[:, 2:] * x.unit, change)
        change = None if along_x.change is None else along_x.change[:, (1, 0, 2)]
        k_y, _ = along_y.force(elastic, y, nodes, w[:, (1, 0, 2)], change)
        return k_x, k_y

    def drop_matrices(self) -> None:
        """Free the matrices; the next step makes them again."""
        self._elastic = None
        for motion in (self._along_x, self._along_y, self._along_z):
            motion.drop_matrices()

    def memory(self) -> Singles:
        """What the next step depends on, of the motions along x, y and z (owned, 12)."""
        return np.concatenate([m.memory() for m in (self._along_x, self._along_y, self._along_z)], axis=1)

    def recall(self, memory: Singles) -> None:
        """Continue from what `memory` returned; collective."""
        for k, motion in enumerate((self._along_x, self._along_y, self._along_z)):
            motion.recall(memory[:, 4 * k : 4 * k + 4])


class _Motion:
    """Least energy of the elastic solid in a motion of the flat, from step to step, by CG with p-multigrid.

    The coarse matrix may be that of other nodes in contact: the cycle masks those of today. The contraction shows when
    it is stale.

    Args:
        fixed: dofs that are prescribed in addition to those of the flat
        components: of the nodes in contact that the coarse matrix holds

    Attributes:
        before: displacement relative to the flat at the step before (owned, 3), None without one
        change: of this displacement since the step before that (owned, 3), None without one
    """

    def __init__(self, solid: Solid, fixed: Integers, components: tuple[int, ...]) -> None:
        self._solid, self.fixed, self._components = solid, fixed, components
        self.change: Floats | None = None
        self.before: Singles | None = None
        self._marked: Flags | None = None  # owned nodes in contact when the coarse matrix was made
        self._contraction = 1.0  # of the last solve, see `EnergyTest`
        self._ksp: Any = None  # made again where it is missing, with its preconditioner and test
        self._multigrid: Any = None
        self._test: Any = None

    def force(
        self, elastic: TangentOperator, motion: _Translation, nodes: Integers, guess: Floats, change: Floats | None
    ) -> tuple[float, Floats]:
        """Stiffness [E L], and displacement relative to the flat (owned, 3); collective.

        It starts from that of the step before and a likely `change` since, or where `nodes` were not touched from a
        `guess`, both (owned, 3).
        """
        self._prepare(elastic, nodes)
        before = None if self.before is None else motion.start(self.before)
        start = motion.start(guess) if before is None else before if change is None else motion.start(before + change)
        force, w = self._minimise(elastic, start, motion)
        self._contraction = self._test.contraction
        if force != force:
            self._solid.tangent.assemble_elastic()
            force, w = motion.force(motion.start(guess))
        self.take(w)
        self.change = None if before is None else w - before
        return force, w

    def take(self, w: Floats | None) -> None:
        """Keep the displacement of this step, found in another way; None without contact."""
        self.change, self.before = None, None if w is None else w.astype(np.float32)

    def drop_matrices(self) -> None:
        """Free the systems; the next step makes them again."""
        self._ksp = self._multigrid = self._test = None

    def _prepare(self, elastic: TangentOperator, nodes: Integers) -> None:
        """Make the systems, with a new coarse matrix where it is stale or belongs to another process; collective.

        It is stale where it contracts badly because other nodes are in contact.
        """
        solid = self._solid
        now = np.zeros(solid.owned, dtype=bool)
        now[nodes] = True
        stale = False
        if self._marked is not None and self._contraction > STALE:
            changed, count = summed(solid.comm, np.sum(now != self._marked), np.sum(now))
            stale = bool(changed > CHANGED * count)
        if stale or self._marked is None:
            self._marked, self._contraction = now, 1.0
        if self._ksp is None:
            from petsc4py import PETSc

            self._multigrid = PMultigrid(elastic)
            self._ksp = PETSc.KSP().create(solid.comm)
            self._ksp.setOptionsPrefix(PREFIX)
            self._multigrid.precondition(self._ksp)
            # one iteration alone would let slow errors add up over the steps
            self._test = EnergyTest(self._ksp, self._multigrid, least=2)
            stale = True
        if stale:
            held = _dofs(np.flatnonzero(self._marked).astype(np.int32), self._components)
            with solid.phases.phase("preconditioner"):
                elastic.hold(np.union1d(self.fixed, held).astype(np.int32))
                self._multigrid.update(renew=True)
        self._test.contraction = self._contraction

    def _minimise(self, elastic: TangentOperator, w: Floats, motion: _Translation) -> tuple[float, Floats]:
        """Least energy [E L], NaN where the solver fails, and its displacement, from a start (owned, 3); collective."""
        solid, ksp, test = self._solid, self._ksp, self._test
        with solid.phases.phase("preconditioner"):
            elastic.hold(motion.rows)
            if not self._multigrid.update(renew=False):
                return nan, w
        b, y, guess = solid.vector(), solid.vector(), 0.0
        with solid.phases.phase("linear solve"):
            for _ in range(PASSES):
                # without the translation most of the solid is at rest, and single precision will do
                image = elastic.product((w - motion.unit).ravel())
                energy = float(summed(solid.comm, float(np.vdot(w, image)))[0])
                b.array = -elastic.free * image
                ksp.setTolerances(rtol=RTOL, atol=sqrt(LEFT * (guess or NEAR * energy)), max_it=ITERATIONS)
                ksp.solve(b, y)
                if ksp.getConvergedReason() < 0:
                    break
                w = w + y.array_r.reshape(-1, 3)
                guess = energy - b.dot(y) - test.left
                if test.left <= LEFT * guess:
                    test.contraction = float(np.float32(test.contraction))  # as a checkpoint keeps it
                    return guess, w
        return nan, w

    def memory(self) -> Singles:
        """Displacement, and the contraction at the nodes of the coarse matrix, zero elsewhere (owned, 4)."""
        n = self._solid.owned
        w = np.zeros((n, 3)) if self.before is None else self.before
        marked = np.zeros(n) if self._marked is None else self._contraction * self._marked
        return np.column_stack([w, marked]).astype(np.float32)

    def recall(self, memory: Singles) -> None:
        """Continue from what `memory` returned; collective."""
        comm, marked = self._solid.comm, memory[:, 3]
        self.change = None
        self.before = np.ascontiguousarray(memory[:, :3]) if comm.allreduce(bool(memory[:, :3].any())) else None
        self._contraction = max(comm.allgather(float(np.max(marked, initial=0.0)))) or 1.0
        self._marked, self._ksp = (marked > 0.0 if comm.allreduce(bool(marked.any())) else None), None


def _dofs(nodes: Integers, components: tuple[int, ...]) -> Integers:
    """Dofs of components of nodes."""
    return (3 * nodes[:, None] + np.array(components, dtype=np.int32)).ravel()


def without_block(whole: float, block: float) -> float:
    """Stiffness or conductance of two in series without that of the block; NaN where the block is practically all."""
    left = 1.0 - whole / block
    return whole / left if left > FULL else nan


class _Translation:
    """Motion of the flat by one along an axis: it holds the dofs `held` of the prescribed owned `rows`.

    The tangent is `symmetric` or not, and may have the stiffness of a contact, `tied`, which resists a translation.
    """

    def __init__(
        self, solver: ContactSolver, axis: int, rows: Integers, held: Integers, symmetric: bool, tied: bool
    ) -> None:
        self._solid, self._linear = solver.solid, solver.newton.linear
        self.rows: Integers = rows.astype(np.int32)
        self._symmetric, self._tied = symmetric, tied
        self.unit: Floats = np.eye(3)[axis]
        e = np.tile(self.unit, (self._solid.owned, 1))
        e.reshape(-1)[held] = 0.0
        self._e = e

    def start(self, guess: Floats | Singles | None = None) -> Floats:
        """Displacement relative to the flat (owned, 3): e on prescribed dofs, a guess (owned, 3) or e on the others."""
        if guess is None:
            return self._e.copy()
        w = np.empty_like(self._e)
        w[:] = guess
        w.reshape(-1)[self.rows] = self._e.reshape(-1)[self.rows]
        return w

    def force(self, w: Floats) -> tuple[float, Floats]:
        """Force of the flat [E L], NaN where the linear solver fails, and displacement, from a start (owned, 3).

        The energy falls by the work of the residual on the correction, and has still to fall by what the linear solver
        predicts. Collective.
        """
        solid, symmetric = self._solid, self._symmetric
        r, y = solid.vector(), solid.vector()
        force, image = self._work(w)
        guess = NEAR * force
        for _ in range(PASSES):
            r.array = -image
            rtol, atol = (RTOL, np.sqrt(LEFT * abs(guess))) if symmetric else (LEFT, 0.0)
            if not self._linear.solve(r, self.rows, np.empty(0), y, rtol, atol)[1]:
                break
            w, before = w + y.array_r.reshape(-1, 3), force
            if symmetric:
                free = np.ones(len(r.array_r), dtype=bool)
                free[self.rows] = False
                fall = float(summed(solid.comm, y.array_r[free] @ r.array_r[free])[0])
                guess = force = before - fall - self._linear.left
                if self._linear.left <= LEFT * abs(force):
                    return force, w
            force, image = self._work(w)
            # the norm of GMRES is not that of the energy: the error that is left is the correction itself
            if not symmetric and abs(before - force) <= LEFT * abs(force):
                return force, w
        return nan, w

    def _work(self, w: Floats) -> tuple[float, Floats]:
        """Force of the flat, and the nodal forces (3 owned,) of a displacement; collective."""
        if self._tied:
            image = tangent_product(self._solid, w)
        else:  # a translation strains nothing; without it most of the solid is at rest, and single precision will do
            image = self._linear.product((w - self.unit).ravel())
        test = w if self._symmetric else self._e  # the forces do the same work on both
        return float(self._solid.comm.allreduce(float(np.vdot(test, image)))), image


def mirrored(solid: Solid, axis: int) -> Integers:
    """Owned dofs without displacement when the flat moves along x (0) or y (1).

    Rollers stand for a solid that continues as its mirror image. A shear along x is antisymmetric about the faces
    normal to x: they move along x only. It is symmetric about the faces normal to y, which stay rollers. Uniform shear
    is free of stress from the sides, so they hold nothing and the compliance of the block is h_b/(A G). Free sides
    stay free, periodic ones joined.
    """
    clamped = (3 * solid.base[:, None] + np.arange(3)).ravel()
    if solid.sides != "rollers":
        return clamped.astype(np.int32)
    across, along = (3 * solid.nodes_on(side) for side in ((SIDE_X, SIDE_Y) if axis == 0 else (SIDE_Y, SIDE_X)))
    other = 1 - axis
    return np.unique(np.concatenate([clamped, across + other, across + 2, along + other])).astype(np.int32)
