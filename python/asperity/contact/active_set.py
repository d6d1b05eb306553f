"""Exact contact at the nodes by a primal-dual active set."""

from __future__ import annotations

import numpy as np

from asperity.arrays import Flags, Floats, Integers
from asperity.contact.contact_surface import ContactSurface
from asperity.contact.interface import Contact
from asperity.fem.solid import Solid
from asperity.runtime.parallel import summed

ROUNDING = 1e-7  # pull on a node over the rms force of the nodes in contact that no solution resolves


class ActiveSet(Contact):
    """Exact contact at the nodes by a primal-dual active set: no node penetrates the flat, no force is tensile.

    Hintermueller, Ito & Kunisch, SIAM J. Optim. 13 (2002) 865: a semismooth Newton method for
    lambda = max(0, lambda + c d), d the penetration, lambda the force of the flat. Active nodes are prescribed, so
    matrix structure and near-null space stay as they are.

    A corner of a facet bears no force under a uniform pressure: it is held unless the flat pulls by more than rounding.
    Released by rounding, it gives way where the pressure exceeds some tenths of the bulk modulus.
    """

    symmetric = True
    has_tangent = False  # active dofs are prescribed by the solver

    def __init__(self, solid: Solid, surface: ContactSurface) -> None:
        self._solid, self.surface = solid, surface
        self._nodes = surface.owned_nodes
        # any positive c gives the same solution; above the stiffness of a node no gap of rounding closes and opens
        self._c = 1.0
        self._z, self._receded = np.inf, 0.0
        self.active = np.zeros(len(self._nodes), dtype=bool)

    def begin(self, z: float) -> None:
        self._z, self._receded = z, 0.0

    def expect(self, z: float, start: Floats, end: Floats, ratio: float) -> None:
        """Where the flat recedes without a prediction, begin with the nodes in contact.

        At its new height the flat touches nothing, and the solid would first spring back from no contact at all.
        """
        self._receded = self._z - z if end is start and self._z > z else 0.0

    def _penetration(self) -> Floats:
        return self.surface.elevation(self._nodes) - self._z

    def residual(self, force: Floats) -> tuple[Floats, Integers, Floats]:
        d = self._penetration()
        pushed = self._c * (d + self._receded) - force[self._nodes, 2]
        self.active = pushed > 0.0
        squares, count = summed(self._solid.comm, np.sum(pushed[self.active] ** 2), np.sum(self.active))
        if count:
            self.active = pushed > -ROUNDING * np.sqrt(squares / count)
        self._receded = 0.0
        r = force.copy()
        held = self._nodes[self.active]
        r[held, 2] = 0.0
        return r, (3 * held + 2).astype(np.int32), -d[self.active]

    def nodes(self) -> Integers:
        return self._nodes[self.active]

    def nodal_force(self, force: Floats) -> Floats:
        out = np.zeros(len(force))
        out[self._nodes[self.active]] = -force[self._nodes[self.active], 2]
        return out

    def touched_edges(self) -> Flags:
        """Nodes that are active."""
        held = np.zeros((self._solid.owned, 1))
        held[self._nodes[self.active]] = 1.0
        return np.asarray(self._solid.ghosts.scatter_forward(held)[:, 0] > 0.0)


class OnTool(ActiveSet):
    """Active set under a tool that meets the nodes at their deformed places, without friction.

    The height of a node with that of the tool above it is g = Z + u_z + t(x + u), and the force on an active node is
    along its gradient n = (t_x, t_y, 1), normal to the tool: f + lambda n = 0. The unknowns of an active node are u_x,
    u_y and n . u in place of u_z, see `Tangent.tilt`. The last one is prescribed, so matrix structure and
    symmetry stay. The curvature of the tool times the force is part of the tangent (SQP: Nocedal & Wright, Numerical
    Optimization, 2006, section 18.1).
    """

    has_tangent = True

    def __init__(self, solid: Solid, surface: ContactSurface) -> None:
        super().__init__(solid, surface)
        assert surface.tool is not None
        self._tool = surface.tool

    def residual(self, force: Floats) -> tuple[Floats, Integers, Floats]:
        r, rows, lacking = super().residual(force)
        held = self._nodes[self.active]
        places = (self._solid.points[held] + self._solid.u.x.array.reshape(-1, 3)[held])[:, :2]
        slopes, self._curvature = self._tool.shape(places)
        below = self._tool.tips(places, self.surface.spacing[held])
        slopes[below], self._curvature[below] = 0.0, 0.0
        self._pressed, self._slopes = -force[held, 2], np.zeros((self._solid.owned, 2))
        self._slopes[held] = slopes
        r[held, :2] += self._pressed[:, None] * slopes
        r[held[below]] = 0.0
        pinned = (3 * held[below, None] + [0, 1]).ravel().astype(np.int32)
        return r, np.concatenate([rows, pinned]), np.concatenate([lacking, np.zeros(len(pinned))])

    def add_tangent(self) -> None:
        solid = self._solid
        diagonal = solid.sparsity.diagonal.reshape(-1, 3)[self._nodes[self.active]]
        for i, j in np.ndindex(2, 2):
            solid.tangent.values()[diagonal[:, i] + j - i] += self._pressed * self._curvature[:, i, j]
        solid.tangent.tilt(solid.ghosts.scatter_forward(self._slopes).copy())

    add_elastic_tangent = add_tangent
