"""Volumetric strain within cells that flow, for any law in UFL that lowers its yield stress: solver/relaxation.hpp."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from asperity.arrays import Floats, Integers
from asperity.fem.weak_form import PointValues

ITERATIONS = 100  # of the flow of a cell, as in relaxation.hpp
ROUNDING = 1e-14  # of the flow, at which it has settled
#: Dilatation, flow and its derivative by a relief at the points of some cells (n, points, 3).
Measures = Callable[[Integers], Floats]


class CellFlow:
    """What the points of each cell have in common; the members of relaxation.hpp, cells as arrays.

    Args:
        mesh: of dolfinx
        volumes: of the quadrature points (cells, points) [L^3]
        bulk: bulk modulus K [E]
        relaxation: stresses S and T [E]

    Attributes:
        coefficients: for the forms: permanent part before, mean dilatation, kept part, relief at the quadrature points
        flowing: cells in which volumetric strain relaxes
        permanent: volumetric strain that flow has made permanent, at the end of the step (cells, points)
    """

    def __init__(self, mesh: Any, volumes: Floats, bulk: float, relaxation: tuple[float, float]) -> None:
        self.coefficients = PointValues(mesh, len(volumes), 4)
        self._volumes, self._volume = volumes, volumes.sum(axis=1)
        self._bulk, (self._spent, self._threshold) = bulk, relaxation

    def _mean(self, values: Floats, cells: Any = slice(None)) -> Floats:
        mean: Floats = np.einsum("cq,cq->c", self._volumes[cells], values) / self._volume[cells]
        return mean

    def settle(self, dilatation: Floats, measures: Measures | None) -> None:
        """Find the flow over a permanent part (cells, points); without measures nothing flows."""
        before, put = dilatation - self._mean(dilatation)[:, None], self.coefficients.put
        put((0.0, 0.0, 1.0, 0.0))
        put(before, of=0)
        self.permanent = before
        self.flowing: Integers = np.empty(0, dtype=np.int32)
        if measures is None:
            return
        own = measures(np.arange(len(before), dtype=np.int32))[..., 0] - before
        mean = self._mean(own)[:, None]
        put(mean, of=1)
        own -= mean
        squares = self._mean(own**2)
        beyond = np.maximum(self._bulk * np.sqrt(squares) - self._threshold, 0.0)
        first, rate = 0.5 * beyond**2 / self._spent, self._bulk / self._spent
        put(first[:, None], of=3)
        cells = np.flatnonzero(beyond).astype(np.int32)
        cells = cells[self._mean(measures(cells)[..., 1], cells) > 0.0]
        self.flowing, self._own = cells, own[cells]
        squares, beyond, first, flow = squares[cells], beyond[cells], first[cells], np.zeros(len(cells))
        for _ in range(ITERATIONS):  # Newton's method from below on a concave function: monotone
            m = 1.0 / (1.0 + rate * flow)
            put((first * m**2)[:, None], cells, of=3)
            found = measures(cells)
            driven, self._softness = (self._mean(found[..., k], cells) for k in (1, 2))
            self._relief_slope = -2.0 * rate * first * m**3
            step = (driven - flow) / (1.0 - self._softness * self._relief_slope)
            flow += step
            if np.all(np.abs(step) <= ROUNDING * flow):
                break
        part = beyond / (self._bulk * np.sqrt(squares))
        kept = 1.0 - part * rate * flow * m
        put(kept[:, None], cells, of=2)
        self.permanent[cells] += (1.0 - kept)[:, None] * self._own
        # of the tangent
        self._lost, self._slope = 1.0 - kept, -self._bulk * part * rate * m**2
        self._curvature = -rate * flow * m * self._threshold / squares**1.5

    def stiffness(self, rows: Floats) -> Floats:
        """What the flowing cells add to the tangent of their points (n, dofs, dofs).

        Args:
            rows: derivatives of dilatation and flow at their points with respect to the dofs (n, points, 2, dofs)
        """
        volumes, volume = self._volumes[self.flowing], self._volume[self.flowing]
        common = np.stack(
            [
                np.einsum("cq,cqd->cd", volumes, rows[:, :, 0]),
                np.einsum("cq,cqd->cd", volumes * self._own, rows[:, :, 0]),
                np.einsum("cq,cqd->cd", volumes, rows[:, :, 1]),
            ],
            axis=1,
        )  # of mean dilatation, D^2/2, and flow at a given relief; times the volume
        share = 1.0 / (1.0 - self._softness * self._relief_slope)
        C = np.zeros((len(volume), 3, 3))
        C[:, 0, 0] = self._bulk * self._lost
        C[:, 1, 1] = self._curvature - share * self._softness * self._slope**2
        C[:, 1, 2] = C[:, 2, 1] = share * self._slope
        C[:, 2, 2] = -share * self._relief_slope
        added: Floats = np.swapaxes(common, 1, 2) @ (C / volume[:, None, None]) @ common
        return added
