"""Stiffness of the contact at a converged state, with the touched points held: normal and tangential, in units of E L.

A rigid flat that moves by one relative to the block is the same as a base that moves by one relative to the flat, for
every formulation of the contact, because a rigid motion strains nothing. With e the unit translation, zero where the
contact prescribes dofs, the displacement relative to the flat is w = e + y, K w = 0 on the free dofs, and the stiffness
is the energy w.K w. It is stationary: an error of the linear solver counts by its square.
"""

from __future__ import annotations

from math import nan
from typing import TYPE_CHECKING, Any

import numpy as np

from asperity.arrays import Floats, Integers
from asperity.curve import ELASTIC_STIFFNESSES
from asperity.fem.solid import Solid
from asperity.linear.energy import LEFT, EnergySolver
from asperity.linear.matrix_free import TangentOperator, tangent_product
from asperity.mesh.distribute import SIDE_X, SIDE_Y

if TYPE_CHECKING:
    from asperity.quasistatic.contact_solver import ContactSolver

NEAR = 0.8  # stiffness over that of its start, roughly
PASSES = 5  # of the linear solver at most
TIGHTEST = 1e-8  # relative tolerance where an absolute one counts
FULL = 1e-3  # part of the compliance below which that of the interface is lost in rounding and discretisation


class Stiffness:
    """Stiffness of the contact: a probe of accepted steps; collective.

    A step does not depend on those before: solutions of the step before save no time as starts.
    """

    def __init__(self, solid: Solid) -> None:
        self._solid = solid
        self._elastic: TangentOperator | None = None  # with the elastic stiffness, beside the tangent of the solver
        self._system: EnergySolver | None = None  # with it
        self._height = 0.0  # of the undeformed block
        self._fixed = tuple(mirrored(solid, axis) for axis in (0, 1))

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
            return dict.fromkeys(ELASTIC_STIFFNESSES, 0.0)
        held = solver.newton.rows
        normal = _Translation(solver, 2, np.concatenate([solid.fixed, held]), held, contact.symmetric, contact.stiff)
        found = {}
        if contact.stiff:
            solid.assemble_elastic(contact.add_elastic_tangent)
            found["k_n_elastic"], w = normal.force(normal.start())
        if self._elastic is None or self._system is None:
            self._elastic = TangentOperator(solid, symmetric=True, single=True, keeps=True)
            self._system = EnergySolver(self._elastic)
        if solid.material.finite or not self._elastic.version:  # in small strain it never changes
            solid.assemble_elastic()
            self._elastic.update()
        if not contact.stiff:
            found["k_n_elastic"], w = self._force(normal, normal.start())
        k_x, k_y = self._tangential(solver, nodes, w)
        found["k_t"], found["k_t_x"] = 0.5 * (k_x + k_y), k_x
        self._height = height = self._height or solver.contact_surface.mean(solid.points[:, 2])
        modulus, shear_modulus = solid.material.block_modulus(solid.sides), solid.material.lame[1]
        found["k_n_interface"] = without_block(found["k_n_elastic"], modulus / height)  # elastic like k_t and the block
        found["k_t_interface"] = without_block(found["k_t"], shear_modulus / height)
        return {name: value for name, value in found.items() if value == value}

    def _tangential(self, solver: ContactSolver, nodes: Integers, w: Floats) -> tuple[float, float]:
        """Stiffness against motions along x and along y [E L], from the displacement along z (owned, 3); collective.

        The vertical motion decays from the contact as the tangential one does, and that along y as that along x.
        """
        plate = _dofs(nodes, (0, 1))
        x, y = (
            _Translation(solver, k, np.union1d(fixed, plate), plate, True, False) for k, fixed in enumerate(self._fixed)
        )
        k_x, w = self._force(x, x.start(w[:, 2:] * x.unit))
        return k_x, self._force(y, y.start(w[:, (1, 0, 2)]))[0]

    def _force(self, motion: _Translation, start: Floats) -> tuple[float, Floats]:
        """Stiffness of the elastic solid [E L], and displacement relative to the flat (owned, 3); collective."""
        assert self._system is not None
        force, w = self._system.minimise(start, motion.unit, motion.rows)
        if force != force:
            self._solid.assemble_elastic()
            force, w = motion.force(start)
        return force, w

    def drop_matrices(self) -> None:
        """Free the matrices; the next step makes them again."""
        self._elastic = self._system = None


def _dofs(nodes: Integers, components: tuple[int, ...]) -> Integers:
    """Dofs of components of nodes."""
    return (3 * nodes[:, None] + np.array(components, dtype=np.int32)).ravel()


def without_block(whole: float, block: float) -> float:
    """Stiffness or conductance of two in series without that of the block; NaN where the block is practically all."""
    left = 1.0 - whole / block
    return whole / left if left > FULL else nan


class _Translation:
    """Motion of the flat by one along an axis.

    Args:
        rows: owned dofs that are prescribed
        held: those of them that the flat holds
        symmetric: whether the tangent is
        tied: whether a contact in the tangent resists a translation
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

    def start(self, guess: Floats | None = None) -> Floats:
        """Displacement relative to the flat (owned, 3): e on prescribed dofs, a guess (owned, 3) or e on the others."""
        if guess is None:
            return self._e.copy()
        w = np.empty_like(self._e)
        w[:] = guess
        w.reshape(-1)[self.rows] = self._e.reshape(-1)[self.rows]
        return w

    def force(self, w: Floats) -> tuple[float, Floats]:
        """Force of the flat [E L], NaN where the linear solver fails, and displacement, from a start (owned, 3).

        The iterates of CG minimise the energy: it falls by the work of the residual on the correction, and has still to
        fall by what the linear solver predicts. Each pass is as loose as the accuracy admits. Collective.
        """
        solid, symmetric = self._solid, self._symmetric
        r, y = solid.vector(), solid.vector()
        force, image = self._work(w)
        guess = NEAR * force
        for _ in range(PASSES):
            r.array = -image
            rtol, atol = (TIGHTEST, np.sqrt(LEFT * abs(guess))) if symmetric else (LEFT, 0.0)
            if not self._linear.solve(r, self.rows, np.empty(0), y, rtol, atol)[1]:
                break
            w, before = w + y.array_r.reshape(-1, 3), force
            if symmetric:
                guess = force = before - self._fall(r, y) - self._linear.left
                if self._linear.left <= LEFT * abs(force):
                    return force, w
            force, image = self._work(w)
            # the norm of GMRES is not that of the energy: the error that is left is the correction itself
            if not symmetric and abs(before - force) <= LEFT * abs(force):
                return force, w
        return nan, w

    def _fall(self, r: Any, y: Any) -> float:
        """Work of the residual on the correction of the free dofs [E L]; collective."""
        free = np.ones(len(r.array_r), dtype=bool)
        free[self.rows] = False
        return float(self._solid.comm.allreduce(float(y.array_r[free] @ r.array_r[free])))

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
