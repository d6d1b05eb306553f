"""Coulomb friction of nodes whose normal forces stay: tangential motion of two like bodies under a constant load."""

from __future__ import annotations

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
        fixed: owned dofs without displacement

    Attributes:
        sliding: the nodes in contact, at rest on the flat; their bounds are given from outside
        normal: their normal forces (n,) [E L^2]
    """

    symmetric = True
    stiff = True

    def __init__(self, solid: Solid, surface: ContactSurface, normal: Floats, fixed: Integers) -> None:
        self._normal = normal
        self._resting = solid.internal_force().copy()  # stays as an external force
        nodes = surface.owned_nodes[normal[surface.owned_nodes] > 0.0]
        self.normal = normal[nodes]
        self.sliding = StickSlip(solid, surface, nodes, fixed)
        self.sliding.origin = self.sliding.position()

    def residual(self, force: Floats) -> tuple[Floats, Integers, Floats]:
        r = force - self._resting
        return r, *self.sliding.residual(r)

    def imbalance(self, force: Floats) -> Floats:
        r = force - self._resting
        self.sliding.imbalance(r)
        return r

    def add_tangent(self) -> None:
        self.sliding.add_tangent()

    def nodal_force(self, force: Floats) -> Floats:
        return self._normal
