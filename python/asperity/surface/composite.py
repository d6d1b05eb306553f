"""The composite surface of two bodies: where they touch first, and how far they are apart, depends on it alone."""

from __future__ import annotations

from typing import Annotated, Any

import numpy as np
from numpy.typing import ArrayLike
from pydantic import InstanceOf

from asperity.arrays import Array
from asperity.runtime.declaration import argument, declared
from asperity.surface.base import Surface
from asperity.surface.shapes import Flat

_PART = argument("a surface")


def composite(surface: Surface, tool: Surface) -> Surface:
    """Sum of the heights of a surface and of a tool above it, each towards the other; a plane adds nothing.

    >>> from asperity.surface import Flat, Sphere
    >>> ball = Sphere(L=1.0, radius=2.0)
    >>> composite(Flat(L=1.0), ball) is composite(ball, Flat(L=1.0)) is ball
    True
    """
    if isinstance(tool, Flat):
        return surface
    return tool if isinstance(surface, Flat) else Composite(L=surface.L, surface=surface, tool=tool)


@declared("surface", eq=False, kw_only=True)
class Composite(Surface):
    """Sum of the heights of a surface and of a tool on the same patch."""

    surface: Annotated[InstanceOf[Surface], *_PART]
    tool: Annotated[InstanceOf[Surface], *_PART]

    @property
    def _parts(self) -> tuple[Surface, Surface]:
        return self.surface, self.tool

    def _sum(self, *parts: Any) -> Any:
        return tuple(a + b for a, b in zip(*parts, strict=True))

    @property
    def rough(self) -> bool:  # type: ignore[override]
        """Whether slope statistics describe the contact of one of them."""
        return self.surface.rough or self.tool.rough

    @property
    def cutoff_key(self) -> str:  # type: ignore[override]
        """What cuts off the short waves of the one with the shorter ones."""
        return min(self._parts, key=lambda part: part.feature_size).cutoff_key

    @property
    def feature_size(self) -> float:
        """That of the one with the shorter waves (length)."""
        return min(part.feature_size for part in self._parts)

    @property
    def periodic(self) -> bool:
        """Whether both are."""
        return self.surface.periodic and self.tool.periodic

    def height(self, x: ArrayLike, y: ArrayLike) -> Array:
        return self.surface.height(x, y) + self.tool.height(x, y)

    def gradient(self, x: ArrayLike, y: ArrayLike) -> tuple[Array, Array]:
        x_y: tuple[Array, Array] = self._sum(*(part.gradient(x, y) for part in self._parts))
        return x_y

    def hessian(self, x: ArrayLike, y: ArrayLike) -> tuple[Array, Array, Array]:
        xx_xy_yy: tuple[Array, Array, Array] = self._sum(*(part.hessian(x, y) for part in self._parts))
        return xx_xy_yy

    def on_product(self, x: Array, y: Array, dx: int = 0, dy: int = 0) -> Array:
        return self.surface.on_product(x, y, dx, dy) + self.tool.on_product(x, y, dx, dy)

    def mean(self) -> float:
        return self.surface.mean() + self.tool.mean()

    def curvature_bound(self) -> float:
        return self.surface.curvature_bound() + self.tool.curvature_bound()

    def short_waves(self, wavelength: float, depth: float) -> float:
        return float(np.hypot(*(part.short_waves(wavelength, depth) for part in self._parts)))

    def smoothed(self, x: ArrayLike, y: ArrayLike, s: ArrayLike) -> Array:
        return self.surface.smoothed(x, y, s) + self.tool.smoothed(x, y, s)
