"""Exact contact of nodes that stick: each keeps the tangential position at which the flat first touched it."""

from __future__ import annotations

import numpy as np

from asperity.arrays import Floats, Integers
from asperity.contact.active_set import ActiveSet
from asperity.contact.contact_surface import ContactSurface
from asperity.fem.solid import Solid

POWER = 2.0 / 3.0  # of the gap that falls linearly with the approach next to the edge of a contact
MOST_ADDITIONS = 5  # passes of a step in which nodes may begin to stick; a usual step takes one or two


class Stick(ActiveSet):
    """Active set whose nodes keep their tangential position from first touch until the flat releases them.

    It is the limit of infinite friction. With a given set of nodes that stick, a position of the flat is a convex
    problem like that without friction, so Newton's method solves it for one set at a time (`settle`): it begins with
    the nodes that stuck after the last step, then nodes in contact stick and the others are free. A node that is
    released and touched again within one step slips in this step.

    Where a node is touched within a step is taken on the way from the last displacement to the predicted one. The error
    of the force is of order 3/2 in the step, see docs/contact.md.
    """

    held: Floats

    def __init__(self, solid: Solid, surface: ContactSurface) -> None:
        super().__init__(solid, surface)
        free = np.ones(3 * solid.owned, dtype=bool)
        free[solid.fixed] = False
        self._free = free.reshape(-1, 3)[self._nodes, :2]
        self.held = np.full((len(self._nodes), 2), np.nan)
        self.begin(np.inf)

    def begin(self, z: float) -> None:
        super().begin(z)
        self._at: Floats = self.held  # where a node sticks; NaN slips
        self._stuck = ~np.isnan(self.held[:, 0]) & (z < np.inf)
        self._freed = np.zeros(len(self._nodes), dtype=bool)  # nodes released in this step
        self._additions = 0

    def expect(self, z: float, start: Floats, end: Floats, ratio: float) -> None:
        """Find where nodes that do not stick yet would be touched in the step to the current height of the flat.

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
        touched = u[:, :2] + part[:, None] * (v - u)[:, :2]
        self._at = np.where(np.isnan(self.held), touched, self.held)

    def settle(self) -> bool:
        """Let the nodes in contact stick and free the others."""
        new = self.active & ~self._stuck & ~self._freed & ~np.isnan(self._at[:, 0])
        if self._additions == MOST_ADDITIONS:
            new[:] = False
        released = self._stuck & ~self.active
        comm = self._solid.comm
        added, changed = comm.allreduce(np.array([new.sum(), new.sum() + released.sum()])) > 0
        self._additions += int(added)
        self._stuck = (self._stuck | new) & ~released
        self._freed |= released
        return bool(changed)

    def residual(self, force: Floats) -> tuple[Floats, Integers, Floats]:
        r, rows, lacking = super().residual(force)
        free = self._free[self._stuck]
        dofs = (3 * self._nodes[self._stuck, None] + np.arange(2))[free]
        r.reshape(-1)[dofs] = 0.0
        left = self._at[self._stuck][free] - self._solid.u.x.array[dofs]
        return r, np.concatenate([rows, dofs]).astype(np.int32), np.concatenate([lacking, left])

    def commit(self) -> None:
        here = self._solid.u.x.array.reshape(-1, 3)[self._nodes, :2]
        at = np.where(self._stuck[:, None], self._at, here)
        self.held = np.where(self.active[:, None], at, np.nan)

    def tangential_work(self, force: Floats, move: Floats) -> float:
        nodes = self._nodes
        return float(np.sum((force[nodes, :2] * move[nodes, :2])[self._free]))
