# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

"""Coulomb friction of nodes whose normal forces stay: tangential motion of two like bodies under a constant load."""

from __future__ import annotations

from math import inf

import numpy as np

from asperity.arrays import Flags, Floats, Integers
from asperity.contact.contact_surface import ContactSurface
from asperity.fem.solid import Solid

MOVED = 1e-9  # slip of nodes assumed to stick, over the motion of the flat, from which on they have to be moved
LARGEST = 1e3  # stiffness across the motion of a node that begins to slip, over that of the solid at the node


class FrozenFriction:
    """Nodes under constant normal forces on a flat that moves sideways, free along z.

    The tangential tractions of like bodies do not change their pressures (Dundurs' constant is zero). A step minimises
    the convex energy + sum of mu N_i |s_i|, s_i the slip of a node on the flat: nodes that stick are prescribed, and a
    node that slips carries mu N_i against its slip. Its derivative is mu N_i/|s_i| across the slip, symmetric.
    Newton's method is semismooth: a node slips where |force - c s| > mu N_i (Hueeber, Stadler & Wohlmuth, SIAM J. Sci.
    Comput. 30 (2008) 572).

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
        self._c = self._own_stiffness()
        self.friction = inf
        self._stuck: Flags = np.ones(len(self._nodes), dtype=bool)
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
        if not keep:
            self._stuck = np.ones(len(self._nodes), dtype=bool)
        self._begins = True

    def positions(self, displacement: Floats) -> Floats:
        """Tangential displacement of the nodes in contact (n, 2), from that of the owned nodes (owned, 3) [L]."""
        return displacement[self._nodes, :2].copy()

    def _position(self) -> Floats:
        return self.positions(self._solid.u.x.array.reshape(-1, 3))

    def _own_stiffness(self) -> Floats:
        """Stiffness of the solid against a tangential motion of each node in contact alone (n,) [E L]; collective.

        With this shift |force - c s| hardly depends on the slip of the node itself. With one a hundred times as large
        nodes that hardly slip keep turning.
        """
        solid = self._solid
        solid.assemble_elastic()
        diagonal = solid.scatter_reverse(solid.values[solid.sparsity.diagonal].reshape(-1, 3))
        return np.asarray(diagonal[self._nodes, :2].mean(axis=1))

    @property
    def slip(self) -> Floats:
        """Slip of the nodes in contact on the flat since the beginning of the step (n, 2) [L]."""
        return (self._position() - self._start - self._move) * self._free

    @property
    def _bounds(self) -> Floats:
        return self.friction * self._normal[self._nodes]

    def residual(self, force: Floats) -> tuple[Floats, Integers, Floats]:
        r = force - self._resting
        slip, traction, bound = self.slip, r[self._nodes, :2] * self._free, self._bounds
        self.traction = traction
        trial = traction - self._c[:, None] * slip
        size = np.linalg.norm(trial, axis=1)
        # the set assumed at the beginning lasts until its nodes have moved
        if not (self._begins and np.abs(slip[self._stuck]).max(initial=0.0) > MOVED * np.abs(self._move).max()):
            self._stuck = size <= bound
        self._begins = False
        loose = ~self._stuck
        # linearised for force and slip as unknowns of their own: the force along the trial is mu N, and that across it
        # is this stiffness times the slip across it
        n = trial[loose] / np.maximum(size[loose], 1e-300)[:, None]
        self._across = np.eye(2) - n[:, :, None] * n[:, None, :]
        excess = np.maximum(size[loose] / np.maximum(bound[loose], 1e-300) - 1.0, 1.0 / LARGEST)
        self._stiffness = self._c[loose] / excess
        astray = np.einsum("nij,nj->ni", self._across, slip[loose])
        r[self._nodes[loose], :2] += self._stiffness[:, None] * astray - bound[loose, None] * n
        free = self._free[self._stuck]
        dofs = (3 * self._nodes[self._stuck, None] + np.arange(2))[free]
        r.reshape(-1)[dofs] = 0.0
        return r, dofs.astype(np.int32), -slip[self._stuck][free]

    def imbalance(self, force: Floats) -> Floats:
        """Forces out of balance; for a node on the flat its force less the admissible one next to force - c slip."""
        r = force - self._resting
        traction = r[self._nodes, :2] * self._free
        trial = traction - self._c[:, None] * self.slip
        size = np.linalg.norm(trial, axis=1)
        share = np.minimum(self._bounds / np.maximum(size, 1e-300), 1.0)
        r[self._nodes, :2] = traction - share[:, None] * trial
        return r

    def add_tangent(self) -> None:
        loose = ~self._stuck
        blocks = self._stiffness[:, None, None] * self._across
        blocks *= self._free[loose][:, :, None] * self._free[loose][:, None, :]
        diagonal = self._solid.sparsity.diagonal.reshape(-1, 3)[self._nodes[loose]]
        for i, j in np.ndindex(2, 2):
            self._solid.values[diagonal[:, i] + j - i] += blocks[:, i, j]

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
        loose = ~self._stuck
        return float(self._bounds[loose] @ np.linalg.norm(self.slip[loose], axis=1))

    def area(self) -> Floats:
        """Areas of the nodes that slip and of those in contact (2,) [L^2]; part of this rank."""
        return np.array([self._weights[~self._stuck].sum(), self._weights.sum()])
