# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

"""Interface of a contact formulation to the contact solver and the load path."""

from __future__ import annotations

from typing import Protocol

from asperity.arrays import Flags, Floats, Integers
from asperity.fem.kernels import History

__all__ = ["Contact"]


class Contact(Protocol):
    """Formulation of the contact of a solid with a rigid flat.

    The flat exerts a force on the nodes. Internal force + contact force = 0 on free dofs, so contact adds a positive z
    component. A formulation may prescribe dofs instead.
    """

    symmetric: bool  # whether the tangent is symmetric, and positive definite with the solid's
    stiff: bool  # whether the contact has a stiffness

    def begin(self, z: float) -> None:
        """Move the flat to height z [length]."""

    def residual(self, force: Floats) -> tuple[Floats, Integers, Floats]:
        """Complete the internal force of the current displacement; collective.

        Args:
            force: internal force on the owned nodes (owned, 3)

        Returns:
            residual (owned, 3) [E L^2]; prescribed owned dofs; the displacement increment each of them still lacks [L]
        """

    def add_tangent(self) -> None:
        """Add the contact stiffness at the last residual to `solid.values`, the local matrix."""

    def add_elastic_tangent(self) -> None:
        """Add the contact stiffness for a solid that does not flow, with the points in contact held."""

    def nodes(self) -> Integers:
        """Owned nodes in contact at the last residual; collective."""

    def nodal_force(self, force: Floats) -> Floats:
        """Normal force of the flat on the owned nodes (owned,), from the internal force (owned, 3)."""

    def commit(self) -> None:
        """Make the history of the last residual the committed one, if the formulation has a history."""

    def sinking(self) -> float:
        """Sum of force times penetration over the points of a compliant contact at the last residual [force length].

        Part of this rank; zero for exact contact.
        """

    def history(self) -> History | None:
        """Committed history, a row per facet of this rank; None, on all ranks, for a formulation without one."""

    def restore(self, history: History) -> None:
        """Restore a committed history returned by `history`; only called where there is a history."""

    def touched(self) -> tuple[Flags, Floats]:
        """Points of the facets that the flat touches at the last residual (F, Q), and the area of each; collective.

        The areas are projected on the plane of the flat (F, Q) [length^2].
        """

    def touched_edges(self) -> Flags:
        """Whether the third of a facet at each of its edge nodes is touched, at the local nodes (nodes,); collective.

        They are the parts of a facet between an edge and the middle, which contact spots and their maps consist of.
        """
