"""Coulomb friction of nodes whose normal forces stay: tangential motion of two like bodies under a constant load."""

from __future__ import annotations

from math import inf

import numpy as np

from asperity.arrays import Floats, Integers
from asperity.contact.contact_surface import ContactSurface
from asperity.contact.friction import StickSlip
from asperity.fem.solid import Solid


class FrozenFriction:
    """Nodes under constant normal forces on a flat that moves sideways, free along z.

    The tangential tractions of like bodies do not change their pressures (Dundurs' constant is zero). A step minimises
    the convex energy + sum of mu N_i |s_i|, s_i the slip of a node on the flat, see `StickSlip`.

    Args:
        solid: at rest under the normal forces
        surface: of the solid
        normal: normal force of the owned nodes (owned,) [E L^2]
        resting: internal force at rest (owned, 3) [E L^2]; it stays as an external one
        fixed: owned dofs without displacement

    Attributes:
        friction: Coulomb's coefficient, infinite where nothing slips
        traction: tangential force of the flat on the nodes in contact at the last residual (n, 2) [E L^2]
    """

    symmetric = True
    stiff = True

    def __init__(self, solid: Solid, surface: ContactSurface, normal: Floats, resting: Floats, fixed: Integers) -> None:
        self._solid, self._normal, self._resting = solid, normal, resting.copy()
        owned = surface.owned_nodes
        self._nodes = owned[normal[owned] > 0.0]
        free = np.ones(3 * solid.owned, dtype=bool)
        free[fixed] = False
        self._free = free.reshape(-1, 3)[self._nodes, :2]
        self._weights = surface.bearing_area()[self._nodes]
        self._friction = StickSlip(solid, self._nodes, self._free)
        self.friction = inf
        self.begin(self._position(), np.zeros(2), keep=False)
        self.traction: Floats = np.zeros((len(self._nodes), 2))

    def begin(self, start: Floats, move: Floats, keep: bool) -> None:
        """Move the flat.

        Args:
            start: tangential displacement of the nodes in contact before, see `positions` (n, 2) [L]
            move: of the flat from there (2,) [L]
            keep: whether the nodes that slipped before slip at first; otherwise all stick
        """
        self._start, self._move = start, move
        stuck = self._friction.stuck if keep else np.ones(len(self._nodes), dtype=bool)
        self._friction.begin(stuck, float(np.abs(move).max()))

    def positions(self, displacement: Floats) -> Floats:
        """Tangential displacement of the nodes in contact (n, 2), from that of the owned nodes (owned, 3) [L]."""
        return displacement[self._nodes, :2].copy()

    def _position(self) -> Floats:
        return self.positions(self._solid.u.x.array.reshape(-1, 3))

    @property
    def slip(self) -> Floats:
        """Slip of the nodes in contact on the flat since the beginning of the step (n, 2) [L]."""
        return (self._position() - self._start - self._move) * self._free

    @property
    def _bounds(self) -> Floats:
        return self.friction * self._normal[self._nodes]

    def residual(self, force: Floats) -> tuple[Floats, Integers, Floats]:
        r = force - self._resting
        self.traction = r[self._nodes, :2] * self._free
        return r, *self._friction.residual(r, self.slip, self._bounds)

    def imbalance(self, force: Floats) -> Floats:
        r = force - self._resting
        r[self._nodes, :2] = self._friction.imbalance(r, self.slip, self._bounds)
        return r

    def add_tangent(self) -> None:
        self._friction.add_tangent()

    def nodal_force(self, force: Floats) -> Floats:
        return self._normal

    def slips(self, displacement: Floats, rest: Floats, move: Floats) -> Floats:
        """Nodes in contact: x, y, area of bearing and slip since rest (n, 4) [L, L^2]; part of this rank.

        Args:
            displacement, rest: of the owned nodes, now and before any slip (owned, 3) [L]
            move: of the flat in between (2,) [L]
        """
        slip = (self.positions(displacement) - self.positions(rest) - move) * self._free
        return np.column_stack([self._solid.points[self._nodes, :2], self._weights, np.linalg.norm(slip, axis=1)])

    def dissipated(self) -> float:
        """Work of friction in the step [E L^3]; part of this rank."""
        loose = ~self._friction.stuck
        return float(self._bounds[loose] @ np.linalg.norm(self.slip[loose], axis=1))

    def area(self) -> Floats:
        """Areas of the nodes that slip and of those in contact (2,) [L^2]; part of this rank."""
        return np.array([self._weights[~self._friction.stuck].sum(), self._weights.sum()])
