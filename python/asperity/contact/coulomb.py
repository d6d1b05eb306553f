"""Exact contact with Coulomb friction on a rigid flat, whose tangential tractions change the pressures."""

from __future__ import annotations

import numpy as np

from asperity.arrays import Floats, Integers
from asperity.contact.active_set import ActiveSet
from asperity.contact.contact_surface import ContactSurface
from asperity.contact.friction import StickSlip
from asperity.fem.solid import Solid

SETTLED = 3e-4  # change of the bounds over their sum
POWER = 2.0 / 3.0  # of the gap that falls linearly with the approach next to the edge of a contact


class Coulomb(ActiveSet):
    """Active set whose nodes stick or slip with Coulomb friction.

    For given bounds mu N_i of the tangential forces a position of the flat is a convex problem, see `StickSlip`. The
    bounds follow from its normal forces, and it is solved again until they stay (`settle`): a fixed point that
    contracts by about mu times Dundurs' constant (Hueeber, Stadler & Wohlmuth, SIAM J. Sci. Comput. 30 (2008) 572).
    The slip of a node counts from its position on the flat after the last step, or from where it is touched on the way
    from the last displacement to the predicted one; so the path is integrated by backward Euler.

    Args:
        friction: Coulomb's coefficient

    Attributes:
        sliding: the nodes on the flat
        held: positions on the flat and normal forces of the nodes in contact after the last committed step (n, 3)
        goes_on: whether the next solves begin with the bounds and the slip of the last one
    """

    has_tangent = True
    held: Floats
    goes_on = False

    def __init__(self, solid: Solid, surface: ContactSurface, friction: float) -> None:
        super().__init__(solid, surface)
        self.friction = friction
        self.hint = f"a smaller contact.friction than {friction:g}, "
        self.sliding = StickSlip(solid, surface, self._nodes, solid.fixed)
        self.held = np.full((len(self._nodes), 3), np.nan)
        self._from = self.sliding.shift
        self.begin(np.inf)

    def begin(self, z: float) -> None:
        super().begin(z)
        self.sliding.origin = self.held[:, :2]
        self.sliding.bounds = self.friction * (self._normal if self.goes_on else np.nan_to_num(self.held[:, 2]))

    def expect(self, z: float, start: Floats, end: Floats, ratio: float) -> None:
        """Find where nodes would be touched in the step, and assume that those in contact stick at first, or go on.

        Next to the edge of a contact the gap closes as the power 3/2 of the approach that is left (Johnson, Contact
        Mechanics, 1985, section 4.2): its power 2/3 is extrapolated from the last step. A linear extrapolation of the
        gap would leave an error of first order in the step.
        """
        super().expect(z, start, end, ratio)
        u, v = start[self._nodes], end[self._nodes]
        gap = np.maximum(z - self._height - u[:, 2], 0.0)
        before = np.maximum(gap + (gap - (self._z - self._height - v[:, 2])) / ratio, 0.0)
        now, closed = gap**POWER, before**POWER - gap**POWER
        part = np.clip(np.divide(now, ratio * closed, out=np.ones_like(gap), where=closed > 0.0), 0.0, 1.0)
        move = (v - u)[:, :2] - self.goes_on * (self.sliding.shift - self._from)  # on the flat, where it is foreseen
        touched = u[:, :2] + part[:, None] * move - self._from
        self.sliding.origin = np.where(np.isnan(self.held[:, :2]), touched, self.held[:, :2])
        stuck = ~np.isnan(self.held[:, 0]) & (self.sliding.stuck | (not self.goes_on))
        self.sliding.begin(stuck, float(np.abs(self.sliding.shift - self._from).max()))

    def residual(self, force: Floats) -> tuple[Floats, Integers, Floats]:
        r, rows, lacking = super().residual(force)
        self._normal = np.where(self.active, np.maximum(-force[self._nodes, 2], 0.0), 0.0)
        dofs, left = self.sliding.residual(r)
        return r, np.concatenate([rows, dofs]).astype(np.int32), np.concatenate([lacking, left])

    def imbalance(self, force: Floats) -> Floats:
        """Forces out of balance; of a node on the flat those next to the admissible ones."""
        r, normal = force.copy(), -force[self._nodes, 2]
        r[self._nodes, 2] = np.maximum(normal + self._c * self._penetration(), 0.0) - normal
        self.sliding.imbalance(r)
        return r

    def settle(self) -> bool:
        """Renew the bounds by the normal forces."""
        new = self.friction * self._normal
        change, whole = self._solid.comm.allreduce(np.array([np.abs(new - self.sliding.bounds).sum(), new.sum()]))
        if change <= SETTLED * whole:
            return False
        self.sliding.bounds = new
        return True

    def add_tangent(self) -> None:
        self.sliding.add_tangent()

    def commit(self) -> None:
        now = np.column_stack([self.sliding.position(), self._normal])
        self.held = np.where(self.active[:, None], now, np.nan)
        self._from = self.sliding.shift

    def tangential_work(self, force: Floats, move: Floats) -> float:
        return float(np.vdot(force[self._nodes, :2], move[self._nodes, :2]))  # fixed dofs do not move
