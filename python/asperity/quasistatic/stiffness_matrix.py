"""Stiffness of the contact against all motions of the flat: three translations and three rotations."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from asperity.arrays import Floats, Integers
from asperity.errors import ConvergenceError
from asperity.linear.matrix_free import tangent_product
from asperity.model.kinds import refuse
from asperity.model.settings import no_rotations

if TYPE_CHECKING:
    from asperity.quasistatic.contact_solver import ContactSolver

MOTIONS = ("x", "y", "z", "rx", "ry", "rz")
RTOL = 1e-4  # of a system, in the energy norm; its square is the error of the stiffness
SINGULAR = 1e-6  # least part of the compliance that the interface may have


@dataclass(frozen=True, eq=False)
class StiffnessMatrix:
    """Forces and moments on the flat per motion of it, in the order x, y, z, rx, ry, rz; z points out of the block.

    Attributes:
        point: what the flat turns about, the centre of the nominal area in the plane of the flat (3,) [length]
        whole: matrix (6, 6), translations [force/length], rotations [force length], coupling [force]
        interface: the same without the block, whose compliance is that of its whole top stuck to the flat; None where
            that is all there is
    """

    point: Floats
    whole: Floats
    interface: Floats | None

    def scaled(self, E: float, side: float) -> StiffnessMatrix:
        """The matrix of a solver in physical units.

        Args:
            E: unit of stress [force/length^2]
            side: unit of length [length]
        """
        power = np.array([0, 0, 0, 1, 1, 1])
        unit = E * side ** (1.0 + power[:, None] + power)
        interface = None if self.interface is None else self.interface * unit
        return StiffnessMatrix(self.point * side, self.whole * unit, interface)

    def to_dict(self) -> dict[str, Any]:
        """Section "stiffness_matrix" of summary.json."""
        return {
            "motions": list(MOTIONS),
            "point": self.point.tolist(),
            "units": {"translations": "force/length", "rotations": "force*length", "coupling": "force"},
            "whole": self.whole.tolist(),
            "interface": None if self.interface is None else self.interface.tolist(),
        }


def stiffness_matrix(solver: ContactSolver) -> StiffnessMatrix | None:
    """Elastic stiffness of the present state against all motions of a flat that the nodes in contact stick to.

    The base is clamped and the sides are free: rollers would hold a block that shears or tilts, and mirror images would
    move otherwise. None without contact. Collective.

    Raises:
        InputError: the sides are periodic, which no rotation is
        ConvergenceError: a linear system cannot be solved

    Examples:
        A cube of E = 1 and nu = 0 in full contact, clamped at both ends:

        >>> from asperity.quasistatic.stiffness_matrix import stiffness_matrix
        >>> from asperity.surface import Flat
        >>> size = asp.MeshSize(h_contact=0.5, h_max=0.5)
        >>> cube = asp.solve_contact(Flat(L=1.0), asp.Material(E=1.0, nu=0.0), delta_max=1e-6, steps=1, size=size)
        >>> found = stiffness_matrix(cube.solver)
        >>> print(found.whole.diagonal().round(2), found.interface)
        [0.31 0.31 1.   0.16 0.16 0.07] None
    """
    solid, contact = solver.solid, solver.contact
    refuse(no_rotations(solid.sides))
    nodes = contact.nodes()
    if not solid.comm.allreduce(len(nodes)):
        return None
    solid.assemble_elastic()
    solver.newton.linear.forget()
    point = np.array([0.5, 0.5, solver.summit - solver.delta])
    whole = _of_plate(solver, nodes, point)
    covered = _of_plate(solver, solver.contact_surface.owned_nodes, point)
    left = np.linalg.inv(whole) - np.linalg.inv(covered)
    # relative to the compliance of each motion
    scale = np.sqrt(whole.diagonal())
    positive = bool(np.linalg.eigvalsh(scale[:, None] * left * scale)[0] > SINGULAR)
    return StiffnessMatrix(point, whole, np.linalg.inv(left) if positive else None)


def _of_plate(solver: ContactSolver, nodes: Integers, point: Floats) -> Floats:
    """Stiffness (6, 6) of a plate that holds the given owned nodes, against motions about a point; collective."""
    solid, linear = solver.solid, solver.newton.linear
    dofs = np.arange(3, dtype=np.int32)
    rows = np.unique(np.concatenate([(3 * of[:, None] + dofs).ravel() for of in (solid.base, nodes)])).astype(np.int32)
    free = np.ones(3 * solid.owned, dtype=bool)
    free[rows] = False
    moved, images = [], []
    r, y = solid.vector(), solid.vector()
    displacement = solid.u.x.array.reshape(-1, 3)
    for motion in _rigid(solid.points[nodes] + displacement[nodes] - point):
        w = np.zeros((solid.owned, 3))
        w[nodes] = motion
        r.array = -tangent_product(solid, w)
        if not linear.solve(r, rows, np.empty(0), y, RTOL)[1]:
            raise ConvergenceError("the stiffness matrix of the flat was not found: a linear system did not converge")
        moved.append(w.ravel() + free * y.array_r)
        images.append(tangent_product(solid, moved[-1]))
    stiffness: Floats = solid.comm.allreduce(np.array(moved) @ np.array(images).T)
    return stiffness


def _rigid(x: Floats) -> Floats:
    """Unit translations, and unit rotations about the origin, at points x (n, 3): (6, n, 3)."""
    rotations = (np.cross(axis, x) for axis in np.eye(3))
    return np.array([*(np.broadcast_to(axis, x.shape) for axis in np.eye(3)), *rotations])
