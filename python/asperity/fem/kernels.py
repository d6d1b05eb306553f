"""What the solid needs of its element kernels, compiled or as UFL forms."""

from __future__ import annotations

from typing import Protocol

from asperity.arrays import Floats

QUADRATURE_DEGREE = 2  # four points; degree 4 moved the force by less than 0.1 %


class ElementKernels(Protocol):
    """Internal force, tangent and history of a solid, cell by cell; of this rank."""

    linear: bool  # whether the tangent never changes

    @property
    def plastic_points(self) -> int:
        """Quadrature points flowing at the last residual, this process."""

    @property
    def volumes(self) -> Floats:
        """Of the quadrature points of this process (cells, points)."""

    def add_internal_force(self, u: Floats, b: Floats) -> None:
        """Add the internal force of the nodal displacement u (nodes, 3) to b; writes the trial history."""

    def tangent(self, u: Floats, values: Floats) -> None:
        """Write the values of the local CSR matrix at u, the state of the last residual."""

    def commit(self) -> None:
        """Make the trial history the committed one."""

    def restore(self, plastic_strain: Floats, accumulated: Floats) -> None:
        """Restore a committed history returned by `history`."""

    def history(self) -> tuple[Floats, Floats]:
        """Committed plastic strain (cells, points, 6) and accumulated plastic strain (cells, points)."""

    def stress(self, u: Floats) -> Floats:
        """Stress (cells, points, 6) of u over the committed history."""
