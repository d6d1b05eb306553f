"""Coulomb friction of exact contact on a rigid flat, whose pressures it changes."""

from __future__ import annotations

import numpy as np

from asperity.arrays import Flags, Floats, Integers
from asperity.contact.active_set import ActiveSet
from asperity.contact.contact_surface import ContactSurface
from asperity.fem.solid import Solid

MOVED = 1e-9  # slip of nodes assumed to stick, over the motion of the flat, from which on they have to be moved
LARGEST = 1e3  # stiffness across the motion of a node that begins to slip, over that of the solid at the node
SETTLED = 3e-4  # change of the bounds over their sum
POWER = 2.0 / 3.0  # of the gap that falls linearly with the approach next to the edge of a contact


class StickSlip:
    """Nodes of which those that stick are prescribed, and those that slip carry their bound against their slip.

    The forces minimise a convex energy: its derivative is bound/|s| across the slip s, symmetric. Newton's method is
    semismooth: a node slips where |force - c s| > bound (Hueeber, Stadler & Wohlmuth, SIAM J. Sci. Comput. 30 (2008)
    572).

    Args:
        nodes: owned nodes of the surface (n,)
        fixed: owned dofs without displacement

    Attributes:
        shift: tangential position of the flat (2,) [L]
        origin: positions on the flat from which the slip of a step counts, NaN where a node cannot slip (n, 2) [L]
        bounds: of the tangential forces (n,) [E L^2]
        stuck: nodes that stick at the last residual (n,)
        traction: tangential forces of the flat there (n, 2) [E L^2]
    """

    def __init__(self, solid: Solid, nodes: Integers, fixed: Integers) -> None:
        self._solid, self._nodes = solid, nodes
        free = np.ones(3 * solid.owned, dtype=bool)
        free[fixed] = False
        self._free: Flags = free.reshape(-1, 3)[nodes, :2]
        # stiffness of the solid against a tangential motion of each node alone [E L]; with this shift, the trial hardly
        # depends on the slip of the node itself; with one a hundred times as large nodes that hardly slip keep turning
        solid.tangent.assemble_elastic()
        diagonal = solid.scatter_reverse(solid.tangent.values()[solid.sparsity.diagonal].reshape(-1, 3))
        self._c: Floats = diagonal[nodes, :2].mean(axis=1)
        self.shift: Floats = np.zeros(2)
        self.origin: Floats = np.full((len(nodes), 2), np.nan)
        self.bounds: Floats = np.zeros(len(nodes))
        self.traction: Floats = np.zeros((len(nodes), 2))
        self.begin(np.ones(len(nodes), dtype=bool), 0.0)

    def begin(self, stuck: Flags, move: float) -> None:
        """Assume nodes that stick, a set that lasts until they have made a move [L]."""
        self.stuck, self._reach = stuck, MOVED * move

    def position(self) -> Floats:
        """Positions of the nodes on the flat, less those of the undeformed solid (n, 2) [L]."""
        return self._solid.u.x.array.reshape(-1, 3)[self._nodes, :2] - self.shift

    def slip(self) -> Floats:
        """Slip of the nodes since `origin` (n, 2) [L]."""
        return np.nan_to_num(self.position() - self.origin) * self._free

    def residual(self, r: Floats) -> tuple[Integers, Floats]:
        """Complete the forces of all owned nodes (owned, 3) [E L^2] in place.

        Returns:
            prescribed dofs, and the displacement increment each of them still lacks [L]
        """
        slip, bounds = self.slip(), self.bounds
        self.traction = r[self._nodes, :2] * self._free
        trial = self.traction - self._c[:, None] * slip
        size = np.linalg.norm(trial, axis=1)
        if not np.abs(slip[self.stuck]).max(initial=0.0) > self._reach > 0.0:
            self.stuck = (size <= bounds) & (bounds > 0.0)
            self._reach = 0.0
        self._loose = loose = ~self.stuck
        # linearised for force and slip as unknowns of their own: the force along the trial is the bound, and that
        # across it is this stiffness times the slip across it
        n = trial[loose] / np.maximum(size[loose], 1e-300)[:, None]
        self._across = np.eye(2) - n[:, :, None] * n[:, None, :]
        excess = np.maximum(size[loose] / np.maximum(bounds[loose], 1e-300) - 1.0, 1.0 / LARGEST)
        self._stiffness = self._c[loose] / excess
        astray = np.einsum("nij,nj->ni", self._across, slip[loose])
        r[self._nodes[loose], :2] += self._stiffness[:, None] * astray - bounds[loose, None] * n
        free = self._free[self.stuck]
        dofs = (3 * self._nodes[self.stuck, None] + np.arange(2))[free]
        r.reshape(-1)[dofs] = 0.0
        return dofs.astype(np.int32), -slip[self.stuck][free]

    def add_tangent(self) -> None:
        """Add the stiffness across the slip to `solid.tangent.values()`, the local matrix."""
        loose = self._loose
        blocks = self._stiffness[:, None, None] * self._across
        blocks *= self._free[loose][:, :, None] * self._free[loose][:, None, :]
        diagonal = self._solid.sparsity.diagonal.reshape(-1, 3)[self._nodes[loose]]
        for i, j in np.ndindex(2, 2):
            self._solid.tangent.values()[diagonal[:, i] + j - i] += blocks[:, i, j]


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
    """

    has_tangent = True
    held: Floats

    def __init__(self, solid: Solid, surface: ContactSurface, friction: float) -> None:
        super().__init__(solid, surface)
        self.friction = friction
        self.sliding = StickSlip(solid, self._nodes, solid.fixed)
        self.held = np.full((len(self._nodes), 3), np.nan)
        self._from = self.sliding.shift
        self._height = surface.heights[self._nodes]
        self.begin(np.inf)

    def begin(self, z: float) -> None:
        super().begin(z)
        self.sliding.origin = self.held[:, :2]
        self.sliding.bounds = self.friction * np.nan_to_num(self.held[:, 2])

    def expect(self, z: float, start: Floats, end: Floats, ratio: float) -> None:
        """Find where nodes would be touched in the step, and assume that those in contact stick at first.

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
        touched = u[:, :2] + part[:, None] * (v - u)[:, :2] - self._from
        self.sliding.origin = np.where(np.isnan(self.held[:, :2]), touched, self.held[:, :2])
        self.sliding.begin(~np.isnan(self.held[:, 0]), float(np.abs(self.sliding.shift - self._from).max()))

    def residual(self, force: Floats) -> tuple[Floats, Integers, Floats]:
        r, rows, lacking = super().residual(force)
        self._normal = np.where(self.active, np.maximum(-force[self._nodes, 2], 0.0), 0.0)
        dofs, left = self.sliding.residual(r)
        return r, np.concatenate([rows, dofs]).astype(np.int32), np.concatenate([lacking, left])

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
