# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

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
from asperity.curve import STIFFNESSES
from asperity.fem.solid import Solid
from asperity.linear.matrix_free import tangent_product
from asperity.mesh.distribute import SIDE_X, SIDE_Y

if TYPE_CHECKING:
    from asperity.quasistatic.contact_solver import ContactSolver

LEFT = 1e-3  # estimate of the relative error that the linear solver may leave; the estimate is taken off
ACCURACY = 1e-3  # the same of GMRES, which has no such estimate
NEAR = 0.8  # stiffness over that of its start from the rate of the step, and tangential over normal stiffness, roughly
PASSES = 5  # of the linear solver at most
TIGHTEST = 1e-8  # relative tolerance where an absolute one counts
FULL = 1e-3  # part of the compliance below which that of the interface is lost in rounding and discretisation


def stiffness_of(solver: ContactSolver, rate: Floats | None = None) -> dict[str, float]:
    """Stiffness at the last solve, before its history is committed; a probe of accepted steps; collective.

    Args:
        solver: contact solver whose last solve converged
        rate: change of the displacement with the approach in the step (owned, 3), with which the solution starts

    Returns:
        by name, in units of E L; what the linear solver does not find is left out
            k_n: of the loading, with the consistent tangent
            k_n_elastic: of unloading and small vibration, with the elastic stiffness
            k_t: tangential, nodes in contact stick to a plate that moves along x and along y; mean of the two, elastic
            k_n_interface: k_n_elastic without the compliance h_b/(A M) of the block; absent where that is all there is
            k_t_interface: k_t without the compliance h_b/(A G), likewise
    """
    solid, contact = solver.solid, solver.contact
    nodes = contact.nodes()
    if not solid.comm.allreduce(len(nodes)):
        return dict.fromkeys(STIFFNESSES, 0.0)
    held = solver.newton.rows
    solid.assemble_tangent(contact.add_tangent if contact.stiff else None)
    normal = _Translation(solver, 2, np.concatenate([solid.fixed, held]), held, contact.symmetric, contact.stiff)
    w = normal.start() if rate is None else normal.start(rate + normal.unit)
    found = {}
    found["k_n"], w = normal.force(w, near=None)
    if solid.material.plastic and solid.comm.allreduce(solid.kernels.plastic_points) > 0:
        solid.assemble_elastic(contact.add_elastic_tangent if contact.stiff else None)
        found["k_n_elastic"], w = normal.force(w, near=found["k_n"])
    else:
        found["k_n_elastic"] = found["k_n"]
    if contact.stiff:
        solid.assemble_elastic()
    plate = (3 * nodes[:, None] + np.arange(3, dtype=np.int32)).ravel()
    x, y = (_Translation(solver, k, np.union1d(_mirrored(solid, k), plate), plate, True, False) for k in (0, 1))
    # the vertical motion decays from the contact as the tangential one does, and that along y as that along x
    along_x, w = x.force(x.start(w[:, 2:] * x.unit), near=NEAR * found["k_n_elastic"])
    along_y, _ = y.force(y.start(w[:, (1, 0, 2)]), near=along_x)
    found["k_t"] = 0.5 * (along_x + along_y)
    height = solver.contact_surface.mean(solid.points[:, 2])
    modulus, shear_modulus = solid.material.block_modulus(solid.sides), solid.material.lame[1]
    found["k_n_interface"] = without_block(found["k_n_elastic"], modulus / height)  # elastic like k_t and the block
    found["k_t_interface"] = without_block(found["k_t"], shear_modulus / height)
    return {name: value for name, value in found.items() if value == value}


def without_block(whole: float, block: float) -> float:
    """Stiffness or conductance of two in series without that of the block; NaN where the block is practically all.

    Examples:
        >>> without_block(whole=1.0, block=2.0)
        2.0
    """
    left = 1.0 - whole / block
    return whole / left if left > FULL else nan


class _Translation:
    """Motion of the flat by one along an axis.

    Args:
        solver: of the contact
        axis: of the translation
        rows: owned dofs that are prescribed
        held: those of them that the flat holds
        symmetric: whether the tangent is
        tied: whether a contact in the tangent resists a translation
    """

    def __init__(
        self, solver: ContactSolver, axis: int, rows: Integers, held: Integers, symmetric: bool, tied: bool
    ) -> None:
        self._solid, self._linear = solver.solid, solver.newton.linear
        self._rows, self._symmetric, self._tied = rows.astype(np.int32), symmetric, tied
        self.unit = np.eye(3)[axis]
        e = np.tile(self.unit, (self._solid.owned, 1))
        e.reshape(-1)[held] = 0.0
        self._e = e

    def start(self, guess: Floats | None = None) -> Floats:
        """Displacement relative to the flat (owned, 3): e on prescribed dofs, a guess (owned, 3) or e on the others."""
        w = self._e.copy()
        if guess is not None:
            free = np.ones(w.size, dtype=bool)
            free[self._rows] = False
            w.reshape(-1)[free] = np.broadcast_to(guess, w.shape).reshape(-1)[free]
        return w

    def force(self, w: Floats, near: float | None) -> tuple[float, Floats]:
        """Force of the flat [E L], NaN where the linear solver fails, and displacement, from a start (owned, 3).

        The iterates of CG minimise the energy: it falls by the work of the residual on the correction, and has left to
        fall what the preconditioner makes of the last residual. Each pass is as loose as the accuracy admits.
        Collective.

        Args:
            w: the start
            near: guess of the force, from which the tolerance of the first pass follows; None for a start that is near
        """
        solid, symmetric = self._solid, self._symmetric
        r, y = solid.vector(), solid.vector()
        force, image = self._work(w)
        guess = NEAR * force if near is None or not near < force else near
        for _ in range(PASSES):
            r.array = -image
            rtol, atol = (TIGHTEST, np.sqrt(LEFT * abs(guess))) if symmetric else (ACCURACY, 0.0)
            if not self._linear.solve(r, self._rows, np.empty(0), y, rtol, atol)[1]:
                break
            w, before = w + y.array_r.reshape(-1, 3), force
            if symmetric:
                guess = force = before - self._fall(r, y) - self._linear.left
                if self._linear.left <= LEFT * abs(force):
                    return force, w
            force, image = self._work(w)
            # the norm of GMRES is not that of the energy: the error that is left is the correction itself
            if not symmetric and abs(before - force) <= ACCURACY * abs(force):
                return force, w
        return nan, w

    def _fall(self, r: Any, y: Any) -> float:
        """Work of the residual on the correction of the free dofs [E L]; collective."""
        free = np.ones(len(r.array_r), dtype=bool)
        free[self._rows] = False
        return float(self._solid.comm.allreduce(float(y.array_r[free] @ r.array_r[free])))

    def _work(self, w: Floats) -> tuple[float, Floats]:
        """Force of the flat, and the nodal forces (3 owned,) of a displacement; collective."""
        if self._tied:
            image = tangent_product(self._solid, w)
        else:  # a translation strains nothing; without it most of the solid is at rest, and single precision will do
            image = self._linear.product((w - self.unit).ravel())
        test = w if self._symmetric else self._e  # the forces do the same work on both
        return float(self._solid.comm.allreduce(float(np.vdot(test, image)))), image


def _mirrored(solid: Solid, axis: int) -> Integers:
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
