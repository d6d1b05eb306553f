"""A surface of one's own: heights, first and second derivatives, mean and a bound of the curvature."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

import asperity as asp


@dataclass(frozen=True, eq=False, kw_only=True)
class Ridges(asp.Surface):
    """Rounded ridges along y, whose crests fall from the middle of the patch to its edges.

    Attributes:
        count: number of ridges.
        amplitude: half of the height from valley to crest (length).
        crown: fall of the crests (length).
    """

    count: int
    amplitude: float
    crown: float

    @property
    def _k(self) -> float:
        return 2 * np.pi * self.count / self.L

    def height(self, x: Any, y: Any) -> Any:
        """Heights (length)."""
        return -self.amplitude * np.cos(self._k * x) - self.crown * (2 * y / self.L - 1) ** 2

    def gradient(self, x: Any, y: Any) -> tuple[Any, Any]:
        """Slopes dz/dx and dz/dy."""
        return (
            self.amplitude * self._k * np.sin(self._k * x) + 0 * y,
            -4 * self.crown / self.L * (2 * y / self.L - 1) + 0 * x,
        )

    def hessian(self, x: Any, y: Any) -> tuple[Any, Any, Any]:
        """Second derivatives xx, xy, yy (1/length)."""
        nothing = 0 * x + 0 * y
        bend = self.amplitude * self._k**2 * np.cos(self._k * x) + nothing
        return bend, nothing, nothing - 8 * self.crown / self.L**2

    def mean(self) -> float:
        """Mean height (length)."""
        return -self.crown / 3

    def curvature_bound(self) -> float:
        """Largest curvature (1/length); it makes the search for the summit safe."""
        return max(self.amplitude * self._k**2, 8 * self.crown / self.L**2)


def main() -> float:
    """Return the greatest load P*."""
    surface = Ridges(L=1e-6, count=2, amplitude=20e-9, crown=5e-9)
    print(f"first touch at x = {surface.maximum()[0]:.3g} m, Sq = {surface.statistics().Sq:.3g} m")
    size = asp.MeshSize(h_contact=0.12e-6, growth=0.6)
    curve = asp.solve_contact(surface, asp.Material(200e9, 0.3), delta_max=8e-9, steps=5, size=size).curve
    print(f"P* = {curve.P_star[-1]:.4g} at delta/L = {curve.delta_star[-1]:g}, "
          f"{curve.area_fraction[-1]:.1%} in contact")  # fmt: skip
    return float(curve.P_star[-1])


if __name__ == "__main__":
    main()
