"""Stiffness of the contact at a converged state, with the touched points held: normal and tangential, in units of E L.

A rigid flat that moves by one relative to the block is the same as a base that moves by one relative to the flat, for
every formulation of the contact, because a rigid motion strains nothing. With e the unit translation, zero where the
contact prescribes dofs, the displacement relative to the flat is w = e + y, K w = 0 on the free dofs, and the stiffness
is the energy w.K w. It is stationary: an error of the linear solver counts by its square.
"""

from __future__ import annotations

from math import nan
from typing import TYPE_CHECKING

import numpy as np

from asperity.arrays import Floats, Integers
from asperity.curve import ELASTIC_STIFFNESSES
from asperity.fem.solid import Solid
from asperity.linear.matrix_free import tangent_product
from asperity.mesh.distribute import SIDE_X, SIDE_Y
from asperity.runtime.parallel import summed

if TYPE_CHECKING:
    from asperity.quasistatic.contact_solver import ContactSolver

# Estimate of the relative error of the energy at which the iteration ends; the estimate is subtracted. With the penalty
# method it is too small after few iterations: 1e-3 left 2.5e-3 in k_n_elastic of a scene of the tests, this 1e-5.
LEFT = 1e-4
NEAR = 0.8  # least energy over that of its start, the solution of the step before, roughly
PASSES = 5  # of the solver at most
RTOL = 1e-8  # relative tolerance where an absolute one counts
FULL = 1e-3  # part of the compliance below which that of the interface is lost in rounding and discretisation


class Stiffness:
    """Stiffness of the contact: a probe of accepted steps, on the linear solver of Newton's method; collective."""

    def __init__(self, solid: Solid) -> None:
        self._along = tuple(mirrored(solid, axis) for axis in (0, 1))  # dofs without displacement
        self._height = 0.0  # of the undeformed block

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
                conductance: constriction conductance over the conductivity, of a half-space 2 k_n_interface/E' [L]
        """
        solid, contact = solver.solid, solver.contact
        nodes, material = contact.nodes(), solid.material
        if not solid.comm.allreduce(len(nodes)):
            return dict.fromkeys((*ELASTIC_STIFFNESSES, "conductance"), 0.0)
        held, symmetric = solver.newton.rows, contact.symmetric and material.symmetric
        solid.tangent.assemble_elastic(contact.add_elastic_tangent if contact.has_tangent else None)
        rows = np.concatenate([solid.fixed, held])
        normal, w = _Translation(solver, 2, rows, held, symmetric, contact.has_tangent).force()
        if contact.has_tangent:
            solid.tangent.assemble_elastic()
        plate, tangential = _dofs(nodes, (0, 1)), []
        for axis, fixed in enumerate(self._along):
            along = _Translation(solver, axis, np.union1d(fixed, plate), plate, symmetric, False)
            tangential.append(along.force(w[:, 2:] * along.unit)[0])  # decays alike from the contact
        k_t = 0.5 * sum(tangential)
        self._height = height = self._height or solver.contact_surface.mean(solid.points[:, 2])
        interface = without_block(normal, material.block_modulus(solid.sides) / height)  # elastic like k_t and block
        found = {
            "k_n_elastic": normal,
            "k_t": k_t,
            "k_t_x": tangential[0],
            "k_n_interface": interface,
            "k_t_interface": without_block(k_t, material.lame[1] / height),
            "conductance": 2.0 * interface / material.reduced_modulus,
        }
        return {name: value for name, value in found.items() if value == value}


def _dofs(nodes: Integers, components: tuple[int, ...]) -> Integers:
    """Dofs of components of nodes."""
    return (3 * nodes[:, None] + np.array(components, dtype=np.int32)).ravel()


def without_block(whole: float, block: float) -> float:
    """Stiffness of two in series without that of the block; NaN where the block is practically all."""
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

    def force(self, guess: Floats | None = None) -> tuple[float, Floats]:
        """Force of the flat [E L], NaN where the linear solver fails, and displacement relative to the flat (owned, 3).

        It is e on prescribed dofs, and begins with e or a guess (owned, 3) on the others.
        The energy falls by the work of the residual on the correction, and has still to fall by what the linear solver
        predicts. Collective.
        """
        solid, symmetric = self._solid, self._symmetric
        r, y = solid.vector(), solid.vector()
        w = (self._e if guess is None else guess).copy()
        w.reshape(-1)[self.rows] = self._e.reshape(-1)[self.rows]
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
