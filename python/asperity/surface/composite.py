"""The composite surface of two bodies: where they touch first, and how far they are apart, depends on it alone."""

from __future__ import annotations

from collections.abc import Callable
from math import hypot
from typing import Annotated, Any

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

    def _each(self, of: Callable[[Surface], Any]) -> tuple[Any, Any]:
        return of(self.surface), of(self.tool)

    @property
    def rough(self) -> bool:  # type: ignore[override]
        """Whether slope statistics describe the contact of one of them."""
        return any(self._each(lambda part: part.rough))

    @property
    def cutoff_key(self) -> str:  # type: ignore[override]
        """What cuts off the short waves of the one with the shorter ones."""
        return min((self.surface, self.tool), key=lambda part: part.feature_size).cutoff_key

    @property
    def feature_size(self) -> float:
        """That of the one with the shorter waves (length)."""
        return min(self._each(lambda part: part.feature_size))

    @property
    def periodic(self) -> bool:
        """Whether both are."""
        return all(self._each(lambda part: part.periodic))

    def height(self, x: ArrayLike, y: ArrayLike) -> Array:
        return sum(self._each(lambda part: part.height(x, y)))

    def gradient(self, x: ArrayLike, y: ArrayLike) -> tuple[Array, Array]:
        one, two = self._each(lambda part: part.gradient(x, y))
        return one[0] + two[0], one[1] + two[1]

    def hessian(self, x: ArrayLike, y: ArrayLike) -> tuple[Array, Array, Array]:
        one, two = self._each(lambda part: part.hessian(x, y))
        return one[0] + two[0], one[1] + two[1], one[2] + two[2]

    def on_product(self, x: Array, y: Array, dx: int = 0, dy: int = 0) -> Array:
        return sum(self._each(lambda part: part.on_product(x, y, dx, dy)))

    def curvature_bound(self) -> float:
        return sum(self._each(lambda part: part.curvature_bound()))

    def short_waves(self, wavelength: float, depth: float) -> float:
        return hypot(*self._each(lambda part: part.short_waves(wavelength, depth)))
