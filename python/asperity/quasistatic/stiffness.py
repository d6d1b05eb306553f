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

if TYPE_CHECKING:
    from asperity.quasistatic.contact_solver import ContactSolver

RTOL = {True: 1e-3, False: 1e-5}  # of the start, for a symmetric tangent in the norm of energy; and for another
LEFT = 1e-5  # error of the result for which the solution is repeated from where it ended
PASSES = 5  # at most
FULL = 1e-3  # part of the compliance below which that of the interface is lost in rounding and discretisation


class Stiffness:
    """Stiffness of the contact: a probe of accepted steps, on the linear solver of Newton's method; collective.

    Attributes:
        columns: names of what it finds
    """

    columns = (*ELASTIC_STIFFNESSES, "conductance")

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
                conductance: constriction conductance over the conductivity [L], 2/E' times k_n_interface (Barber,
                    Proc. R. Soc. A 459 (2003) 53), likewise; exact for the contact of a half-space without friction
        """
        solid, contact = solver.solid, solver.contact
        nodes, material = contact.nodes(), solid.material
        if not solid.comm.allreduce(len(nodes)):
            return dict.fromkeys(self.columns, 0.0)
        held = solver.newton.now.rows
        solid.tangent.assemble_elastic(contact.add_elastic_tangent if contact.has_tangent else None)
        rows = np.concatenate([solid.fixed, held])
        normal, w = _moved(solver, 2, rows, held, contact.has_tangent)
        if contact.has_tangent:
            solid.tangent.assemble_elastic()
        plate, tangential = (3 * nodes[:, None] + np.arange(2)).ravel(), []
        for axis, fixed in enumerate(self._along):
            guess = w[:, 2:] * np.eye(3)[axis]  # it decays alike from the contact
            tangential.append(_moved(solver, axis, np.union1d(fixed, plate), plate, False, guess)[0])
        k_t = 0.5 * sum(tangential)
        self._height = height = self._height or solver.contact_surface.mean(solid.points[:, 2])
        interface = without_block(normal, material.block_modulus(solid.sides) / height)  # elastic like k_t
        found = {
            "k_n_elastic": normal,
            "k_t": k_t,
            "k_t_x": tangential[0],
            "k_n_interface": interface,
            "k_t_interface": without_block(k_t, material.lame[1] / height),
            "conductance": 2.0 / material.reduced_modulus * interface,
        }
        return {name: value for name, value in found.items() if value == value}


def without_block(whole: float, block: float) -> float:
    """Stiffness of two in series without that of the block; NaN where the block is practically all."""
    left = 1.0 - whole / block
    return whole / left if left > FULL else nan


def _moved(
    solver: ContactSolver, axis: int, rows: Integers, held: Integers, tied: bool, guess: Floats | None = None
) -> tuple[float, Floats]:
    """Force of a flat that moves by one along an axis [E L], NaN where the linear solver fails; collective.

    Args:
        rows: prescribed owned dofs, of which the flat holds `held`
        tied: whether the tangent has the stiffness of a contact, which resists a translation
        guess: of the displacement (owned, 3)

    Returns:
        force, and displacement relative to the flat (owned, 3)
    """
    solid, linear, unit = solver.solid, solver.newton.linear, np.eye(3)[axis]
    symmetric = solver.contact.symmetric and solid.material.symmetric
    e = np.tile(unit, (solid.owned, 1))
    e.reshape(-1)[held] = 0.0

    def work(w: Floats) -> tuple[float, Floats]:
        """Force of the flat, and the nodal forces (3 owned,) of a displacement."""
        # a translation strains nothing; without it most of the solid is at rest, and single precision will do
        image = tangent_product(solid, w) if tied else linear.product((w - unit).ravel())
        test = w if symmetric else e  # the forces do the same work on both
        return float(solid.comm.allreduce(float(np.vdot(test, image)))), image

    w = (e if guess is None else guess).copy()
    w.reshape(-1)[rows] = e.reshape(-1)[rows]
    r, y = solid.vector(), solid.vector()
    force, image = work(w)
    for _ in range(PASSES):
        r.array = -image
        if not linear.solve(r, rows.astype(np.int32), np.empty(0), y, RTOL[symmetric])[1]:
            break
        w, before = w + y.array_r.reshape(-1, 3), force
        force, image = work(w)
        # the norm of GMRES is not that of the energy: what is left is less than the correction itself
        left = linear.left if symmetric or not linear.left else abs(force - before)
        if left <= LEFT * abs(force):
            return force, w
    return nan, w


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
