"""Interface of a contact formulation to the contact solver and the load path."""

from __future__ import annotations

from abc import ABC, abstractmethod

import numpy as np

from asperity.arrays import Flags, Floats, Integers
from asperity.contact.contact_surface import ContactSurface
from asperity.mesh.element import BEARING


class Contact(ABC):
    """Formulation of the contact of a solid with a rigid flat.

    The flat exerts a force on the nodes. Internal force + contact force = 0 on free dofs, so contact adds a positive z
    component. A formulation may prescribe dofs instead. What has a default does nothing: a compliant contact overrides
    the tangents, and `penetration_work` where its penetration is an error; one with a history `commit`.

    Attributes:
        surface: of the solid
        symmetric: whether the tangent is symmetric, and positive definite with the solid's
        has_tangent: whether the contact has a stiffness
        held: what friction keeps of the owned nodes of the top that are in contact after the last committed step, NaN
            of the others (N, up to 3); None, on all ranks, for a formulation without tangential forces
    """

    surface: ContactSurface
    symmetric: bool
    has_tangent: bool
    held: Floats | None = None

    @abstractmethod
    def begin(self, z: float) -> None:
        """Move the flat to height z [L]."""

    @abstractmethod
    def residual(self, force: Floats) -> tuple[Floats, Integers, Floats]:
        """Complete the internal force of the current displacement; collective.

        Args:
            force: internal force on the owned nodes (owned, 3)

        Returns:
            residual (owned, 3) [E L^2]; prescribed owned dofs; the displacement increment each of them still lacks [L]
        """

    @abstractmethod
    def nodes(self) -> Integers:
        """Owned nodes in contact at the last residual; collective."""

    @abstractmethod
    def nodal_force(self, force: Floats) -> Floats:
        """Normal force of the flat on the owned nodes (owned,), from the internal force (owned, 3)."""

    @abstractmethod
    def touched_edges(self) -> Flags:
        """Whether the third of a facet at each of its edge nodes is touched, at the local nodes (nodes,); collective.

        They are the parts of a facet between an edge and the middle, which contact spots and their maps consist of.
        """

    def touched(self) -> tuple[Flags, Floats]:
        """Points of the facets that the flat touches at the last residual (F, Q), and the area of each; collective.

        They are the edge nodes of `touched_edges`, each with a third of its facet. Corner nodes do not indicate
        contact: under a smooth pressure their consistent force vanishes, so the exact solution may leave a small gap
        there. A small contact may lie around one; it has no area. Areas are projected on the flat (F, Q) [L^2].
        """
        edges, nodes, area = self.touched_edges(), self.surface.nodes, self.surface.area
        bearing = edges[nodes[:, BEARING]]
        if self.surface.solid.comm.allreduce(int(bearing.sum())):
            return bearing, np.repeat(area[:, None] / len(BEARING), len(BEARING), axis=1)
        return edges[nodes[:, :3]], np.zeros((len(nodes), 3))

    def expect(self, z: float, start: Floats, end: Floats, ratio: float) -> None:  # noqa: B027
        """Prepare the step to the height of `begin`, before its first residual.

        Args:
            z: height of the flat at the beginning of the step [L]
            start: displacement there (owned, 3) [L]
            end: displacement predicted for the end of the step, `start` itself if there is no prediction (owned, 3) [L]
            ratio: of the length of the step to that of the step before
        """

    def settle(self) -> bool:
        """Renew what is constant during a solve, after one that converged; collective.

        Returns:
            whether anything has changed, so that the step has to be solved again
        """
        return False

    def add_tangent(self) -> None:  # noqa: B027
        """Add the contact stiffness at the last residual to `solid.tangent.values()`, the local matrix."""

    def add_elastic_tangent(self) -> None:  # noqa: B027
        """Add the contact stiffness for a solid that does not flow, with the points in contact held."""

    def penetration_work(self) -> float:
        """Sum of force times penetration over the points of a compliant contact at the last residual [E L^3].

        Part of this rank; zero for exact contact, and where the penetration is meant, as the compression of a coating.
        """
        return 0.0

    def tangential_work(self, force: Floats, move: Floats) -> float:
        """Work of the tangential forces of the flat along a displacement (owned, 3) [E L^3]; part of this rank."""
        return 0.0

    def commit(self) -> None:  # noqa: B027
        """Make the history of the last residual the committed one."""
