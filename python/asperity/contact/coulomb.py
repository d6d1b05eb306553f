"""Exact contact with Coulomb friction on a rigid flat, whose tangential tractions change the pressures."""

from __future__ import annotations

import numpy as np

from asperity.arrays import Floats, Integers
from asperity.contact.active_set import ActiveSet
from asperity.contact.contact_surface import ContactSurface
from asperity.contact.friction import StickSlip
from asperity.contact.stick import Stick
from asperity.fem.solid import Solid

SETTLED = 3e-4  # change of the bounds over their sum


class Coulomb(Stick):
    """Active set whose nodes stick or slip with Coulomb friction.

    For given bounds mu N_i of the tangential forces a position of the flat is a convex problem, see `StickSlip`. The
    bounds follow from its normal forces, and it is solved again until they stay (`settle`): a fixed point that
    contracts by about mu times Dundurs' constant (Hueeber, Stadler & Wohlmuth, SIAM J. Sci. Comput. 30 (2008) 572).
    The slip of a node counts from its position on the flat after the last step, or from where it is touched, see
    `Stick.expect`; so the path is integrated by backward Euler.

    Args:
        friction: Coulomb's coefficient

    Attributes:
        shift: tangential position of the flat (2,) [L]
        held: positions on the flat of the nodes in contact after the last committed step
    """

    symmetric = True
    stiff = True

    def __init__(self, solid: Solid, surface: ContactSurface, friction: float) -> None:
        self.friction = friction
        self.shift: Floats = np.zeros(2)
        self._from: Floats = self.shift
        self._normal: Floats = np.zeros(len(surface.owned_nodes))
        super().__init__(solid, surface)
        self._weights = surface.bearing_area()[self._nodes]
        self._sliding = StickSlip(solid, self._nodes, self._free)

    def begin(self, z: float) -> None:
        ActiveSet.begin(self, z)
        self._at: Floats = self.held
        self._bounds = self.friction * self._normal

    def expect(self, z: float, start: Floats, end: Floats, ratio: float) -> None:
        """Find where nodes would be touched, see `Stick.expect`, and assume that those in contact stick at first."""
        super().expect(z, start, end, ratio)
        self._at = np.where(np.isnan(self.held), self._at - self._from, self.held)
        self._sliding.begin(~np.isnan(self.held[:, 0]), float(np.abs(self.shift - self._from).max()))

    @property
    def slip(self) -> Floats:
        """Slip of the nodes on the flat in the step, zero where they are not touched (n, 2) [L]."""
        at = self._position()
        return (at - np.where(np.isnan(self._at), at, self._at)) * self._free

    def _position(self) -> Floats:
        return self._solid.u.x.array.reshape(-1, 3)[self._nodes, :2] - self.shift

    def residual(self, force: Floats) -> tuple[Floats, Integers, Floats]:
        r, rows, lacking = ActiveSet.residual(self, force)
        self._normal = np.where(self.active, np.maximum(-force[self._nodes, 2], 0.0), 0.0)
        self.traction = force[self._nodes, :2] * self._free
        dofs, left = self._sliding.residual(r, self.slip, self._bounds)
        return r, np.concatenate([rows, dofs]).astype(np.int32), np.concatenate([lacking, left])

    def imbalance(self, force: Floats) -> Floats:
        """Forces out of balance; of a node on the flat those next to the admissible ones."""
        r, normal = force.copy(), -force[self._nodes, 2]
        r[self._nodes, 2] = np.maximum(normal + self._c * self._penetration(), 0.0) - normal
        r[self._nodes, :2] = self._sliding.imbalance(force, self.slip, self._bounds)
        return r

    def settle(self) -> bool:
        """Renew the bounds by the normal forces."""
        new = self.friction * self._normal
        change, whole = self._solid.comm.allreduce(np.array([np.abs(new - self._bounds).sum(), new.sum()]))
        if change <= SETTLED * whole:
            return False
        self._bounds = new
        return True

    def add_tangent(self) -> None:
        self._sliding.add_tangent()

    def commit(self) -> None:
        self.held = self._position()
        self.held[~self.active] = np.nan
        self._from = self.shift

    def dissipated(self) -> float:
        """Work of friction in the step [E L^3]; part of this rank."""
        return float(self._bounds @ np.linalg.norm(self.slip, axis=1))

    def slips(self, rest: Floats) -> Floats:
        """Nodes in contact: x, y, area of bearing and slip since positions on the flat (n, 4); part of this rank."""
        slip = np.linalg.norm(np.nan_to_num((self.held - rest) * self._free), axis=1)
        nodes = np.column_stack([self._solid.points[self._nodes, :2], self._weights, slip])
        return nodes[self.active]

    def area(self) -> Floats:
        """Areas of the nodes that slip and of those in contact (2,) [L^2]; part of this rank."""
        slips = self.active & ~self._sliding.stuck
        return np.array([self._weights[slips].sum(), self._weights[self.active].sum()])
