"""Volumetric strain within cells that flow, for any law in UFL that lowers its yield stress: solver/relaxation.hpp."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from asperity.arrays import Floats, Integers
from asperity.fem.kernels import MOST_RELIEF
from asperity.fem.weak_form import PointValues

ITERATIONS = 100  # of the flow of a cell, as in relaxation.hpp
ROUNDING = 1e-15  # of the flow, at which it has settled
#: Dilatation, flow and its derivative by a relief at the points of some cells (n, points, 3).
Measures = Callable[[Integers], Floats]


class CellFlow:
    """What the points of each cell have in common; the members of relaxation.hpp, cells as arrays.

    Args:
        mesh: of dolfinx
        volumes: of the quadrature points (cells, points) [L^3]
        bulk: bulk modulus K [E]
        relaxation: c, and the stress T [E]
        strength: yield strength [E]

    Attributes:
        coefficients: for the forms: permanent part before, mean dilatation, kept part, relief at the quadrature points
        flowing: cells in which volumetric strain relaxes
        permanent: volumetric strain that flow has made permanent, at the end of the step (cells, points)
    """

    def __init__(
        self, mesh: Any, volumes: Floats, bulk: float, relaxation: tuple[float, float], strength: float
    ) -> None:
        self.coefficients = PointValues(mesh, len(volumes), 4)
        self._volumes, self._volume = volumes, volumes.sum(axis=1)
        self._bulk, (self._most, self._threshold) = bulk, relaxation
        self._highest = MOST_RELIEF * strength  # relief

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
        theta = measures(np.arange(len(before), dtype=np.int32))[..., 0]
        mean = self._mean(theta)[:, None]
        own = theta - mean - before
        squares = self._mean(own**2)
        size, c = np.sqrt(squares), self._most
        steepest = self._bulk * c**2
        beyond = np.maximum(self._bulk * size - self._threshold, 0.0)
        relief = np.minimum(c * beyond, self._highest)
        least = (c * beyond - relief) / steepest  # of the flow, where the relief begins to fall
        flow, softness, limited = least.copy(), np.zeros_like(size), np.zeros(len(size), dtype=bool)
        cells: Integers = np.flatnonzero(beyond).astype(np.int32)
        for _ in range(ITERATIONS):
            if not len(cells):
                break
            put(relief[cells, None], cells, of=3)
            found = measures(cells)
            driven, softness[cells] = (self._mean(found[..., k], cells) for k in (1, 2))
            limited[cells] = relief[cells] > 0.0
            step = (driven - flow[cells]) / (1.0 + softness[cells] * steepest * limited[cells])
            paid = (step <= 0.0) & (relief[cells] == self._highest)
            limited[cells[paid]] = False
            on = ~paid & (np.abs(step) > ROUNDING * flow[cells])
            cells, step = cells[on], step[on]
            flow[cells] = np.maximum(flow[cells] + step, least[cells])
            relief[cells] = np.clip(c * (beyond[cells] - self._bulk * c * flow[cells]), 0.0, self._highest)
        put(relief[:, None], of=3)
        relaxed = np.where(limited, self._bulk * c * flow, beyond - relief / c)  # K x
        self.flowing = cells = np.flatnonzero(relaxed > 0.0).astype(np.int32)
        lost = (relaxed[cells] / self._bulk) / size[cells]
        kept = np.ones_like(size)
        kept[cells] = 1.0 - lost
        put(mean, of=1)
        put(kept[:, None], of=2)
        self.permanent = before + (1.0 - kept)[:, None] * own
        # of the tangent
        limits = limited[cells]
        self._own, self._lost, self._softness = own[cells], lost, softness[cells]
        self._slope = np.where(limits, -self._bulk * c / size[cells], 0.0)
        self._curvature = self._bulk * np.where(limits, lost, lost - 1.0) / squares[cells]
        self._relief_slope = np.where(limits, -steepest, 0.0)

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
