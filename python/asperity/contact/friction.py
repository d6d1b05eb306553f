"""Nodes that stick or slip on a flat under given bounds of their tangential forces."""

from __future__ import annotations

import numpy as np

from asperity.arrays import Flags, Floats, Integers
from asperity.fem.solid import Solid

MOVED = 1e-9  # slip of nodes assumed to stick, over the motion of the flat, from which on they have to be moved
LARGEST = 1e3  # stiffness across the motion of a node that begins to slip, over that of the solid at the node


class StickSlip:
    """Nodes of which those that stick are prescribed, and those that slip carry their bound against their slip.

    The forces minimise a convex energy: its derivative is bound/|s| across the slip s, symmetric. Newton's method is
    semismooth: a node slips where |force - c s| > bound (Hueeber, Stadler & Wohlmuth, SIAM J. Sci. Comput. 30 (2008)
    572).

    Args:
        nodes: owned nodes (n,)
        free: which of their tangential dofs are free (n, 2)

    Attributes:
        stuck: nodes that stick at the last residual (n,)
    """

    def __init__(self, solid: Solid, nodes: Integers, free: Flags) -> None:
        self._solid, self._nodes, self._free = solid, nodes, free
        self._c = self._own_stiffness()
        self.begin(np.ones(len(nodes), dtype=bool), 0.0)

    def _own_stiffness(self) -> Floats:
        """Stiffness of the solid against a tangential motion of each node alone (n,) [E L]; collective.

        With this shift |force - c s| hardly depends on the slip of the node itself. With one a hundred times as large
        nodes that hardly slip keep turning.
        """
        solid = self._solid
        solid.assemble_elastic()
        diagonal = solid.scatter_reverse(solid.values[solid.sparsity.diagonal].reshape(-1, 3))
        return np.asarray(diagonal[self._nodes, :2].mean(axis=1))

    def begin(self, stuck: Flags, move: float) -> None:
        """Assume nodes that stick, a set that lasts until they have made a move [L]."""
        self.stuck, self._reach = stuck, MOVED * move

    def _trial(self, traction: Floats, slip: Floats) -> tuple[Floats, Floats]:
        trial = traction - self._c[:, None] * slip
        return trial, np.linalg.norm(trial, axis=1)

    def residual(self, r: Floats, slip: Floats, bound: Floats) -> tuple[Integers, Floats]:
        """Complete the forces of all owned nodes in place.

        Args:
            r: forces (owned, 3) [E L^2]
            slip: of the nodes on the flat (n, 2) [L]
            bound: of their tangential forces (n,) [E L^2]

        Returns:
            prescribed dofs, and the displacement increment each of them still lacks [L]
        """
        trial, size = self._trial(r[self._nodes, :2] * self._free, slip)
        if not np.abs(slip[self.stuck]).max(initial=0.0) > self._reach > 0.0:
            self.stuck = (size <= bound) & (bound > 0.0)
            self._reach = 0.0
        self._loose = loose = ~self.stuck
        # linearised for force and slip as unknowns of their own: the force along the trial is the bound, and that
        # across it is this stiffness times the slip across it
        n = trial[loose] / np.maximum(size[loose], 1e-300)[:, None]
        self._across = np.eye(2) - n[:, :, None] * n[:, None, :]
        excess = np.maximum(size[loose] / np.maximum(bound[loose], 1e-300) - 1.0, 1.0 / LARGEST)
        self._stiffness = self._c[loose] / excess
        astray = np.einsum("nij,nj->ni", self._across, slip[loose])
        r[self._nodes[loose], :2] += self._stiffness[:, None] * astray - bound[loose, None] * n
        free = self._free[self.stuck]
        dofs = (3 * self._nodes[self.stuck, None] + np.arange(2))[free]
        r.reshape(-1)[dofs] = 0.0
        return dofs.astype(np.int32), -slip[self.stuck][free]

    def imbalance(self, force: Floats, slip: Floats, bound: Floats) -> Floats:
        """Force of each node less the admissible one next to force - c slip (n, 2) [E L^2]."""
        traction = force[self._nodes, :2] * self._free
        trial, size = self._trial(traction, slip)
        share = np.minimum(bound / np.maximum(size, 1e-300), 1.0)
        return np.asarray(traction - share[:, None] * trial)

    def add_tangent(self) -> None:
        """Add the stiffness across the slip to `solid.values`, the local matrix."""
        loose = self._loose
        blocks = self._stiffness[:, None, None] * self._across
        blocks *= self._free[loose][:, :, None] * self._free[loose][:, None, :]
        diagonal = self._solid.sparsity.diagonal.reshape(-1, 3)[self._nodes[loose]]
        for i, j in np.ndindex(2, 2):
            self._solid.values[diagonal[:, i] + j - i] += blocks[:, i, j]
